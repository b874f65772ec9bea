"""What the words of the page mean, for whoever rests the pointer on one, or taps it: terms of statistics, and the channels."""

from awescli.notation.quantities import IN_WORDS, UNITS
from awescli.reporting.words import CHANNELS, unit_of

TERMS = {
    "NRMSE": "root mean square error over the measured range, of whole predictions",
    "RMSE": "root mean square error, in the channel's unit",
    "R²": "share of the measured variance that the model explains: 1 is all, below 0 is worse than the mean",
    "Theil U": "RMSE over the sum of the root mean squares of measured and simulated: 0 is perfect, 1 is useless",
    "χ²": "chi-square per degree of freedom: mean square of the residuals over their noise; 1 is noise alone",
    "deviance": "minus two log likelihoods, all that is not known integrated out; a lead of 10 is a likelihood ratio of 150",
    "score": "fall of χ² that re-fitting with the candidate promises, to first order",
    "p value": "probability that chance alone gives a score as large",
    "plausible size": "whether the fitted size lies inside the range that the library gives for this effect",
    "probability": "of each cause, prior odds even, evidence tempered; they add up to 1",
    "noise alone": "what sensor noise alone leaves of a perfect model's prediction",
    "rivals": "effects that do as well in its place on this flight",
    "prior ± 2 std": "what the kite file believes of the parameter before the flight",
    "value ± 2 std": "fitted value with its 95 % interval",
    "size ± 2 std": "fitted size with its 95 % interval",
    "shift [prior std]": "distance of the value from the declared one, in standard deviations of the prior",
    "threshold": "what the value is compared with",
    "χ² over noise": "mean square of what is left of the channel on validation loops, over the noise that was found; 1 is noise alone",
    "repeats before": "share of the residual's variance that repeats from loop to loop, under the declared model",
    "repeats after": "share of the residual's variance that repeats from loop to loop, with the effect",
    "test goes": "how far the test part goes, in times of what train flew; above 1 the model is tested outside what it was fitted to",
    "validation goes": "how far the validation part goes, in times of what train flew",
    "white noise (1 std)": "standard deviation of white noise, from differences of high order",
    "train": "loops that models are fitted to",
    "validation": "loops that choices are made on",
    "test": "loops that nothing was fitted to or chosen on",
}


def _of_channels() -> dict[str, str]:
    """Channel in words -> its symbol, what it is and which way it counts, and its unit."""
    return {CHANNELS[n]: f"{n}: {said} [{unit_of(UNITS[n])[0] or '-'}]" for n, said in IN_WORDS.items() if n in CHANNELS}


TIPS = {**TERMS, **_of_channels()}
"""Text on the page -> what it means."""
