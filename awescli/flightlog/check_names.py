"""The names of all data checks: a plan may `ignore` them. Here, in a file that imports nothing, because every command reads plans."""

OF_LOG = (
    "invalid samples", "sensor faults", "missing rows", "repeated blocks", "usable loops", "moving surfaces", "physical ranges",
    "air density", "wind speed", "wind heights", "weather coverage", "line that pushes", "load against airspeed",
    "position against velocity", "position lag", "attitude against rates", "acceleration against velocity", "airspeed bias",
    "airspeed scatter", "tether length bias", "tether length scatter", "reel-out speed against length", "winch clock",
    "axes of the rates", "nose against airflow", "clock rate", "airspeed scale", "wind against airspeed", "downwind", "ranges",
)  # fmt: skip
"""Checks of a log by itself (`quality.data_quality`)."""

OF_KITE = ("surface travel", "aileron response", "elevator response", "rudder response", "flaps response", "load as declared")
"""Checks of a log against the declared kite (`estimation/as_declared.py`)."""

NAMES = (*OF_LOG, *OF_KITE)
