"use strict";
// The path in space: targets, and the error that each correction cancels.

class View {
  constructor(node, columns, onPick) {
    this.node = node;
    this.columns = columns;
    this.mode = "status";
    this.way = null;
    this.selected = -1;
    this.most = View.MOST;
    this.scale = this.suggest();
    this.listening = false;
    this.onPick = onPick;
  }

  // How far the targets reach along x, y and z [mm].
  spans() {
    const { column } = this.columns.numbers.position_mm;
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    for (let k = 0; k < column.length; k++) {
      if (column[k] < low[k % 3]) low[k % 3] = column[k];
      if (column[k] > high[k % 3]) high[k % 3] = column[k];
    }
    return high.map((v, k) => Math.max(v - low[k], 0));
  }

  // True proportions that fit into the frame however long and thin the path is.
  aspect() {
    const spans = this.spans(), most = Math.max(...spans);
    const [x, y, z] = spans.map((v) => 1.5 * Math.max(most > 0 ? v / most : 1, View.THIN));
    return { x, y, z };
  }

  // A magnification that makes large errors about a twelfth of the path's size.
  suggest() {
    const extent = Math.hypot(...this.spans());
    const sizes = Array.from(this.columns.size).filter((v) => v > 0).sort((a, b) => a - b);
    if (!sizes.length || !(extent > 0)) return 100;
    const wanted = 0.08 * extent / sizes[Math.floor(0.95 * (sizes.length - 1))];
    const off = (s) => Math.abs(Math.log(s / wanted));
    return View.SCALES.reduce((best, s) => (off(s) < off(best) ? s : best), 1);
  }

  // The rows that are drawn: all, or uncorrected ones and every k-th of the others.
  thin(rows) {
    const placed = rows.filter((i) => Number.isFinite(this.columns.of("position_mm", i)[0]));
    if (placed.length <= this.most) return { rows: placed, of: placed.length };
    const urgent = placed.filter((i) => View.LEFT.has(this.columns.status_of(i)));
    const kept = View.every(urgent, this.most / 2);
    const rest = placed.filter((i) => !View.LEFT.has(this.columns.status_of(i)));
    const more = View.every(rest, this.most - kept.length);
    return { rows: [...kept, ...more].sort((a, b) => a - b), of: placed.length };
  }

  static every(rows, most) {
    if (rows.length <= most) return rows;
    return Array.from({ length: Math.floor(most) }, (_, k) => rows[Math.floor(k * rows.length / most)]);
  }

  // Classes of the chosen mode: name, colour, symbol, and which class a row is in.
  classes() {
    const c = this.columns;
    if (this.mode === "status") {
      const kinds = c.statuses.map((s) => Object.assign({ name: s }, Columns.STATUS[s]));
      return { kinds, of: (i) => c.status[i] };
    }
    if (this.mode === "size") return this.sizes();
    const joint = Number(this.mode) - 1;
    const kinds = [
      { name: `↓ joint ${joint + 1} turning −`, colour: Page.COLOURS.vermillion, symbol: "square" },
      { name: "· not known", colour: Page.COLOURS.grey, symbol: "circle-open" },
      { name: `↑ joint ${joint + 1} turning +`, colour: Page.COLOURS.blue, symbol: "diamond" },
    ];
    return { kinds, of: (i) => c.side(i, joint) + 1 };
  }

  sizes() {
    const size = this.columns.size;
    let top = 0;
    for (const v of size) if (v > top) top = v;
    const step = (top || 1) / View.SHADES.length;
    const kinds = View.SHADES.map((colour, k) => ({
      name: `${Page.number(k * step, 3)} to ${Page.number((k + 1) * step, 3)} mm`,
      colour, symbol: View.SYMBOLS[k],
    }));
    const last = kinds.length - 1;
    return { kinds, of: (i) => Math.min(last, Math.floor((size[i] || 0) / step)) };
  }

  // One class: its targets, and a line to where the tool would land, magnified.
  traces(kind, rows) {
    const marks = { x: [], y: [], z: [] }, lines = { x: [], y: [], z: [] };
    for (const i of rows) {
      const p = this.columns.of("position_mm", i), c = this.columns.of("correction_mm", i);
      const put = (to, f) => { to.x.push(f(0)); to.y.push(f(1)); to.z.push(f(2)); };
      put(marks, (k) => p[k]);
      if (!(this.columns.size[i] > 0)) continue;
      put(lines, (k) => p[k]);
      put(lines, (k) => p[k] - this.scale * c[k]);
      put(lines, () => null);
    }
    const common = { type: "scatter3d", legendgroup: kind.name };
    return [
      { ...common, ...marks, mode: "markers", name: `${kind.name} (${rows.length})`, customdata: rows,
        hovertemplate: "%{text}<extra></extra>", text: rows.map((i) => this.told(i)),
        marker: { size: this.crowd, color: kind.colour, symbol: kind.symbol } },
      { ...common, ...lines, mode: "lines", showlegend: false, hoverinfo: "skip",
        line: { color: kind.colour, width: 4 } },
    ];
  }

  told(i) {
    const c = this.columns;
    const name = View.plain(c.names[c.name[i]]);
    return `target ${c.visit[i]} ${name}<br>line ${View.plain(c.place(i))}, ${c.status_of(i)}<br>`
      + `${Page.number(c.size[i], 3)} mm, joints ${c.arrows(i)}`;
  }

  // Plotly reads a few tags in its texts: take them for what they are, text.
  static plain(text) {
    return text.replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");
  }

  // The way from visit to visit, whatever is filtered.
  path() {
    if (this.way) return this.way;
    const out = { x: [], y: [], z: [] };
    const all = Array.from({ length: this.columns.length }, (_, i) => i);
    for (const i of View.every(all, this.most)) {
      const p = this.columns.of("position_mm", i);
      out.x.push(p[0]); out.y.push(p[1]); out.z.push(p[2]);
    }
    this.way = { ...out, type: "scatter3d", mode: "lines", name: "order of visits", hoverinfo: "skip",
      line: { color: "#b5b5b5", width: 1.5 } };
    return this.way;
  }

  mark() {
    const p = this.selected < 0 ? [null, null, null] : this.columns.of("position_mm", this.selected);
    return { x: [p[0]], y: [p[1]], z: [p[2]], type: "scatter3d", mode: "markers", name: "selected",
      showlegend: this.selected >= 0, hoverinfo: "skip",
      marker: { size: 13, color: Page.COLOURS.black, symbol: "circle-open", line: { width: 3 } } };
  }

  // Draw the rows that the table lists.
  show(rows) {
    const thin = this.thin(rows);
    this.crowd = thin.rows.length > 3000 ? 1.8 : thin.rows.length > 300 ? 2 : 3.4;
    const { kinds, of } = this.classes();
    const members = kinds.map(() => []);
    for (const i of thin.rows) members[of(i)].push(i);
    const traces = [this.path(), this.mark()];
    kinds.forEach((kind, k) => { if (members[k].length) traces.push(...this.traces(kind, members[k])); });
    const aspect = this.aspect();
    const axis = (name) => ({ title: { text: `${name} base [mm]` }, nticks: Math.max(3, Math.round(5 * aspect[name])), backgroundcolor: "#fff",
      gridcolor: "#ddd", zerolinecolor: "#bbb", showspikes: false });
    const done = Page.draw(this.node, traces, {
      margin: { l: 0, r: 0, t: 0, b: 0 }, uirevision: "keep", hovermode: "closest",
      legend: { x: 0, y: 1, bgcolor: "rgba(255,255,255,0.8)", itemsizing: "constant" },
      scene: { aspectmode: "manual", aspectratio: aspect, camera: { eye: { x: 1.55, y: -1.55, z: 1.0 }, center: { x: 0, y: 0, z: -0.16 } }, xaxis: axis("x"), yaxis: axis("y"), zaxis: axis("z") },
    });
    this.note(thin);
    if (!this.listening) this.listen();
    return done;
  }

  // A click takes the target whose label is shown, a drag turns the view.
  listen() {
    this.listening = true;
    let hovered = -1, from = null;
    this.node.on("plotly_hover", ({ points }) => { hovered = points[0].customdata ?? -1; });
    this.node.on("plotly_unhover", () => { hovered = -1; });
    this.node.addEventListener("pointerdown", (e) => { from = [e.clientX, e.clientY]; }, true);
    this.node.addEventListener("pointerup", (e) => {
      const still = from && Math.hypot(e.clientX - from[0], e.clientY - from[1]) < 4;
      if (still && hovered >= 0) this.onPick(hovered);
    }, true);
  }

  note(thin) {
    const some = thin.rows.length < thin.of
      ? ` Showing ${thin.rows.length} of ${thin.of}: uncorrected targets and every k-th of the others; filter to see all of a part.` : "";
    document.getElementById("view-note").textContent =
      `Lines run from each target to where the tool would land uncorrected, drawn ${this.scale} times as long as they are.${some}`;
  }

  select(i) {
    this.selected = i;
    const p = this.columns.of("position_mm", i);
    Plotly.restyle(this.node, { x: [[p[0]]], y: [[p[1]]], z: [[p[2]]], showlegend: true }, [1]);
  }
}

View.THIN = 0.12;  // least proportion of an axis
View.MOST = 12000;  // targets drawn at a time
View.SCALES = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000];
View.LEFT = new Set(["conflict", "rejected", "runtime"]);
View.SHADES = ["#fdc527", "#d9a528", "#8c6f63", "#4a4a8f", "#0d0887"];  // light to dark: told apart in grey too
View.SYMBOLS = ["circle-open", "circle", "diamond-open", "diamond", "square"];
