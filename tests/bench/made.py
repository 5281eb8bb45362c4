"""Programs of any length, of the five kinds that users bring, made without chance.

Every kind repeats what the sample program of its name does, on paths of its own: the
same moves, number formats and layout, so that a line costs what a real one costs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ROW = 191  # points of a milled row, 2 mm apart
ROWS = 130  # rows of an operation, between two stops
SHIFT = 0.618034  # of a turn: spreads repetitions evenly


@dataclass(frozen=True)
class Made:
    """A program with its variable file.

    Attributes:
        name: File name of the program.
        source: The program.
        variables: The variable file, where there is one.
    """

    name: str
    source: bytes
    variables: bytes | None = None


def milling(n: int) -> Made:
    """Mill a freeform blank in rows, one fly run an operation, n points."""
    k = np.arange(n) // ROW
    y = -143.0 + 2.2 * (k % ROWS) + 0.01 * (k // ROWS % 200)
    return _milling("milling", _milled(y), ROW * ROWS)


def unbroken(n: int) -> Made:
    """Mill the same blank there and back without a stop, one fly run of n points."""
    k = np.arange(n) // ROW
    there, passes = np.abs(k % (2 * ROWS - 2) - (ROWS - 1)), k // (2 * ROWS - 2)
    y = -143.0 + 2.2 * there + 0.01 * (passes % 200)
    return _milling("unbroken", _milled(y), n)


def _milling(name: str, points: Array, run: int) -> Made:
    """Write points (n, 6) [mm, deg] as operations of so many, a fly run each."""
    text = (
        "  MOVEFLY LINEAR TO POS(%.4f, %.4f, %.4f, %.4f, %.4f, %.4f,"
        "'W T1:0 T2:0 T3:0') ADVANCE"
    )
    lines = [text % tuple(p) for p in points.tolist()]
    body: list[str] = []
    for a in range(0, len(points), run):
        own = lines[a : a + run]
        first, last = points[a], points[a + len(own) - 1]
        body += [f"  -- Operation {a // run + 1}: parallel to X, zigzag"]
        body += ["  $LIN_SPD := 0.2500", _retracted(first), "  $LIN_SPD := 0.0600"]
        body += [*own, "  $LIN_SPD := 0.1000", _retracted(last)]
    joints = "{11.62947, 15.45382, -130.46645, -148.98738, -74.35892, -91.72012}"
    head = [
        f"PROGRAM {name} EZ, PROG_ARM=1, HOLD, STACK=5000",
        "ROUTINE SpindleOn(rpm : INTEGER) EXPORTED FROM spindle GLOBAL",
        "BEGIN",
        "  $MOVE_TYPE := JOINT",
        "  $TERM_TYPE := NOSETTLE",
        "  $ORNT_TYPE := RS_WORLD",
        "  $FLY_TYPE := FLY_CART",
        "  $FLY_DIST := 1.0000",
        "  $UFRAME := POS(648.2500, 1436.8000, 862.4000, 0.0000, 0.0000, 12.5000,'')",
        "  $TOOL := POS(0.4120, -168.4470, 318.9030, -90.0000, 40.0000, -90.0000,'')",
        f"  MOVE TO {joints}",
        "  SpindleOn(18000)",
    ]
    return Made(f"{name}.pdl", _text([*head, *body, f"END {name}"]))


def _milled(y: Array) -> Array:
    """Points of rows at y [mm], (n, 6) [mm, deg], the spindle leaning as they do."""
    k = np.arange(len(y))
    forth, along = k // ROW % 2 == 0, k % ROW
    x = -190.0 + 2.0 * np.where(forth, along, ROW - 1 - along)
    z = 45.0 + 6.0 * np.sin(x / 60.0) * np.cos(y / 50.0)
    dx = 0.10 * np.cos(x / 60.0) * np.cos(y / 50.0) + 0.20
    dy = -0.12 * np.sin(x / 60.0) * np.sin(y / 50.0) + 0.07
    lean = np.arctan(np.hypot(dx, dy))
    a = np.rad2deg(np.arctan2(dy, dx))
    return np.column_stack([x, y, z, a, 180.0 - np.rad2deg(lean), a])


def _retracted(point: Array) -> str:
    """Move 60 mm above a point."""
    p = (*point[:2], point[2] + 60.0, *point[3:])
    numbers = ", ".join(f"{v:.4f}" for v in p)
    return f"  MOVE LINEAR TO POS({numbers},'W T1:0 T2:0 T3:0')"


def drilling(n: int) -> Made:
    """Drill rows of holes: in front of it, into it, and out again; n targets."""
    holes = -(-n // 3)
    k = np.arange(holes)
    x = -420.0 + 24.0 * (k % 20) + np.mod(SHIFT * k, 1.0)
    y = -34.5 - 60.0 * (k // 20 % 8) + np.mod(SHIFT * (k + 3), 1.0)
    z = -276.9 + 0.02 * (x + 420.0) - 0.1 * (y + 34.5)
    a, e, r = -86.26 - 0.009 * (x + 420.0), 81.346 - 0.0 * x, -0.563 + 0.0013 * x
    rows = np.column_stack([x, y, z, a, e, r])
    out = rows + np.array([-2.579, 39.461, -6.019, 0.0, 0.0, 0.0])
    text = "  MOVE LINEAR TO POS( %.3f, %.3f, %.3f, %.3f, %.3f, %.3f, '')"
    body: list[str] = []
    for i, (front, hole) in enumerate(zip(out.tolist(), rows.tolist(), strict=True)):
        three = [
            text % tuple(front),
            text % tuple(hole) + " WITH $LIN_SPD = 0.05\n  drill_hole(1)",
            text % tuple(front),
        ]
        body += three[: n - 3 * i]
    head = [
        "PROGRAM drilling EZ, HOLD, PROG_ARM=1, STACK=4096",
        "ROUTINE drill_hole(ai_cycle : INTEGER) EXPORTED FROM drl_lib GLOBAL",
        "BEGIN",
        "  $TERM_TYPE := FINE",
        "  $ORNT_TYPE := RS_WORLD",
        "  $LIN_SPD := 0.35",
        "  $UFRAME := POS(38.412, 2094.755, 2052.380, 179.9312, 0.0415, 0.0268, '')",
        "  $TOOL := POS(-155.620, 1.180, 441.730, 179.6150, 60.1420, -179.8840, '')",
        "  MOVE JOINT TO $HOME",
        "  MOVE JOINT TO POS(-429.672, 113.414, -299.455, -86.260, 81.346, -0.563,"
        " 'T1:0 T2:0')",
    ]
    return Made("drilling.pdl", _text([*head, *body, "END drilling"]))


def spot(n: int) -> Made:
    """Weld n spots in rows, every point a variable of the .lsv file."""
    k = np.arange(n)
    x = -680.0 + 82.0 * (k % 12) + np.mod(SHIFT * k, 1.0)
    y = -18.5 + 3.8 * (k % 12) + 20.0 * np.mod(SHIFT * (k // 12), 1.0)
    z = 338.0 + 20.0 * (k // 12 % 8) + np.mod(SHIFT * (k + 5), 1.0)
    a, e, r = -87.0 - 0.3 * (k % 12), 88.0 + 0.1 * (k % 12), 3.0 - 0.5 * (k % 12)
    rows = np.column_stack([x, y, z, a, e, r]).tolist()
    entry = (
        "WP_%d XTND Arm: 1 Ax:1 Priv\n X: %.2f  Y: %.2f  Z: %.2f  A: %.3f  E: %.3f"
        "  R: %.3f  1: 22\n CNFG: ''"
    )
    listed = [entry % (i + 1, *row) for i, row in enumerate(rows)]
    weld = (
        "  MOVE JOINT TO WP_%d ,\n    WITH CONDITION[spot(1, %d, 1, FALSE)],\n  ENDMOVE"
    )
    body = [weld % (i + 1, 90000 + i) for i in range(n)]
    head = [
        "PROGRAM spot EZ, PROG_ARM=1, HOLD",
        "VAR",
        *(
            "    " + ", ".join(f"WP_{i + 1}" for i in some) + " : XTNDPOS FOR ARM[1]"
            for some in _pieces(n, 9)
        ),
        "ROUTINE spot(ai_gun, ai_id, ai_sched : INTEGER ; ab_last : BOOLEAN) : INTEGER"
        " EXPORTED FROM spotapp GLOBAL",
        "ROUTINE tf(ai_tool, ai_frame : INTEGER) : INTEGER EXPORTED FROM tf_lib GLOBAL",
        "BEGIN",
        "  $par := tf(1,2)",
        "  $TERM_TYPE := COARSE",
        "  MOVE JOINT TO $HOME",
    ]
    variables = ["--$$  ARM: 1 AXES: 8 AUX: 1 MASK: 191", *listed]
    source = _text([*head, *body, "END spot"])
    return Made("spot.pdl", source, _text(variables))


def handling(n: int) -> Made:
    """Carry parts from a conveyor to a rack by JOINT moves between stops, n targets."""
    stations = np.array(
        [
            [40.26222, 22.95832, -101.48996, -4.66204, 58.66170, 137.90077],
            [39.61611, 17.99889, -98.42195, -2.13121, 65.65084, 137.56491],
            [21.80763, 17.33177, -96.50415, -10.37034, 77.44218, 149.01775],
            [3.93749, 2.98370, -102.42752, -6.88800, 71.67178, 145.72950],
            [-2.52798, 10.24772, -120.99282, 10.95375, 41.49035, 133.20616],
            [-7.08893, 15.67510, -112.91402, 5.55051, 58.08264, 174.77019],
            [-35.12295, 6.33796, -109.93860, -4.83264, 59.73880, 152.03726],
            [-49.85667, 11.17556, -112.53045, -2.44617, 60.25232, 134.50046],
            [-74.43630, -2.88934, -105.15067, 0.98648, 65.05298, 163.18213],
            [-108.93158, 17.55485, -119.96391, 8.27906, 33.88542, 137.95807],
        ]
    )
    k = np.arange(n)
    jitter = np.mod(SHIFT * (k[:, None] // 10 + 1) * (1 + np.arange(6)), 1.0)
    rows = stations[k % 10] + jitter - 0.5
    text = "  MOVE JOINT TO {%.5f, %.5f, %.5f, %.5f, %.5f, %.5f}"
    body = [text % tuple(row) for row in rows.tolist()]
    head = [
        "PROGRAM handling EZ, NOHOLD, STACK=3072",
        "BEGIN",
        "  $MOVE_TYPE := JOINT",
        "  $TERM_TYPE := COARSE",
        "  $JNT_MTURN := TRUE",
        "  $TOOL := POS(62.4100, -0.8500, 318.2600, 0.0000, 0.0000, -45.0000, '')",
        "  MOVE JOINT TO $HOME",
    ]
    return Made("handling.pdl", _text([*head, *body, "END handling"]))


def _pieces(n: int, size: int) -> Iterator[range]:
    """Cut the numbers below n into pieces."""
    return (range(a, min(a + size, n)) for a in range(0, n, size))


def _text(lines: list[str]) -> bytes:
    """Join lines as a program file has them."""
    return ("\n".join(lines) + "\n").encode("latin-1")


KINDS: Mapping[str, Callable[[int], Made]] = {
    "milling": milling,
    "unbroken": unbroken,
    "spot": spot,
    "drilling": drilling,
    "handling": handling,
}
