"""Leave an effect out of a model and let the flight tell which one it was: python examples/find_a_left_out_effect.py

A kite is flown with an airspeed sensor that reads 6 % low. Its user declares other values of its parameters and knows nothing of the
sensor. The tracer gets the log and the declaration.
"""

from pathlib import Path

from awescli import Tracing, identify, read_flight, read_kite, simulate, trace

DATA = Path(__file__).parent.parent / "data"
LEFT_OUT = {"airspeed_scale": {"s": 0.94}}


def main() -> Tracing:
    truth, declared = (read_kite(DATA / "kites" / f"km1_{which}.yaml") for which in ("identified", "initial"))
    # wind and winch are those of the bundled flight; a built-in law steers
    day = read_flight(DATA / "km1_demo")
    flown = simulate(truth, day, surfaces="path_following", start=0.0, duration=140.0, effects=LEFT_OUT)
    print(flown.flown)
    identified = identify(flown.flown, declared)
    print(identified)
    traced = trace(identified)
    print(f"verdict: {traced.verdict}")
    for effect in traced.effects:
        sizes = ", ".join(f"{n} = {value:.4g} +- {2 * std:.2g} {unit}" for n, (value, std, unit) in effect.parameters.items())
        print(f"  {effect.name}: {sizes}")
    errors = traced.errors
    for channel, words in (("V_a", "airspeed"), ("mean", "mean of the states")):
        print(f"error {errors.horizon:g} s ahead on unseen loops, {words}: {errors.before[channel]:.4f} before, "
              f"{errors.after[channel]:.4f} after, {errors.noise[channel]:.4f} is noise")  # fmt: skip
    return traced


if __name__ == "__main__":
    main()
