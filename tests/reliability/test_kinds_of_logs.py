"""Plausible but wrong logs are noticed and named: the campaign benchmarks/kinds_logs.py on the bundled flight."""

import numpy as np
import pytest
from kinds_logs import DEMO, KINDS_OF, REPAIRED, Judge, kite_of


@pytest.mark.parametrize("every", [4, pytest.param(1, marks=pytest.mark.campaign)])
def test_wrong_logs_are_noticed_and_named(tmp_path, every):
    """Guards the shares that issue 19 asks for, of every fourth kind or of all; none may be an error that awes did not mean (it would end
    this test)."""
    judge = Judge(DEMO, kite_of(DEMO, tmp_path, None), tmp_path)
    told = {kind: judge(kind, np.random.default_rng(i)) for i, kind in enumerate(KINDS_OF) if i % every == 0}
    wrong = [kind for kind in told if kind not in REPAIRED]
    assert len(wrong) >= 40 / every
    # kgf and daN differ by 2 %, which is less than what load cells and lift are known to
    assert {kind for kind in wrong if not told[kind].noticed} <= {"load in daN"}
    assert sum(told[kind].named for kind in wrong) >= 0.9 * len(wrong), [k for k in wrong if not told[k].named]
    assert all(told[kind].how in ("silent", "noted") for kind in REPAIRED if kind in told)
