"""The forms of what train-hybrid leaves."""

from pydantic import Field

from awescli.artifacts.forms.words import Before, Channels, Checked, Duration, Misfit, Number, Numbers, Parts, Predicted, Text


class History(Checked):
    """The course of the training, a row a round."""

    columns: list[Text] = Field(description="what the columns are: phase, round, horizon [s], costs, evaluations, seconds [s]")
    rows: list[list[Number | None]] = Field(
        description="one list a round [as `columns` says; costs in squared errors of the physics, 1: pure physics]"
    )


class Ensemble(Checked):
    """What several networks say."""

    spread: Numbers = Field(
        default={}, description="channel -> standard deviation of the members' predictions of the test loops [SI unit of the channel]"
    )


class Validated(Checked):
    """What validation says of the network, against pure physics."""

    prediction: dict[str, Number | None] = Field(
        default={},
        description="mean squared error of physics and of the hybrid, standard error of their difference, and the gain that is needed [-]; "
        "in units of what physics leaves",
    )
    chi2: dict[str, Misfit | None] = Field(
        default={}, description="the same four of chi-square with gusts and drift integrated out [-]; 1: noise"
    )


class Compared(Checked):
    """L-BFGS beside Adam alone, from the same start."""

    test: dict[str, Channels] = Field(default={}, description="optimiser -> channel -> NRMSE on test loops [-]")


class Training(Predicted):
    """metrics.json of train-hybrid."""

    horizon_s: Duration = Field(default=0.0, description="length of a prediction in `nrmse` [s]")
    nrmse: Parts | None = Field(default=None, description="errors of the model that is handed on")
    before: Before | None = Field(default=None, description="errors of physics alone")
    gate: bool = Field(default=True, description="whether the network is used only where validation proves it")
    proved: bool = Field(default=False, description="whether validation proves it")
    training: Number | None = Field(default=None, description="cost on train at the last horizon, over that of physics [-]")
    horizons: list[Number] = Field(default=[], description="lengths of the predictions that it was trained on, one after the other [s]")
    train_segments: int = Field(default=0, description="predictions that it was trained on")
    validation_segments: int = Field(default=0, description="predictions that it was chosen on")
    weights: int = Field(default=0, description="weights of the network")
    gradient_evaluations: Number = Field(default=0.0, description="gradients that training took, in passes over all train segments [-]")
    left_out_inputs: dict[str, Text] = Field(default={}, description="quantity that the network does not see -> why")
    parametric_share: Number | None = Field(
        default=None, description="share of the correction that changes of the free parameters could make as well [-]"
    )
    outside_box_validation: Number | None = Field(
        default=None, description="share of validation samples with an input outside its training range [-]"
    )
    history: History | None = Field(default=None, description="the course of the training")
    sentence: Text = Field(description="whether the network is used and why, in a sentence")
    comparison: Compared | None = Field(default=None, description="optimisers side by side, where the plan asks for it")
    validation: Validated | None = Field(default=None, description="what the decision stands on")
    ensemble: Ensemble | None = Field(default=None, description="of several members, where the plan asks for them")
    share_of_acceleration: dict[str, Number | None] | None = Field(
        default=None, description="corrected state -> root mean square of the correction over that of the corrected derivative [-]"
    )
    validation_rmse_ratio: dict[str, Number | None] | None = Field(
        default=None, description="channel -> error on validation over that of pure physics [-]"
    )
    distilled: list[Text] = Field(default=[], description="sparse formulas that say what the network learned")
    outside_box_test: Number | None = Field(
        default=None, description="share of the test loops on which the flight leaves what the network was trained on [-]"
    )


class Network(Checked):
    """network.json; the weights stand in network.safetensors."""

    outputs: list[Text] = Field(default=[], description="derivatives that the network adds to, in order")
    format: Text = Field(description="layout of the weights")
    inputs: list[Text] = Field(description="quantities that the network sees, in order")
    hidden: list[int] = Field(description="widths of the tanh layers")
    width: Number = Field(description="how far outside its training range the correction has fallen to 1/e [half ranges]")
    fingerprint: Text = Field(description="ties this file to its weights")
