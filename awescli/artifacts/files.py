"""One file, written and read: it appears whole or not at all (temporary file in the same folder, fsync, rename).

JSON is strict (no NaN) and byte-identical for equal content. Nothing is ever pickled.
"""

import json
import math
import os
from collections.abc import Iterable, Mapping
from contextlib import suppress
from itertools import count
from pathlib import Path
from typing import Any

from awescli.artifacts.form_check import versioned, without_version, wrong_arrays, wrong_with
from awescli.notation.errors import BadInput, NumericalFailure
from awescli.notation.regular_files import open_regular

MOST_READ = 2_000_000_000
"""Bytes of one artifact: the predictions of a flight of three hours take a hundredth."""
MAX_DEPTH = 40
"""Levels of mappings and lists in JSON; artifacts have about ten."""


# --- writing ------------------------------------------------------------------------------------------------------------


def write_json(path: Path, obj: Any) -> None:
    """Strict JSON, keys in the order given, floats by repr. numpy values and arrays, tuples, paths and pydantic models are
    accepted; a NaN or infinity raises NumericalFailure with its place in the file. Files of `forms.FORMS` get their version."""
    _write(path, [(_render(_plain(versioned(path.name, obj), path.name), 0) + "\n").encode()])


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
    """All pieces, atomically. A link at `path` is replaced, what it leads to stays as it is."""
    path = Path(path)
    temporary = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        descriptor, temporary = _new_file(path)
        with os.fdopen(descriptor, "wb") as file:
            for piece in pieces:
                file.write(piece.encode() if isinstance(piece, str) else piece)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
        temporary = None
        sync_folder(path.parent)
    except OSError as e:
        raise cannot_write(path, e) from None
    finally:
        if temporary is not None:
            with suppress(OSError):
                temporary.unlink(missing_ok=True)


def _new_file(path: Path) -> tuple[int, Path]:
    """A file beside `path` that nobody had before: never one that lies there already, never through a link."""
    for attempt in count():
        temporary = path.with_name(f".{path.name}.{os.getpid()}-{attempt}.tmp")
        with suppress(FileExistsError):
            return os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_NOFOLLOW", 0), 0o666), temporary
    raise AssertionError("count never ends")


def cannot_write(path: Path, e: OSError) -> BadInput:
    """The error of a disk that is full, read-only or not ours."""
    cure = "Free space, fix permissions, or choose another folder: --set out=FOLDER."
    return BadInput(f"cannot be written ({e.strerror or e})", str(path), cure)


def sync_folder(folder: Path) -> None:
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


def read_json(path: Path, made_by: str = "", any_form: bool = False) -> Any:
    """Strict JSON, of the form that `forms.FORMS` asks of a file of this name in a folder of this stage.

    made_by: the command that makes the file again (default: `awes` and the name of its folder); any_form: also that of an older awes.
    """

    def no_constant(text: str):
        raise ValueError(f"{text} is not JSON")

    path = Path(path)
    try:
        content = json.loads(_read(path, made_by).decode(), parse_constant=no_constant)
    except (ValueError, RecursionError) as e:
        raise _corrupt(path, made_by, f"not readable as JSON: {e}") from None
    if _deeper(content, MAX_DEPTH):
        raise _corrupt(path, made_by, f"nested deeper than {MAX_DEPTH} levels")
    if not any_form and (wrong := wrong_with(path.parent.name, path.name, content)):
        raise _corrupt(path, made_by, wrong)
    return without_version(content)


def _deeper(content: Any, most: int) -> bool:
    """Whether lists and mappings lie deeper in each other than `most`: readers of artifacts go down by recursion."""
    level = [content]
    for _ in range(most):
        level = [v for c in level if isinstance(c, (dict, list)) for v in (c.values() if isinstance(c, dict) else c)]
        if not level:
            return False
    return any(isinstance(c, (dict, list)) for c in level)


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
    if wrong := wrong_arrays(Path(path).name, arrays):
        raise _corrupt(path, made_by, wrong)
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
        with open_regular(Path(path), MOST_READ) as file:
            return file.read()
    except FileNotFoundError:
        raise _corrupt(path, made_by, "there is no such file") from None
    except OSError as e:
        raise BadInput(f"cannot be read ({e.strerror or e})", str(path), "Check the path and its permissions.") from None


def _corrupt(path: Path, made_by: str, what: str) -> BadInput:
    return BadInput(what, str(path), f"Make it again: {made_by or f'awes {Path(path).parent.name} --force'}.")
