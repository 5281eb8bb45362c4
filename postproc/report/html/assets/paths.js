"use strict";
// The moves that leave their path the most: a strip each, the curve of the chosen one.

class Paths {
  static WIDTH = 240;
  static HEIGHT = 22;

  constructor(node, paths) {
    this.node = node;
    this.paths = paths;
    this.most = Math.max(...paths.map((path) => Math.max(...path.curve.after_mm)), 1e-6);
    this.rows = paths.map((path, k) => this.row(path, k));
    node.querySelector("tbody").append(...this.rows);
    this.select(0);
  }

  row(path, k) {
    const number = (value, digits) => Page.element("td", { className: "number" }, Page.number(value, digits));
    const button = Page.element("button", { type: "button" }, String(path.line));
    button.addEventListener("click", () => this.select(k));
    return Page.element("tr", {}, Page.element("td", {}, button), Page.element("td", {}, path.move),
      number(path.length_mm, 1), number(path.max_mm.before, 3), number(path.max_mm.after, 3), number(path.at_mm.after, 1),
      Page.element("td", {}, path.joint.after ? `J${path.joint.after}` : "–"), number(path.uncertainty_mm.after, 3),
      Page.element("td", {}, this.strip(path)));
  }

  // The distance from the path along the move, drawn to one scale for all moves.
  strip(path) {
    const space = "http://www.w3.org/2000/svg", { way_mm: way, after_mm: after } = path.curve;
    const svg = document.createElementNS(space, "svg"), line = document.createElementNS(space, "polyline");
    svg.setAttribute("width", Paths.WIDTH);
    svg.setAttribute("height", Paths.HEIGHT);
    svg.setAttribute("role", "img");
    svg.setAttribute("aria-label", `largest ${Page.number(path.max_mm.after, 3)} mm`);
    const length = way[way.length - 1] || 1;
    const place = (s, k) => `${(s / length * (Paths.WIDTH - 2) + 1).toFixed(1)},${(Paths.HEIGHT - 1 - after[k] / this.most * (Paths.HEIGHT - 3)).toFixed(1)}`;
    line.setAttribute("points", way.map(place).join(" "));
    line.setAttribute("fill", "none");
    line.setAttribute("stroke", Page.COLOURS.blue);
    line.setAttribute("stroke-width", "1.5");
    svg.append(line);
    for (const point of path.points || []) svg.append(this.mark(space, point.at_mm / length));
    return svg;
  }

  // A point that was put on the way: a small triangle at the foot of the strip.
  mark(space, share) {
    const shape = document.createElementNS(space, "path"), x = share * (Paths.WIDTH - 2) + 1;
    shape.setAttribute("d", `M${x.toFixed(1)},${Paths.HEIGHT - 5} l3,5 h-6 z`);
    shape.setAttribute("fill", Page.COLOURS.vermillion);
    return shape;
  }

  select(k) {
    this.rows.forEach((row, i) => row.classList.toggle("selected", i === k));
    const path = this.paths[k], { way_mm: x } = path.curve, points = path.points || [];
    const marks = { type: "scatter", mode: "markers", name: "points", x: points.map((point) => point.at_mm), y: points.map(() => 0),
      marker: { symbol: "triangle-up", size: 9, color: Page.COLOURS.vermillion }, hovertemplate: "%{x:.1f} mm<extra>point</extra>" };
    const curve = (name, y, colour, dash) => ({ type: "scatter", mode: "lines", name, x, y, line: { color: colour, dash },
      hovertemplate: "%{x:.1f} mm: %{y:.3f} mm<extra></extra>" });
    Page.draw(document.getElementById("path-curve"), [
      curve("before", path.curve.before_mm, Page.COLOURS.vermillion, "dot"), curve("after", path.curve.after_mm, Page.COLOURS.blue, "solid"),
      ...(points.length ? [marks] : [])], {
      legend: { orientation: "h", x: 0, y: 1.02, yanchor: "bottom", traceorder: "normal" }, margin: { l: 56, r: 16, t: 30, b: 44 },
      xaxis: { title: { text: `way on the move to line ${path.line} [mm]` } }, yaxis: { title: { text: "from the path [mm]" }, rangemode: "tozero" },
    });
  }
}
