"""Artifacts: whole or not at all, strict, byte-identical, and readable again."""

import math
import os
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from awescli import artifacts
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

    assert json.loads(artifacts._render(artifacts._plain(obj, "f"), 0)) == obj


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
            artifacts.write_json(staged / "params.json", value)
    with pytest.raises(KeyboardInterrupt), artifacts.staged_folder(folder) as staged:
        artifacts.write_json(staged / "params.json", 3)
        raise KeyboardInterrupt
    assert artifacts.read_json(folder / "params.json") == 2
    assert os.listdir(tmp_path) == ["identify"]


def test_without_an_exchanging_rename(tmp_path, monkeypatch):
    monkeypatch.setattr(artifacts, "_exchange", lambda a, b: False)
    test_a_staged_folder_takes_the_old_ones_place_as_a_whole(tmp_path)


def test_the_lock_keeps_a_second_run_out_and_cleans_up(tmp_path):
    (tmp_path / ".identify.partial-1").mkdir()
    (tmp_path / ".simulate.old-1").mkdir()  # killed between two renames
    (tmp_path / ".x.json.tmp-1").write_text("half")
    with artifacts.locked(tmp_path):
        assert sorted(os.listdir(tmp_path)) == [".lock", "simulate"]
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


def test_content_hash_is_of_contents(tmp_path):
    a, b = tmp_path / "a", tmp_path / "b"
    for folder in (a, b):
        (folder / "sub").mkdir(parents=True)
        (folder / "sub" / "x.csv").write_text("1")
    assert artifacts.content_hash(a) == artifacts.content_hash(b)
    (b / "out").mkdir()
    (b / "out" / "y").write_text("2")
    assert artifacts.content_hash(a) == artifacts.content_hash(b, exclude=[b / "out"]) != artifacts.content_hash(b)
    (b / "sub" / "x.csv").rename(b / "sub" / "z.csv")
    assert artifacts.content_hash(a) != artifacts.content_hash(b, exclude=[b / "out"])
    with pytest.raises(BadInput, match="none"):
        artifacts.content_hash(tmp_path / "none")


def test_scratch_comes_back_only_for_the_same_key(tmp_path):
    folder = artifacts.scratch_folder(tmp_path / ".s", "key 1")
    (folder / "checkpoint").write_text("x")
    assert (artifacts.scratch_folder(tmp_path / ".s", "key 1") / "checkpoint").is_file()
    assert not (artifacts.scratch_folder(tmp_path / ".s", "key 2") / "checkpoint").exists()
