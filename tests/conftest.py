"""Fixtures of the physics tests: the development kite and a short noise-free flight of it."""

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
