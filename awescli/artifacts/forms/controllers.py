"""The forms of what fit-controller leaves."""

from typing import Any

from pydantic import Field

from awescli.artifacts.forms.words import Checked, Metrics, Number, Numbers, Text, Word


class Chosen(Checked):
    """The features of a control law."""

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
    path_error_5s_m: Number | None = Field(
        default=None, description="root mean square distance from the measured path over the first 5 s [m]; of flights that last so long"
    )


class Delay(Checked):
    """The delay from state to set-point."""

    delay_s: Number | None = Field(default=None, description="delay at which the log is fitted best [s]; 0: none shows")


class Steering(Checked):
    """How the law steers back to its circle."""

    moved_deg: Number | None = Field(default=None, description="angle between the centres of the commanded and the flown circle [deg]")
    slopes: dict[str, Text] | None = Field(
        default=None, description="surface -> where its slopes come from: identified, turn-rate law, or does not steer"
    )


class Gain(Checked):
    """Terms of the small-gain condition, of one surface; its condition is not a proof (see the gain margin)."""

    gamma_error: Number | None = Field(
        default=None, description="Lipschitz constant of what the law leaves of the set-points [rad per standard deviation of the features]"
    )
    plant_gain: Number | None = Field(
        default=None, description="largest change of the standardised features per deflection, measured in closed loop [1/rad]"
    )


class ControllerFit(Metrics):
    """metrics.json of fit-controller."""

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
