"use strict";
// The visits as typed columns.

class Columns {
  constructor(packed) {
    this.files = packed.files;
    this.names = packed.names;
    this.reasons = packed.reasons;
    this.moves = packed.moves;
    this.statuses = packed.statuses;
    this.effects = packed.effects;
    this.heads = packed.heads;
    this.verdicts = packed.verdicts;
    Object.assign(this, packed.index);
    this.length = this.visit.length;
    this.direction = packed.direction;
    this.numbers = {};
    for (const [key, { step, width, values }] of Object.entries(packed.numbers)) {
      const column = new Float64Array(values.length);
      for (let i = 0; i < values.length; i++) {
        column[i] = values[i] === null ? NaN : values[i] * step;
      }
      this.numbers[key] = { width, column };
    }
    this.size = this.lengths("correction_mm");
    this.sigma = this.lengths("std_mm");
    this.several = new Set(this.file).size > 1;
    this.row = new Map(this.visit.map((v, i) => [v, i]));
  }

  // The numbers of one visit.
  of(key, i) {
    const { width, column } = this.numbers[key];
    return column.subarray(i * width, (i + 1) * width);
  }

  lengths(key) {
    const { column } = this.numbers[key];
    const out = new Float64Array(this.length);
    for (let i = 0; i < this.length; i++) {
      out[i] = Math.hypot(column[3 * i], column[3 * i + 1], column[3 * i + 2]);
    }
    return out;
  }

  // -1, 0 or 1 of joint 0 to 5.
  side(i, joint) {
    return "-0+".indexOf(this.direction[6 * i + joint]) - 1;
  }

  arrows(i) {
    let out = "";
    for (let j = 0; j < 6; j++) out += Columns.ARROWS[this.side(i, j) + 1];
    return out;
  }

  place(i) {
    return (this.several ? `${this.files[this.file[i]]}:` : "") + this.line[i];
  }

  status_of(i) {
    return this.statuses[this.status[i]];
  }
}

Columns.ARROWS = ["↓", "·", "↑"];
Columns.STATUS = {
  corrected: { mark: "●", symbol: "circle", colour: Page.COLOURS.blue, told: "corrected" },
  conflict: { mark: "■", symbol: "square", colour: Page.COLOURS.vermillion, told: "conflict: arrivals disagree" },
  rejected: { mark: "◆", symbol: "diamond", colour: Page.COLOURS.orange, told: "rejected: correction not trusted" },
  runtime: { mark: "✚", symbol: "cross", colour: Page.COLOURS.purple, told: "runtime: value known at run time only" },
  unchanged: { mark: "○", symbol: "circle-open", colour: Page.COLOURS.grey, told: "unchanged: nothing to correct" },
};
