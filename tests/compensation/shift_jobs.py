"""Jobs with shifted targets, and where their moves go: read from the text anew.

What a shifted move must be commanded is told by a twin: the same moves, each to a
target whose numbers stand in the move. Nothing of the package reads the texts here.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial.transform import Rotation

from postproc.compensation.compensate import compensate
from postproc.compensation.options import AS_USUAL, Options
from postproc.compensation.outcome import Outcome, Status
from postproc.model.model import Model
from postproc.robot.cell import Cell
from tests.any_controller import any_controller
from tests.language.neutral_job import OUTSIDE, NeutralJob, confdata, place, quaternion

MIDDLE = np.deg2rad([-20.0, 15.0, -100.0, 25.0, 58.0, 25.0])
TURNS = {
    "p1": [0, 0, 0, 0, 0, 0],
    "p2": [5, 3, -4, 4, -5, 6],
    "p3": [-6, -2, 5, -7, 6, -3],
}  # [deg] from the middle
TOOL, FRAME = np.eye(4), np.eye(4)
TOOL[:3, 3] = [0.02, -0.03, 0.25]
FRAME[:3, :3] = Rotation.from_euler("z", 30, degrees=True).as_matrix()
FRAME[:3, 3] = [0.5, 0.2, 0.3]
EXACT_MM, AGREED_MM = 2.5e-3, 0.021
MOVE = re.compile(r"\b(Move[LJC]|ArcL|TriggL)\s+([^;]*);")
CALL = re.compile(r"(\w+)\s*\((.*)\)$", re.S)


@dataclass(frozen=True)
class Shop:
    """What jobs are compensated with."""

    cell: Cell
    model: Model
    options: Options = AS_USUAL

    @classmethod
    def of(cls, cell: Cell, model: Model, options: Options = AS_USUAL) -> Shop:
        """Let the cell run programs of every language."""
        cell = any_controller(cell)
        robot = cell.file.robot.model_copy(update={"absolute_accuracy": False})
        told = replace(cell, file=cell.file.model_copy(update={"robot": robot}))
        return cls(told, model, options)

    def compensate(self, files: Mapping[str, bytes]) -> Outcome:
        """Compensate a program and its pages."""
        main, *others = files
        pages = {name: files[name] for name in others}
        return compensate(
            files[main], self.cell, self.model, name=main, pages=pages,
            options=self.options,
        )  # fmt: skip

    @property
    def job(self) -> NeutralJob:
        """Where tool and frame are."""
        return NeutralJob(self.cell, TOOL, FRAME)

    def point(self, name: str) -> np.ndarray:
        """Return the pose of a point in its frame, (4, 4) [m]."""
        return self.job.pose(MIDDLE + np.deg2rad(TURNS[name]))


def parts_of(text: str) -> list[str]:
    """Split at commas that stand in no bracket."""
    depth, parts = 0, [""]
    for sign in text:
        depth += (sign in "([{") - (sign in ")]}")
        if sign == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += sign
    return [one.strip() for one in parts]


def numbers_of(text: str) -> list[float]:
    """Read all numbers of a text."""
    return [
        float(n) for n in re.findall(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:E[-+]?\d+)?", text)
    ]


def pose(place_mm: Sequence[float], rotation: Rotation) -> np.ndarray:
    """Return a pose, (4, 4) [m]."""
    out = np.eye(4)
    out[:3, 3], out[:3, :3] = np.array(place_mm) / 1000.0, rotation.as_matrix()
    return out


@dataclass(frozen=True)
class RapidText:
    """A module, and where its moves go.

    Attributes:
        text: The module.
        names: What parameters stand for.
    """

    text: str
    names: Mapping[str, str] = field(default_factory=dict)

    @property
    def moves(self) -> list[list[str]]:
        """The destinations of every move, in the order of the text."""
        code = re.sub(r"![^\n]*", "", self.text)
        found = MOVE.findall(code)
        return [parts_of(rest)[: 1 + (word == "MoveC")] for word, rest in found]

    def at(self, goal: str) -> np.ndarray:
        """Return the pose of a destination, (4, 4) [m]."""
        goal = self.names.get(goal, goal)
        if goal.startswith("["):
            x, y, z, q1, q2, q3, q4 = numbers_of(goal)[:7]
            return pose([x, y, z], Rotation.from_quat([q2, q3, q4, q1]))
        call = CALL.match(goal)
        if call is None:
            written = re.search(rf"robtarget {goal}:=(\[.*?\]\]);", self.text)
            return self.at(written[1])
        own, x, y, rest = parts_of(call[2])
        z, *turns = rest.split("\\")
        by = [float(one) for one in (x, y, z)]
        start = self.at(own)
        if call[1].lower() == "offs":
            return start + _beside(by)
        angle = {one[:2].lower(): numbers_of(one)[-1] for one in turns}
        turn = Rotation.from_euler(
            "XYZ", [angle.get(a, 0.0) for a in ("rx", "ry", "rz")], degrees=True
        )
        return start @ pose(by, turn)


def _beside(by: Sequence[float]) -> np.ndarray:
    out = np.zeros((4, 4))
    out[:3, 3] = np.array(by) / 1000.0
    return out


def rapid(shop: Shop, lines: Sequence[str], more: str = "", data: str = "") -> bytes:
    """Write a module: three points, an approach, and what is given."""
    job = shop.job
    tool, frame = (f"[{place(p)},{quaternion(p)}]" for p in (TOOL, FRAME))
    points = [f"CONST robtarget {n}:={inline(shop.point(n), job, n)};" for n in TURNS]
    starts = [
        f"MoveAbsJ [[{','.join(f'{v:.4f}' for v in np.rad2deg(MIDDLE) - off)}],"
        f"{OUTSIDE}],v200,fine,t;"
        for off in (24, 12)
    ]
    return "\n".join([
        "MODULE m", f"PERS tooldata t:=[TRUE,{tool},[0.001,[0,0,1],[1,0,0,0],0,0,0]];",
        f'PERS wobjdata w:=[FALSE,TRUE,"",{frame},[[0,0,0],[1,0,0,0]]];', *points, data,
        "PROC main()", "ConfL\\Off;", "ConfJ\\Off;", *starts, *lines, "EXIT;",
        "ENDPROC", more, "ENDMODULE", "",
    ]).encode()  # fmt: skip


def inline(at: np.ndarray, job: NeutralJob, name: str) -> str:
    """Write a robtarget."""
    x, y, z = (at[:3, 3] * 1000.0).tolist()
    q = MIDDLE + np.deg2rad(TURNS[name])
    return f"[[{x:.6f},{y:.6f},{z:.6f}],{quaternion(at)},{confdata(job, q)},{OUTSIDE}]"


@dataclass(frozen=True)
class Landed:
    """A job, what came of it, and how far its moves are from where the twin's go.

    Attributes:
        done: The outcome.
        text: The rewritten module.
        off_mm, turned_deg: By move as it is run, (k,).
    """

    done: Outcome
    text: str
    off_mm: np.ndarray
    turned_deg: np.ndarray

    @property
    def status(self) -> list[str]:
        """What became of the visits."""
        return [Status(s).name for s in self.done.decisions.status.tolist()]

    @property
    def whys(self) -> str:
        """All reasons."""
        d = self.done.decisions
        return " / ".join(d.reasons[k] for k in d.why.tolist())


def landed(
    shop: Shop,
    lines: Sequence[str],
    more: str = "",
    runs: Sequence[tuple[int, Mapping[str, str]]] = (),
    data: str = "",
) -> Landed:
    """Compensate a RAPID job and its twin, and compare where their moves go.

    Args:
        shop: Cell, model and options.
        lines: Of main.
        more: Routines.
        runs: Moves in the order in which they are run: their number in the text, and
            what parameters stand for; all of them once where nothing is given.
        data: Declarations.
    """
    source = rapid(shop, lines, more, data)
    plain = RapidText(source.decode())
    order = runs or [(k, {}) for k in range(len(plain.moves))]
    spelt = iter(_spelt(shop, plain, order))
    straight = [next(spelt) if MOVE.search(line) else line for line in lines]
    twin = rapid(shop, [*spelt] if runs else straight, "", data)
    done, other = (shop.compensate({"m.mod": text}) for text in (source, twin))
    now = done.outputs["m.mod"].decode()
    wanted = RapidText(other.outputs["m.mod"].decode())
    truth = [wanted.at(goal) for move in wanted.moves for goal in move]
    got = []
    for k, names in order:
        read = RapidText(now, names)
        got += [read.at(goal) for goal in read.moves[k]]
    return Landed(done, now, *_compared(got, truth))


def _compared(
    got: Sequence[np.ndarray], truth: Sequence[np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    off = [
        np.linalg.norm((a - b)[:3, 3]) * 1000.0 for a, b in zip(got, truth, strict=True)
    ]
    turn = [
        Rotation.from_matrix(a[:3, :3].T @ b[:3, :3]).magnitude()
        for a, b in zip(got, truth, strict=True)
    ]
    return np.array(off), np.rad2deg(turn)


def _spelt(
    shop: Shop, plain: RapidText, order: Sequence[tuple[int, Mapping[str, str]]]
) -> list[str]:
    """Write every move with the numbers of its target."""
    out = []
    code = re.sub(r"![^\n]*", "", plain.text)
    heads = MOVE.findall(code)
    for k, names in order:
        word, rest = heads[k]
        goals, read = plain.moves[k], RapidText(plain.text, names)
        ends = [
            inline(read.at(g), shop.job, _named(names.get(g, g), names)) for g in goals
        ]
        rest_of = parts_of(rest)[len(goals) :]
        out.append(f"{word} {','.join([*ends, *rest_of])};")
    return out


def _named(goal: str, names: Mapping[str, str]) -> str:
    """Return the point that a destination begins with."""
    found = re.findall(r"\b(p\d|\w+)\b", goal)
    return next(names.get(n, n) for n in found if names.get(n, n) in TURNS)
