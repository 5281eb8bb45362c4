"""Random programs that the arm of the tests can run, and what it does then."""

from __future__ import annotations

import random
import re
from dataclasses import replace

from tests.language.generator import Generator
from tests.language.interpreter import Executed, Generated

# Around the frames of the tests' cell: middle and half width of every number.
BOXES = {
    "pose": ((150, 150), (200, 150), (250, 100), (0, 20), (168, 9), (0, 20)),
    "joints": ((-10, 8), (15, 8), (-100, 8), (20, 10), (60, 8), (0, 10)),
    "tool": ((80, 10), (-40, 10), (150, 10), (0, 0), (0, 0), (0, 0)),
    "uframe": ((1600, 30), (-300, 30), (900, 30), (0, 3), (0, 2), (0, 3)),
}
OPENING = (
    (-40.0, -10.0, -80.0, -20.0, 30.0, -40.0),
    (-25.0, 0.0, -90.0, 0.0, 45.0, -20.0),
)
_SIX = re.compile(r"(?:POS\(|\{)([^'{}()]*?)(?:,\s*''\)|\})")
_LAST = re.compile(r"(-?\d+\.\d+)[^\d]*$")
Pose = tuple[float, ...]


class Reachable(Generator):
    """Draws poses, joint angles and frames within reach."""

    def opening(self) -> None:
        """Move all joints one way, so that every gear's side is known; set points."""
        for numbers in OPENING:
            text = ", ".join(f"{n:.4f}" for n in numbers)
            self.emit(f"MOVE JOINT TO {{{text}}}", "move", numbers)
        self.assign_joints()
        self.extended()
        for index in ("1", "2"):
            numbers, text = self.record()
            line = f"tab[{index}] := POS({text}, '')"
            self.emit(line, "fill", index, numbers)

    def drawn(self, kind: str) -> Pose:
        """Draw six numbers."""
        rng = self.rng
        return tuple(round(rng.uniform(m - w, m + w), 4) for m, w in BOXES[kind])

    def number(self) -> float:
        """Draw a component, or what is added to one."""
        return round(self.rng.uniform(10.0, 40.0), 4)


def reachable(seed: int, exact: bool) -> Generated:
    """Write a program that starts at a known place."""
    made = Reachable(random.Random(seed), exact).program()
    return made


def reread(made: Generated, text: str) -> Generated:
    """Take the numbers of a rewritten text, one stamp line longer, into the ops."""
    lines, ops = text.splitlines()[1:], dict(made.ops)
    for line, op in made.ops.items():
        if line < 1 or op[0] not in ("move", "set", "fill", "component"):
            continue
        code = lines[line - 1].split("--")[0]
        six = _SIX.search(code)
        if six and len(numbers := _numbers(six[1])) == 6:
            ops[line] = (*op[:-1], numbers)
        elif op[0] == "component" and (last := _LAST.search(code)):
            ops[line] = (*op[:3], float(last[1]), op[4])
    return replace(made, text=text, ops=ops)


def _numbers(text: str) -> Pose:
    parts = text.split(",")
    try:
        return tuple(float(part) for part in parts)
    except ValueError:
        return ()


def straight(made: Generated, trace: list[Executed]) -> bytes:
    """Write what was executed as a program without branches, move after move."""
    lines = ["PROGRAM job EZ", "VAR", "BEGIN"]
    source = made.text.splitlines()
    shift = source[0].startswith("-- postproc")
    frames: dict[str, Pose] = {}
    for executed in trace:
        for name in ("tool", "uframe"):
            now = getattr(executed, name)
            if now != frames.get(name) and any(now):
                lines.append(f"  ${name.upper()} := POS({_text(now)}, '')")
                frames[name] = now
        words = source[executed.line - 1 + shift].split("--")[0]
        how = "LINEAR" if "LINEAR" in words else "JOINT"
        fly, end = ("MOVEFLY", " ADVANCE") if "MOVEFLY" in words else ("MOVE", "")
        numbers = _text(executed.values or ())
        joints = "{" in words or " TO j1" in words
        target = f"{{{numbers}}}" if joints else f"POS({numbers}, '')"
        lines.append(f"  {fly} {how} TO {target}{end}")
    return "\n".join([*lines, "END job", ""]).encode("ascii")


def _text(numbers: Pose) -> str:
    return ", ".join(f"{n:.7f}" for n in numbers)
