"""`flights: [...]` of a plan: the flights that it names, each with a name of its own, and the plan of each as if it stood alone."""

import re
from collections.abc import Iterator, Sequence
from glob import glob
from pathlib import Path

from awescli.flightlog.files import DECLARED, find_flight
from awescli.notation.document import Document
from awescli.notation.errors import BadInput, BadInputs

FLIGHT, FLIGHTS, OUT = "flight", "flights", "out"
TABLE, TABLE_JSON, PAGE = "flights.csv", "flights.json", "flights.html"
"""The table over flights and its page, in the folder of all results, beside the folders of the flights."""


def alone(document: Document, folder: Path, listed: Sequence[Path], out: Path, taken: Sequence[str]) -> dict[str, Document]:
    """Name of a flight -> the document that is the plan of this flight alone, its results in `out`/NAME, in the order of the list.

    folder: what paths are relative to; listed: the checked value of `flights`; taken: names that other things have in folders of results.
    Raises BadInput, or BadInputs, for what is no flight and for names that would meet in one folder.
    """
    found: dict[str, tuple[str, Path]] = {}
    errors: list[BadInput] = []
    for i, entry in enumerate(listed):
        where = document.where(FLIGHTS, i)
        # as any path of a plan: what `--set` gives counts from the current folder, if it is there
        base = Path() if where.startswith("--set") and any(_meant(entry, Path())) else folder
        meant = list(_meant(entry, base))
        if not meant:
            errors.append(BadInput(f"no folder matches {entry}", where, f"It is looked for in {base.absolute()}."))
        for path in meant:
            name = name_of(path)
            if error := _refused(name, path, where, found, taken):
                errors.append(error)
            else:
                found[name] = where, path
    if errors:
        raise errors[0] if len(errors) == 1 else BadInputs(errors)
    return {name: _for_one(document, where, path, out / name) for name, (where, path) in found.items()}


def name_of(path: Path) -> str:
    """What a flight is called: its folder; of a YAML file with a name of its own, that one."""
    if path.suffix in (".yaml", ".yml") and not path.is_dir():
        return path.absolute().parent.name if path.name == DECLARED else path.stem
    return path.resolve().name


def _meant(entry: Path, base: Path) -> Iterator[Path]:
    """The paths that an entry of the list stands for: itself, or all that its pattern matches, by name."""
    path = base / entry
    if path.exists() or not re.search(r"[*?[]", str(entry)):
        yield path
    else:
        yield from (Path(p) for p in sorted(glob(str(path))))


def _refused(name: str, path: Path, where: str, before: dict[str, tuple[str, Path]], taken: Sequence[str]) -> BadInput | None:
    """Why a path cannot be one of the flights; None where it can. What is wrong inside a log is for the flight's own run to say."""
    try:
        find_flight(path)
    except BadInput as e:
        # a flight.yaml with mistakes is a flight: its run is refused, and the others go on
        if not isinstance(e, BadInputs) and e.where == str(path):
            return BadInput(f"{path} is no flight: {e.what}", where, e.do)
    if name.startswith(".") or not name or name in (*taken, TABLE, TABLE_JSON, PAGE):
        return BadInput(f"a flight called '{name}' would have its results where awes keeps others", where, "Rename its folder.")
    for other, (_, theirs) in before.items():
        if other.casefold() == name.casefold():
            return BadInput(f"two flights are called '{name}' ({theirs} and {path}): their results would meet", where, "Rename one folder.")
    return None


def _for_one(document: Document, where: str, flight: Path, out: Path) -> Document:
    """The same document for one of its flights."""
    data = {**{k: v for k, v in document.data.items() if k != FLIGHTS}, FLIGHT: str(flight.absolute()), OUT: str(out)}
    places = {loc: place for loc, place in document.places.items() if loc[:1] != (FLIGHTS,)}
    return Document(document.source, data, {**places, (FLIGHT,): where}, document.omit)
