"""Several flights in one fit: what they share, what each has for itself, and what several starts say."""

import numpy as np
import pytest
from kites import DEVELOPMENT, declared, flight, lively, truly

from awescli.estimation.fit import fit, fit_together
from awescli.estimation.fitted import Share
from awescli.estimation.identifiability import describe
from awescli.estimation.misfit import Misfit
from awescli.estimation.several_starts import Optimum, spread_of
from awescli.notation.constraints import parse_constraint
from awescli.physics.kite import Kite
from awescli.simulation.rollout import Simulator

SHARED, OWN = ("CLa", "CD0", "CYb", "Clp", "Cnb"), ("dl", "Cm0")
TRIMS = ({"dl": 0.78, "Cm0": 0.106}, {"dl": 0.83, "Cm0": 0.117})


@pytest.fixture(scope="module")
def flown():
    """Two flights of one kite in other winds (other numbers of stations, too), each with its own trim: (simulator, observed)."""
    found = []
    for seed, air, trim in ((1, "table", TRIMS[0]), (2, "power", TRIMS[1])):
        log = flight(seed=seed, air=air).log
        kite = Kite(declared(wind={"law": air, "exponent": 0.12 if air == "power" else 0.0}), log.wind.height)
        simulator = Simulator(kite)
        found.append((simulator, truly(lively(kite, log, count=8, seconds=2.0, seed=seed), simulator, trim, noise_seed=seed)))
    return found


def share(simulator, observed, label=""):
    table = simulator.kite.parameters
    start = table.with_values({n: 1.05 * table[n].value for n in SHARED})
    unknowns = tuple(f"{n}@{label}" if label and n in OWN else n for n in (*SHARED, *OWN))
    return Share(Misfit(simulator.holding(start), observed, (*SHARED, *OWN)), start, start, unknowns)


def test_common_parameters_and_own_trims_are_recovered_and_intervals_shrink(flown):
    """Guards the design matrix: shared values and two trims come back within their intervals, and two flights know more than one."""
    together = fit_together([share(*flown[0]), share(*flown[1], "b")], prior=False)
    assert together.solution.outcome == "converged" and together.chi2 == pytest.approx(1.0, abs=0.05)
    std = dict(zip(together.names, np.sqrt(np.diag(together.covariance)), strict=True))
    truth = {n: DEVELOPMENT.table()[n].value for n in SHARED} | TRIMS[0] | {f"{n}@b": v for n, v in TRIMS[1].items()}
    assert set(together.names) == set(truth)
    for name, value in truth.items():
        assert abs(together.parameters[name].value - value) < 4 * std[name], name
    assert abs(truth["dl"] - truth["dl@b"]) > 8 * std["dl"]
    for i, label in enumerate(("", "@b")):
        alone = fit_together([share(*flown[i])], prior=False)
        # more data in the same model: the covariance of what is shared can only fall
        here = [together.names.index(n) for n in SHARED]
        there = [alone.names.index(n) for n in SHARED]
        gain = alone.covariance[np.ix_(there, there)] - together.covariance[np.ix_(here, here)]
        assert np.linalg.eigvalsh(gain / np.sqrt(np.outer(*[np.diag(alone.covariance)[there]] * 2)))[0] > -1e-3
        for n in SHARED:
            assert std[n] < 0.95 * np.sqrt(alone.covariance[alone.names.index(n)][alone.names.index(n)]), n
        assert together.flights[i].parameters["dl"].value == together.parameters[f"dl{label}"].value


def test_wrongly_shared_trims_are_seen_in_the_residual(flown):
    """Guards that `per_flight` matters: one trim for both flights cannot fit."""
    together = fit_together([share(*flown[0]), share(*flown[1])], prior=False)
    assert together.names == (*SHARED, *OWN) and together.chi2 > 3


def test_flights_that_share_nothing_are_as_good_as_apart(flown):
    """Guards the bookkeeping: without shared parameters a joint fit is two fits."""
    names = ("CLa", "CD0")
    shares = [
        Share(Misfit(simulator, observed, names), simulator.kite.parameters, simulator.kite.parameters, tuple(f"{n}{i}" for n in names))
        for i, (simulator, observed) in enumerate(flown)
    ]
    together = fit_together(shares, tolerance=1e-8)
    for (simulator, observed), found in zip(flown, together.flights, strict=True):
        alone = fit(Misfit(simulator, observed, names), simulator.kite.parameters, tolerance=1e-8)
        assert [found.parameters[n].value for n in names] == pytest.approx([alone.parameters[n].value for n in names], rel=1e-5)
        assert found.covariance == pytest.approx(alone.covariance, rel=1e-5) and found.chi2 == pytest.approx(alone.chi2, rel=1e-6)
    assert np.abs(together.covariance[:2, 2:]).max() < 1e-12 * np.abs(together.covariance).max()


def test_the_answer_says_which_value_belongs_to_which_flight(flown):
    """Guards params.json: the owner of a flight's own value; shared ones have none."""
    together = fit_together([share(*flown[0]), share(*flown[1], "b")])
    rows = describe(together, flight_of={"dl": "a", "Cm0": "a", "dl@b": "b", "Cm0@b": "b"})["parameters"]
    assert {n: r.get("flight") for n, r in rows.items()} == dict.fromkeys(SHARED) | {"dl": "a", "Cm0": "a", "dl@b": "b", "Cm0@b": "b"}


def test_a_constraint_on_own_parameters_holds_for_every_flight():
    """Guards constraints in a joint fit: on a flight's own names where it has them."""
    constraint = parse_constraint("dl + CLa <= 5")
    assert constraint.renamed({"dl": "dl@b"}).factors == {"dl@b": 1, "CLa": 1} and "dl is dl@b" in constraint.renamed({"dl": "dl@b"}).text
    assert constraint.renamed({"CLa": "CLa"}) == constraint


def test_several_starts_say_how_many_agree(flown):
    """Guards the report of several starts: which led to the best optimum, how far apart they lie in standard deviations."""
    best = fit_together([share(*flown[0])], prior=False)
    std = np.sqrt(np.diag(best.covariance))
    x, cost = best.solution.x, best.solution.cost
    near, far = Optimum(cost + 0.3, "converged", x + 0.1 * std), Optimum(cost + 50, "no_progress", x - 7 * std)
    optima = [Optimum(cost, "converged", x), near, far]
    said = spread_of(optima, best)
    assert said["starts"] == 3 and said["same_optimum"] == 2 and said["cost_above_best"] == pytest.approx([0, 0.3, 50])
    assert said["largest_distance_within_optimum_std"] == pytest.approx(0.1) and said["largest_distance_std"]["CLa"] == pytest.approx(7)
