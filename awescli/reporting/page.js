// Draws the figures of the page from the JSON beside each, sorts and copies tables. No network, no state outside the page.
(() => {
  "use strict";
  const root = document.documentElement;
  const errors = [];
  const report = (message) => { errors.push(String(message)); root.dataset.errors = errors.join(" | "); };
  window.addEventListener("error", (e) => report(e.message));
  window.addEventListener("unhandledrejection", (e) => report(e.reason));

  // --- colours: "@blue" is the CSS variable --blue; "@blue/0.2" the same, translucent; "$name" a shared array -------------
  const shared = {};
  document.querySelectorAll("script.shared").forEach((s) => { shared[s.dataset.name] = JSON.parse(s.textContent); });
  const css = (name) => getComputedStyle(root).getPropertyValue("--" + name).trim();
  const colour = (token) => {
    const [name, alpha] = token.slice(1).split("/");
    const hex = css(name);
    if (!hex) return token;
    if (!alpha) return hex;
    const [r, g, b] = [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16));
    return `rgba(${r},${g},${b},${alpha})`;
  };
  const resolve = (v) => {
    if (typeof v === "string") return v[0] === "@" ? colour(v) : v[0] === "$" && v.slice(1) in shared ? shared[v.slice(1)] : v;
    if (Array.isArray(v)) return v.length && v.every((e) => typeof e !== "object" && typeof e !== "string" || e === null) ? v : v.map(resolve);
    if (v && typeof v === "object") return Object.fromEntries(Object.entries(v).map(([k, e]) => [k, resolve(e)]));
    return v;
  };
  const touch = matchMedia("(pointer: coarse)").matches;
  const template = () => {
    const ax = { gridcolor: css("rule"), zerolinecolor: css("rule"), linecolor: css("rule"), automargin: true, title: { standoff: 6 } };
    const wall = { gridcolor: css("rule"), zerolinecolor: css("grey"), color: css("soft"), showbackground: false };
    return { layout: {
      font: { family: getComputedStyle(document.body).fontFamily, size: 12, color: css("ink") },
      paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", xaxis: ax, yaxis: ax,
      scene: { xaxis: wall, yaxis: wall, zaxis: wall },
      margin: { l: 52, r: 12, t: 10, b: 40 }, legend: { orientation: "h", x: 0, y: 1.02, yanchor: "bottom", bgcolor: "rgba(0,0,0,0)" },
      hoverlabel: { bgcolor: css("panel"), bordercolor: css("rule"), font: { color: css("ink") } },
      modebar: { bgcolor: "rgba(0,0,0,0)", color: css("rule"), activecolor: css("soft") },
      hovermode: "closest", bargap: 0.25, bargroupgap: 0.05, dragmode: touch ? false : "zoom",
    } };
  };
  const config = (div) => ({
    responsive: true, displaylogo: false, displayModeBar: innerWidth < 700 ? false : "hover", modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d", "zoom2d", "pan2d", "zoomIn2d", "zoomOut2d", "zoom3d", "pan3d",
      "orbitRotation", "tableRotation", "resetCameraLastSave3d"],
    toImageButtonOptions: { format: div.dataset.three ? "png" : "svg", filename: div.closest("figure").id },
  });
  const spec = (div, more) => {
    const raw = JSON.parse(div.parentElement.querySelector(":scope > script").textContent);
    const layout = resolve(raw.layout);
    // a turned 3-D view wants drag, also on a phone; the template's dragmode is for plots in the plane
    if (div.dataset.three) layout.dragmode = "orbit";
    return [resolve(raw.data), { ...layout, template: template(), ...more }];
  };

  // --- drawing: first screen first, one after the other, so that the page never hangs ---------------------------------------
  const plots = [...document.querySelectorAll(".plot")];
  const tick = () => new Promise((done) => setTimeout(done));
  async function draw() {
    for (const div of plots) {
      try {
        await Plotly.newPlot(div, ...spec(div), config(div));
        div.dataset.drawn = "yes";
        link(div);
      } catch (e) { report(`${div.closest("figure").id}: ${e.message}`); }
      await tick();
    }
    await stills();
    root.dataset.plots = `${plots.filter((d) => d.dataset.drawn).length}/${plots.length}`;
  }
  const again = (more) => plots.filter((d) => d.dataset.drawn).forEach((div) => {
    const [data, layout] = spec(div, more);
    if (div.dataset.three && div.layout.scene) layout.scene = { ...layout.scene, camera: div.layout.scene.camera };
    Plotly.react(div, data, layout, config(div));
  });

  // plots of one time zoom together
  let busy = false;
  function link(div) {
    const name = div.dataset.linked;
    if (!name) return;
    div.on("plotly_relayout", async (change) => {
      const range = "xaxis.range[0]" in change ? { "xaxis.range": [change["xaxis.range[0]"], change["xaxis.range[1]"]] }
        : change["xaxis.range"] ? { "xaxis.range": change["xaxis.range"] } : change["xaxis.autorange"] ? { "xaxis.autorange": true } : null;
      if (busy || !range) return;
      busy = true;
      try {
        await Promise.all(plots.filter((d) => d !== div && d.dataset.linked === name && d.dataset.drawn).map((d) => Plotly.relayout(d, range)));
      } finally { busy = false; }
    });
  }

  document.querySelectorAll(".keys[data-for] button").forEach((button) => button.addEventListener("click", () => {
    const show = button.getAttribute("aria-pressed") !== "true";
    button.setAttribute("aria-pressed", String(show));
    plots.filter((d) => d.dataset.linked === button.parentElement.dataset.for && d.dataset.drawn).forEach((div) => {
      // `meta` is the plain name; `name` is escaped, as plotly.js reads marks in it
      const lines = div.data.map((t, i) => [t.meta, i]).filter(([name]) => name === button.dataset.line).map(([, i]) => i);
      if (lines.length) Plotly.restyle(div, { visible: show }, lines);
    });
  }));

  // --- paper: light colours, a still picture instead of WebGL, everything unfolded ------------------------------------------
  async function stills() {
    const was = root.dataset.paper;
    root.dataset.paper = "yes";
    const three = plots.filter((d) => d.dataset.three && d.dataset.drawn).map((div) => [div, spec(div, { width: 760, height: 490 })]);
    if (was === undefined) delete root.dataset.paper;
    for (const [div, [data, layout]] of three) {
      try {
        const still = new Image();
        still.className = "still";
        still.alt = div.getAttribute("aria-label");
        still.src = await Plotly.toImage({ data, layout }, { format: "png", width: 760, height: 490, scale: 2 });
        div.append(still);
        div.classList.add("has-still");
      } catch { /* no WebGL: the paper then lacks this picture, the page says so where it stands */ }
    }
  }
  let opened = [];
  window.addEventListener("beforeprint", () => {
    root.dataset.paper = "yes";
    opened = [...document.querySelectorAll("details:not([open])")];
    opened.forEach((d) => { d.open = true; });
    plots.filter((d) => d.dataset.drawn && !d.dataset.three).forEach((div) => {
      const panel = div.closest(".panel");
      Plotly.react(div, ...spec(div, { width: panel ? 330 : 680, autosize: false }), config(div));
    });
  });
  window.addEventListener("afterprint", () => {
    delete root.dataset.paper;
    opened.forEach((d) => { d.open = false; });
    again();
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => again());
  document.querySelectorAll("details").forEach((d) => d.addEventListener("toggle", () => {
    d.querySelectorAll(".plot[data-drawn]").forEach((div) => Plotly.Plots.resize(div));
  }));

  // --- tables -------------------------------------------------------------------------------------------------------------
  const key = (row, column) => {
    const cell = row.cells[column];
    return cell.dataset.v === undefined ? cell.textContent : isNaN(+cell.dataset.v) ? cell.dataset.v : +cell.dataset.v;
  };
  const order = (a, b) => typeof a === "number" && typeof b === "number" ? a - b
    : typeof a === "number" ? -1 : typeof b === "number" ? 1 : a.localeCompare(b);
  document.querySelectorAll("table.sortable thead th").forEach((th) => th.addEventListener("click", () => {
    const body = th.closest("table").tBodies[0];
    const sign = th.getAttribute("aria-sort") === "descending" ? 1 : -1;
    const rows = [...body.rows].sort((a, b) => sign * order(key(a, th.cellIndex), key(b, th.cellIndex)));
    th.parentElement.querySelectorAll("th").forEach((other) => other.setAttribute("aria-sort", "none"));
    th.setAttribute("aria-sort", sign > 0 ? "ascending" : "descending");
    body.append(...rows);
  }));
  document.querySelectorAll(".table .copy").forEach((button) => button.addEventListener("click", () => {
    const rows = [...button.parentElement.querySelectorAll("tr")];
    const text = rows.map((r) => [...r.cells].map((c) => c.textContent.trim()).join("\t")).join("\n");
    const area = document.createElement("textarea");
    area.value = text;
    document.body.append(area);
    area.select();
    // the clipboard interface is not there in every browser for a page opened from a file
    const done = navigator.clipboard ? navigator.clipboard.writeText(text).then(() => true, () => document.execCommand("copy")) : Promise.resolve(document.execCommand("copy"));
    done.then(() => { area.remove(); button.textContent = "copied"; setTimeout(() => { button.textContent = "copy"; }, 1500); });
  }));

  draw();
})();
