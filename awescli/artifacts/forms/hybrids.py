"""The forms of what train-hybrid leaves."""

from pydantic import Field

from awescli.artifacts.forms.words import Channels, Checked, Metrics, Number, Numbers, Text


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


class Compared(Checked):
    """L-BFGS beside Adam alone, from the same start."""

    test: dict[str, Channels] = Field(default={}, description="optimiser -> channel -> NRMSE on test loops [-]")


class Training(Metrics):
    """metrics.json of train-hybrid."""

    history: History | None = Field(default=None, description="the course of the training")
    sentence: Text = Field(default="", description="whether the network is used and why, in a sentence")
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

    format: Text = Field(description="layout of the weights")
    inputs: list[Text] = Field(description="quantities that the network sees, in order")
    hidden: list[int] = Field(description="widths of the tanh layers")
    width: Number = Field(description="how far outside its training range the correction has fallen to 1/e [half ranges]")
    fingerprint: Text = Field(description="ties this file to its weights")
