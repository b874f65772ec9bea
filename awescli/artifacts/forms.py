"""What each JSON artifact must hold for its readers: one form a file, each with a version; more than that is allowed in any of them."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import BaseModel, Field, model_validator

from awescli.artifacts.form_words import Channels, Checked, Horizon, Number, Numbers, Spread, Text, Word
from awescli.artifacts.score_forms import Parts, Scores


class Stamp(Checked):
    """What a stage was made from."""

    inputs: dict[str, Text]
    upstream: dict[str, Text | None]
    settings: dict[str, Any] = {}
    versions: dict[str, Text] = {}
    split: dict[str, Any] = {}


class Timing(Checked):
    """When, and for how long."""

    started: Text = ""
    duration_s: Number | None = None


class Provenance(Checked):
    """provenance.json of every stage."""

    artifacts: dict[str, Text]
    stamp: Stamp
    paths: dict[str, Text] = {}
    summary: dict[str, Any] = {}
    timing: Timing = Timing()


class Metrics(Checked):
    """What metrics.json of every stage has where it has it."""

    outcome: Text | None = None


class Level(Checked):
    """How strong a process is."""

    level: Number
    unit: Text


class Fit(Metrics):
    """metrics.json of identify."""

    chi2: Number | None = None
    method: Literal["filter error", "output error"]
    surfaces: Literal["recorded", "controller"]
    horizon_s: Number
    nrmse: Parts
    outputs: list[Word]
    processes: dict[str, Level]
    noise_factors: Numbers


class Chosen(Checked):
    chosen: list[Text] = []
    how: Text = ""
    reasons: dict[str, dict[str, Any]] = {}


class Proof(Checked):
    outcome: Text | None = None
    asked_s: Number = 0.0
    survival_s: list[Number] = []
    starts_s: list[Number] = []
    path_error_5s_m: Number | None = None


class Delay(Checked):
    delay_s: Number | None = None


class Steering(Checked):
    moved_deg: Number | None = None
    slopes: dict[str, Text] | None = None


class Gain(Checked):
    gamma_error: Number | None = None
    plant_gain: Number | None = None


class ControllerFit(Metrics):
    """metrics.json of fit-controller."""

    kind: Text = ""
    nonzeros: int = 0
    surfaces: list[Word] = []
    features: Chosen = Chosen()
    delay: Delay | None = None
    nrmse: dict[str, dict[str, Number | None]] = {}
    noise_nrmse: dict[str, dict[str, Number | None]] | None = None
    closed_loop: Proof = Proof()
    steering: Steering | None = None
    gain: dict[str, Gain] = {}
    hold: Number | None = None


class History(Checked):
    columns: list[Text]
    rows: list[list[Number | None]]


class Ensemble(Checked):
    spread: Numbers = {}


class Validated(Checked):
    prediction: dict[str, Number | None] = {}


class Compared(Checked):
    test: dict[str, Channels] = {}


class Training(Metrics):
    """metrics.json of train-hybrid."""

    history: History | None = None
    sentence: Text = ""
    comparison: Compared | None = None
    validation: Validated | None = None
    ensemble: Ensemble | None = None
    share_of_acceleration: dict[str, Number | None] | None = None
    validation_rmse_ratio: dict[str, Number | None] | None = None
    distilled: list[Text] = []
    outside_box_test: Number | None = None


class OwnWind(Checked):
    speed: Number | None
    direction: Number | None


class Earned(Checked):
    """Energy of a phase or a cycle that was flown."""

    cycle: int
    from_s: Number
    to_s: Number
    energy_J: Number
    mean_W: Number
    mean_tension_N: Number
    from_m: Number
    to_m: Number


class InWind(Checked):
    """Mean cycle power in one wind; null where the kite is lost."""

    wind_m_s: Number
    mean_W: Number | None
    low_W: Number | None
    high_W: Number | None
    draws: int


class FlownPhase(Earned):
    phase: Text
    ended_by: Text


class Flown(Checked):
    """metrics.json of simulate."""

    outcome: Literal["flew_on", "departed"]
    start_s: Number
    survived_s: Number
    asked_s: Number
    unseen_s: Number = 0.0
    model: Literal["initial", "identified", "with_effects", "hybrid"]
    surfaces: Literal["controller", "recorded", "path_following"]
    effects: dict[str, dict[str, Number]]
    wind: OwnWind
    nrmse: dict[Horizon, Channels]
    path_error_m: dict[Horizon, Number]
    phases: list[FlownPhase] = []
    cycles: list[Earned] = []
    mean_cycle_W: Number | None = None
    mean_cycle_interval_W: Annotated[list[Number], Field(min_length=2, max_length=2)] | None = None
    power_curve: dict[Literal["initial", "identified", "with_effects"], list[InWind]] = {}

    @model_validator(mode="after")
    def _alike(self):
        if self.nrmse.keys() != self.path_error_m.keys():
            raise ValueError("nrmse and path_error_m are of different times")
        return self


class Row(Checked):
    """One parameter of params.json. value, std, prior, prior_std: in unit; excited: the flight halves its prior; determined: how well the
    flight says where it is; at_bound: at an end of its range; partners: parameters correlated with it by more than 0.95."""

    value: Number
    std: Spread
    unit: Text
    prior: Number
    prior_std: Annotated[float, Field(gt=0, allow_inf_nan=False)]
    shift_in_prior_std: Number
    excited: bool = True
    determined: Literal["well", "hardly", "poorly"] = "well"
    at_bound: bool = False
    partners: list[Text] = []
    advice: Text | None = None


class Factor(Checked):
    says: Annotated[str, Field(min_length=1)]


class Kept(Checked):
    constraint: Text
    active: bool
    cost_per_unit: Number


class Params(Checked):
    """params.json."""

    parameters: dict[str, Row]
    common_factors: list[Factor] = []
    constraints: list[Kept] = []


class Size(Checked):
    value: Number
    std: Spread | None
    unit: Text


class Named(Checked):
    name: Text
    acts_on: Text = ""


class Effect(Named):
    rivals: list[Named]
    parameters: dict[str, Size]
    doc: Text = ""


class Candidate(Named):
    """One candidate, as the first round judged it. score: fall of the deviance to first order; p_value: of the likelihood ratio;
    explained_share: of what the answer explains; test_gain: share of the validation cost that it takes away; outcome: of its fit."""

    score: Number
    p_value: Number
    explained_share: Number
    plausible_size: bool
    test_gain: Number | None
    outcome: Text = ""


class Unexplained(Checked):
    channel: Text = ""
    share: Number | None = None
    expression: Text | None = None


class OwnUnit(Checked):
    unit: Text = "-"


class Shift(Checked):
    before_in_prior_std: Number
    after_in_prior_std: Number


class Errors(Checked):
    """Channel -> NRMSE before, after, and of noise alone, of the same channels."""

    horizon_s: Number
    before: Channels = None  # there where a model was fitted
    after: Channels
    noise_floor: Channels

    @model_validator(mode="after")
    def _alike(self):
        before = self.after if self.before is None else self.before
        if not before.keys() == self.after.keys() == self.noise_floor.keys():
            raise ValueError("before, after and noise_floor are of different channels")
        return self


class BeforeAfter(Checked):
    before: Number
    after: Number


class RollGusts(Checked):
    std_rad_s: Number
    worth: Number
    lasts_s: Number
    split: Text
    channels: dict[str, BeforeAfter]
    parameter_shifts: dict[str, Shift]


class Criterion(Checked):
    """One line of what the verdict stands on."""

    says: Text
    value: Number | Text
    threshold: Number | Text
    passed: bool | None = Field(alias="pass")
    source: Text


class SeenAlone(Checked):
    """An error of a sensor that kinematics alone shows."""

    name: Word
    acts_on: Text
    channels: list[Text]
    size: Number
    std: Number
    unit: Text
    sentence: Text


class Effects(Checked):
    """effects.json. criteria: what the verdict stands on; probability: of every cause; detectable: smallest size that this flight would
    have shown, by effect; not_testable: effects that the free parameters absorb; separate: what would tell rivals apart."""

    verdict: Literal["none", "found", "cannot_tell", "unexplained", "not_deterministic", "not_testable"]
    sentence: Text
    effects: list[Effect]
    ranking: list[Candidate]
    unexplained: Unexplained | None
    error: Errors
    criteria: list[Criterion] = []
    probability: Numbers = {}
    chi2: dict[str, Number | None] = {}
    gust_m_s: Number | None = None
    roll_gusts: RollGusts | None = None
    detectable: Numbers = {}
    detectable_units: dict[str, OwnUnit] = {}
    not_testable: list[Text] = []
    parameter_shifts: dict[str, Shift] = {}
    separate: list[Text] = []
    kinematics: list[SeenAlone] = []

    @model_validator(mode="after")
    def _fitted(self):
        if self.error.before is None and self.verdict != "not_testable":
            raise ValueError("error.before is missing")
        return self


class Network(Checked):
    """network.json."""

    format: Text
    inputs: list[Text]
    hidden: list[int]
    width: Number
    fingerprint: Text


class Controller(Checked):
    """controller.json."""

    kind: Text
    surfaces: list[Word]
    features: list[Text]
    centre: list[Number]
    scale: list[Number]
    limits: dict[str, list[Number]]
    constants: dict[str, Any]
    pattern: dict[str, Any] | None
    rate_limits: Numbers
    delay_s: Number


@dataclass(frozen=True)
class Form:
    """How one file looks today. unversioned: awes 0.1 wrote the same form, without a version."""

    model: type[BaseModel]
    version: int = 2
    unversioned: bool = False


FORMS: Mapping[str, Form] = {
    "provenance.json": Form(Provenance, unversioned=True),
    "params.json": Form(Params),
    "effects.json": Form(Effects),
    "network.json": Form(Network),
    "controller.json": Form(Controller),
    "metrics.json": Form(Metrics),
    "fit-controller/metrics.json": Form(ControllerFit),
    "identify/metrics.json": Form(Fit),
    "train-hybrid/metrics.json": Form(Training),
    "simulate/metrics.json": Form(Flown),
    "evaluate/metrics.json": Form(Scores),
}
"""File, with its stage where stages differ -> its form."""

_ANY = (1 << 40, True)
_PATH = {f"{which}_{axis}": ((("time", which == "measured"),)) for which in ("simulated", "measured") for axis in ("p_n", "p_e", "p_d")}
_PREDICTED = (("first", False), ("time", False))
ARRAYS: Mapping[str, Mapping[str, tuple[tuple[int | str, bool], ...]]] = {
    "trajectory.npz": {"time": (_ANY,), **_PATH, "simulated_*": (("time", False),), "measured_*": (("time", True),)},
    "predictions.npz": {
        "time": (_ANY,), "first": (_ANY,), "measured_p_n": _PREDICTED,
        **{f"{which}_*": _PREDICTED for which in ("measured", "initial", "identified", "with_effects", "hybrid", "linear", "low", "high")},
    },
    "correction.npz": {"time": (_ANY,), "correction": (("time", False), (6, False))},
    "residuals.npz": {
        "time": (_ANY,), "test_first": (_ANY,),
        "test_before_*": (("test_first", False), ("time", False)), "test_after_*": (("test_first", False), ("time", False)),
    },
}  # fmt: skip
"""File -> array, or all whose names begin so -> its axes: (length, or the array that is as long; whether it may be shorter)."""
