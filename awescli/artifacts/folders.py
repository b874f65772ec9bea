"""Folders of results that appear whole, and lose nothing that awes did not make.

Whatever awes makes in a folder is marked: a stage's folder holds a file MARK that names what awes put there, and everything that comes and
goes (lock, half-written folders, checkpoints) lies in one folder OWN of the results, marked as well. Nothing outside the marks is removed
or renamed, and no link is followed where awes writes.
"""

import ctypes
import errno
import json
import os
import shutil
import stat
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

from awescli.artifacts.files import cannot_write, sync_folder, write_content, write_text
from awescli.artifacts.origins import PROVENANCE
from awescli.notation.errors import BadInput

OWN = ".awes"
"""Folder inside a folder of results: `lock`, `partial/` for what is being written, `scratch/` for checkpoints, `forced.json` while a run is
forced, `awes.log`."""
MARK = ".made-by-awes"
"""In a stage's folder: JSON, which files awes made. In OWN: a sentence."""
LONGEST_MARK = 1_000_000
"""Bytes: a mark of ours names some dozens of files."""


# --- what is ours ---------------------------------------------------------------------------------------------------------


def refuse_foreign(folder: Path, makes: tuple[str, ...] = ()) -> None:
    """Raise BadInput where a stage's result cannot take the place of `folder` without losing something that awes did not make.

    makes: names of files that the stage always writes. Other files that somebody put into a folder of ours are carried over instead.
    """
    if not os.path.lexists(folder):
        return
    do = "Move it elsewhere, or write to another folder: --set out=FOLDER."
    if folder.is_symlink() or not folder.is_dir():
        raise BadInput(f"this is {'a link' if folder.is_symlink() else 'a file'}; awes makes a folder here", str(folder), do)
    made = _made(folder)
    if made is None and any(folder.iterdir()):
        raise BadInput("this folder holds files and no mark of awes, which would replace it", str(folder), do)
    if clash := [name for name in foreign_files(folder) if name in makes]:
        raise BadInput("awes did not make this file and would replace it", str(folder / clash[0]), do)


def foreign_files(folder: Path) -> list[str]:
    """Names of what lies in a stage's folder and was not put there by awes; folders that hold nothing end in a slash."""
    made = _made(folder) or set()
    return [name for name in _all_in(folder) if name not in made]


def _made(folder: Path) -> set[str] | None:
    """Names of the files that awes put into a folder; None where no mark says so. awes 0.1 marked its folders by their provenance."""
    for file, key in ((folder / MARK, "files"), (folder / PROVENANCE, "artifacts")):
        try:
            if stat.S_ISREG(file.lstat().st_mode) and file.stat().st_size <= LONGEST_MARK:
                named = json.loads(file.read_bytes())[key]
                return {str(name) for name in named} | {MARK, PROVENANCE}
        except (OSError, ValueError, TypeError, KeyError, RecursionError):
            continue
    return None


def _all_in(folder: Path) -> list[str]:
    """Relative names of all that lies in a folder: files, links (not followed), and folders without content as `name/`."""
    found = []
    for at, folders, files in os.walk(folder):
        here = Path(at).relative_to(folder)
        links = [name for name in folders if (Path(at) / name).is_symlink()]
        found += [(here / name).as_posix() for name in (*files, *links)]
        if not folders and not files and at != str(folder):
            found.append(f"{here.as_posix()}/")
    return sorted(found)


def _own(out: Path, *inside: str) -> Path:
    """A folder in `out`/OWN, made if need be. Raises BadInput where OWN is somebody else's."""
    own = out / OWN
    with suppress(FileExistsError):
        own.mkdir(parents=True)
    if own.is_symlink() or not own.is_dir() or not _is_own(own):
        raise BadInput("awes keeps what it is writing in a folder of this name, and this one is not its own", str(own),
                       "Move it elsewhere, or write to another folder: --set out=FOLDER.")  # fmt: skip
    if not (own / MARK).exists():
        write_text(own / MARK, "awes keeps here what it is writing. While no awes runs, this folder may be deleted.\n")
    folder = own.joinpath(*inside)
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def _is_own(own: Path) -> bool:
    """Marked; or empty but for a half-written mark, as a killed awes leaves it."""
    mark = own / MARK
    if os.path.lexists(mark):
        return mark.is_file() and not mark.is_symlink()
    return all(p.name.startswith(f".{MARK}.") for p in own.iterdir())


# --- a stage's folder -----------------------------------------------------------------------------------------------------


@contextmanager
def staged_folder(folder: Path) -> Iterator[Path]:
    """An empty folder to write into, which takes the place of `folder` in one step when the block ends well.

    If the block raises, or the process is killed, `folder` stays as it was; what was half-written is removed here or by the
    next `locked` run. Files in `folder` that awes did not make are in the new one too. Raises BadInput as `refuse_foreign` does.
    """
    refuse_foreign(folder)
    try:
        partial = _own(folder.parent, "partial") / f"{folder.name}-{os.getpid()}"
        shutil.rmtree(partial, ignore_errors=True)
        partial.mkdir()
    except OSError as e:
        raise cannot_write(folder, e) from None
    try:
        yield partial
        refuse_foreign(folder)  # the block may have taken hours
        try:
            _mark(partial, _all_in(partial))
            _carry_over(folder, partial)
            sync_folder(partial)
            _put_in_place(partial, folder)
            sync_folder(folder.parent)
        except OSError as e:
            raise cannot_write(folder, e) from None
    finally:
        shutil.rmtree(partial, ignore_errors=True)


def copied_folder(source: Path, folder: Path) -> None:
    """A stage's folder, once more in other results: the files that awes made in `source`."""
    made = (_made(source) or set()) - {MARK}
    with staged_folder(folder) as staged:
        for name in sorted(made):
            if (source / name).is_file():
                write_content(staged / name, (source / name).read_bytes())


def _carry_over(old: Path, new: Path) -> None:
    """What awes did not make in the folder `old` is in `new` afterwards too (as the same files, where the disk can)."""
    for name in foreign_files(old) if old.is_dir() else ():
        source, target = old / name, new / name
        if name.endswith("/"):
            target.mkdir(parents=True, exist_ok=True)
        elif not (os.path.lexists(target) and os.path.samestat(source.lstat(), target.lstat())):
            target.parent.mkdir(parents=True, exist_ok=True)
            while os.path.lexists(target):  # the stage now makes a file of this name
                target = target.with_name(f"{target.name}.yours")
            try:
                os.link(source, target, follow_symlinks=False)
            except OSError:
                shutil.copy2(source, target, follow_symlinks=False)


def _put_in_place(partial: Path, folder: Path) -> None:
    """`folder` becomes `partial`; the old content is left under the partial's name, to be removed."""
    if not folder.exists():
        os.rename(partial, folder)
    elif _exchange(partial, folder):
        _carry_over(partial, folder)  # what came into the old folder between the two
    else:
        # without an exchanging rename there is an instant with no folder; a kill just then is mended by `_clean_up`
        old = partial.with_name(f"{folder.name}.old")
        os.rename(folder, old)
        os.rename(partial, folder)
        _carry_over(old, folder)
        shutil.rmtree(old, ignore_errors=True)


def _exchange(a: Path, b: Path) -> bool:
    """Swap two folders in one step, where the system can (Linux: renameat2 with RENAME_EXCHANGE = 2)."""
    at_cwd, exchange = -100, 2
    try:
        renameat2 = ctypes.CDLL(None).renameat2
    except (AttributeError, OSError, TypeError):
        return False
    return renameat2(at_cwd, os.fsencode(a), at_cwd, os.fsencode(b), exchange) == 0


def _clean_up(out: Path) -> None:
    """Remove what killed runs left half-written. Only called under the lock, when no run is alive, and only in our own folder."""
    for left in sorted(_own(out, "partial").iterdir()):
        if left.is_symlink() or not left.is_dir():
            left.unlink()
            continue
        name = left.name.removesuffix(".old") if left.name.endswith(".old") else left.name.rpartition("-")[0]
        folder = out / name
        if left.name.endswith(".old") and not os.path.lexists(folder):
            os.rename(left, folder)
            continue
        if (left / MARK).is_file() and folder.is_dir() and not folder.is_symlink():
            _carry_over(left, folder)  # it may be the old folder, which had just been exchanged
        shutil.rmtree(left, ignore_errors=True)


# --- one run at a time ----------------------------------------------------------------------------------------------------


@contextmanager
def locked(out: Path) -> Iterator[None]:
    """Hold the folder of results: a second awes that wants it stops with a clear error instead of mixing its files in."""
    try:
        lock = _own(out) / "lock"
        if lock.is_symlink():
            raise BadInput("this is a link, and awes writes through no links", str(lock), "Remove it.")
        # opening must not wipe the pid of the run that holds it
        descriptor = os.open(lock, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0), 0o666)
    except NotADirectoryError:
        raise BadInput("this is a file, a folder is needed for the results", str(out), "Choose another: --set out=FOLDER.") from None
    except OSError as e:
        raise cannot_write(out, e) from None
    found = os.fstat(descriptor)
    if not stat.S_ISREG(found.st_mode) or found.st_nlink != 1:  # a second name of somebody's file is not written to either
        os.close(descriptor)
        raise BadInput("this is no lock that awes made", str(lock), "Remove it.")
    with os.fdopen(descriptor, "r+") as file:
        if not os.access(out, os.W_OK | os.X_OK):  # known before hours are spent
            raise cannot_write(out, PermissionError(errno.EACCES, os.strerror(errno.EACCES)))
        if not _hold(descriptor):
            file.seek(0)
            raise BadInput(
                f"another awes (process {file.read(20).strip() or 'unknown'}) is running in this folder",
                str(out),
                "Wait for it, or write elsewhere: --set out=FOLDER.",
            )
        try:
            file.truncate(0)
            file.write(str(os.getpid()))
            file.flush()
            _clean_up(out)
        except OSError as e:
            raise cannot_write(out, e) from None
        yield


def _hold(descriptor: int) -> bool:
    """Lock an open file until it is closed; False where another process holds it."""
    try:
        import fcntl
    except ImportError:
        what = "awes holds its folder of results by a POSIX file lock, which this system does not have"
        raise BadInput(what, do="Run it on Linux or macOS; on Windows, in WSL.") from None
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


# --- notes, checkpoints, copies, folders of the user ---------------------------------------------------------------------


def own_path(out: Path, name: str) -> Path:
    """A file that awes keeps for itself among the results, in the folder that `locked` has made."""
    return out / OWN / name


def scratch_path(out: Path, stage: str) -> Path:
    """Where a stage keeps its checkpoints."""
    return out / OWN / "scratch" / stage


def scratch_folder(out: Path, stage: str, key: str) -> Path:
    """A folder for checkpoints that outlives an interruption, emptied when `key` (what they are checkpoints of) has changed."""
    folder = scratch_path(out, stage)
    try:
        _own(out, "scratch")
        stamp = folder / "key"
        if folder.is_symlink() or not stamp.is_file() or stamp.read_text(errors="replace") != key:
            remove(folder)
            folder.mkdir()
            write_text(stamp, key)
    except OSError as e:
        raise cannot_write(folder, e) from None
    return folder


def remove(path: Path) -> None:
    """A file or folder in OWN that is no longer needed."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


def has_checkpoints(out: Path, stage: str) -> bool:
    """Has a stage kept any?"""
    folder = scratch_path(out, stage)
    return folder.is_dir() and any(p.name != "key" for p in folder.iterdir())


def put_beside(folder: Path, files: Mapping[str, bytes]) -> None:
    """Write files (name -> content) into a folder of the user's, beside what may lie there.

    Raises BadInput where that would replace a file that awes neither put there earlier (these are marked) nor finds the same.
    """
    made = _made(folder) or set()
    others = [name for name, content in files.items() if name not in made and not _free(folder / name, content)]
    if others:
        what = f"awes did not make {', '.join(others[:5])}{', ...' if len(others) > 5 else ''}, and would replace {len(others)} files"
        raise BadInput(what, str(folder), "Move them away, or name another folder.")
    for name, content in files.items():
        write_content(folder / name, content)
    _mark(folder, sorted(made - {MARK, PROVENANCE} | set(files)))


def new_folder(folder: Path, files: Mapping[str, bytes]) -> None:
    """Write files (relative name -> content) into a folder of the user's that is new, or empty: all of them or none.

    Raises BadInput where something is there already. In an empty folder they appear in the order given, so that the last one is there only
    where all are.
    """
    if os.path.lexists(folder) and (folder.is_symlink() or not folder.is_dir()):
        raise BadInput("this is no folder", str(folder), "Name a new folder, or an empty one.")
    if folder.is_dir() and (there := sorted(p.name for p in folder.iterdir())):
        holds = f"{', '.join(there[:3])}{', ...' if len(there) > 3 else ''}"
        raise BadInput(f"this folder holds files ({holds})", str(folder), "Name a new folder, or an empty one.")
    written: list[Path] = []
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        if not folder.exists():
            partial = folder.with_name(f".{folder.name}.{os.getpid()}.tmp")
            written.append(partial)
            for name, content in files.items():
                write_content(partial / name, content)
            os.rename(partial, folder)
            sync_folder(folder.parent)
            return
        for name, content in files.items():
            written.append(folder / Path(name).parts[0])
            write_content(folder / name, content)
    except OSError as e:
        _remove_all(written)
        raise cannot_write(folder, e) from None
    except BaseException:
        _remove_all(written)
        raise


def _remove_all(paths: list[Path]) -> None:
    """What was begun and did not come to its end."""
    for path in paths:
        with suppress(OSError):
            remove(path)


def _free(path: Path, content: bytes) -> bool:
    """Whether nothing is lost where `content` is written to `path`."""
    if not os.path.lexists(path):
        return True
    return path.is_file() and not path.is_symlink() and path.read_bytes() == content


def _mark(folder: Path, names: list[str]) -> None:
    """Say in a folder which of its files awes made."""
    write_text(folder / MARK, json.dumps({"made_by": "awes", "files": names}, indent=1) + "\n")
