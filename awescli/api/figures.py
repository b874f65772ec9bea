"""The figures of the report, one at a time: what `.plot()` gives."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from awescli.notation.errors import BadInput, did_you_mean


@dataclass(frozen=True)
class Picture:
    """One figure of the report. A notebook shows it; `save` writes it.

    title: what it shows; note: how to read it; svg: the drawing; png: the same, 200 dots per inch.
    """

    title: str
    note: str
    svg: str
    png: bytes

    def save(self, file: str | Path) -> Path:
        """Write it to FILE.svg or FILE.png, by the name's ending. Raises BadInput for other endings, or where nothing can be written."""
        from awescli.artifacts import write_content

        path = Path(file)
        content = {".svg": self.svg.encode(), ".png": self.png}.get(path.suffix.lower())
        if content is None:
            raise BadInput(f"a picture is .svg or .png, not '{path.suffix}'", str(path), "Name it so.")
        write_content(path, content)
        return path

    def _repr_html_(self) -> str:
        from awescli.reporting.rendering import rendered, trusted

        return rendered("picture.html", drawing=trusted(self.svg[self.svg.index("<svg") :]), note=self.note)

    def _repr_png_(self) -> bytes:
        return self.png

    def __repr__(self) -> str:
        return f"Picture({self.title!r})"


@dataclass(frozen=True)
class Album:
    """The figures of some sections of the report. tell: gives the sections, when a figure is first asked for."""

    tell: Callable[[], list[Any]]

    @cached_property
    def _pieces(self) -> list[Any]:
        from awescli.reporting.marks import blocks

        return [piece for section in self.tell() for piece in blocks(section.body)]

    @cached_property
    def figures(self) -> Mapping[str, Any]:
        """Name -> figure (`reporting.plots.Figure`)."""
        from awescli.reporting.plots import Figure

        return {p.id.removeprefix("fig-"): p for p in self._pieces if isinstance(p, Figure)}

    def picture(self, name: str | None) -> Picture:
        """One by name; None: the first one. Raises BadInput for a name that it has not."""
        import numpy as np

        from awescli.reporting.drawing import drawn
        from awescli.reporting.paper import light_colours
        from awescli.reporting.plots import Shared

        if name is not None and name not in self.figures:
            raise BadInput(f"there is no figure '{name}'", "plot()", did_you_mean(name, self.figures))
        if not self.figures:
            raise BadInput("there is nothing to draw", "plot()", "See the result itself: print it.")
        figure = self.figures[name] if name is not None else next(iter(self.figures.values()))
        shared = {p.name: np.asarray(p.values) for p in self._pieces if isinstance(p, Shared)}
        files = drawn(figure, light_colours(), shared)
        return Picture(figure.title, figure.note, files["svg"].decode(), files["png"])
