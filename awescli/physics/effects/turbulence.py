"""Turbulence: gusts that no parameter explains. Simulated, reported, never traced as a deterministic effect."""

from types import SimpleNamespace

from awescli.notation.parameters import Parameter
from awescli.physics.effects.base import Effect
from awescli.physics.instant import Instant, Wind


class Turbulence(Effect):
    """Adds sigma times the turbulence inputs (Dryden series of unit variance made by `simulation.gusts`) to the wind, and roll times
    another one to its roll gust."""

    name = "turbulence"
    doc = "stochastic gusts (Dryden)"
    parameters = (
        Parameter("sigma", 0.0, "m/s", 0.0, 3.0, source="turbulence intensity 10 %"),
        Parameter("L", 150.0, "m", 10.0, 1000.0, source="MIL-F-8785C, low altitude"),
        Parameter("roll", 0.0, "rad/s", 0.0, 1.0, source="MIL-F-8785C: see simulation/gusts.py; 0.08 for 1 m/s and 5.5 m of span"),
    )
    shapes = ("L", "roll")
    traceable = False

    def airflow(self, wind: Wind, at: Instant, own: SimpleNamespace) -> Wind:
        i = at.inputs
        return wind._replace(
            n=wind.n + own.sigma * i["turbulence_n"],
            e=wind.e + own.sigma * i["turbulence_e"],
            d=wind.d + own.sigma * i["turbulence_d"],
            roll=wind.roll + own.roll * i["turbulence_p"],
        )
