"""Folders of results: what awes did not make is neither removed nor renamed, and nothing is written through a link."""

import os
import subprocess
import sys

import pytest

from awescli.artifacts import folders, foreign_files, locked, refuse_foreign, staged_folder, write_json
from awescli.notation.errors import BadInput


def make(folder, **files):
    """A stage's folder as awes leaves it."""
    with staged_folder(folder) as staged:
        for name, content in files.items():
            write_json(staged / f"{name}.json", content)


def tree(folder):
    """Everything in a folder but awes' own: name -> content (a link's target)."""
    found = {}
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        if not name.startswith(".awes") and ".made-by-awes" not in name:
            found[name] = os.readlink(path) if path.is_symlink() else path.read_text() if path.is_file() else None
    return found


USERS = {
    ".notes.tmp-1": "a", ".data.partial-week1/x": "b", ".thesis.old-2024/chapter.tex": "c", ".archive.old-2019/photo": "d",
    ".identify.partial-1/x": "e", ".simulate.old-7/x": "f", ".lock": "g", "identify.txt": "h",
}  # fmt: skip


def test_names_that_look_like_those_of_awes_are_safe(tmp_path):
    """A folder of results may be the user's own folder: its temporary-looking files used to be deleted, `.archive.old-2019` renamed."""
    for name, text in USERS.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    before = tree(tmp_path)
    for _ in range(2):
        with locked(tmp_path):
            make(tmp_path / "identify", params=1)
    after = tree(tmp_path)
    assert after.pop("identify") is None and after.pop("identify/params.json") == "1\n" and after == before


def test_a_folder_of_the_user_with_a_stages_name_is_not_replaced(tmp_path):
    (tmp_path / "simulate").mkdir()
    (tmp_path / "simulate" / "mydata.txt").write_text("years of work")
    with pytest.raises(BadInput, match="no mark of awes"):
        make(tmp_path / "simulate", metrics=1)
    assert tree(tmp_path) == {"simulate": None, "simulate/mydata.txt": "years of work"}


@pytest.mark.parametrize("kind", ["link to a folder", "file"])
def test_a_link_or_file_with_a_stages_name_is_not_replaced(tmp_path, kind):
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "x").write_text("x")
    folder = tmp_path / "identify"
    folder.symlink_to(tmp_path / "elsewhere") if kind != "file" else folder.write_text("x")
    before = tree(tmp_path)
    with pytest.raises(BadInput, match="awes makes a folder here"):
        make(folder, params=1)
    assert tree(tmp_path) == before


@pytest.mark.parametrize("exchange", [True, False])
def test_what_the_user_puts_into_a_stages_folder_stays_there(tmp_path, monkeypatch, exchange):
    """Notes, an editor's backup, a plot, an empty folder, a link: in place after every further run, whatever the stage now makes."""
    if not exchange:
        monkeypatch.setattr(folders, "_exchange", lambda a, b: False)
    folder = tmp_path / "identify"
    make(folder, params=1, gone=1)
    (folder / "plots" / "raw").mkdir(parents=True)
    (folder / "plots" / "one.png").write_text("pixels")
    (folder / ".notes").write_text("hidden")
    (folder / "link").symlink_to("/nowhere")
    (folder / "report.html").write_text("the user's own")
    with locked(tmp_path):
        make(folder, params=2, extra=3)
    found = tree(folder)
    assert found == {
        "params.json": "2\n", "extra.json": "3\n", ".notes": "hidden", "link": "/nowhere", "plots": None, "plots/one.png": "pixels",
        "plots/raw": None, "report.html": "the user's own",
    }  # fmt: skip
    assert foreign_files(folder) == [".notes", "link", "plots/one.png", "plots/raw/", "report.html"]
    with staged_folder(folder) as staged:  # now the stage makes a file that the user has there
        (staged / "report.html").write_text("the stage's")
    assert tree(folder)["report.html"] == "the stage's" and tree(folder)["report.html.yours"] == "the user's own"
    assert sorted(os.listdir(tmp_path / ".awes" / "partial")) == []


def test_a_file_that_the_stage_always_writes_is_refused_before_it_runs(tmp_path):
    make(tmp_path / "identify", other=1)
    (tmp_path / "identify" / "params.json").write_text("mine")
    with pytest.raises(BadInput, match="params.json: awes did not make this file"):
        refuse_foreign(tmp_path / "identify", ("params.json",))


def test_folders_of_the_first_version_are_known_by_their_provenance(tmp_path):
    folder = tmp_path / "identify"
    write_json(folder / "params.json", {"a": 1})
    write_json(folder / "provenance.json", {"stamp": {}, "artifacts": {"params.json": "0" * 64}})
    (folder / "notes").write_text("mine")
    make(folder, fresh=1)
    assert sorted(tree(folder)) == ["fresh.json", "notes"]


def test_a_mark_cannot_name_files_elsewhere(tmp_path):
    """The names in a mark are compared with what lies there, never used as paths."""
    (tmp_path / "victim").write_text("mine")
    make(tmp_path / "identify", params=1)
    (tmp_path / "identify" / ".made-by-awes").write_text('{"files": ["../victim", "/etc/hostname", "params.json"]}')
    make(tmp_path / "identify", params=2)
    assert (tmp_path / "victim").read_text() == "mine"


LOCK = "from pathlib import Path; from awescli.artifacts import locked\nwith locked(Path({!r})): pass"


def lock(folder):
    return subprocess.run([sys.executable, "-c", LOCK.format(str(folder))], capture_output=True, text=True).stderr


def test_the_lock_follows_no_links(tmp_path):
    """A link `.lock` used to have its target wiped and a process number written into it."""
    victim, out = tmp_path / "victim", tmp_path / "out"
    victim.write_text("mine")
    out.mkdir()
    (out / ".lock").symlink_to(victim)
    assert lock(out) == ""
    (out / ".awes" / "lock").unlink()
    (out / ".awes" / "lock").symlink_to(victim)
    assert "this is a link, and awes writes through no links" in lock(out)
    (out / ".awes" / "lock").unlink()
    os.link(victim, out / ".awes" / "lock")
    assert "no lock that awes made" in lock(out)
    (out / ".awes" / "lock").unlink()
    os.mkfifo(out / ".awes" / "lock")
    assert "no lock that awes made" in lock(out) and victim.read_text() == "mine"


def test_a_folder_of_the_user_called_as_ours_is_left_alone(tmp_path):
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / ".awes").symlink_to(tmp_path / "elsewhere")
    (tmp_path / "b" / ".awes").mkdir(parents=True)
    (tmp_path / "b" / ".awes" / "x").write_text("mine")
    for name in "ab":
        with pytest.raises(BadInput, match="this one is not its own"), locked(tmp_path / name):
            pass
    assert os.listdir(tmp_path / "elsewhere") == [] and os.listdir(tmp_path / "b" / ".awes") == ["x"]


def test_a_folder_of_ours_that_was_half_made_is_taken(tmp_path):
    """Killed between making the folder and marking it."""
    (tmp_path / ".awes").mkdir()
    (tmp_path / ".awes" / "..made-by-awes.123-0.tmp").write_text("")
    with locked(tmp_path):
        make(tmp_path / "identify", params=1)


def test_a_kill_between_exchange_and_removal_loses_nothing(tmp_path):
    """The old folder then lies among the half-written ones: what awes did not make in it is in the new one, or comes back."""
    make(tmp_path / "identify", params=1)
    with locked(tmp_path):
        pass
    old = tmp_path / ".awes" / "partial" / "identify-99"
    make(old.with_name("x"), params=0)
    old.with_name("x").rename(old)
    (old / "notes").write_text("mine")
    with locked(tmp_path):
        pass
    assert tree(tmp_path / "identify") == {"params.json": "1\n", "notes": "mine"} and not old.exists()
