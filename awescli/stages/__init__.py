"""Floor 7: STAGES, the table of all stages, in the order data flows through them."""

from awescli.stages.base import Stage
from awescli.stages.evaluate import Evaluate
from awescli.stages.fit_controller import FitController
from awescli.stages.identify import Identify
from awescli.stages.simulate import Simulate
from awescli.stages.trace_residual import TraceResidual
from awescli.stages.train_hybrid import TrainHybrid

STAGES: tuple[Stage, ...] = (FitController(), Identify(), TraceResidual(), TrainHybrid(), Simulate(), Evaluate())
"""fit-controller -> identify -> trace-residual -> train-hybrid -> simulate -> evaluate. The commands are made from this table."""
