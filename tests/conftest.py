"""Fixtures of the physics tests: the development kite and a short noise-free flight of it."""

# first, before anything imports numpy: it gives BLAS one thread, and fits are four times faster for it
import awescli  # noqa: F401, I001
import pytest
from kites import DEVELOPMENT, flight

from awescli.physics.kite import Kite


@pytest.fixture(scope="session")
def development():
    """The declaration of the development kite."""
    return DEVELOPMENT


@pytest.fixture(scope="session")
def calm():
    """40 s of loops without noise and without anything undeclared."""
    return flight()


@pytest.fixture(scope="session")
def kite(calm):
    """The development kite in the wind record of `calm`."""
    return Kite(DEVELOPMENT, calm.log.wind.height)
