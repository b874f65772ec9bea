"""A kite file's constraints in a fit: read with their place, kept, reported, and named where they contradict each other."""

from dataclasses import replace

import numpy as np
import pytest
from kites import DEVELOPMENT, lively, truly

from awescli.estimation.fit import fit_together
from awescli.estimation.fitted import Share
from awescli.estimation.identifiability import describe
from awescli.estimation.limits import limits_of, scaling
from awescli.estimation.misfit import Misfit
from awescli.notation.constraints import parse_constraint
from awescli.notation.errors import BadInput
from awescli.physics.declaration import kite_text, read_kite
from awescli.physics.kite import Kite
from awescli.simulation.rollout import Simulator

TABLE = DEVELOPMENT.table()


def constrained(*texts):
    return DEVELOPMENT.model_copy(update={"constraints": texts})


def test_a_kite_file_holds_constraints(tmp_path):
    """Guards the way from file to file, and errors that name file, line and entry."""
    file = tmp_path / "kite.yaml"
    file.write_text(kite_text(constrained("Jx + Jz >= Jy", "CLa <= 6")))
    assert read_kite(file).constraints == ("Jx + Jz >= Jy", "CLa <= 6")
    file.write_text(kite_text(constrained("Jx + Jz >= Jy", "CLa <= 6", "Jx + Kz >= Jy", "CLa < 6")))
    with pytest.raises(BadInput) as caught:
        read_kite(file)
    lines = file.read_text().splitlines()
    for text, word in (("Jx + Kz >= Jy", "unknown parameter 'Kz'"), ("CLa < 6", "not a linear constraint")):
        line = next(i for i, content in enumerate(lines, 1) if text in content)
        assert any(f"kite.yaml:{line}: constraints." in m and word in m for m in str(caught.value).splitlines())


def test_rows_are_in_units_of_the_prior_and_fixed_parameters_count_at_their_values():
    """Guards the scaling and the constant: A x <= high says the same as the text."""
    constraint = parse_constraint("2*CLa + m <= 70")
    found = limits_of(TABLE, ("CD0", "CLa"), [constraint, parse_constraint("m <= 60")])
    assert found.A.shape == (1, 2) and not TABLE["m"].free
    x = np.array([0.1, (70 - TABLE["m"].value) / 2])
    assert found.A @ x == pytest.approx(found.high)
    assert found.A[0, 1] * scaling(constraint, TABLE) == pytest.approx(2)


def test_constraints_that_contradict_each_other_are_named():
    """Guards the message of an infeasible problem: those in conflict, not those beside it, and that bounds count."""
    texts = ("CLa >= 5.5", "CD0 + CLa <= 4.5", "Jx + Jz >= Jy")
    with pytest.raises(BadInput) as caught:
        limits_of(TABLE, TABLE.free, [parse_constraint(t) for t in texts])
    assert "'CLa >= 5.5' and 'CD0 + CLa <= 4.5'" in caught.value.what and "Jx" not in caught.value.what
    with pytest.raises(BadInput, match=f"satisfy 'CLa >= {TABLE['CLa'].upper + 1}'"):
        limits_of(TABLE, TABLE.free, [parse_constraint(f"CLa >= {TABLE['CLa'].upper + 1}")])


@pytest.fixture(scope="module")
def observed(kite, calm):
    return truly(lively(kite, calm.log, count=16, seconds=1.5), Simulator(kite))


def joint(kite, observed, start, names):
    share = Share(Misfit(Simulator(kite).holding(start), observed, names), start, start, names)
    return fit_together([share], prior=False, tolerance=1e-9, iterations=60)


def test_a_fit_keeps_a_constraint_and_says_what_it_costs(kite, observed):
    """Guards the way from the kite file to the answer: the constraint is active, the multiplier is the slope of the optimal cost."""
    names, truth = ("CLa", "CL0", "CD0", "Clp"), kite.parameters
    sharp = truth["CLa"].value + 10 * truth["CL0"].value
    sum_of_two = round(truth["CD0"].value + 0.1 * truth["Clp"].value + 1e-4, 6)

    def fitted(limit):
        limited = Kite(constrained(f"CLa + 10*CL0 <= {limit!r}", f"CD0 + 0.1*Clp = {sum_of_two!r}"), kite.heights)
        start = truth.with_values({"CLa": 1.05 * truth["CLa"].value})
        return joint(limited, observed, start, names)

    limit = 0.999 * sharp
    found, less, more = (fitted(limit + h) for h in (0.0, -1e-4, 1e-4))
    at = {n: found.parameters[n].value for n in names}
    assert found.solution.outcome == "converged" and at["CLa"] + 10 * at["CL0"] == pytest.approx(limit, rel=1e-8)
    assert at["CD0"] + 0.1 * at["Clp"] == pytest.approx(sum_of_two, abs=1e-9)
    inequality, equality = describe(found)["constraints"]
    assert inequality["active"] and equality["active"]
    assert inequality["cost_per_unit"] == pytest.approx((less.solution.cost - more.solution.cost) / 2e-4, rel=1e-3)
    # across an equality there is no variance
    across = np.array([0, 0, 1, 0.1])
    assert across @ found.covariance @ across < 1e-9 * across**2 @ np.diag(found.covariance)


def test_a_constraint_that_truth_keeps_changes_nothing(kite, observed):
    """Guards an inactive constraint: the same optimum, and no multiplier."""
    names, truth = ("CLa", "CD0"), kite.parameters
    start = truth.with_rows([replace(truth["CLa"], value=1.1 * truth["CLa"].value)])
    free = joint(kite, observed, start, names)
    kept = joint(Kite(constrained("CLa <= 100"), kite.heights), observed, start, names)
    assert kept.solution.x == pytest.approx(free.solution.x, rel=1e-12)
    (row,) = describe(kept)["constraints"]
    assert not row["active"] and row["cost_per_unit"] == 0
