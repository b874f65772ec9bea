"""awes: close the loop between an airborne wind energy model and its measured flights."""

__version__ = "0.1.0"
