"""What would tell apart effects that one flight cannot: the experiment that a flight-test engineer would fly next."""

from collections.abc import Mapping, Sequence

from awescli.notation.quantities import SURFACES

EXPERIMENTS = {
    "parameter": "move the surface whose derivative this is",
    "airflow": "other heights and directions of flight, or a wind profile measured at height",
    "coefficients": "other airspeeds and angles of attack or sideslip at the same tension",
    "line": "another tether length and low tension",
    "load": "another tether length",
    "body": "another loading of the kite",
    "report": "a second sensor of the same quantity",
    **dict.fromkeys(SURFACES, "steps of that surface, sharp enough to see phase and amplitude"),
    "winch": "steps of the reel-out speed, which the tension answers at once",
    "roll": "steps of the aileron, at two airspeeds",
    "pitch": "steps of the elevator, at two airspeeds",
    "yaw": "steps of the rudder, at two airspeeds",
    "alpha": "steady flight at several airspeeds, where attitude, path and wind say the angle of attack",
    "beta": "steady flight without sideslip, in both directions of turn",
    **dict.fromkeys(("phi", "theta"), "half a minute at rest before the flight, levelled, which shows what the attitude reports of that"),
    "rates": "half a minute at rest before the flight, which shows what the gyros report of nothing",
    "accelerations": "half a minute at rest before the flight, level, which shows what the accelerometers report of gravity alone",
}
"""What an effect acts on (`Effect.acts_on`, or "parameter") -> what to fly."""


def separate(effects: Sequence[Mapping]) -> list[str]:
    """For every pair of rivals among the entries of effects.json: what would tell them apart."""
    return [f"{e['name']} and {r['name']}: fly so that what they act on differs: {_words(e, r)}." for e in effects for r in e["rivals"]]


def _words(effect: Mapping, rival: Mapping) -> str:
    mine, other = (EXPERIMENTS[entry["acts_on"]] for entry in (effect, rival))
    return mine if mine == other else f"{mine} against {other}"
