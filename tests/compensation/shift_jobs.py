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
from postproc.compensation.options import DEFAULT_OPTIONS, Options
from postproc.compensation.outcome import Outcome, Status
from postproc.model.model import Model
from postproc.robot.cell import Cell
from tests.any_controller import any_controller
from tests.language.neutral_job import (
    OUTSIDE,
    NeutralJob,
    confdata,
    place,
    quaternion,
    status,
)

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
    options: Options = DEFAULT_OPTIONS

    @classmethod
    def of(cls, cell: Cell, model: Model, options: Options = DEFAULT_OPTIONS) -> Shop:
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
        return " / ".join(d.reasons[k].text for k in d.why.tolist())


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


# The same in KRL.

KRL_MOVE = re.compile(
    r"^[ \t]*(S?(?:LIN|PTP|CIRC)) +([^;\n]*?)(?: C_\w+)?[ \t]*(?:;.*)?$", re.M
)


@dataclass(frozen=True)
class KrlText:
    """A source with its data list, and where its moves go.

    Attributes:
        text: The source.
        data: The data list.
    """

    text: str
    data: str

    @property
    def moves(self) -> list[list[str]]:
        """The destinations of every move but those to axes."""
        found = [parts_of(rest) for _, rest in self.heads]
        return found

    @property
    def heads(self) -> list[tuple[str, str]]:
        """Words and destinations of every move but those to axes."""
        found = KRL_MOVE.findall(self.text.replace("\r", ""))
        return [one for one in found if "A1" not in one[1]]

    def at(self, goal: str) -> np.ndarray:
        """Return the pose of a destination, (4, 4) [m]."""
        if ":" in goal.replace("E6POS:", "").replace("FRAME:", ""):
            first, second = re.split(r"(?<!E6POS)(?<!FRAME)\s*:\s*", goal, maxsplit=1)
            return self.at(first) @ self.at(second)
        if goal.startswith("{"):
            pairs = re.findall(r"\b([XYZABC])\s+([-+.\dE]+)", goal)
            n = {name: float(value) for name, value in pairs}
            turn = Rotation.from_euler("ZYX", [n["A"], n["B"], n["C"]], degrees=True)
            return pose([n["X"], n["Y"], n["Z"]], turn)
        written = re.search(rf"(?i)\b{goal}=(\{{.*?\}})", self.data + self.text)
        return self.at(written[1])


def six(at: np.ndarray) -> str:
    """Write X to C of a pose."""
    x, y, z = (at[:3, 3] * 1000.0).tolist()
    a, b, c = Rotation.from_matrix(at[:3, :3]).as_euler("ZYX", True).tolist()
    return f"X {x:.6f},Y {y:.6f},Z {z:.6f},A {a:.9f},B {b:.9f},C {c:.9f}"


def krl(
    shop: Shop, lines: Sequence[str], more: str = "", data: str = ""
) -> dict[str, bytes]:
    """Write a source and a data list: three points, an approach, and what is given."""
    points = [
        f"DECL E6POS X{n}={{{six(shop.point(n))},{flags(shop, n)}}}" for n in TURNS
    ]
    starts = [
        "PTP {" + ",".join(
            f"A{k} {v:.4f}" for k, v in enumerate(np.rad2deg(MIDDLE) - off, start=1)
        ) + "}"
        for off in (24, 12)
    ]  # fmt: skip
    source = [
        "&ACCESS RVP", "DEF job ( )", f"$TOOL={{{six(TOOL)}}}",
        f"$BASE={{{six(FRAME)}}}", "$VEL.CP=0.2", *starts, *lines, "END", more,
    ]  # fmt: skip
    page = ["&ACCESS RVP", "DEFDAT job", *points, data, "ENDDAT", ""]
    texts = {"job.src": source, "job.dat": page}
    return {name: "\r\n".join(text).encode() for name, text in texts.items()}


def flags(shop: Shop, name: str) -> str:
    """Write S and T of a point."""
    return status(shop.job, MIDDLE + np.deg2rad(TURNS[name]))


def krl_landed(
    shop: Shop,
    lines: Sequence[str],
    more: str = "",
    runs: Sequence[int] = (),
    data: str = "",
) -> Landed:
    """Compensate a KRL job and its twin, see `landed`; moves that run by number."""
    files = krl(shop, lines, more, data)
    plain = KrlText(*(text.decode() for text in files.values()))
    order = runs or range(len(plain.moves))
    spelt = [_krl_spelt(shop, plain, k) for k in order]
    each = iter(spelt)
    straight = [next(each) if KRL_MOVE.search(line) else line for line in lines]
    twin = krl(shop, spelt if runs else straight, "", data)
    done, other = shop.compensate(files), shop.compensate(twin)
    now = KrlText(*(done.outputs.get(n, t).decode() for n, t in files.items()))
    wanted = KrlText(*(other.outputs.get(n, t).decode() for n, t in twin.items()))
    truth = [wanted.at(goal) for move in wanted.moves for goal in move]
    got = [now.at(goal) for k in order for goal in now.moves[k]]
    return Landed(done, now.text, *_compared(got, truth))


def _krl_spelt(shop: Shop, plain: KrlText, k: int) -> str:
    """Write a move with the numbers of its target."""
    word, _ = plain.heads[k]
    ends = []
    for goal in plain.moves[k]:
        point = re.search(r"(?i)X(p\d)\b", goal)[1].lower()
        own = re.match(r"(?i)Xp\d\s*:", goal)  # a frame comes out: no S and T
        more = "" if own else f",{flags(shop, point)}"
        ends.append(f"{{{six(plain.at(goal))}{more}}}")
    return f"{word} {','.join(ends)}"
