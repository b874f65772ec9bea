"""Leave an effect out of a model and let the flight tell which one it was: python examples/find_a_left_out_effect.py

A development kite is flown with an airspeed sensor that reads 6 % low. Its user declares guesses that are 5-30 % off and knows nothing of
the sensor. The tracer gets the log and the declaration.
"""

import awescli  # noqa: F401, I001  (before numpy: one BLAS thread)
from pathlib import Path

from awescli.estimation.prediction import predict
from awescli.flightlog.loops import find_loops
from awescli.flightlog.split import split
from awescli.physics.declaration import read_kite
from awescli.simulation.campaign_flights import dev_like
from awescli.tracing.account import account
from awescli.tracing.flight import trace_flight

LEFT_OUT = {"airspeed_scale": {"s": 0.94}}


def main() -> dict:
    truth = read_kite(Path(__file__).parent.parent / "data" / "kites" / "development.yaml")
    flight = dev_like(truth, seed=11, effects=LEFT_OUT)
    parts = split(find_loops(flight.log), log=flight.log)
    finding = trace_flight(flight.declared, flight.log, parts)
    before, after = (predict(model, flight.log, parts.test, 5.0) for model in (finding.before(), finding.after()))
    answer = account(finding, flight.log, 5.0, before, after)
    print(f"verdict: {answer['verdict']}")
    for effect in answer["effects"]:
        sizes = ", ".join(f"{n} = {p['value']:.4g} +- {2 * p['std']:.2g} {p['unit']}" for n, p in effect["parameters"].items())
        print(f"  {effect['name']}: {sizes}")
    error = answer["error"]
    print(f"error 5 s ahead on unseen loops: {error['before']['mean']:.4f} before, {error['after']['mean']:.4f} after, "
          f"{error['noise_floor']['mean']:.4f} is noise")  # fmt: skip
    return answer


if __name__ == "__main__":
    main()
