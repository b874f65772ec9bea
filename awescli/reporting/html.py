"""The page: evidence in, one self-contained HTML text out. It asks nothing of a network and opens from a file:// address."""

from base64 import b64encode
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
from awescli.reporting.marks import Section, esc
from awescli.reporting.next_steps import next_steps
from awescli.reporting.prediction import prediction
from awescli.reporting.provenance import provenance
from awescli.reporting.residual import residual

SECTIONS = (headline, flight, controller, identification, residual, hybrid, free_flight, prediction, next_steps, provenance)
"""The story, in order."""

NAMES = {
    "summary": "Summary", "flight": "Flight", "controller": "Controller", "identification": "Identification", "residual": "Residual",
    "hybrid": "Hybrid", "flown": "Flown", "prediction": "Predicted", "next": "Next", "provenance": "Provenance",
}  # fmt: skip

POLICY = "default-src 'none'; script-src {scripts}; style-src 'unsafe-inline'; img-src data: blob:; font-src data:"
"""What the browser lets the page do: nothing but what stands in it, and run no script but its own two, known by their hashes."""


def story(evidence: Evidence) -> list[Section]:
    """All sections, in order: what the page and the files for papers are made of."""
    return [tell(evidence) for tell in SECTIONS]


def page(evidence: Evidence) -> str:
    """The whole page."""
    sections = story(evidence)
    first, *rest = sections
    links = "".join(f'<a href="#{s.id}">{NAMES[s.id]}</a>' for s in sections)
    scripts = [_inline(get_plotlyjs()), _inline(own("page.js"))]
    policy = POLICY.format(scripts=" ".join(_hash(script) for script in scripts))
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1"><meta name="color-scheme" content="light dark">\n'
        f"<title>{esc(first.title)} · {esc(evidence.log.name)}</title>\n<style>{own('page.css')}</style></head>\n<body>\n"
        f'<nav aria-label="sections"><div>{links}</div></nav>\n{_top(evidence, first)}<main>\n'
        f"{''.join(s.html() for s in rest)}<footer>Made by awes {esc(evidence.versions.get('awes', ''))}.</footer></main>\n"
        f"{''.join(f'<script>{script}</script>{chr(10)}' for script in scripts)}</body></html>\n"
    )


def _top(evidence: Evidence, first: Section) -> str:
    """The first screen is no chapter: its title is the page's."""
    kicker = f"Flight {esc(evidence.log.name)} · model against measurement"
    return f'<header class="top" id="{first.id}"><p class="kicker">{kicker}</p><h1>{esc(first.title)}</h1>\n{first.inside()}</header>\n'


def own(name: str) -> str:
    """A file of this room."""
    return (files("awescli.reporting") / name).read_text(encoding="utf-8")


def _inline(script: str) -> str:
    """JavaScript inside a script element: only its end mark could end it. Lines end as the browser reads, and hashes, them."""
    return script.replace("</script", "<\\/script").replace("\r\n", "\n").replace("\r", "\n")


def _hash(script: str) -> str:
    """A script in a Content-Security-Policy (CSP level 2, section 4.2.5)."""
    return f"'sha256-{b64encode(sha256(script.encode()).digest()).decode()}'"
