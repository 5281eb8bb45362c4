"use strict";
// The table of targets: search, filter, sort, a page at a time.

class Table {
  constructor(columns, listing, onRows, onPick) {
    this.columns = columns;
    this.listing = listing;
    this.onRows = onRows;
    this.onPick = onPick;
    this.sorting = { key: "visit", down: false };
    this.rows = Array.from({ length: columns.length }, (_, i) => i);
    this.page = 0;
    this.selected = -1;
    this.words = null;
    this.body = document.querySelector("#targets tbody");
    Sheets.whole.set(this.body.parentElement, () => this.sheet());
    this.head();
    this.controls();
  }

  head() {
    const row = document.querySelector("#targets thead tr");
    for (const { key, label, title } of Table.FIELDS) {
      const button = Page.element("button", { type: "button", title: title || label }, label);
      button.addEventListener("click", () => this.sort(key));
      row.append(Page.element("th", { scope: "col", "data-key": key }, button));
    }
  }

  controls() {
    const search = document.getElementById("search");
    search.addEventListener("input", () => this.update());
    const box = document.getElementById("statuses");
    const counts = new Array(this.columns.statuses.length).fill(0);
    for (const s of this.columns.status) counts[s]++;
    this.columns.statuses.forEach((status, s) => {
      if (!counts[s]) return;
      const input = Page.element("input", { type: "checkbox", checked: true, value: String(s) });
      input.addEventListener("change", () => this.update());
      const { mark, told } = Columns.STATUS[status];
      box.append(Page.element("label", { title: told }, input, ` ${mark} ${status} (${counts[s]})`));
    });
    document.getElementById("earlier").addEventListener("click", () => this.turn(this.page - 1));
    document.getElementById("later").addEventListener("click", () => this.turn(this.page + 1));
    this.body.addEventListener("click", (event) => {
      const row = event.target.closest("tr");
      if (row) this.onPick(Number(row.dataset.row));
    });
    this.body.parentElement.addEventListener("keydown", (event) => this.key(event));
  }

  key(event) {
    const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (!step || !event.target.closest("tbody")) return;
    event.preventDefault();
    const at = this.rows.indexOf(this.selected) + step;
    if (at >= 0 && at < this.rows.length) this.onPick(this.rows[at]);
  }

  // What a search looks through, in small letters, made when first needed.
  haystack() {
    if (this.words) return this.words;
    const c = this.columns;
    this.words = new Array(c.length);
    for (let i = 0; i < c.length; i++) {
      const text = this.listing.text(c.files[c.file[i]], c.line[i]) || "";
      this.words[i] = `${c.names[c.name[i]]}\n${c.place(i)}\n${c.moves[c.move[i]]}\n${c.reasons[c.why[i]]}\n${text}`.toLowerCase();
    }
    return this.words;
  }

  update() {
    const wanted = new Set([...document.querySelectorAll("#statuses input:checked")].map((n) => Number(n.value)));
    const terms = document.getElementById("search").value.toLowerCase().split(/\s+/).filter(Boolean);
    const words = terms.length ? this.haystack() : null;
    const status = this.columns.status;
    const rows = [];
    for (let i = 0; i < this.columns.length; i++) {
      if (wanted.has(status[i]) && (!words || terms.every((t) => words[i].includes(t)))) rows.push(i);
    }
    this.rows = rows;
    this.order();
    this.turn(0);
    this.onRows(rows);
  }

  sort(key) {
    const down = this.sorting.key === key ? !this.sorting.down : Table.FIELDS.find((f) => f.key === key).down || false;
    this.sorting = { key, down };
    this.order();
    this.turn(0);
  }

  order() {
    const { key, down } = this.sorting;
    const field = Table.FIELDS.find((f) => f.key === key);
    const values = new Array(this.columns.length);
    for (const i of this.rows) values[i] = field.value(this.columns, i);
    const sign = down ? -1 : 1;
    const blank = (v) => v === "" || Number.isNaN(v);
    this.rows.sort((a, b) => {
      const u = values[a], v = values[b];
      if (blank(u) || blank(v)) return blank(u) - blank(v) || a - b;  // what is not known comes last
      return (u < v ? -sign : u > v ? sign : 0) || a - b;
    });
    for (const th of document.querySelectorAll("#targets th")) {
      th.setAttribute("aria-sort", th.dataset.key !== key ? "none" : down ? "descending" : "ascending");
    }
  }

  turn(page) {
    const pages = Math.max(1, Math.ceil(this.rows.length / Table.LENGTH));
    this.page = Math.min(Math.max(page, 0), pages - 1);
    const first = this.page * Table.LENGTH;
    const shown = this.rows.slice(first, first + Table.LENGTH);
    this.body.replaceChildren(...shown.map((i) => this.row(i)));
    const to = first + shown.length;
    document.getElementById("where").textContent = shown.length
      ? `${first + 1} to ${to} of ${this.rows.length}` : "no target matches";
    document.getElementById("earlier").disabled = this.page === 0;
    document.getElementById("later").disabled = this.page === pages - 1;
  }

  row(i) {
    const row = Page.element("tr", { tabIndex: i === this.selected ? 0 : -1, "data-row": i,
      className: `${this.columns.status_of(i)}${i === this.selected ? " selected" : ""}` });
    for (const { cell, kind } of Table.FIELDS) {
      row.append(Page.element("td", { className: kind || "" }, cell(this.columns, i)));
    }
    return row;
  }

  // All targets as rows of a sheet, in program order.
  sheet() {
    const rows = [Table.FIELDS.map((f) => f.title && f.kind === "number" ? `${f.label} (${f.title})` : f.label)];
    for (let i = 0; i < this.columns.length; i++) {
      rows.push(Table.FIELDS.map((f) => Sheets.value(f.cell(this.columns, i))));
    }
    return rows;
  }

  // All targets for a printer, in program order; nothing of them stays on the screen.
  print() {
    const head = document.querySelector("#all-targets thead tr");
    head.replaceChildren(...Table.PRINTED.map((f) => Page.element("th", { scope: "col" }, f.label)));
    const rows = [];
    for (let i = 0; i < this.columns.length; i++) {
      rows.push(Page.element("tr", { className: this.columns.status_of(i) },
        ...Table.PRINTED.map((f) => Page.element("td", { className: f.kind || "" }, f.cell(this.columns, i)))));
    }
    document.querySelector("#all-targets tbody").replaceChildren(...rows);
  }

  forgetPrint() {
    document.querySelector("#all-targets tbody").replaceChildren();
  }

  // Show a row: turn to its page, mark it.
  select(i, focus) {
    this.selected = i;
    const at = this.rows.indexOf(i);
    this.turn(at < 0 ? this.page : Math.floor(at / Table.LENGTH));
    const row = this.body.querySelector("tr.selected");
    if (!row) return;
    const frame = this.body.closest(".scroll"), top = row.offsetTop, head = 34;
    if (top - head < frame.scrollTop) frame.scrollTop = top - head;
    const under = top + row.offsetHeight - frame.clientHeight;
    if (under > frame.scrollTop) frame.scrollTop = under;
    if (focus) row.focus({ preventScroll: true });
  }
}

Table.LENGTH = 100;
{
  // What scripts add to the columns that the page states: how they are sorted and shown.
  const number = (value) => ({ value, cell: (c, i) => Page.number(value(c, i), 3) });
  const text = (value) => ({ value, cell: (c, i) => value(c, i) });
  const changed = (value) => ({ value: (c, i) => (c.size[i] > 0 ? value(c, i) : NaN), cell: (c, i) => (c.size[i] > 0 ? Page.number(value(c, i), 3) : "") });
  const axis = (k) => changed((c, i) => c.of("correction_mm", i)[k]);
  const expected = (k) => number((c, i) => c.of("expected_mm", i)[k]);
  Table.CELLS = {
    visit: { value: (c, i) => c.visit[i], cell: (c, i) => String(c.visit[i]) },
    line: { value: (c, i) => c.file[i] * 1e9 + c.line[i], cell: (c, i) => c.place(i) },
    name: text((c, i) => c.names[c.name[i]]),
    move: text((c, i) => c.moves[c.move[i]]),
    status: { value: (c, i) => Table.URGENCY.indexOf(c.status_of(i)), cell: (c, i) => `${Columns.STATUS[c.status_of(i)].mark} ${c.status_of(i)}` },
    expected: expected(1), bound: expected(2), before: expected(0),
    verdict: text((c, i) => c.verdicts[c.verdict[i]]),
    size: changed((c, i) => c.size[i]),
    dx: axis(0), dy: axis(1), dz: axis(2),
    sigma: number((c, i) => c.sigma[i]),
    sides: text((c, i) => c.arrows(i)),
    why: text((c, i) => c.reasons[c.why[i]]),
  };
}
Table.FIELDS = [];
Table.PRINTED = [];
Table.take = (fields) => {
  Table.FIELDS = fields.map((field) => ({ ...field, ...Table.CELLS[field.key] }));
  const printed = ["visit", "line", "name", "status", "before", "expected", "bound", "verdict", "dx", "dy", "dz", "why"];
  Table.PRINTED = printed.map((key) => Table.FIELDS.find((f) => f.key === key));
};
Table.URGENCY = ["conflict", "rejected", "runtime", "corrected", "unchanged"];
