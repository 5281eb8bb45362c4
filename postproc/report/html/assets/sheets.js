"use strict";
// Every table of the page as CSV and as a workbook, made in the page: nothing is sent.

const Sheets = {
  whole: new Map(),  // element -> () => rows, where the page shows only a part of a table

  // Numbers stay numbers; what is not known is empty.
  value(text) {
    const plain = text.replaceAll("−", "-").replace(/\s+/g, " ").trim();
    if (plain === "–") return "";
    return /^-?\d+(\.\d+)?$/.test(plain) ? Number(plain) : plain;
  },

  rows(table) {
    const own = Sheets.whole.get(table);
    if (own) return own();
    return [...table.rows].map((row) => [...row.cells].map((cell) => Sheets.value(cell.textContent)));
  },

  title(table) {
    if (table.dataset.sheet) return table.dataset.sheet;
    const heading = table.caption || table.closest("section")?.querySelector("h2, h3");
    return heading ? heading.textContent.trim() : "table";
  },

  tables() {
    return [...document.querySelectorAll("main table")].filter((t) => !t.dataset.copy && t.rows.length);
  },

  csv(rows) {
    const cell = (v) => {
      const text = typeof v === "string" && /^[=+@-]/.test(v) ? `'${v}` : String(v);
      return /[",\r\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
    };
    return rows.map((row) => row.map(cell).join(",") + "\r\n").join("");
  },

  save(name, parts, type) {
    const url = URL.createObjectURL(new Blob(parts, { type }));
    const link = Page.element("a", { href: url, download: name });
    link.click();
    setTimeout(() => URL.revokeObjectURL(url), 10000);
  },

  file(ending) {
    const base = document.querySelector("h1").textContent.trim().replace(/[^\w.-]+/g, "_");
    return `${base}.${ending}`;
  },

  start() {
    for (const table of Sheets.tables()) {
      const title = Sheets.title(table);
      const button = Page.element("button", { type: "button", className: "save", title: `Save the table "${title}" as CSV` }, "CSV");
      button.addEventListener("click", () => Sheets.save(Sheets.file(`${title.replace(/\W+/g, "_")}.csv`),
        ["\ufeff", Sheets.csv(Sheets.rows(table))], "text/csv"));
      const heading = table.closest("section")?.querySelector("h2"), scroll = table.closest(".scroll");
      if (heading) heading.after(button);
      else if (scroll?.previousElementSibling?.classList.contains("bar")) scroll.previousElementSibling.append(button);
      else table.before(button);
    }
    document.getElementById("save-tables")?.addEventListener("click", () => Workbook.save());
    document.getElementById("print")?.addEventListener("click", () => window.print());
  },
};

// A workbook: XML in a zip archive whose entries are stored as they are.
const Workbook = {
  escape(text) {
    return text.replace(/[\x00-\x08\x0b\x0c\x0e-\x1f]/g, "").replaceAll("&", "&amp;").replaceAll("<", "&lt;").replaceAll(">", "&gt;").replaceAll('"', "&quot;");
  },

  sheet(rows) {
    const cell = (v) => (typeof v === "number" ? `<c><v>${v}</v></c>`
      : `<c t="inlineStr"><is><t xml:space="preserve">${Workbook.escape(String(v))}</t></is></c>`);
    const body = rows.map((row) => `<row>${row.map(cell).join("")}</row>`).join("");
    return `${Workbook.HEAD}<worksheet xmlns="${Workbook.MAIN}"><sheetData>${body}</sheetData></worksheet>`;
  },

  // At most 31 characters, and no name twice.
  names(titles) {
    const used = new Set();
    return titles.map((title) => {
      const base = title.replace(/[[\]:*?/\\']/g, " ").slice(0, 27).trim() || "table";
      let name = base;
      for (let k = 2; used.has(name.toLowerCase()); k++) name = `${base} ${k}`;
      used.add(name.toLowerCase());
      return name;
    });
  },

  files(sheets) {
    const types = "http://schemas.openxmlformats.org/package/2006/content-types";
    const relations = "http://schemas.openxmlformats.org/package/2006/relationships";
    const office = "http://schemas.openxmlformats.org/officeDocument/2006/relationships";
    const kind = "application/vnd.openxmlformats-officedocument.spreadsheetml";
    const names = Workbook.names(sheets.map(([title]) => title));
    const each = (f) => sheets.map((_, k) => f(k + 1)).join("");
    const files = {
      "[Content_Types].xml": `${Workbook.HEAD}<Types xmlns="${types}"><Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/><Default Extension="xml" ContentType="application/xml"/><Override PartName="/xl/workbook.xml" ContentType="${kind}.sheet.main+xml"/>${each((k) => `<Override PartName="/xl/worksheets/sheet${k}.xml" ContentType="${kind}.worksheet+xml"/>`)}</Types>`,
      "_rels/.rels": `${Workbook.HEAD}<Relationships xmlns="${relations}"><Relationship Id="r1" Type="${office}/officeDocument" Target="xl/workbook.xml"/></Relationships>`,
      "xl/workbook.xml": `${Workbook.HEAD}<workbook xmlns="${Workbook.MAIN}" xmlns:r="${office}"><sheets>${each((k) => `<sheet name="${Workbook.escape(names[k - 1])}" sheetId="${k}" r:id="r${k}"/>`)}</sheets></workbook>`,
      "xl/_rels/workbook.xml.rels": `${Workbook.HEAD}<Relationships xmlns="${relations}">${each((k) => `<Relationship Id="r${k}" Type="${office}/worksheet" Target="worksheets/sheet${k}.xml"/>`)}</Relationships>`,
    };
    sheets.forEach(([, rows], k) => { files[`xl/worksheets/sheet${k + 1}.xml`] = Workbook.sheet(rows); });
    return files;
  },

  check(bytes) {
    let sum = 0xffffffff;
    for (const byte of bytes) sum = Workbook.TABLE[(sum ^ byte) & 255] ^ (sum >>> 8);
    return (sum ^ 0xffffffff) >>> 0;
  },

  // Numbers of 2 and 4 bytes, the low one first.
  bytes(...fields) {
    const out = [];
    for (const [value, size] of fields) for (let k = 0; k < size; k++) out.push((value >>> (8 * k)) & 255);
    return new Uint8Array(out);
  },

  zip(files) {
    const parts = [], list = [], encoder = new TextEncoder();
    let at = 0, listed = 0;
    for (const [name, text] of Object.entries(files)) {
      const path = encoder.encode(name), data = encoder.encode(text);
      const same = [[20, 2], [0x800, 2], [0, 2], [0, 2], [0x21, 2], [Workbook.check(data), 4], [data.length, 4], [data.length, 4], [path.length, 2], [0, 2]];
      const head = Workbook.bytes([0x04034b50, 4], ...same);
      const entry = Workbook.bytes([0x02014b50, 4], [20, 2], ...same, [0, 2], [0, 2], [0, 2], [0, 4], [at, 4]);
      parts.push(head, path, data);
      list.push(entry, path);
      at += head.length + path.length + data.length;
      listed += entry.length + path.length;
    }
    const count = Object.keys(files).length;
    const end = Workbook.bytes([0x06054b50, 4], [0, 2], [0, 2], [count, 2], [count, 2], [listed, 4], [at, 4], [0, 2]);
    return [...parts, ...list, end];
  },

  make() {
    return Workbook.zip(Workbook.files(Sheets.tables().map((table) => [Sheets.title(table), Sheets.rows(table)])));
  },

  save() {
    Sheets.save(Sheets.file("xlsx"), Workbook.make(), "application/vnd.openxmlformats-officedocument.spreadsheetml.sheet");
  },
};

Workbook.HEAD = '<?xml version="1.0" encoding="UTF-8" standalone="yes"?>\n';
Workbook.MAIN = "http://schemas.openxmlformats.org/spreadsheetml/2006/main";
Workbook.TABLE = Array.from({ length: 256 }, (_, n) => {
  let c = n;
  for (let k = 0; k < 8; k++) c = c & 1 ? 0xedb88320 ^ (c >>> 1) : c >>> 1;
  return c >>> 0;
});

Sheets.start();
