"""The page: evidence in, one self-contained HTML text out. It asks nothing of a network and opens from a file:// address."""

from base64 import b64encode
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from importlib.resources import files

from plotly.offline import get_plotlyjs

from awescli.reporting.controller import controller
from awescli.reporting.evidence import Evidence
from awescli.reporting.flight import flight
from awescli.reporting.free_flight import free_flight
from awescli.reporting.headline import headline
from awescli.reporting.hybrid import hybrid
from awescli.reporting.identification import identification
from awescli.reporting.marks import Section
from awescli.reporting.next_steps import next_steps
from awescli.reporting.prediction import prediction
from awescli.reporting.provenance import provenance
from awescli.reporting.rendering import rendered, trusted
from awescli.reporting.residual import residual

SECTIONS = (headline, flight, controller, identification, residual, hybrid, free_flight, prediction, next_steps, provenance)
"""The story, in order."""

NAMES = {
    "summary": "Summary", "flight": "Flight", "controller": "Controller", "identification": "Identification", "residual": "Residual",
    "hybrid": "Hybrid", "flown": "Flown", "prediction": "Predicted", "next": "Next", "provenance": "Provenance",
}  # fmt: skip


@dataclass(frozen=True)
class Script:
    """JavaScript of ours inside the page: only its end mark could end it. Lines end as the browser reads, and hashes, them."""

    source: str

    @property
    def text(self) -> str:
        return trusted(self.source.replace("</script", "<\\/script").replace("\r\n", "\n").replace("\r", "\n"))

    @property
    def hash(self) -> str:
        return _hash(self.text)


def story(evidence: Evidence) -> list[Section]:
    """All sections, in order: what the page and the files for papers are made of."""
    return [tell(evidence) for tell in SECTIONS]


def page(evidence: Evidence) -> str:
    """The whole page."""
    name = evidence.log.name
    kicker = f"Flight {name} · model against measurement"
    return whole_page(story(evidence), NAMES, subject=name, kicker=kicker, version=evidence.versions.get("awes", ""))


def whole_page(sections: Sequence[Section], names: Mapping[str, str], *, subject: str, kicker: str, version: str) -> str:
    """A page of its own of some sections, the first of which is the first screen. names: id of a section -> what the menu calls it;
    subject: what the browser's title names; kicker: the line above the title."""
    first, *rest = sections
    return rendered(
        "page.html", first=first, rest=tuple(rest), named=[(names[s.id], s) for s in sections], subject=subject, kicker=kicker,
        version=version, style=trusted(own("page.css")), scripts=[Script(get_plotlyjs()), Script(own("page.js"))],
    )  # fmt: skip


def own(name: str) -> str:
    """A file of this room."""
    return (files("awescli.reporting") / name).read_text(encoding="utf-8")


def _hash(script: str) -> str:
    """A script in a Content-Security-Policy (CSP level 2, section 4.2.5)."""
    return f"sha256-{b64encode(sha256(script.encode()).digest()).decode()}"
