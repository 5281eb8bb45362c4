"""Made-up exports of one survey: layouts of many tools, in three languages.

A layout is a function of rows and a locale. What it writes is what the tool of its name
would: the same ids, joint angles and places for all of them.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from postproc.arrays import Floats

MM_PER = {"mm": 1.0, "m": 1000.0, "inch": 25.4, "ft": 304.8}


@dataclass(frozen=True)
class Rows:
    """Ids, joint angles (n, 6) [deg] and places (n, 3) [mm]."""

    ids: tuple[str, ...]
    q: Floats
    xyz: Floats


@dataclass(frozen=True)
class Locale:
    """How a country writes numbers, tables and words."""

    decimal: str
    thousands: str
    split: str
    encoding: str
    point: str
    axis: str
    actual: str
    nominal: str
    deviation: str
    degrees: str
    inches: str
    feet: str
    title: str

    def number(self, value: float, digits: int = 4, thousands: bool = False) -> str:
        """Write a number as the country does."""
        text = f"{value:,.{digits}f}" if thousands else f"{value:.{digits}f}"
        signs = {",": self.thousands, ".": self.decimal}
        return "".join(signs.get(c, c) for c in text)


LOCALES = {
    "en": Locale(
        ".", ",", ",", "utf-8", "Point", "Joint", "Actual", "Nominal", "Deviation",
        "deg", "in", "ft", "Survey of cell 7",
    ),
    "de": Locale(
        ",", ".", ";", "latin-1", "Punktname", "Achse", "Ist", "Soll", "Abweichung",
        "Grad", "Zoll", "Fuß", "Prüfprotokoll für Zelle 7",
    ),
    "fr": Locale(
        ",", "\u202f", ";", "utf-8-sig", "Nom du point", "Axe", "Mesuré", "Théorique",
        "Écart", "degrés", "pouces", "pieds", "Relevé de la cellule nº 7",
    ),
}  # fmt: skip


def table(rows: Sequence[Sequence[str]], split: str) -> str:
    """Join cells; those with the separator or blanks are quoted."""
    return "\r\n".join(
        split.join(f'"{c}"' if split in c else c for c in row) for row in rows
    )


def cells(
    rows: Rows, at: Locale, unit: str = "mm", rad: bool = False
) -> list[list[str]]:
    """Write id, joints and places of every row."""
    q, xyz = (np.deg2rad(rows.q) if rad else rows.q), rows.xyz / MM_PER[unit]
    fine = 4 if unit == "mm" else 7
    return [
        [name, *(at.number(v, 7) for v in a), *(at.number(v, fine) for v in p)]
        for name, a, p in zip(rows.ids, q, xyz, strict=True)
    ]


def points(rows: Rows, at: Locale, unit: str = "mm", **how: bool) -> list[list[str]]:
    """Write id and places of every row."""
    fine = 4 if unit == "mm" else 7
    return [
        [name, *(at.number(v / MM_PER[unit], fine, **how) for v in p)]
        for name, p in zip(rows.ids, rows.xyz, strict=True)
    ]


def axes(pattern: str) -> list[str]:
    """Write the names of six joints."""
    return [pattern.format(k) for k in range(1, 7)]


# Layouts with joint angles.


def sheet(rows: Rows, at: Locale) -> str:
    """Excel: units in brackets behind the names."""
    head = [at.point, *axes(f"{at.axis} {{}} [°]"), "X [mm]", "Y [mm]", "Z [mm]"]
    text = table([head, *cells(rows, at)], at.split)
    return text.replace("°", "deg") if at.encoding == "ascii" else text


def units_below(rows: Rows, at: Locale) -> str:
    """A data logger: names, then a row of units; tabs; feet."""
    head = ["Nr", *axes("J{}"), "X", "Y", "Z"]
    units = ["", *[at.degrees] * 6, *[at.feet] * 3]
    return table([head, units, *cells(rows, at, "ft")], "\t")


def inches(rows: Rows, at: Locale) -> str:
    """Measured and nominal places in inches, radians."""
    unit = at.inches
    head = [
        at.point, *axes("A{} (rad)"), *(f"{a} {at.actual} [{unit}]" for a in "XYZ"),
        *(f"{a} {at.nominal} [{unit}]" for a in "XYZ"),
    ]  # fmt: skip
    body = [
        [*row, *(at.number(v / 25.4 + 0.05, 7) for v in p)]
        for row, p in zip(cells(rows, at, "inch", True), rows.xyz, strict=True)
    ]
    return table([head, *body], ";")


def no_units(rows: Rows, at: Locale) -> str:
    """Names without any unit, degrees and millimetres."""
    return table([["Name", *axes("q{}"), "x", "y", "z"], *cells(rows, at)], ";")


def radians_and_metres(rows: Rows, at: Locale) -> str:
    """Names without any unit, radians and metres: only the arm can tell."""
    head = ["Name", *axes("joint_{}"), "x", "y", "z"]
    return table([head, *cells(rows, at, "m", True)], "\t")


def from_excel(rows: Rows, at: Locale) -> str:
    """The line sep=, comments, separators at the ends of rows, thousands."""
    head = [at.point, *axes("Axis{}_deg"), "X_mm", "Y_mm", "Z_mm", "", ""]
    body = [
        [*row[:7], *(at.number(v, 4, True) for v in p), "", ""]
        for row, p in zip(cells(rows, at), rows.xyz, strict=True)
    ]
    split = "|" if at.split == "," else at.split
    return f"sep={split}\r\n# {at.title}\r\n" + table([head, *body], split)


def quoted(rows: Rows, at: Locale) -> str:
    """Commas between cells, so that decimal commas are quoted."""
    head = [
        "Pose",
        *axes(f"{at.axis}_{{}} ({at.degrees})"),
        "X (mm)",
        "Y (mm)",
        "Z (mm)",
    ]
    return table([head, *cells(rows, at)], ",")


def bare_joints(rows: Rows, at: Locale) -> str:
    """No header: name, place, zeros, joints, as DELMIA writes it."""
    body = [[r[0], *r[7:], "0", "0", "0", *r[1:7]] for r in cells(rows, at)]
    return "// DELMIA\r\n" + table(body, "\t")


def robodk(rows: Rows, at: Locale) -> str:
    """18 columns of a calibration project: joints, place, turns, TCP, its turns."""
    tcp = [at.number(v) for v in (0.0, 0.0, 0.0, *TOOL, 0.0, 0.0, 0.0)]
    return table([[*row[1:], *tcp] for row in cells(rows, at)], at.split)


# Layouts without joint angles, joined with the program.


def analyzer(rows: Rows, at: Locale) -> str:
    """SpatialAnalyzer: collection, group, target, with a header."""
    head = ["Collection", "Group", "Target", "X [mm]", "Y [mm]", "Z [mm]"]
    body = [["A", "Main", *row] for row in points(rows, at)]
    lines = f"// SpatialAnalyzer\r\n// {at.title}\r\n"
    return lines + table([head, *body], at.split)


def analyzer_bare(rows: Rows, at: Locale) -> str:
    """SpatialAnalyzer: the same without a header, in inches that a comment states."""
    body = [["A", "Main", *row] for row in points(rows, at, "inch")]
    return "// Frame: A::base\r\n// Units: Inches\r\n" + table(body, "\t")


def analyzer_names(rows: Rows, at: Locale) -> str:
    """SpatialAnalyzer: collection, group and target in one cell."""
    head = ["Point Name", "X", "Y", "Z"]
    body = [[f"A::Main::{row[0]}", *row[1:]] for row in points(rows, at)]
    return table([head, *body], at.split)


def leica(rows: Rows, at: Locale) -> str:
    """Leica: times, apostrophes, columns in any order, thousands."""
    head = ["X [mm]", "Y [mm]", "Z [mm]", "Zeit für Punkt", "Point Id"]
    body = [
        [*row[1:], "'12:30:05'", f"'{row[0]}'"]
        for row in points(rows, at, thousands=True)
    ]
    return table([head, *body], ";")


def faro(rows: Rows, at: Locale) -> str:
    """FARO: a title, then measured, nominal places and deviations, tabs."""
    kinds = (at.actual, at.nominal, at.deviation)
    head = ["Label", *(f"{kind} {a}" for kind in kinds for a in "XYZ")]
    body = []
    for name, p in zip(rows.ids, rows.xyz, strict=True):
        nominal = np.round(p, 0)
        values = [at.number(v) for v in (*p, *nominal, *(p - nominal))]
        body.append([name, *values])
    return f"{at.title}\r\n" + table([head, *body], "\t")


def polyworks(rows: Rows, at: Locale) -> str:
    """PolyWorks: each axis with nominal value, measured value and deviation."""
    kinds = (at.nominal, at.actual, at.deviation)
    head = ["Object Name", *(f"{a} {kind} (mm)" for a in "XYZ" for kind in kinds)]
    body = []
    for name, p in zip(rows.ids, rows.xyz, strict=True):
        nominal = np.round(p, 0)
        values = np.stack([nominal, p, p - nominal], axis=1).reshape(-1)
        body.append([name, *(at.number(v) for v in values)])
    return table([head, *body], at.split)


TOOL = (120.0, -35.0, 260.0)  # [mm] probe point of the survey
Layout = Callable[[Rows, Locale], str]
JOINTS: tuple[Layout, ...] = (
    sheet, units_below, inches, no_units, radians_and_metres, from_excel, quoted,
    bare_joints, robodk,
)  # fmt: skip
POINTS: tuple[Layout, ...] = (
    analyzer, analyzer_bare, analyzer_names, leica, faro, polyworks
)  # fmt: skip


# Workbooks.


def workbook(rows: Rows, at: Locale, as_text: bool) -> bytes:
    """Write a sheet of numbers, or of numbers as text, and a sheet of remarks."""
    from openpyxl import Workbook

    book = Workbook()
    page = book.active
    page.append([at.title])
    page.append([at.point, *axes(f"{at.axis} {{}} [°]"), "X [mm]", "Y [mm]", "Z [mm]"])
    for row, q, p in zip(cells(rows, at), rows.q, rows.xyz, strict=True):
        page.append(row if as_text else [row[0], *q.tolist(), *p.tolist()])
    book.create_sheet("Info").append([at.title])
    out = io.BytesIO()
    book.save(out)
    return out.getvalue()
