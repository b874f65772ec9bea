"""The contract of a law, on all of LAWS."""

import numpy as np
import pytest

from awescli.control.features import FEATURE_SETS
from awescli.control.law import deflections_of_states, standardised_features
from awescli.control.laws import LAWS, from_artifact, to_artifact
from awescli.control.pattern import Pattern
from awescli.notation.errors import BadInput
from awescli.notation.quantities import STATES

FEATURES = FEATURE_SETS["invariant"]
F, S, M = len(FEATURES), 2, 7


def a_law(kind, **changes):
    r = np.random.default_rng(1)
    own = {
        "gaussian": lambda: {"centres": r.normal(size=(M, F)), "width": 3.0,
                             "coefficients": r.normal(size=(S, M)), "affine": r.normal(size=(S, F + 1))},
        "linear": lambda: {"affine": 0.1 * r.normal(size=(S, F + 1))},
        "network": lambda: {
            "affine": r.normal(size=(S, F + 1)), "weights_1": r.normal(size=(5, F)), "bias_1": r.normal(size=5),
            "weights_2": r.normal(size=(4, 5)), "bias_2": r.normal(size=4), "weights_3": r.normal(size=(S, 4)),
        },
    }[kind]()  # fmt: skip
    common = {
        "surfaces": ("elevator", "rudder"), "features": FEATURES, "centre": tuple(r.normal(size=F)), "scale": tuple(r.uniform(5, 50, F)),
        "limits": {"elevator": (-9.0, 9.0), "rudder": (-9.0, 9.0)}, "constants": {"aileron": 0.01},
        "pattern": Pattern(0.6, 0.1, 50.0, -1.0),
    }  # fmt: skip
    return LAWS[kind](**(common | own | changes))


def states(n=30):
    r = np.random.default_rng(2)
    z = {name: r.normal(size=n) for name in STATES}
    return z | {"p_n": r.uniform(150, 300, n), "p_d": r.uniform(-200, -100, n), "u": r.uniform(20, 50, n), "theta": r.uniform(-1, 1, n)}


@pytest.mark.parametrize("kind", LAWS)
def test_scalars_and_arrays_agree(kind):
    law, z = a_law(kind), states()
    fast, slow = deflections_of_states(law, z), law.deflections(z)
    assert set(fast) == {"elevator", "rudder", "aileron"}
    for name in law.surfaces:
        np.testing.assert_allclose(fast[name], slow[name], rtol=1e-12, atol=1e-12)
        for i in range(3):
            one = law.deflections({k: float(v[i]) for k, v in z.items()})[name]
            assert type(one) is float and one == pytest.approx(fast[name][i], rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("kind", LAWS)
def test_recorded_law_gives_the_same_numbers(kind):
    """The engine's tape, replayed in Python, equals the law on floats."""
    record = pytest.importorskip("awescli.engine.record")
    law, z = a_law(kind), states(1)
    tape = record.Tape()
    result = law.deflections(dict(zip(STATES, tape.inputs("x", 12), strict=True)))["rudder"]
    assert isinstance(result, record.Scalar)
    values: list[float] = []
    for op, *args in tape.nodes:
        if op == "input":
            values.append(float(z[STATES[args[1]]][0]))
        elif op == "const":
            values.append(args[0])
        else:
            values.append(record._FOLD[op](*(values[a] for a in args)))
    assert values[result.index] == pytest.approx(float(deflections_of_states(law, z)["rudder"][0]), rel=1e-11)


@pytest.mark.parametrize("kind", LAWS)
def test_saturates(kind):
    free = deflections_of_states(a_law(kind, limits=dict.fromkeys(("elevator", "rudder"), (-1e9, 1e9))), states())
    limits = {name: tuple(np.quantile(free[name], (0.3, 0.7))) for name in ("elevator", "rudder")}
    law = a_law(kind, limits=limits)
    for found in (law.deflections(states()), deflections_of_states(law, states())):
        for name, (lower, upper) in limits.items():
            assert found[name].min() == lower and found[name].max() == upper
            np.testing.assert_allclose(found[name], np.clip(free[name], lower, upper), atol=1e-12)


@pytest.mark.parametrize("kind", LAWS)
def test_there_and_back(kind):
    law = a_law(kind, rate_limits={"rudder": 0.6}, delay_s=0.04)
    again = from_artifact(*to_artifact(law))
    assert again.rate_limits == {"rudder": 0.6} and again.delay_s == 0.04 and again.pattern == law.pattern
    np.testing.assert_array_equal(deflections_of_states(law, states())["rudder"], deflections_of_states(again, states())["rudder"])


def test_far_from_all_centres_nothing_is_denormal():
    law = a_law("gaussian", scale=(1e-2,) * F)
    z = states()
    assert np.isfinite(deflections_of_states(law, z)["rudder"]).all()
    from awescli.control.gaussian_law import design

    assert design(standardised_features(law, z), law.centres, law.width)[:, :M].min() > 1e-30


def test_unknown_surface_and_feature():
    with pytest.raises(BadInput, match="rudder|unknown"):
        a_law("linear", limits={})
    with pytest.raises(BadInput, match="Did you mean 'course_error'"):
        a_law("linear", features=("course_eror", *FEATURES[1:]))
