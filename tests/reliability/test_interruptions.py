"""The campaign of random kills (benchmarks/interruptions.py), small; and that its judge would see damage."""

import pytest
from interruptions import NAMES, artifacts, campaign, full_disk, read_only, two_at_once, undisturbed, wrong_with
from small_run import make_small_run

from awescli.artifacts import artifact_hashes, write_json


def test_the_judge_sees_what_is_neither_old_nor_new(tmp_path):
    """A stage's folder with a file of the one plan and a file of the other, or one that its provenance does not know."""
    references = {}
    for plan in ("first", "second"):
        for name in NAMES:
            folder = tmp_path / "out" / name
            for file in ("a.json", "b.json"):
                write_json(folder / file, {"plan": plan, "file": file})
            write_json(folder / "provenance.json", {"artifacts": artifact_hashes(folder)})
        references[plan] = artifacts(tmp_path / "out")
    assert wrong_with(tmp_path / "out", references) == []
    write_json(tmp_path / "out" / NAMES[0] / "a.json", {"plan": "first", "file": "a.json"})
    assert wrong_with(tmp_path / "out", references) == [f"{NAMES[0]} is neither plan's", f"{NAMES[0]} is not what its provenance says"]
    (tmp_path / "out" / NAMES[1]).rename(tmp_path / "elsewhere")
    assert f"{NAMES[1]} is gone" in wrong_with(tmp_path / "out", references)


@pytest.mark.campaign
def test_a_few_kills_a_full_disk_a_folder_that_is_not_ours_and_two_at_once(tmp_path):
    make_small_run(tmp_path)
    references = undisturbed(tmp_path)
    tally = campaign(tmp_path, references, kills=4, seed=1)
    assert tally.killed == 4 and tally.wrong == []
    for test in (full_disk, read_only, two_at_once):
        assert test(tmp_path, references) == []
