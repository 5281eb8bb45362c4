"use strict";
// The source lines, and what is known of one target.

class Listing {
  constructor(files) {
    this.files = new Map();
    for (const [name, { line, text }] of Object.entries(files)) {
      const lines = new Map();
      let at = 0;
      for (let k = 0; k < line.length; k += 2) {
        for (let n = 0; n < line[k + 1]; n++) lines.set(line[k] + n, text[at++]);
      }
      this.files.set(name, lines);
    }
  }

  text(file, line) {
    const lines = this.files.get(file);
    return lines ? lines.get(line) : undefined;
  }

  // Lines around one, as elements; the line itself is marked.
  around(file, line, reach) {
    const block = Page.element("pre", { className: "listing" });
    for (let k = Math.max(1, line - reach); k <= line + reach; k++) {
      const text = this.text(file, k);
      if (text === undefined) continue;
      const mine = k === line;
      block.append(Page.element("span", { className: mine ? "here" : "", "data-line": k },
        `${mine ? "▶" : " "}${String(k).padStart(6)}  ${text}\n`));
    }
    return block;
  }
}

class Detail {
  constructor(node, columns, listing) {
    this.node = node;
    this.columns = columns;
    this.listing = listing;
  }

  show(i) {
    const c = this.columns;
    const status = Columns.STATUS[c.status_of(i)];
    const title = `${status.mark} target ${c.visit[i]} ${c.names[c.name[i]]}`.trimEnd();
    const why = c.reasons[c.why[i]];
    this.node.replaceChildren(
      Page.element("h3", {}, title),
      Page.element("p", {}, `${c.moves[c.move[i]]}, ${status.told}${why ? ` – ${why}` : ""}`),
      ...this.source(i),
      Page.element("div", { className: "pair" }, this.tool(i), this.shares(i), this.free(i), this.joints(i)),
      this.numbers(i),
    );
    const here = this.node.querySelector(".here");
    if (here) here.parentElement.scrollTop = here.offsetTop - here.parentElement.offsetTop - 40;
  }

  // The move, and the literal where it stands elsewhere.
  source(i) {
    const c = this.columns, out = [];
    const places = [[c.files[c.file[i]], c.line[i], "move"]];
    const literal = c.literal_file[i] < 0 ? null : [c.files[c.literal_file[i]], c.literal_line[i], "numbers"];
    if (literal && (literal[0] !== places[0][0] || Math.abs(literal[1] - places[0][1]) > 4)) places.push(literal);
    for (const [file, line, what] of places) {
      out.push(Page.element("h4", {}, `${what}: ${file}, line ${line}`));
      if (this.listing.text(file, line) !== undefined) out.push(this.listing.around(file, line, 4));
    }
    return out;
  }

  static table(caption, head, rows) {
    const cells = (tag, row) => row.map((v, k) => Page.element(k ? tag : "th", { className: "number" }, v));
    return Page.element("table", { className: "small" },
      Page.element("caption", {}, caption),
      Page.element("thead", {}, Page.element("tr", {}, ...cells("th", head))),
      Page.element("tbody", {}, ...rows.map((row) => Page.element("tr", {}, ...cells("td", row)))));
  }

  tool(i) {
    const c = this.columns, told = (key, digits) => [...c.of(key, i)].map((v) => Page.number(v, digits));
    return Detail.table("Tool, base frame [mm]", ["", "x", "y", "z", "length"], [
      ["position", ...told("position_mm", 2), ""],
      ["correction", ...told("correction_mm", 4), Page.number(c.size[i], 4)],
      ["± std error", ...told("std_mm", 4), Page.number(c.sigma[i], 4)],
    ]);
  }

  // Which effect has which share in the predicted error, the largest first.
  shares(i) {
    const c = this.columns, sizes = [...c.of("share_mm", i)];
    if (!sizes.some(Number.isFinite)) return "";
    const known = sizes.map((v) => (Number.isFinite(v) ? v : 0));
    const order = known.map((_, k) => k).sort((a, b) => known[b] - known[a]);
    const most = known[order[0]] || 1;
    const rows = order.map((k) => Page.element("tr", {},
      Page.element("th", { scope: "row" }, c.effects[k]),
      Page.element("td", { className: "number" }, Page.number(sizes[k], 4)),
      Page.element("td", { className: "wide" }, Page.element("meter", { min: 0, max: most, value: known[k] }))));
    return Page.element("table", { className: "small shares" },
      Page.element("caption", {}, "Shares in the predicted error [mm]"), Page.element("tbody", {}, ...rows));
  }

  // What free forms, which no law explains, have of it, and how surely.
  free(i) {
    const c = this.columns, told = ["nonparametric_mm", "nonparametric_std_mm"].map((key) => [...c.of(key, i)]);
    if (!told[0].length) return "";
    const cells = (values) => [...values, Math.hypot(...values)].map((v) => Page.number(v, 4));
    return Detail.table("Of it free forms, base frame [mm]", ["", "x", "y", "z", "length"],
      [["error", ...cells(told[0])], ["± std error", ...cells(told[1])]]);
  }

  joints(i) {
    const c = this.columns;
    return Detail.table("Joints", ["", "1", "2", "3", "4", "5", "6"], [
      ["angle [deg]", ...[...c.of("q_deg", i)].map((v) => Page.number(v, 2))],
      ["arrives", ...c.arrows(i)],
    ]);
  }

  numbers(i) {
    const c = this.columns;
    let original = [...c.of("original", i)], change = [...c.of("change", i)];
    if (original.every(Number.isNaN)) return "";
    // Of joint angles there are six, whatever a pose takes.
    const pose = original.slice(6).some(Number.isFinite) || original.length === 6;
    if (!pose) [original, change] = [original.slice(0, 6), change.slice(0, 6)];
    const heads = pose && c.heads.length === original.length ? c.heads : original.map((_, k) => String(k + 1));
    return Detail.table("Numbers in the file", ["", ...heads], [
      ["original", ...original.map((v) => Page.number(v, 4))],
      ["corrected", ...original.map((v, k) => Page.number(v + change[k], 4))],
      ["change", ...change.map((v) => Page.number(v, 4))],
    ]);
  }
}
