"""The page in headless Chromium: every plot drawn, no error, no request; tables sort, the 3-D view turns."""

import re
import shutil
import subprocess

import pytest
from reporting.small_evidence import evidence

from awescli.reporting.html import _hash, page

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed (Debian: apt-get install chromium)"),
]

FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    "--enable-logging=stderr", "--log-level=0", "--host-resolver-rules=MAP * ~NOTFOUND", "--virtual-time-budget=60000",
)  # fmt: skip

INTRUSION = re.compile(r"(inline (script|event handler)|Loading the image|load the image).*violates the following Content Security Policy")

USER = """
<script>
// a user who waits for the plots, sorts a table, turns the flight and zooms in time; what happened stands in data attributes
const waiting = setInterval(async () => {
  const root = document.documentElement;
  if (!root.dataset.plots) return;
  clearInterval(waiting);
  try {
    const head = document.querySelector("#tab-ranking > .table thead th:nth-child(5)");
    const column = () => [...document.querySelectorAll("#tab-ranking > .table tbody tr")].map((r) => +r.cells[4].dataset.v).join(",");
    head.querySelector("button").click();
    root.dataset.sorted = column();
    head.querySelector("button").click();
    root.dataset.again = column();
    const eyes = [];
    for (const three of document.querySelectorAll(".plot[data-three]")) {
      await Plotly.relayout(three, { "scene.camera.eye": { x: 0.1, y: 0.2, z: 2 } });
      eyes.push(three._fullLayout.scene._scene.getCamera().eye.z);
    }
    root.dataset.eyes = eyes.join(",");
    // every claim of the first screen leads to something that is shown
    const shown = (id) => [...document.querySelectorAll(`${id}, ${id} *`)].some((e) => e.matches(".plot[data-drawn], table, li, summary"));
    const claims = [...document.querySelectorAll("header.top a")].map((a) => a.getAttribute("href"));
    root.dataset.claims = claims.length;
    root.dataset.empty = claims.filter((id) => !shown(id)).join(",");
    // a table is copied as text with tabs
    let copied = "";
    document.execCommand = () => { copied = document.activeElement.value || document.querySelector("body > textarea").value; return true; };
    document.querySelector("#tab-ranking .copy").click();
    root.dataset.copied = (document.querySelector("body > textarea") || {}).value || copied;
    await Plotly.relayout(document.querySelector("#fig-p_n .plot"), { "xaxis.range[0]": 60, "xaxis.range[1]": 62 });
    await new Promise((done) => setTimeout(done, 500));
    root.dataset.zoom = document.querySelector("#fig-theta .plot")._fullLayout.xaxis.range.join(",");
    document.querySelector('.keys[data-for="test"] button').click();
    root.dataset.hidden = document.querySelector("#fig-theta .plot").data[0].visible;
    window.dispatchEvent(new Event("beforeprint"));
    root.dataset.printed = document.querySelectorAll("details:not([open])").length;
    window.dispatchEvent(new Event("afterprint"));
    root.dataset.done = "yes";
  } catch (e) { root.dataset.errors = `${root.dataset.errors || ""} user: ${e.message}`; }
}, 50);
</script></body>"""


INTRUDER = """<img src=x onerror="document.documentElement.dataset.intruder='image'">
<script>document.documentElement.dataset.intruder = "script"</script>"""
"""What a hole in the escaping would let in."""


@pytest.fixture(scope="module")
def visited(tmp_path_factory):
    """(attributes of the root element, console) after a visit."""
    folder = tmp_path_factory.mktemp("browser")
    file = folder / "report.html"
    text = page(evidence(evil="<b>&")).replace("</body></html>", INTRUDER + USER)
    own = _hash(re.search(r"<script>(.*?)</script></body>", USER, re.DOTALL)[1])  # what the policy does not name is not run
    file.write_text(text.replace("script-src ", f"script-src '{own}' ", 1), encoding="utf-8")
    command = [CHROMIUM, *FLAGS, f"--user-data-dir={folder / 'profile'}", "--window-size=1280,2000", "--dump-dom", file.as_uri()]
    done = subprocess.run(command, capture_output=True, text=True, timeout=150)
    root = re.search(r"<html[^>]*>", done.stdout)
    assert root, done.stderr[-2000:]
    console = [line for line in done.stderr.splitlines() if ":CONSOLE" in line]
    return dict(re.findall(r'data-(\w+)="([^"]*)"', root[0])), console


def test_every_plot_is_drawn_without_error(visited):
    attributes, console = visited
    drawn, plots = attributes["plots"].split("/")
    assert drawn == plots and int(plots) > 25
    assert "errors" not in attributes, attributes["errors"]
    # the console also holds notes on the speed of the software renderer
    bad = re.compile(r"Uncaught|Error|error:|Refused|violates|Failed|net::|NaN")
    assert not [line for line in console if bad.search(line) and not INTRUSION.search(line)], console


def test_a_script_that_is_not_the_pages_own_does_not_run(visited):
    """Should a text become a part of the page after all: the policy names the page's scripts by their hashes."""
    attributes, console = visited
    assert "intruder" not in attributes
    assert sum("violates the following Content Security Policy" in line for line in console) >= 2


def test_tables_sort_both_ways(visited):
    values = [float(v) for v in visited[0]["sorted"].split(",")]
    assert values == sorted(values, reverse=True) and visited[0]["again"] == ",".join(f"{v:g}" for v in sorted(values))


def test_every_claim_of_the_first_screen_leads_to_what_shows_it(visited):
    assert int(visited[0]["claims"]) > 15 and not visited[0].get("empty")


def test_a_table_is_copied_as_tab_separated_text(visited):
    first, second = visited[0]["copied"].splitlines()[:2]
    assert first.count("\t") == second.count("\t") == 7 and "candidate" in first


def test_the_flight_turns_and_the_channels_zoom_together(visited):
    eyes = [float(z) for z in visited[0]["eyes"].split(",")]
    assert len(eyes) == 3 and eyes == pytest.approx([2, 2, 2], abs=0.05)
    assert visited[0]["zoom"] == "60,62"
    assert visited[0]["hidden"] == "false"


def test_print_unfolds_everything(visited):
    assert visited[0]["printed"] == "0" and visited[0]["done"] == "yes"
