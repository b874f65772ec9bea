"""What integrating nuisances out adds to the cost where the model is not linear in them: its gradient (Laplace's approximation).

Nuisances that are many and known badly, as gusts are, pull the globals towards values under which they would matter more: a fit then
explains noise by them. What corrects that is the log determinant of their normal matrix M = C C'. With d = PROBE C^-T z and random z of
unit variance, the second difference of the gradient J'r along d is on average, by Fisher's identity, -1/2 the gradient of the log
determinant, to second order in d (Hutchinson's estimator); a change of the nuisances' own gradient is answered by the nuisances.
"""

import numpy as np

from awescli.estimation.links import Gram, Links
from awescli.estimation.misfit import Misfit, Own

PROBE = 0.5
"""Size of the probes, in standard deviations: small enough not to lose a segment."""


def tilt(misfit: Misfit, x: np.ndarray, own: Own, links: Links, gram: Gram, which: np.ndarray) -> np.ndarray | None:
    """(n,) -1/2 of the gradient of the log determinant with respect to the globals, at parameter values x and nuisances at their best:
    what is to be added to J'r. None where a probe loses a segment. links, gram: of `misfit` there."""
    info = misfit.eliminated(gram, own, which)
    draw, mask = info.samples(1, seed=0), np.isin(np.arange(len(links)), which)
    bent_x, bent = (-2.0 * g for g in links.gradients())
    for side in (1.0, -1.0):
        probed, trajectories = misfit.links(x, own.moved(draw, side * PROBE, mask))
        if not (trajectories.alive[which] > misfit.observed.segments.steps).all():
            return None
        of_x, of_globals = probed.gradients()
        bent_x, bent = bent_x + of_x, bent + of_globals
    # the prior's pull is linear, and gone from second differences: processes at rest
    asked = gram.asked(bent_x / (2 * PROBE**2), bent / (2 * PROBE**2))
    return misfit.eliminated(asked, Own(own.starts, 0.0 * own.path), which).b
