"""Where the numbers come from: stages, settings, inputs by their hashes, versions."""

from awescli.reporting.evidence import Evidence
from awescli.reporting.marks import Body, Cell, Code, Folded, Paragraph, Section, table
from awescli.reporting.words import number


def provenance(evidence: Evidence) -> Section:
    rows, settings, inputs = [], [], {}
    for stage, record in evidence.provenance.items():
        timing, stamp = record.get("timing") or {}, record.get("stamp") or {}
        seconds = timing.get("duration_s")
        rows.append((
            stage, timing.get("started", "with this page"), Cell(f"{number(seconds)} s" if seconds else "–", seconds),
            str(stamp.get("seed", "–")),
            Cell(Code(str(stamp.get("code", "–"))[:12]), str(stamp.get("code", ""))),
        ))  # fmt: skip
        inputs.update({str(k): str(v) for k, v in (stamp.get("inputs") or {}).items()})
        settings += [(stage, str(k), str(v)) for k, v in (stamp.get("settings") or {}).items()]
    hashes = [(name, Cell(Code(f"{digest[:32]}…"), digest)) for name, digest in inputs.items()]
    body: Body = (
        table(("stage", "made", "took", "seed", "code (sha256)"), rows) if rows else "",
        table(("input", "content (sha256)"), hashes, sortable=False) if hashes else "",
        Folded("Settings", table(("stage", "setting", "value"), settings)) if settings else "",
        Folded("Versions", table(("package", "version"), list(evidence.versions.items()))),
    )
    about = "This page is one file: it asks nothing of any network and can be sent as it is. Plots: plotly.js (MIT licence), inside."
    return Section("provenance", "Where the numbers come from", (body, Paragraph(about, "soft")))
