"""The forms of the .npz files that stages leave: which arrays they hold, of which axes, and what these are."""

from collections.abc import Mapping
from typing import NamedTuple

Axis = tuple[int | str, bool]
"""(Length, or the array that is as long; whether it may be shorter.)"""
_ANY = (1 << 40, True)
_WHOLE, _PREDICTED = (("time", False),), (("first", False), ("time", False))
_VALIDATION = (("validation_first", False), ("time", False))
_TEST = (("test_first", False), ("time", False))


class Array(NamedTuple):
    """One array, or all whose names begin so (`*`)."""

    axes: tuple[Axis, ...]
    means: str


_SIMULATED = Array(_WHOLE, "(N,) a state or channel of the simulated flight, noise-free [SI]")
_MEASURED = Array((("time", True),), "(M,) the same as measured, as far as the log reaches [SI]")

ARRAYS: Mapping[str, Mapping[str, Array]] = {
    "trajectory.npz": {
        "time": Array((_ANY,), "(N,) on the flight's clock [s]"),
        **{f"simulated_{axis}": _SIMULATED for axis in ("p_n", "p_e", "p_d")},
        **{f"measured_{axis}": _MEASURED for axis in ("p_n", "p_e", "p_d")},
        "simulated_*": _SIMULATED, "measured_*": _MEASURED,
    },
    "predictions.npz": {
        "time": Array((_ANY,), "(N,) from the begin of a prediction [s]"),
        "first": Array((_ANY,), "(K,) sample of the flight at which each prediction of the test loops begins [-]"),
        "measured_p_n": Array(_PREDICTED, "(K, N) measured position north of the winch [m]"),
        "measured_*": Array(_PREDICTED, "(K, N) measured channel [SI]"),
        **{
            f"{which}_*": Array(_PREDICTED, f"(K, N) channel as {whose} predicts it [SI]")
            for which, whose in (
                ("initial", "the declared model"), ("identified", "the identified model"), ("with_effects", "the model with effects"),
                ("hybrid", "the model with the network"), ("linear", "the linear model"),
            )
        },
        "low_*": Array(_PREDICTED, "(K, N) lower end of the 90 % band around a channel, `low_MODEL_CHANNEL` [SI]"),
        "high_*": Array(_PREDICTED, "(K, N) upper end of it, `high_MODEL_CHANNEL` [SI]"),
    },
    "correction.npz": {
        "time": Array((_ANY,), "(N,) on the flight's clock [s]"),
        "correction": Array((("time", False), (6, False)), "(N, 6) what the network adds to the rates of u, v, w [m/s2], p, q, r [rad/s2]"),
        "physics": Array((("time", False), (6, False)), "(N, 6) the same rates by physics alone [m/s2 and rad/s2]"),
        "fade": Array((("time", False),), "(N,) factor on the network: 1 inside its training range, towards 0 outside [-]"),
    },
    "residuals.npz": {
        "time": Array((_ANY,), "(N,) from the begin of a prediction [s]"),
        "test_first": Array((_ANY,), "(K,) sample of the flight at which each prediction of the test loops begins [-]"),
        "test_before_*": Array(_TEST, "(K, N) measured channel less the prediction, without the answer's effects [SI]"),
        "test_after_*": Array(_TEST, "(K, N) the same, with them [SI]"),
        "validation_first": Array((_ANY,), "(V,) likewise, of the validation loops [-]"),
        "validation_before_*": Array(_VALIDATION, "(V, N) measured channel less the prediction, without the answer's effects [SI]"),
        "validation_after_*": Array(_VALIDATION, "(V, N) the same, with them [SI]"),
        **{
            f"study_{which}_{name}": Array((_ANY,), f"{means}, {whose} the answer's effects {unit}")
            for which, whose in (("before", "without"), ("after", "with"))
            for name, means, unit in (
                ("equation_force_*", "(M,) measured force less the model's, sample by sample", "[N]"),
                ("equation_moment_*", "(M,) measured moment less the model's", "[N m]"),
                ("equation_tension*", "(M,) measured tension less the model's", "[N]"),
                ("equation_along_line_*", "(M,) force along the line less the load cell's", "[N]"),
                ("innovation_first*", "(I,) sample of the flight of each innovation", "[-]"),
                ("innovation_*", "(I,) error of a prediction half a second ahead", "[SI]"),
                ("frequency*", "(F,) frequency of the spectra", "[Hz]"),
                ("spectrum_*", "(F,) power spectral density of the innovation of a channel", "[SI2/Hz]"),
                ("averaged_*", "(B,) innovation of a channel, mean over loops by phase of the loop", "[SI]"),
            )
        },
    },
}  # fmt: skip
"""File -> array -> its form."""
