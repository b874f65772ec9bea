"""Floor 6: STAGES, the table of all stages, in the order data flows through them."""

from awescli.stages.base import Stage

STAGES: tuple[Stage, ...] = ()
"""fit-controller -> identify -> trace-residual -> train-hybrid -> simulate -> evaluate. The commands are made from this table."""
