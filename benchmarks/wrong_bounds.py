"""What a user declares whose bounds do not hold the truth."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from awescli.notation.parameters import ParameterTable
from awescli.physics.declaration import KiteDeclaration

GUESS, WIDTH = 1.5, (0.85, 1.3)
"""The guess over the truth, and the bounds over the guess: the nearer one lies 27 % beyond the truth."""


def with_wrong_bounds(declared: KiteDeclaration, truth: KiteDeclaration, names: Sequence[str], seed: int) -> KiteDeclaration:
    """The declaration with two of the parameters `names`, drawn from the seed, declared so that their bounds miss the truth's value."""
    chosen = set(np.random.default_rng([seed, 5]).choice(sorted(names), 2, replace=False).tolist())
    rows = []
    for row in declared.table().rows:
        if row.name in chosen:
            guess = GUESS * truth.parameters[row.name].value
            lower, upper = sorted(w * guess for w in WIDTH)
            row = replace(row, value=guess, lower=lower, upper=upper, std=None, source=f"guess beside the truth, seed {seed}")
        rows.append(row)
    return declared.with_parameters(ParameterTable(rows))
