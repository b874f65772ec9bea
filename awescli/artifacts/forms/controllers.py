"""The forms of what fit-controller leaves."""

from typing import Any

from pydantic import Field

from awescli.artifacts.forms.words import Checked, Metrics, Number, Numbers, Text, Word


class Score(Checked):
    """Errors by which laws are compared."""

    score: Number | None = Field(default=None, description="what is compared: root mean square of those below [-]")
    cv_nrmse: Number | None = Field(default=None, description="cross-validated over whole loops [-]")
    ahead_nrmse: Number | None = Field(default=None, description="on the validation part [-]")
    far_nrmse: Number | None = Field(default=None, description="on the latest known flight, fitted to the early train part alone [-]")


class Set(Score):
    """A set of features that was tried."""

    features: list[Text] = Field(description="quantities in it")


class Trial(Score):
    """A law that was tried."""

    basis: Text = Field(default="", description="how its terms were chosen: greedy or convex")
    width: Number | None = Field(default=None, description="width of its Gaussians [standard deviations of the features]")
    nonzeros: int | None = Field(default=None, description="terms that are not zero")
    ridge: Number | None = Field(default=None, description="weight of its ridge regression [-]")
    alpha: Number | None = Field(default=None, description="factor on the noise in the bound of the convex fit [-]")
    decay: Number | None = Field(default=None, description="weight decay of a network [-]")


class Attempt(Trial):
    """A law that was fitted to the end and flown."""

    features: list[Text] = Field(default=[], description="quantities that it sees")
    hold: Number | None = Field(default=None, description="weight of the wish to steer back to the circle [-]")
    survival: Number | None = Field(default=None, description="share of the asked time that the declared model flew with it [-]")


class Sparse(Checked):
    """The sparse fit of one surface by convex optimisation."""

    eps: Number = Field(description="estimated noise of the set-points [rad]")
    gamma: Number = Field(description="estimated Lipschitz constant of what is left [rad per standard deviation of the features]")
    alpha: Number = Field(description="factor on `eps` in the bound on the error [-]")
    samples: int = Field(description="samples that it was fitted to")
    l1_norm: Number = Field(description="sum of the magnitudes of its coefficients [rad]")
    worst_slack: Number | None = Field(description="largest excess over the bound [rad]")
    share_beyond_bound: Number | None = Field(description="share of samples beyond it [-]")
    support: int = Field(default=0, description="terms that are not zero")
    pairs: int = Field(default=0, description="pairs of samples that bound the Lipschitz constant")
    solver: Text = Field(default="", description="how the solver ended")


class Rate(Checked):
    """How fast the set-points of one surface move."""

    fastest: Number = Field(description="fastest set-point of the log [rad/s]")
    share_at_fastest: Number = Field(description="share of samples that move so fast [-]")
    limited: bool = Field(description="whether that is a limit")


class LawErrors(Checked):
    """Errors of a law at the measured states."""

    nrmse: dict[str, dict[str, Number | None]] = Field(
        default={}, description="part -> surface -> error of the commanded set-point over its range [-]"
    )
    nrmse_smoothed: dict[str, dict[str, Number | None]] = Field(
        default={}, description="likewise, at states with the sensors' noise smoothed out [-]"
    )
    noise_nrmse: dict[str, dict[str, Number | None]] | None = Field(
        default=None, description="likewise, what the noise of the sensors causes by itself [-]"
    )
    nonzeros: int = Field(default=0, description="terms of the law that are not zero")
    condition: Number | None = Field(default=None, description="condition number of the regression that was solved [-]")
    hold: Number | None = Field(default=None, description="weight of the wish to steer back to the circle [-]")
    survival: Number | None = Field(default=None, description="share of the asked time that the declared model flew with it [-]")


class Added(Checked):
    """A feature that was added to a set."""

    added: Text = Field(description="which feature")
    score_before: Number = Field(description="score without it [-]")
    score_after: Number = Field(description="score with it [-]")


class Chosen(Checked):
    """The features of a control law."""

    sets: dict[str, Set] = Field(default={}, description="set of features -> what it was worth")
    steps: list[Added] = Field(default=[], description="features that were added, one after the other")
    notes: list[Text] = Field(default=[], description="what was left out, and why")
    chosen: list[Text] = Field(default=[], description="quantities that the law sees")
    how: Text = Field(default="", description="how they were chosen: by the plan, or greedily by cross-validation")
    reasons: dict[str, dict[str, Any]] = Field(default={}, description="feature -> what the error was with it and without")


class Proof(Checked):
    """Flights of the declared model with the fitted law, from several states of the log."""

    outcome: Text | None = Field(
        default=None, description="flies: the whole time from every state; departs: from some; does_not_fly: from none"
    )
    asked_s: Number = Field(default=0.0, description="how long it was to fly [s]")
    survival_s: list[Number] = Field(default=[], description="how long it flew, from each start [s]")
    starts_s: list[Number] = Field(default=[], description="where in the flight each of them began [s]")
    share: Number | None = Field(default=None, description="mean of survival_s over asked_s [-]")
    path_error_5s_m: Number | None = Field(
        default=None, description="root mean square distance from the measured path over the first 5 s [m]; of flights that last so long"
    )


class Delay(Checked):
    """The delay from state to set-point."""

    scores: list[Number | None] = Field(default=[], description="error of the law, delay by delay [-]")
    step_s: Number | None = Field(default=None, description="step from one delay to the next [s]; the first is 0")
    delay_s: Number | None = Field(default=None, description="delay at which the log is fitted best [s]; 0: none shows")


class Circle(Checked):
    """A circle on the sphere around the winch."""

    elevation: Number = Field(description="of its centre, above the horizon [rad]")
    azimuth: Number = Field(description="of its centre, clockwise from north [rad]")
    radius: Number = Field(description="along the sphere [m]")
    turn: Number = Field(description="sense of turning: 1 clockwise as seen from the winch, -1 the other way [-]")


class Misfit(Checked):
    """Error of the few steering terms on unseen flight."""

    flown: Number = Field(description="about the flown circle [-]")
    commanded: Number = Field(description="about the commanded one [-]")


class Steering(Checked):
    """How the law steers back to its circle."""

    circle: Text = Field(default="", description="commanded: a circle of its own was found; flown: the flown one")
    flown_circle: Circle | None = Field(default=None, description="circle of the measured path")
    misfit: Misfit | None = Field(default=None, description="which of both the set-points follow")
    course_rad_per_rad: dict[str, Number | None] = Field(default={}, description="surface -> deflection per error of course [rad/rad]")
    radius_rad_per_m: dict[str, Number | None] = Field(default={}, description="surface -> deflection per error of radius [rad/m]")
    turn_per_metre_and_rad: dict[str, Number | None] = Field(
        default={}, description="surface -> turn of the path per metre flown and deflection [1/m]"
    )
    share_of_turning: dict[str, Number | None] = Field(
        default={}, description="surface -> share of the standard deviation of the rate of turn that it makes [-]"
    )
    moved_deg: Number | None = Field(default=None, description="angle between the centres of the commanded and the flown circle [deg]")
    slopes: dict[str, Text] | None = Field(
        default=None, description="surface -> where its slopes come from: identified, turn-rate law, or does not steer"
    )


class Gain(Checked):
    """Terms of the small-gain condition, of one surface; its condition is not a proof (see the gain margin)."""

    eps_error: Number | None = Field(default=None, description="error that the law leaves of the set-points [rad]")
    gamma_error: Number | None = Field(
        default=None, description="Lipschitz constant of what the law leaves of the set-points [rad per standard deviation of the features]"
    )
    plant_gain: Number | None = Field(
        default=None, description="largest change of the standardised features per deflection, measured in closed loop [1/rad]"
    )


class ControllerFit(Metrics):
    """metrics.json of fit-controller."""

    method: Text = Field(default="", description="how the terms were chosen: greedy, convex, or the best of both")
    samples: int = Field(default=0, description="samples that it was fitted to")
    loops: int = Field(default=0, description="loops of the flight, or blocks of one that does not circle")
    folds: int = Field(default=0, description="how many parts cross-validation leaves out in turn")
    folds_of: Text = Field(default="", description="what cross-validation leaves out: loops, or blocks of time")
    pattern: Circle | None = Field(default=None, description="circle that the law steers for; nothing for a flight without one")
    constants: dict[str, Number] = Field(default={}, description="surface that never moved -> where it stands [rad]")
    rates: dict[str, Rate] = Field(default={}, description="surface -> how fast its set-points move")
    attempts: list[Attempt] = Field(default=[], description="laws that were fitted to the end and flown, the chosen one among them")
    trials: list[Trial] = Field(default=[], description="laws that were tried on the way to it")
    chosen_by: Trial = Field(default=Trial(), description="errors that it was chosen by")
    comparison: dict[str, LawErrors] = Field(default={}, description="kind of law -> its errors, where the plan asks for several")
    convex: list[Sparse] = Field(default=[], description="sparse fits by convex optimisation, a surface each")
    width: Number | None = Field(default=None, description="width of its Gaussians [standard deviations of the features]")
    ridge: Number | None = Field(default=None, description="weight of its ridge regression [-]")
    condition: Number | None = Field(default=None, description="condition number of the regression that was solved [-]")
    condition_raw: Number | None = Field(default=None, description="the same without the ridge [-]")
    largest_coefficient_deg: Number | None = Field(default=None, description="largest coefficient of the law [deg]")
    nrmse_smoothed: dict[str, dict[str, Number | None]] = Field(
        default={}, description="part -> surface -> error at states with the sensors' noise smoothed out, over the set-point's range [-]"
    )
    survival: Number | None = Field(default=None, description="share of the asked time that the declared model flew with it [-]")
    kind: Text = Field(default="", description="kind of the law: gaussian, network or linear")
    nonzeros: int = Field(default=0, description="terms of the law that are not zero")
    surfaces: list[Word] = Field(default=[], description="surfaces that the law drives")
    features: Chosen = Field(default=Chosen(), description="what the law sees")
    delay: Delay | None = Field(default=None, description="delay of its set-points")
    nrmse: dict[str, dict[str, Number | None]] = Field(
        default={}, description="part -> surface -> error of the commanded set-point over its range [-], at the measured states"
    )
    noise_nrmse: dict[str, dict[str, Number | None]] | None = Field(
        default=None, description="likewise, what the noise of the sensors that the law sees causes by itself [-]"
    )
    closed_loop: Proof = Field(default=Proof(), description="whether the declared model flies with the law")
    steering: Steering | None = Field(default=None, description="how it steers back to its circle")
    gain: dict[str, Gain] = Field(default={}, description="surface -> terms of the small-gain condition")
    hold: Number | None = Field(
        default=None, description="weight of the wish to steer back to the circle, against that of the log [-]; 0: none was needed"
    )


class Controller(Checked):
    """controller.json: the law itself; larger arrays stand in controller.safetensors."""

    metrics: LawErrors = Field(default=LawErrors(), description="its errors, as in metrics.json")
    unit: Text = Field(default="rad", description="unit of the set-points")
    kind: Text = Field(description="kind of the law: gaussian, network or linear")
    surfaces: list[Word] = Field(description="surfaces that it drives, in the order of its outputs")
    features: list[Text] = Field(description="quantities that it sees, in the order of its inputs")
    centre: list[Number] = Field(description="mean of each feature, subtracted first [unit of the feature]")
    scale: list[Number] = Field(description="standard deviation of each feature, divided by then [unit of the feature]")
    limits: dict[str, list[Number]] = Field(description="surface -> [low, high] that set-points are kept within [rad]")
    constants: dict[str, Any] = Field(description="surface that never moved -> where it stands [rad]")
    pattern: dict[str, Any] | None = Field(
        description="the circle of the flight: elevation and azimuth of its centre [rad], radius along the sphere [m], sense of turning; "
        "nothing for a flight without one"
    )
    rate_limits: Numbers = Field(description="surface -> fastest set-point, where the log shows a limit [rad/s]")
    delay_s: Number = Field(description="delay of the set-points [s]")
