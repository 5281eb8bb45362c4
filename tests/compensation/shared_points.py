"""Random programs whose points are reached from several sides."""

from __future__ import annotations

import numpy as np

SWEEP = (
    "MOVE JOINT TO {-20.0, -15.0, -130.0, -60.0, 20.0, -80.0}",
    "MOVE JOINT TO {20.0, 25.0, -80.0, 60.0, 80.0, 80.0}",
)


class Writer:
    """Writes one program; some points stand in its variable file."""

    def __init__(self, seed: int) -> None:
        """Draw where the points are."""
        self.rng = np.random.default_rng(seed)
        self.points = {name: self.pose() for name in ("p1", "p2", "W3", "d4")}
        self.loops = 0

    def pose(self) -> str:
        """Draw a pose within reach, as it is written."""
        place = self.rng.uniform([0, 0, 100], [300, 400, 400])
        turn = self.rng.uniform([-5, 165, -5], [5, 179, 5])
        return ", ".join(f"{n:.3f}" for n in (*place, *turn))

    def program(self) -> tuple[bytes, bytes]:
        """Write the program and its variable file."""
        head = ["PROGRAM job", "VAR i1, i2, i3 : INTEGER", "  p1, p2 : POSITION"]
        head += ["  W3 : XTNDPOS FOR ARM[1]", "  j5 : JOINTPOS FOR ARM[1]"]
        head += [f"  d4 : POSITION (POS({self.points['d4']}, '')) NOSAVE -- declared"]
        head += ["ROUTINE r", "BEGIN", *self.moves(3), "END r", "BEGIN", *SWEEP]
        body = [f"  {n} := POS({self.points[n]}, '')" for n in ("p1", "p2")]
        body += ["  j5 := {5.00, 10.00, -95.00, 30.00, 50.00, 30.00}", *self.block(0)]
        text = "\r\n".join([*head, *body, "END job", ""])
        return text.encode(), self.values().encode()

    def values(self) -> str:
        """Write the variable file."""
        numbers = zip("XYZAER", self.points["W3"].split(", "), strict=True)
        row = "  ".join(f"{letter}: {number}" for letter, number in numbers)
        return f"--$$  ARM: 1\r\nW3 XTND Arm: 1 Ax:1 Priv\r\n {row}  1: 90\r\n CNFG: ''"

    def moves(self, count: int) -> list[str]:
        """Write moves to points, and some to joint angles between."""
        found = []
        for _ in range(count):
            if self.rng.random() < 0.4:
                angles = self.rng.uniform(
                    [-20, -15, -130, -60, 25, -80], [20, 25, -80, 60, 80, 80]
                )
                text = ", ".join(f"{a:.2f}" for a in angles)
                found.append(f"  MOVE JOINT TO {{{text}}}")
            else:
                name = self.rng.choice([*self.points, "j5"])
                found.append(f"  MOVE JOINT TO {name}")
        return found

    def block(self, depth: int) -> list[str]:
        """Write moves, loops, branches, calls and new values."""
        found = self.moves(4)
        for _ in range(3 if depth == 0 else 1):
            kind = self.rng.integers(4) if depth < 2 else 3
            if kind == 0 and self.loops < 3:
                self.loops += 1
                name = f"i{self.loops}"
                found += [f"FOR {name} := 1 TO 2 DO", *self.moves(2)]
                found += [f"IF {name} = 2 THEN", *self.block(depth + 1), "ELSE"]
                found += [*self.moves(1), "ENDIF", *self.moves(2), "ENDFOR"]
            elif kind == 1:
                found += ["  r", *self.moves(3)]
            elif kind == 2:
                found += [f"  p1 := POS({self.pose()}, '')", *self.moves(4)]
            else:
                found += self.moves(3)
        return found
