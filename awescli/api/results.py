"""What all results have in common: where they come from, their files, a table, figures, and what a notebook shows of them."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

from awescli.api.figures import Album, Picture
from awescli.api.inputs import Flight, Kite, read_kite
from awescli.api.shown import as_html, as_text
from awescli.api.work import Done, Origin
from awescli.stages.answers import ANSWER

if TYPE_CHECKING:
    import polars

    from awescli.flightlog.split import Split

Document = Mapping[str, Any]
Kind = TypeVar("Kind", bound="Result")


@dataclass(frozen=True, eq=False)
class Result:
    """What one stage found. origin: what it comes from; folder: where its files are (temporary, unless `out` named one);
    answer: its own words, as the terminal shows them; notes: what it said on the way; documents: its JSON files, by name."""

    origin: Origin
    folder: Path
    answer: tuple[str, ...]
    notes: tuple[str, ...]
    documents: Mapping[str, Document]

    title: ClassVar[str] = ""
    stage: ClassVar[str] = ""
    reads: ClassVar[tuple[str, ...]] = ("metrics.json",)

    @property
    def metrics(self) -> Document:
        """metrics.json: all numbers of the stage."""
        return self.documents["metrics.json"]

    @property
    def flight(self) -> Flight:
        """The flight that it was made from."""
        return self.origin.flight

    @cached_property
    def parts(self) -> "Split":
        """train, validation, test: half-open sample ranges of the flight, whole loops each."""
        return self.origin.context().inputs.parts_of(self.flight.log, self.flight.path)

    def to_frame(self) -> "polars.DataFrame":
        """Its main table."""
        raise NotImplementedError

    def plot(self, name: str | None = None) -> Picture:
        """A figure of its section of the report, by name (`figures`); None: the first. Raises BadInput for other names."""
        return self._album.picture(name)

    @property
    def figures(self) -> tuple[str, ...]:
        """Names for `plot`."""
        return tuple(self._album.figures)

    def _tell(self) -> Callable[[Any], Any]:
        """Its section of the report."""
        raise NotImplementedError

    def _scores(self) -> dict[str, Any]:
        """What its section knows of errors, in the form of evaluate's metrics.json."""
        return {}

    @cached_property
    def _album(self) -> Album:
        def tell() -> list[Any]:
            from awescli.stages.page import gather

            return [self._tell()(gather(self.origin.context(), self.flight.log, self.parts, self._scores(), {}))]

        return Album(tell)

    def __repr__(self) -> str:
        return as_text(self.title, self.answer)

    def _repr_html_(self) -> str:
        return as_html(self.title, self.answer, self.to_frame())


class HandsOn(Result):
    """A result that hands on a model."""

    label: ClassVar[str] = ""
    """Its name among the nested models of a run."""

    @property
    def kite(self) -> Kite:
        """The model as a kite file: the declaration with what was found."""
        path = self.folder / "kite.yaml"
        return Kite(path, read_kite(path).declaration, self.origin.made[self.stage].keep)


def result(kind: type[Kind], done: Done) -> Kind:
    """A result of what a stage left."""
    from awescli.artifacts import read_json

    documents = {name: read_json(done.folder / name) for name in kind.reads}
    answer = done.summary.get(ANSWER, ())
    return kind(done.origin, done.folder, tuple([answer] if isinstance(answer, str) else answer), done.notes, documents)
