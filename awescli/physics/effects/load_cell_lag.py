"""A load cell behind a filter."""

from types import SimpleNamespace

from awescli.notation.parameters import Parameter
from awescli.physics.effects.base import Effect
from awescli.physics.effects.lag import lag_rate, lag_time, lagged
from awescli.physics.instant import Instant


class LoadCellLag(Effect):
    """tau dy/dt = T - y: first-order filter on the reported load."""

    name = "load_cell_lag"
    doc = "filtered load cell"
    instrument = "load cell"
    of_line = True
    parameters = (Parameter("tau", 0.0, "s", 0.0, 1.5, source="0.1-0.5 s"),)
    states = ("load",)
    start_spread = (30.0,)
    units = ("N",)
    probes = {"tau": (0.06, 0.15, 0.4)}

    def report(self, reported: dict, at: Instant, own: SimpleNamespace) -> dict:
        (state,) = self.own_states(at)
        return {**reported, "tension": lagged(state, reported["tension"], own.tau)}

    def rates(self, at: Instant, own: SimpleNamespace) -> tuple:
        (state,) = self.own_states(at)
        return (lag_rate(state, at.tension, own.tau),)

    def initial(self, at: Instant, own: SimpleNamespace) -> tuple:
        # the measured rate of the load stands for the true one: both are slow against the filter
        return (at.tension - lag_time(own.tau) * at.inputs["tension_rate"],)
