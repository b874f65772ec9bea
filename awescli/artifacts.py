"""What a stage leaves behind: the only place of awes that writes files, and the readers of what it wrote.

Every file appears whole or not at all (temporary file in the same folder, fsync, rename), and so does every folder of a stage
(`staged_folder`). JSON is strict (no NaN) and byte-identical for equal content. Nothing is ever pickled.
"""

import ctypes
import fcntl
import hashlib
import json
import math
import os
import platform
import shutil
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from awescli import __version__
from awescli.notation.errors import BadInput, NumericalFailure

PROVENANCE = "provenance.json"
"""Beside the artifacts of every stage; holds times, so it takes no part in their hashes."""


# --- writing ------------------------------------------------------------------------------------------------------------


def write_json(path: Path, obj: Any) -> None:
    """Strict JSON, keys in the order given, floats by repr. numpy values and arrays, tuples, paths and pydantic models are
    accepted; a NaN or infinity raises NumericalFailure with its place in the file."""
    _write(path, [(_render(_plain(obj, path.name), 0) + "\n").encode()])


def write_text(path: Path, text: str | Iterable[str]) -> None:
    """UTF-8 text, whole or in pieces (a long CSV need not be in memory at once)."""
    _write(path, ([text] if isinstance(text, str) else text))


def write_content(path: Path, content: bytes) -> None:
    """A file of any kind: a picture."""
    _write(path, [content])


def write_arrays(path: Path, arrays: Mapping[str, Any]) -> None:
    """Named arrays as .npz. Not np.savez: that stamps the time of day into the file, so equal content would differ."""
    import io
    import zipfile

    import numpy as np

    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_STORED) as archive:
        for name, array in arrays.items():
            member = io.BytesIO()
            np.lib.format.write_array(member, np.asarray(array, order="C"), version=(1, 0), allow_pickle=False)
            archive.writestr(zipfile.ZipInfo(f"{name}.npy", date_time=(1980, 1, 1, 0, 0, 0)), member.getvalue())
    _write(path, [buffer.getvalue()])


def write_tensors(path: Path, tensors: Mapping[str, Any]) -> None:
    """Named arrays or torch tensors as .safetensors."""
    import numpy as np
    from safetensors.numpy import save

    # the numpy API writes the buffer as it lies, so a transposed view would come back scrambled
    plain = {k: np.asarray(t.detach().cpu().numpy() if hasattr(t, "detach") else t, order="C") for k, t in tensors.items()}
    _write(path, [save(plain)])


def _write(path: Path, pieces: Iterable[str | bytes]) -> None:
    """All pieces, atomically."""
    path = Path(path)
    temporary = path.with_name(f".{path.name}.tmp-{os.getpid()}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with open(temporary, "wb") as file:
            for piece in pieces:
                file.write(piece.encode() if isinstance(piece, str) else piece)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
        _sync_folder(path.parent)
    except OSError as e:
        raise cannot_write(path, e) from None
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


def cannot_write(path: Path, e: OSError) -> BadInput:
    """The error of a disk that is full, read-only or not ours."""
    cure = "Free space, fix permissions, or choose another folder: --set out=FOLDER."
    return BadInput(f"cannot be written ({e.strerror or e})", str(path), cure)


def _sync_folder(folder: Path) -> None:
    """Make renames in `folder` survive a power cut."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _plain(obj: Any, at: str) -> Any:
    """dict, list, str, int, float, bool, None only; every float finite. `at` says where, for the error."""
    if obj is None or isinstance(obj, (bool, str)):
        return obj
    if hasattr(obj, "tolist") and hasattr(obj, "dtype"):  # numpy scalar or array
        return _plain(obj.tolist(), at)
    if isinstance(obj, int):
        return int(obj)
    if isinstance(obj, float):
        if not math.isfinite(obj):
            raise NumericalFailure("not_finite", f"{at} is {obj}", do="A result that is not a number is not kept; see the stage's notes.")
        return float(obj)
    if isinstance(obj, Mapping):
        return {str(k): _plain(v, f"{at}: {k}") for k, v in obj.items()}
    if isinstance(obj, (list, tuple)):
        return [_plain(v, f"{at}[{i}]") for i, v in enumerate(obj)]
    if isinstance(obj, Path):
        return str(obj)
    if hasattr(obj, "model_dump"):
        return _plain(obj.model_dump(by_alias=True), at)
    raise TypeError(f"{at}: {type(obj).__name__} has no place in JSON")


def _render(obj: Any, indent: int) -> str:
    """Indented JSON in which lists and objects of plain values that fit stay on one line."""
    flat = json.dumps(obj, ensure_ascii=False, allow_nan=False)
    nested = isinstance(obj, (dict, list)) and any(isinstance(v, (dict, list)) for v in (obj.values() if isinstance(obj, dict) else obj))
    if not isinstance(obj, (dict, list)) or not obj or (not nested and len(flat) + indent <= 140 and (indent or isinstance(obj, list))):
        return flat
    inside, pad = indent + 2, " " * (indent + 2)
    if isinstance(obj, dict):
        lines = [f"{pad}{json.dumps(k, ensure_ascii=False)}: {_render(v, inside)}" for k, v in obj.items()]
        return "{\n" + ",\n".join(lines) + "\n" + " " * indent + "}"
    if not nested:
        return flat  # a long list of numbers: one line, not one line each
    return "[\n" + ",\n".join(pad + _render(v, inside) for v in obj) + "\n" + " " * indent + "]"


# --- reading ------------------------------------------------------------------------------------------------------------


def read_json(path: Path, made_by: str = "") -> Any:
    """Strict JSON. `made_by`: the command that makes the file again (default: `awes` and the name of its folder)."""

    def no_constant(text: str):
        raise ValueError(f"{text} is not JSON")

    try:
        return json.loads(_read(path, made_by).decode(), parse_constant=no_constant)
    except (ValueError, RecursionError) as e:
        raise _corrupt(path, made_by, f"not readable as JSON: {e}") from None


def read_arrays(path: Path, made_by: str = "") -> dict[str, Any]:
    """The named arrays of an .npz that `write_arrays` made."""
    import io
    import zipfile
    import zlib

    import numpy as np

    arrays = {}
    try:
        with zipfile.ZipFile(io.BytesIO(_read(path, made_by))) as archive:
            for info in archive.infolist():
                # stored uncompressed, so a small file cannot unfold into a large one
                if info.compress_type != zipfile.ZIP_STORED or not info.filename.endswith(".npy"):
                    raise ValueError(f"unexpected member '{info.filename}'")
                member = io.BytesIO(archive.read(info))
                arrays[info.filename.removesuffix(".npy")] = _read_member(np, member)
    except (ValueError, KeyError, EOFError, OSError, RuntimeError, NotImplementedError, SyntaxError, zipfile.BadZipFile, zlib.error) as e:
        raise _corrupt(path, made_by, f"not readable as npz: {e}") from None
    return arrays


def _read_member(np: Any, member: Any) -> Any:
    """One array. The size its header claims is compared with the bytes there are, before memory is asked for."""
    if np.lib.format.read_magic(member) != (1, 0):
        raise ValueError("unknown npy version")
    shape, fortran, dtype = np.lib.format.read_array_header_1_0(member)
    raw = member.read()
    if dtype.hasobject or math.prod(shape) * dtype.itemsize != len(raw):
        raise ValueError("array and header disagree")
    return np.frombuffer(raw, dtype).reshape(shape, order="F" if fortran else "C").copy()


def read_tensors(path: Path, made_by: str = "") -> dict[str, Any]:
    """The named arrays of a .safetensors file, as numpy arrays."""
    from safetensors import SafetensorError
    from safetensors.numpy import load

    try:
        return load(_read(path, made_by))
    except (SafetensorError, ValueError, KeyError, TypeError) as e:
        raise _corrupt(path, made_by, f"not readable as safetensors: {e}") from None


def _read(path: Path, made_by: str) -> bytes:
    try:
        return Path(path).read_bytes()
    except FileNotFoundError:
        raise _corrupt(path, made_by, "there is no such file") from None
    except OSError as e:
        raise BadInput(f"cannot be read ({e.strerror or e})", str(path), "Check the path and its permissions.") from None


def _corrupt(path: Path, made_by: str, what: str) -> BadInput:
    return BadInput(what, str(path), f"Make it again: {made_by or f'awes {Path(path).parent.name} --force'}.")


# --- folders that appear whole --------------------------------------------------------------------------------------------


@contextmanager
def staged_folder(folder: Path) -> Iterator[Path]:
    """An empty folder to write into, which takes the place of `folder` in one step when the block ends well.

    If the block raises, or the process is killed, `folder` stays as it was; what was half-written is removed here or by the
    next `locked` run.
    """
    partial = folder.with_name(f".{folder.name}.partial-{os.getpid()}")
    try:
        shutil.rmtree(partial, ignore_errors=True)
        partial.mkdir(parents=True)
    except OSError as e:
        raise cannot_write(folder, e) from None
    try:
        yield partial
        try:
            _sync_folder(partial)
            _put_in_place(partial, folder)
            _sync_folder(folder.parent)
        except OSError as e:
            raise cannot_write(folder, e) from None
    finally:
        shutil.rmtree(partial, ignore_errors=True)


def _put_in_place(partial: Path, folder: Path) -> None:
    """`folder` becomes `partial`; the old content is left under the partial's name, to be removed."""
    if not folder.exists():
        os.rename(partial, folder)
    elif not _exchange(partial, folder):
        # without an exchanging rename there is an instant with no folder; a kill just then is mended by `_clean_up`
        old = folder.with_name(f".{folder.name}.old-{os.getpid()}")
        os.rename(folder, old)
        os.rename(partial, folder)
        shutil.rmtree(old, ignore_errors=True)


def _exchange(a: Path, b: Path) -> bool:
    """Swap two folders in one step, where the system can (Linux: renameat2 with RENAME_EXCHANGE = 2)."""
    at_cwd, exchange = -100, 2
    try:
        renameat2 = ctypes.CDLL(None).renameat2
    except (AttributeError, OSError):
        return False
    return renameat2(at_cwd, os.fsencode(a), at_cwd, os.fsencode(b), exchange) == 0


def _clean_up(out: Path) -> None:
    """Remove what killed runs left half-written. Only called under the lock, when no run is alive."""
    for old in out.glob(".*.old-*"):
        folder = out / old.name.removeprefix(".").rsplit(".old-", 1)[0]
        if folder.exists():
            shutil.rmtree(old, ignore_errors=True)
        else:
            os.rename(old, folder)
    for partial in [*out.glob(".*.partial-*"), *out.glob(".*.tmp-*")]:
        shutil.rmtree(partial, ignore_errors=True) if partial.is_dir() else partial.unlink(missing_ok=True)


@contextmanager
def locked(out: Path) -> Iterator[None]:
    """Hold the output folder: a second awes that wants it stops with a clear error instead of mixing its files in."""
    try:
        out.mkdir(parents=True, exist_ok=True)
        # append mode: opening must not wipe the pid of the run that holds the lock
        file = open(out / ".lock", "a+")  # noqa: SIM115 - closed below
    except FileExistsError:
        raise BadInput("this is a file, a folder is needed for the results", str(out), "Choose another: --set out=FOLDER.") from None
    except OSError as e:
        raise cannot_write(out, e) from None
    with file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            file.seek(0)
            raise BadInput(
                f"another awes (process {file.read().strip() or 'unknown'}) is running in this folder",
                str(out),
                "Wait for it, or write elsewhere: --set out=FOLDER.",
            ) from None
        try:
            file.truncate(0)
            file.write(str(os.getpid()))
            file.flush()
            _clean_up(out)
        except OSError as e:
            raise cannot_write(out, e) from None
        yield


def scratch_folder(folder: Path, key: str) -> Path:
    """A folder for checkpoints that outlives an interruption, emptied when `key` (what they are checkpoints of) has changed."""
    try:
        stamp = folder / "key"
        if not stamp.is_file() or stamp.read_text(errors="replace") != key:
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir(parents=True)
            write_text(stamp, key)
    except OSError as e:
        raise cannot_write(folder, e) from None
    return folder


def has_checkpoints(folder: Path) -> bool:
    """Does a folder for checkpoints hold any?"""
    return folder.is_dir() and any(p.name != "key" for p in folder.iterdir())


def remove(path: Path) -> None:
    """A file or folder of ours that is no longer needed."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


def copy_files(source: Path, folder: Path) -> int:
    """Every file of `source` copied into a folder of the user's, beside what may lie there; how many."""
    files = sorted(p for p in source.iterdir() if p.is_file())
    for file in files:
        _write(folder / file.name, [file.read_bytes()])
    return len(files)


# --- what it was made from ------------------------------------------------------------------------------------------------


def content_hash(*paths: Path, exclude: Iterable[Path] = ()) -> str:
    """sha256 of contents, not of times or places. Of a folder: its sorted relative file names and contents, without hidden
    files, caches and whatever lies in `exclude`."""
    total = hashlib.sha256()
    left_out = [p.resolve() for p in exclude]
    for path in map(Path, paths):
        if path.is_dir():
            for name, digest in _folder_digests(path, left_out):
                total.update(f"{name}\0{digest}\n".encode())
        else:
            total.update(f"{file_hash(path)}\n".encode())
    return total.hexdigest()


def file_hash(path: Path) -> str:
    """sha256 of one file."""
    try:
        with open(path, "rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as e:
        raise BadInput(f"cannot be read ({e.strerror or e})", str(path), "Check the path and its permissions.") from None


def _folder_digests(folder: Path, left_out: list[Path]) -> Iterator[tuple[str, str]]:
    for file in sorted(folder.rglob("*")):
        relative = file.relative_to(folder)
        hidden = any(part.startswith(".") or part == "__pycache__" for part in relative.parts)
        if hidden or not file.is_file() or any(p in (real := file.resolve()).parents or p == real for p in left_out):
            continue
        yield relative.as_posix(), file_hash(file)


def artifact_hashes(folder: Path) -> dict[str, str]:
    """File name -> sha256 of everything a stage left in its folder but the provenance (which holds times)."""
    return {name: digest for name, digest in _folder_digests(folder, []) if name != PROVENANCE}


def table_hash(table: Mapping[str, str]) -> str:
    """One sha256 for a table of names and hashes (or other text)."""
    return hashlib.sha256("\n".join(f"{k}\0{v}" for k, v in sorted(table.items())).encode()).hexdigest()


def versions() -> dict[str, str]:
    """Versions of what the numbers depend on. From the packages' metadata: importing torch for it would take seconds."""
    found = {"awes": __version__, "python": platform.python_version()}
    for package in ("numpy", "scipy", "torch", "torchdiffeq", "llvmlite", "polars"):
        with suppress(PackageNotFoundError):
            found[package] = version(package)
    return found


def machine() -> dict[str, Any]:
    """What the last bits of the numbers may depend on besides versions."""
    return {"system": platform.system(), "machine": platform.machine(), "libc": " ".join(platform.libc_ver()), "cores": os.cpu_count()}
