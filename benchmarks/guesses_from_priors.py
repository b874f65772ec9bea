"""Guesses that are off as their priors say: what an interval is worth where a flight says little is a matter of the guesses."""

from dataclasses import replace

import numpy as np

from awescli.notation.parameters import ParameterTable
from awescli.physics.declaration import KiteDeclaration


def guessed(declared: KiteDeclaration, true: ParameterTable, seed: int) -> KiteDeclaration:
    """The declaration with guesses drawn from its priors about the truth, so that bounds still hold that."""
    random, rows = np.random.default_rng([seed, 9]), []
    for p in declared.table().rows:
        truth, offset, found = true[p.name].value, p.lower < 0 < p.upper, not p.free
        while not found:
            away = random.standard_normal()
            value = truth + p.prior_std * away if offset else truth * np.exp(np.log(p.upper / p.lower) / 4 * away)
            lower, upper = (p.lower, p.upper) if offset else (end * value / p.value for end in (p.lower, p.upper))
            if found := min(truth, value) >= lower and max(truth, value) <= upper:
                p = replace(p, value=value, lower=lower, upper=upper)
        rows.append(p)
    return declared.with_parameters(ParameterTable(rows))
