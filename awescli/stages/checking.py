"""What the stages of a plan would refuse, before any of them runs: for `awes check`, and for the runner before every stage."""

from collections.abc import Mapping
from typing import Any

from awescli.notation.errors import BadInput, BadInputs
from awescli.stages.answers import ANSWER
from awescli.stages.base import Inputs, Stage
from awescli.stages.data_checks import stopped, warning
from awescli.stages.plan import Plan


def refused(stage: Stage, inputs: Inputs, plan: Plan) -> list[BadInput]:
    """Every mistake that a stage sees in its settings, the flight and the kite, with the place of the setting; data checks first."""
    errors = []
    try:
        errors += stopped(stage, inputs, plan)
        for key, error in stage.check(inputs, plan.settings[stage.name]):
            where = plan.where("stages", stage.name, *key.split(".")) if key else error.where
            errors.append(BadInput(error.what, where, error.do))
    except BadInput as e:  # the inputs themselves cannot be read
        errors += e.errors if isinstance(e, BadInputs) else [e]
    return errors


def raise_all(errors: list[BadInput]) -> None:
    """All errors, each once, as one."""
    once = list({str(e): e for e in errors}.values())
    if once:
        raise once[0] if len(once) == 1 else BadInputs(once)


def with_warning(summary: Mapping[str, Any], inputs: Inputs, plan: Plan) -> dict[str, Any]:
    """A stage's summary whose answer ends with the data checks that are not good, where some are not."""
    warned = warning(inputs, plan)
    return {**summary, ANSWER: [*summary[ANSWER], warned]} if warned and ANSWER in summary else dict(summary)
