"use strict";
// The program page: table, view, source and figures, each following the others.

class ProgramPage {
  constructor(data) {
    const columns = new Columns(data.columns);
    Table.take(data.fields);
    const listing = new Listing(data.listing);
    this.columns = columns;
    this.detail = new Detail(document.getElementById("detail"), columns, listing);
    this.table = new Table(columns, listing, (rows) => this.filtered(rows), (i) => this.select(i, true));
    const node = document.getElementById("view");
    this.view = node && new View(node, columns, (i) => this.select(i, false));
  }

  // The table first; the view, which takes longer, when the table is on the screen.
  async start(data) {
    this.table.order();
    this.table.turn(0);
    performance.mark("table");
    await new Promise((resolve) => setTimeout(resolve));
    if (this.view) this.controls();
    this.histogram(data.histogram);
    if (data.paths.length) new Paths(document.getElementById("path-rows"), data.paths);
    window.addEventListener("beforeprint", () => this.table.print());
    window.addEventListener("afterprint", () => this.table.forgetPrint());
    window.addEventListener("hashchange", () => this.follow());
    const idle = window.requestIdleCallback || ((f) => setTimeout(f, 200));
    idle(() => this.table.haystack());
    if (this.view) await this.redraw();
    performance.mark("view");
    if (this.columns.length) this.show(this.worst());
    this.follow();
  }

  controls() {
    const mode = document.getElementById("mode"), scale = document.getElementById("scale");
    for (const s of View.SCALES) scale.append(Page.element("option", { value: s }, `× ${s}`));
    scale.value = String(this.view.scale);
    mode.addEventListener("change", () => { this.view.mode = mode.value; this.redraw(); });
    scale.addEventListener("change", () => { this.view.scale = Number(scale.value); this.redraw(); });
  }

  redraw() {
    return this.view.show(this.table.rows.slice().sort((a, b) => a - b));
  }

  // The table answers at once; the view follows when typing pauses.
  filtered() {
    if (!this.view) return;
    clearTimeout(this.waiting);
    this.waiting = setTimeout(() => this.redraw(), 250);
  }

  show(i) {
    this.detail.show(i);
    if (this.view) this.view.select(i);
  }

  select(i, focus) {
    this.table.select(i, focus);
    this.show(i);
    document.body.dataset.selected = this.columns.visit[i];
  }

  // The target with the largest bound of its error, else with the largest correction.
  worst() {
    const c = this.columns, key = (i) => c.of("expected_mm", i)[2] || 0;
    let worst = 0;
    for (let i = 1; i < c.length; i++) {
      if (key(i) > key(worst) || (key(i) === key(worst) && c.size[i] > c.size[worst])) worst = i;
    }
    return worst;
  }

  // A link to #target-12 selects visit 12.
  follow() {
    const found = /^#target-(\d+)$/.exec(location.hash);
    const i = found ? this.columns.row.get(Number(found[1])) : undefined;
    if (i === undefined) return;
    this.select(i, false);
    document.getElementById("bench").scrollIntoView();
  }

  histogram({ edges_mm: edges, counts }) {
    const node = document.getElementById("histogram");
    if (!counts.length) { node.replaceChildren("No target was corrected."); return; }
    const x = counts.map((_, k) => (edges[k] + edges[k + 1]) / 2);
    Page.draw(node, [{ type: "bar", x, y: counts, width: edges[1] - edges[0],
      marker: { color: Page.COLOURS.blue, line: { color: "#fff", width: 1 } },
      hovertemplate: "%{x:.3f} mm: %{y}<extra></extra>" }], {
      bargap: 0, xaxis: { title: { text: "length of the correction [mm]" }, rangemode: "tozero" },
      yaxis: { title: { text: "targets" } },
    });
  }
}

Page.data()
  .then((data) => { performance.mark("data"); return data; })
  .then((data) => new ProgramPage(data).start(data))
  .then(() => { document.body.dataset.ready = "yes"; })
  .catch((problem) => Page.trouble(problem));
