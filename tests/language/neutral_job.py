"""A job in no language, and its text in each: the same moves to the same places."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from postproc.compensation.compensate import compensate
from postproc.compensation.outcome import Outcome
from postproc.model.model import Model
from postproc.robot.cell import Cell
from postproc.robot.pose import MM, record_from_pose
from postproc.robot.trajectory import Motion

OUTSIDE = "[9E9,9E9,9E9,9E9,9E9,9E9]"


@dataclass(frozen=True)
class NeutralMove:
    """One move.

    Attributes:
        motion: How the arm gets there.
        q: Joint angles there, (6,) [rad].
        in_joints: It is a joint target.
        zone_mm: It is passed in a zone of this size; 0: it stops.
        via: Joint angles at the point of an arc.
        name: Of the point, "" where it is written in the move.
    """

    motion: Motion
    q: np.ndarray
    in_joints: bool = False
    zone_mm: float = 0.0
    via: np.ndarray | None = None
    name: str = ""


@dataclass(frozen=True)
class NeutralJob:
    """Moves with one tool in one user frame.

    Attributes:
        cell: The arm, and its base.
        tool, uframe: Poses (4, 4) [m]; `uframe` in the world.
        moves: In the order of the program.
        speed: Along paths [m/s].
    """

    cell: Cell
    tool: np.ndarray
    uframe: np.ndarray
    moves: Sequence[NeutralMove] = field(default_factory=tuple)
    speed: float = 0.2

    def pose(self, q: np.ndarray) -> np.ndarray:
        """Return where the tool is in the user frame, (4, 4) [m]."""
        flange = self.cell.arm.flange(q[None])[0]
        world = self.cell.base.pose @ flange @ self.tool
        return np.linalg.inv(self.uframe) @ world


def record(pose: np.ndarray) -> str:
    """Write a pose as PDL2 has it, its orientation to more digits than usual."""
    x, y, z, a, e, r = record_from_pose(pose).tolist()
    return f"{x:.3f}, {y:.3f}, {z:.3f}, {a:.10f}, {e:.10f}, {r:.10f}"


def pdl2(job: NeutralJob) -> bytes:
    """Write a job in PDL2."""
    points = [
        f"    {m.name} : POSITION" for m in job.moves if m.name and not m.in_joints
    ]
    given = [
        f"    {m.name} := POS({record(job.pose(m.q))}, '{configuration(job, m.q)}')"
        for m in job.moves
        if m.name and not m.in_joints
    ]
    lines = [
        "PROGRAM job", "VAR", *dict.fromkeys(points), "BEGIN",
        f"    $TOOL := POS({record(job.tool)})",
        f"    $UFRAME := POS({record(job.uframe)})",
        f"    $LIN_SPD := {job.speed:g}",
        "    $FLY_TYPE := FLY_CART", "    $FLY_TRAJ := FLY_FROM", "    $FLY_PER := 100",
        *dict.fromkeys(given), *(_pdl2_move(job, m) for m in job.moves), "END job",
    ]  # fmt: skip
    return "\n".join(line for line in lines if line != "VAR" or points).encode() + b"\n"


def configuration(job: NeutralJob, q: np.ndarray) -> str:
    """Write the configuration of joint angles as PDL2 has it."""
    slot = int(job.cell.arm.branch(q[None])[0])
    flags = [name for name, bit in (("S", 2), ("E", 1), ("W", 4)) if slot & bit]
    turns = np.floor((q[[3, 5]] + np.pi) / (2 * np.pi)).astype(int)
    return " ".join([*flags, f"T1:{turns[0]}", f"T2:{turns[1]}"])


def _pdl2_move(job: NeutralJob, move: NeutralMove) -> str:
    word = {Motion.JOINT: "JOINT", Motion.LINEAR: "LINEAR", Motion.CIRCULAR: "CIRCULAR"}
    fly = "FLY" if move.zone_mm else ""
    to = _pdl2_point(job, move.q, move.in_joints, move.name)
    text = f"    MOVE{fly} {word[move.motion]} TO {to}"
    if move.via is not None:
        text += f" VIA {_pdl2_point(job, move.via, False, '')}"
    if move.zone_mm:
        return f"    $FLY_DIST := {move.zone_mm:g}\n{text} ADVANCE"
    return text


def _pdl2_point(job: NeutralJob, q: np.ndarray, in_joints: bool, name: str) -> str:
    if in_joints:
        return "{" + ", ".join(f"{v:.5f}" for v in np.rad2deg(q)) + "}"
    return name or f"POS({record(job.pose(q))}, '{configuration(job, q)}')"


def quaternion(pose: np.ndarray, digits: int = 12) -> str:
    """Write an orientation as RAPID has it."""
    x, y, z, w = Rotation.from_matrix(pose[:3, :3]).as_quat().tolist()
    return f"[{w:.{digits}f},{x:.{digits}f},{y:.{digits}f},{z:.{digits}f}]"


def place(pose: np.ndarray) -> str:
    """Write a position [mm]."""
    return "[" + ",".join(f"{v:.3f}" for v in (pose[:3, 3] / MM).tolist()) + "]"


def confdata(job: NeutralJob, q: np.ndarray) -> str:
    """Write the configuration of joint angles."""
    cf = np.floor(q[[0, 3, 5]] / (np.pi / 2)).astype(int).tolist()
    slot = int(job.cell.arm.branch(q[None])[0])
    cfx = 4 * bool(slot & 2) + 2 * bool(slot & 1) + bool(slot & 4)
    return "[" + ",".join(map(str, [*cf, cfx])) + "]"


def rapid(job: NeutralJob) -> bytes:
    """Write a job in RAPID."""
    tool = f"[{place(job.tool)},{quaternion(job.tool)}]"
    frame = f"[{place(job.uframe)},{quaternion(job.uframe)}]"
    none = "[[0,0,0],[1,0,0,0]]"
    named = [
        f"  CONST robtarget {m.name}:={_rapid_point(job, m.q, False, '')};"
        for m in job.moves
        if m.name and not m.in_joints
    ]
    lines = [
        "MODULE job",
        f"  TASK PERS tooldata tWork:=[TRUE,{tool},{_load(job)}];",
        f'  TASK PERS wobjdata wPart:=[FALSE,TRUE,"",{frame},{none}];',
        f"  CONST speeddata vWork:=[{1000 * job.speed:g},500,5000,1000];",
        *(f"  CONST zonedata zone{m.zone_mm:g}:=[FALSE,{m.zone_mm:g},1,1,1,1,1];"
          for m in {m.zone_mm: m for m in job.moves if m.zone_mm}.values()),
        *dict.fromkeys(named),
        "  PROC main()", "    CirPathMode\\CirPointOri;",
        *(_rapid_move(job, m) for m in job.moves), "    EXIT;", "  ENDPROC",
        "ENDMODULE",
    ]  # fmt: skip
    return "\n".join(lines).encode() + b"\n"


def _load(job: NeutralJob) -> str:
    """Write what the arm carries as the cell says; a placeholder where it does not."""
    mass = job.cell.payload_mass
    centre = ",".join(f"{x:g}" for x in (job.cell.payload_com / MM).tolist())
    return f"[{mass if mass == mass else 0.001:g},[{centre}],[1,0,0,0],0,0,0]"


def _rapid_move(job: NeutralJob, move: NeutralMove) -> str:
    word = {Motion.JOINT: "MoveJ", Motion.LINEAR: "MoveL", Motion.CIRCULAR: "MoveC"}
    zone = f"zone{move.zone_mm:g}" if move.zone_mm else "fine"
    if move.in_joints:
        joints = ",".join(f"{v:.5f}" for v in np.rad2deg(move.q))
        return f"    MoveAbsJ [[{joints}],{OUTSIDE}],vWork,{zone},tWork;"
    via = ""
    if move.via is not None:
        via = _rapid_point(job, move.via, False, "") + ","
    to = _rapid_point(job, move.q, False, move.name)
    return f"    {word[move.motion]} {via}{to},vWork,{zone},tWork\\WObj:=wPart;"


def _rapid_point(job: NeutralJob, q: np.ndarray, in_joints: bool, name: str) -> str:
    pose = job.pose(q)
    if name:
        return name
    return f"[{place(pose)},{quaternion(pose)},{confdata(job, q)},{OUTSIDE}]"


def krl(job: NeutralJob) -> dict[str, bytes]:
    """Write a job in KRL: a source and its data list."""
    named = {
        f"DECL E6POS X{m.name}={_krl_point(job, m.q, False, '')}": None
        for m in job.moves
        if m.name and not m.in_joints
    }
    interpolate = "{ORI #INTERPOLATE}"
    lines = [
        "&ACCESS RVP", "&REL 1", "DEF job ( )",
        f"$TOOL={_krl_frame(job.tool)}", f"$BASE={_krl_frame(job.uframe)}",
        f"$VEL.CP={job.speed:g} ; m/s",
        f"$CIRC_MODE={{AUX_PT {interpolate},TARGET_PT {interpolate}}}",
        *(_krl_move(job, m) for m in job.moves), "END",
    ]  # fmt: skip
    data = ["&ACCESS RVP", "DEFDAT job", *named, "ENDDAT"]
    texts = {"job.src": lines, "job.dat": data}
    return {name: "\r\n".join([*text, ""]).encode() for name, text in texts.items()}


def _krl_frame(pose: np.ndarray) -> str:
    x, y, z = (pose[:3, 3] / MM).tolist()
    a, b, c = Rotation.from_matrix(pose[:3, :3]).as_euler("ZYX", True).tolist()
    place, angles = (
        f"X {x:.3f},Y {y:.3f},Z {z:.3f}",
        f"A {a:.10f},B {b:.10f},C {c:.10f}",
    )
    return f"{{{place},{angles}}}"


def status(job: NeutralJob, q: np.ndarray) -> str:
    """Write S and T of joint angles."""
    slot = int(job.cell.arm.branch(q[None])[0])
    s = bool(slot & 2) + 2 * (not slot & 1) + 4 * bool(slot & 4)
    return f"S {s},T {sum(2**k for k in range(6) if q[k] < 0)}"


def _krl_move(job: NeutralJob, move: NeutralMove) -> str:
    word = {Motion.JOINT: "SPTP", Motion.LINEAR: "SLIN", Motion.CIRCULAR: "SCIRC"}
    to = _krl_point(job, move.q, move.in_joints, move.name)
    via = "" if move.via is None else _krl_point(job, move.via, False, "") + ","
    text = f"{word[move.motion]} {via}{to}"
    if move.zone_mm:
        return f"$APO.CDIS={move.zone_mm:g}\r\n{text} C_SPL"
    return text


def _krl_point(job: NeutralJob, q: np.ndarray, in_joints: bool, name: str) -> str:
    if in_joints:
        angles = zip("123456", np.rad2deg(q), strict=True)
        return "{" + ",".join(f"A{k} {v:.5f}" for k, v in angles) + "}"
    if name:
        return f"X{name}"
    frame = _krl_frame(job.pose(q))[:-1]
    return f"{frame},{status(job, q)},E1 0.0,E2 0.0,E3 0.0,E4 0.0,E5 0.0,E6 0.0}}"


Writer = Callable[[NeutralJob], dict[str, bytes]]
LANGUAGES: dict[str, Writer] = {
    "job.pdl": lambda job: {"job.pdl": pdl2(job)},
    "job.mod": lambda job: {"job.mod": rapid(job)},
    "job.src": krl,
}


def compensated(
    name: str, files: Mapping[str, bytes], cell: Cell, model: Model
) -> Outcome:
    """Compensate the files of a job, the one of a name first."""
    pages = {page: data for page, data in files.items() if page != name}
    return compensate(files[name], cell, model, name=name, pages=pages)


def drawn(cell: Cell, seed: int, count: int = 40) -> NeutralJob:
    """Draw a job: joint moves, lines, arcs and zones around one pose."""
    rng = np.random.default_rng(seed)
    middle = np.deg2rad([20.0, -25.0, -110.0, 30.0, 50.0, 20.0])
    begin = middle - np.deg2rad(12.0)  # all joints turn on the way from home
    moves = [NeutralMove(Motion.JOINT, begin, in_joints=True)]
    for k in range(count):
        q = middle + np.deg2rad(rng.uniform(-9.0, 9.0, 6))
        kind = rng.choice(["joint", "line", "line", "arc", "angles"])
        zone = float(rng.choice([0.0, 0.0, 5.0, 10.0]))
        name = f"p{k}" if rng.random() < 0.4 else ""
        if kind == "angles":
            moves.append(NeutralMove(Motion.JOINT, q, in_joints=True))
        elif kind == "arc":
            via = middle + np.deg2rad(rng.uniform(-9.0, 9.0, 6))
            end = middle + np.deg2rad(rng.uniform(-9.0, 9.0, 6))
            moves.append(NeutralMove(Motion.CIRCULAR, end, via=via, name=name))
        else:
            motion = Motion.JOINT if kind == "joint" else Motion.LINEAR
            moves.append(NeutralMove(motion, q, zone_mm=zone, name=name))
    moves.append(NeutralMove(Motion.JOINT, middle, in_joints=True))
    tool = np.eye(4)
    tool[:3, :3] = Rotation.from_euler("ZYZ", [170.0, 60.0, -179.0], True).as_matrix()
    tool[:3, 3] = [-0.15562, 0.00118, 0.44173]
    uframe = np.eye(4)
    uframe[:3, :3] = Rotation.from_euler("ZYZ", [179.9, 2.0, 3.0], True).as_matrix()
    uframe[:3, 3] = [0.038412, 2.094755, 1.05238]
    return NeutralJob(cell, tool, uframe, tuple(moves))
