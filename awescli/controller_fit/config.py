"""Settings of a controller fit, as every kind of law reads them."""

from dataclasses import dataclass, field

from awescli.control.laws import LAWS
from awescli.controller_fit.noise import NOISE
from awescli.notation.errors import BadInput, did_you_mean

FEWEST_FOLDS = 2
"""With fewer nothing is left to be judged on."""


@dataclass(frozen=True)
class ControllerConfig:
    """Settings of a controller fit.

    kind: one of LAWS; method: how the terms of a gaussian law are found: greedy, convex (linear programmes alone), or best: greedy, with
    and without what a linear programme prefers, whichever predicts better; features: a set of FEATURE_SETS, 'auto', or names; surfaces:
    None for all that move; folds: of whole loops; few_loops: fewer loops than folds make fewer folds, are refused, or
    give way to blocks of time;
    most_nonzeros, candidates, width_factors (times sqrt(number of features)), counts: its basis; condition_limit: of its regression;
    alphas: the convex step's tolerances in units of eps, the first that all but `outliers` of the samples meet; gamma_share: the error's
    Lipschitz bound, as a share of gamma; smooth_window_s: 0 fits to the states as measured; refit_with_validation: after
    all choices are made, use the validation part too; limits: surface -> (lower, upper) [rad]; limit_margin: share of the flown range
    granted beyond it; noise: sensor standard deviations, SI; hold: weight of what controller_hold asks where nobody flies the law,
    hold_strengths: those tried, weakest first, where somebody does; compare: fit all kinds.
    """

    kind: str = "gaussian"
    method: str = "best"
    features: str | tuple[str, ...] = "auto"
    additions: tuple[str, ...] = ("inverse_speed", "range", "wing_along_line", "nose_along_line", "v_d", "reel_out_speed")
    surfaces: tuple[str, ...] | None = None
    folds: int = 4
    few_loops: str = "fewer"
    most_nonzeros: int = 79
    candidates: int = 200
    counts: tuple[int, ...] = (15, 30, 45, 60)
    width_factors: tuple[float, ...] = (0.9, 1.2, 1.6, 2.1)
    condition_limit: float = 1e6
    alphas: tuple[float, ...] = (1.0, 1.5, 2.0, 3.0)
    outliers: float = 0.05
    gamma_share: float = 0.5
    convex_samples: int = 300
    convex_pairs: int = 200
    smooth_window_s: float = 0.34
    selection_samples: int = 3000
    refit_with_validation: bool = True
    limits: dict = field(default_factory=dict)
    limit_margin: float = 0.5
    noise: dict = field(default_factory=lambda: dict(NOISE))
    network_width: int = 12
    network_iterations: int = 300
    seed: int = 0
    hold_strengths: tuple[float, ...] = (0.003, 0.0055, 0.01, 0.03, 0.1)
    hold: float = 0.01
    compare: bool = False

    def __post_init__(self) -> None:
        if self.kind not in LAWS:
            raise BadInput(f"unknown kind of control law '{self.kind}'", do=did_you_mean(self.kind, LAWS))
        if self.folds < FEWEST_FOLDS:
            raise BadInput(f"{self.folds} folds", do=f"Set folds to {FEWEST_FOLDS} or more.")


def too_few_loops(loops: int, folds: int, few_loops: str) -> BadInput | None:
    """What is wrong with so many loops in the training part, if anything is. few_loops: as of ControllerConfig."""
    least = {"blocks": 0, "fewer": FEWEST_FOLDS, "refuse": folds}[few_loops]
    if loops >= least:
        return None
    there = "1 loop" if loops == 1 else f"{loops} loops"
    do = f"Set folds to at most {loops}" if loops >= FEWEST_FOLDS else "Set few_loops to blocks"
    return BadInput(f"{there} in the training part, fewer than {least} folds", do=f"{do}, or give a longer training range.")
