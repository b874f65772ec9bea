"""Artifacts: whole or not at all, strict, byte-identical, and readable again."""

import math
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from awescli import artifacts
from awescli.artifacts import files, folders
from awescli.notation.errors import BadInput, NumericalFailure


def test_json_is_strict_and_knows_numpy(tmp_path):
    obj = {"b": np.float64(0.1), "a": np.arange(3), "c": (np.int32(1), True, None, "ü"), "nested": {"x": [[1.5, 2.0], [3.0, 4.0]]}}
    artifacts.write_json(tmp_path / "x.json", obj)
    expected = {"b": 0.1, "a": [0, 1, 2], "c": [1, True, None, "ü"], "nested": {"x": [[1.5, 2.0], [3.0, 4.0]]}}
    assert artifacts.read_json(tmp_path / "x.json") == expected
    assert list(artifacts.read_json(tmp_path / "x.json")) == list(obj)
    for bad in (math.nan, math.inf, np.float32("nan"), np.array([1, np.nan])):
        with pytest.raises(NumericalFailure, match="x.json: nrmse: u"):
            artifacts.write_json(tmp_path / "x.json", {"nrmse": {"u": bad}})
    assert artifacts.read_json(tmp_path / "x.json")["b"] == 0.1  # the old file stands
    assert os.listdir(tmp_path) == ["x.json"]


json_like = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(st.characters(codec="utf-8")),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(st.characters(codec="utf-8")), inner, max_size=4),
)


@given(json_like)
def test_json_there_and_back(obj):
    import json

    assert json.loads(files._render(files._plain(obj, "f"), 0)) == obj


def test_arrays_there_and_back_and_byte_identical(tmp_path):
    arrays = {"a": np.random.default_rng(0).normal(size=(3, 4)).T, "n": np.array(3), "s": np.array(["ab", "c"]), "e": np.zeros((0, 2))}
    artifacts.write_arrays(tmp_path / "1.npz", arrays)
    artifacts.write_arrays(tmp_path / "2.npz", arrays)
    back = artifacts.read_arrays(tmp_path / "1.npz")
    assert back.keys() == arrays.keys() and all(np.array_equal(back[k], arrays[k]) for k in arrays)
    assert (tmp_path / "1.npz").read_bytes() == (tmp_path / "2.npz").read_bytes()
    assert all(np.array_equal(np.load(tmp_path / "1.npz")[k], arrays[k]) for k in arrays)
    with pytest.raises(ValueError):
        artifacts.write_arrays(tmp_path / "3.npz", {"o": np.array([{}], dtype=object)})


def test_tensors_there_and_back(tmp_path):
    weights = {"w": np.arange(6.0).reshape(2, 3).T, "b": np.float32([1, 2])}
    artifacts.write_tensors(tmp_path / "n.safetensors", weights)
    back = artifacts.read_tensors(tmp_path / "n.safetensors")
    assert all(np.array_equal(back[k], weights[k]) and back[k].dtype == weights[k].dtype for k in weights)


READERS = {"x.json": artifacts.read_json, "x.npz": artifacts.read_arrays, "x.safetensors": artifacts.read_tensors}


@pytest.mark.parametrize("name", READERS)
@given(damage=st.binary(max_size=40), keep=st.integers(0, 300), seed=st.integers(0, 999))
def test_a_corrupt_file_names_the_command_that_makes_it_again(name, damage, keep, seed, tmp_path_factory):
    folder = tmp_path_factory.getbasetemp() / "identify"
    folder.mkdir(exist_ok=True)
    good = folder / f"good-{name}"
    if not good.exists():
        content = {"a": np.arange(5.0), "b": np.ones((2, 2))}
        {"x.json": artifacts.write_json, "x.npz": artifacts.write_arrays, "x.safetensors": artifacts.write_tensors}[name](good, content)
    raw = good.read_bytes()
    at = seed % (len(raw) + 1)
    (folder / name).write_bytes((raw[:at] + damage + raw[at + len(damage) :])[: keep if seed % 2 else None])
    try:
        READERS[name](folder / name)
    except BadInput as e:
        assert "awes identify" in e.do


def test_a_missing_file_names_the_command(tmp_path):
    with pytest.raises(BadInput, match="awes train-hybrid"):
        artifacts.read_json(tmp_path / "train-hybrid" / "network.json")
    with pytest.raises(BadInput, match="awes make"):
        artifacts.read_arrays(tmp_path / "a.npz", made_by="awes make")


def test_an_npz_that_claims_more_than_it_holds(tmp_path):
    import io
    import zipfile

    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<f8", "fortran_order": False, "shape": (10**12,)})
    with zipfile.ZipFile(tmp_path / "bomb.npz", "w") as archive:
        archive.writestr("a.npy", header.getvalue())
    with pytest.raises(BadInput, match="disagree"):
        artifacts.read_arrays(tmp_path / "bomb.npz")


def test_a_staged_folder_takes_the_old_ones_place_as_a_whole(tmp_path):
    folder = tmp_path / "identify"
    for value in (1, 2):
        with artifacts.staged_folder(folder) as staged:
            artifacts.write_json(staged / "fitted.json", value)
    with pytest.raises(KeyboardInterrupt), artifacts.staged_folder(folder) as staged:
        artifacts.write_json(staged / "fitted.json", 3)
        raise KeyboardInterrupt
    assert artifacts.read_json(folder / "fitted.json") == 2
    assert sorted(os.listdir(tmp_path)) == [".awes", "identify"] and os.listdir(tmp_path / ".awes" / "partial") == []


def test_without_an_exchanging_rename(tmp_path, monkeypatch):
    monkeypatch.setattr(folders, "_exchange", lambda a, b: False)
    test_a_staged_folder_takes_the_old_ones_place_as_a_whole(tmp_path)


def test_the_lock_keeps_a_second_run_out_and_cleans_up(tmp_path):
    with artifacts.locked(tmp_path):
        pass
    partial = tmp_path / ".awes" / "partial"
    (partial / "identify-1").mkdir()
    (partial / "simulate.old").mkdir()  # killed between two renames
    (partial / "x.json").write_text("half")
    with artifacts.locked(tmp_path):
        assert sorted(os.listdir(tmp_path)) == [".awes", "simulate"] and os.listdir(partial) == []
        code = f"from pathlib import Path; from awescli.artifacts import locked\nwith locked(Path({str(tmp_path)!r})): pass"
        second = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
        assert f"another awes (process {os.getpid()}) is running in this folder" in second.stderr
    with artifacts.locked(tmp_path):
        pass


def test_errors_of_the_disk(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(BadInput, match="folder is needed"), artifacts.locked(tmp_path / "file"):
        pass
    with pytest.raises(BadInput, match="cannot be written"):
        artifacts.write_text(tmp_path / "file" / "x.txt", "x")
    with pytest.raises(BadInput, match="No space left"):
        artifacts.write_text(tmp_path / "full.txt", _pieces_until_the_disk_is_full())
    assert os.listdir(tmp_path) == ["file"]


def _pieces_until_the_disk_is_full():
    import errno

    yield "a"
    raise OSError(errno.ENOSPC, "No space left on device")


def test_scratch_comes_back_only_for_the_same_key(tmp_path):
    folder = artifacts.scratch_folder(tmp_path, "identify", "key 1")
    (folder / "checkpoint").write_text("x")
    assert (artifacts.scratch_folder(tmp_path, "identify", "key 1") / "checkpoint").is_file()
    assert not (artifacts.scratch_folder(tmp_path, "identify", "key 2") / "checkpoint").exists()


def test_versions_name_everything_that_numbers_come_from():
    """Guards a new dependency (daqp was forgotten once): only what draws on the terminal is no part of a result."""
    declared = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text())["project"]["dependencies"]
    needed = {re.split(r"[ =<>!~;\[]", d)[0].lower() for d in declared} - {"rich", "typer"}
    assert needed <= set(artifacts.versions()) and {"awes", "python"} <= set(artifacts.versions())


def test_a_file_is_written_through_no_link_and_over_no_file_of_somebody_else(tmp_path):
    """A planted link with the name of the temporary file used to have its target overwritten."""
    victim = tmp_path / "victim"
    victim.write_text("mine")
    for n in range(3):
        (tmp_path / f".x.txt.tmp-{os.getpid()}").unlink(missing_ok=True)
        (tmp_path / f".x.txt.tmp-{os.getpid()}").symlink_to(victim)
        (tmp_path / f".x.txt.{os.getpid()}-{n}.tmp").symlink_to(victim)
    (tmp_path / "x.txt").symlink_to(victim)
    artifacts.write_text(tmp_path / "x.txt", "new")
    assert victim.read_text() == "mine" and (tmp_path / "x.txt").read_text() == "new" and not (tmp_path / "x.txt").is_symlink()


def test_only_regular_files_are_read_and_hashed(tmp_path):
    """A named pipe used to be waited for, and /dev/zero to be read until the memory was full."""
    os.mkfifo(tmp_path / "x.json")
    for path in (tmp_path / "x.json", Path("/dev/zero"), tmp_path):
        for read in (artifacts.read_json, artifacts.read_arrays, artifacts.read_tensors, artifacts.file_hash):
            with pytest.raises(BadInput, match="this is (a named pipe|a device|a folder), a file is needed"):
                read(path)


def test_json_that_is_nested_without_end_is_refused(tmp_path):
    (tmp_path / "x.json").write_text("[" * 500 + "]" * 500)
    with pytest.raises(BadInput, match="nested deeper"):
        artifacts.read_json(tmp_path / "x.json")
