"""awes: close the loop between an airborne wind energy model and its measured flights."""

import os

# Segments run in parallel here, and the matrices of one segment are small: a second pool of BLAS threads only makes both pools
# wait for each other, several times over on busy cores. Set before numpy is first imported; a user's own choice stands, but not while a
# stage runs (stages/blas.py): its numbers would depend on it.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_WAIT_POLICY", "passive")

__version__ = "0.1.0"
