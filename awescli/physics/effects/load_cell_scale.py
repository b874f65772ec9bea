"""A load cell that reads wrong."""

from types import SimpleNamespace

from awescli.notation.parameters import Parameter
from awescli.physics.effects.base import Effect
from awescli.physics.instant import Instant


class LoadCellScale(Effect):
    """reported load = s T + b."""

    name = "load_cell_scale"
    doc = "scale and offset of the load cell"
    instrument = "load cell"
    of_line = True
    parameters = (
        Parameter("s", 1.0, "-", 0.5, 1.5, source="5-10 %"),
        Parameter("b", 0.0, "N", -500.0, 500.0, source="zero drift"),
    )

    slips = {
        "s": {
            2.2046: "is the load in lbf, and read as kgf?",
            0.45359: "is the load in kgf, and read as lbf?",
            9.80665: "is the load in N, and read as kgf?",
            0.10197: "is the load in kgf, and read as N?",
            4.44822: "is the load in N, and read as lbf?",
            0.22481: "is the load in lbf, and read as N?",
            10.0: "is the load in daN, and read as N, or the other way round?",
            0.1: "is the load in daN, and read as N?",
        }
    }

    def report(self, reported: dict, at: Instant, own: SimpleNamespace) -> dict:
        return {**reported, "tension": own.s * reported["tension"] + own.b}
