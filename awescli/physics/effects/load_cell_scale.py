"""A load cell that reads wrong."""

from awescli.notation.parameters import Parameter
from awescli.physics.effects.base import Effect


class LoadCellScale(Effect):
    """reported load = s T + b."""

    name = "load_cell_scale"
    doc = "scale and offset of the load cell"
    of_line = True
    parameters = (
        Parameter("s", 1.0, "-", 0.5, 1.5, source="5-10 %"),
        Parameter("b", 0.0, "N", -500.0, 500.0, source="zero drift"),
    )

    def report(self, reported, at, own):
        return {**reported, "tension": own.s * reported["tension"] + own.b}
