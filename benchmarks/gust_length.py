"""How long the gusts of a campaign's flight are: nobody knows it of a wind beforehand."""

import numpy as np

LENGTHS = (40.0, 500.0)
"""[m] between which it is drawn, evenly in the logarithm."""


def drawn(*seed: int) -> float:
    """[m] The length of a seed's gusts."""
    return float(np.exp(np.random.default_rng(seed).uniform(*np.log(LENGTHS))))
