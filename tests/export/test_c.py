"""The C file flies what the simulator flies."""

import shutil

import pytest
from export.flying import in_c, put
from export.models import CASES, compared, with_one
from kites import every_key

from awescli.export.c_code import c_files

pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc on this machine")


@pytest.mark.parametrize("case", CASES)
def test_c_flies_the_same_ten_seconds(case, tmp_path):
    flown = CASES[case]()
    files = c_files(flown.model)
    assert sum(map(len, files.values())) < 200_000
    assert compared(flown, in_c(put(tmp_path, files), flown.tables, flown.ride)) < 1e-9


@pytest.mark.parametrize("key", every_key())
def test_every_effect_flies_in_c(key, tmp_path):
    """A second with one effect at a plausible size."""
    flown = with_one(key)
    assert compared(flown, in_c(put(tmp_path, c_files(flown.model)), flown.tables, flown.ride)) < 1e-9
