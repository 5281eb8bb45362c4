"""Outcomes made by hand: a path on a cylinder, errors of a millimetre."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from postproc.compensation.outcome import Decisions, Outcome, Status
from postproc.compensation.output.sidecar import Sidecar
from postproc.diagnostics import NO_REASON, Code, Reason
from postproc.language.pdl2.pose_encoding import PDL2_DIALECT
from postproc.language.visits import Diagnostic, Literals, NumberPlaces, Visits
from postproc.model.statistics import ErrorStatistics
from tests.made_visits import assemble

REASONS = (
    NO_REASON,
    Reason(
        Code.ARRIVALS_DIFFER,
        "its arrivals differ by more than conflict_mm = 0.02 "
        "(see --shared-points clone)",
    ),
    Reason(Code.NUMBERS_NOT_OWN, "its numbers are not written in the program"),
    Reason(Code.SINGULAR_WRIST, "joint 5 is within 3 deg of the wrist singularity"),
    Reason(Code.NO_TARGET, "this move holds no target"),
)
FIRST_LINE = 4  # of the moves in `program_text`


def program_text(n: int, extra: str = "") -> bytes:
    """Write a program of n moves, one a line, the first on line `FIRST_LINE`."""
    p = path(n)
    head = f"PROGRAM panel\r\n-- B\xfcgel {extra}\r\nBEGIN\r\n"
    moves = (
        f"  MOVEFLY LINEAR TO POS({x:.3f}, {y:.3f}, {z:.3f}, -70.6800, 140.4690, "
        "-11.6190, '') ADVANCE\r\n"
        for x, y, z in p.tolist()
    )
    return (head + "".join(moves) + "END panel\r\n").encode("latin-1", "replace")


def path(n: int) -> np.ndarray:
    """Place n targets on a cylinder, (n, 3) [mm], user frame."""
    turn = np.linspace(0.0, 12.0 * np.pi, n)
    return np.column_stack(
        [300 * np.cos(turn), 300 * np.sin(turn), np.linspace(0.0, 400.0, n)]
    )


def visits_of(n: int, name: str, names: tuple[str, ...]) -> Visits:
    """Make n visits of as many literals in one file."""
    index, no = np.arange(n), np.zeros(n, dtype=bool)
    nan = np.full(n, np.nan)
    line = index + FIRST_LINE
    angles = np.tile([-70.68, 140.469, -11.619], (n, 1))
    start = np.zeros((n, 6), dtype=np.int64)
    name_of = index % len(names)
    literals = Literals(
        index * 0,
        line,
        NumberPlaces.of(start, start + 5),
        no,
        tuple(names[k] for k in name_of),
        no,
        no,
        ("",) * n,
    )
    return assemble(
        files=(name,),
        file=index * 0,
        line=line,
        kind=index * 0 + 1,
        meaning=index * 0,
        via=no,
        values=np.column_stack([path(n), angles]),
        distance_mm=nan,
        aux=np.empty((n, 0)),
        config=index * 0,
        configs=("",),
        config_given=no,
        literal=index,
        follows=index * 0 - 1,
        name=name_of,
        names=names,
        tool=index * 0,
        base=index * 0,
        uframe=index * 0,
        poses=np.eye(4)[None],
        taught=np.zeros(1, dtype=bool),
        tool_remote=no,
        nearest_turn=no,
        care=np.zeros((n, 3), dtype=np.int64),
        fly=~no,
        size_mm=nan,
        overlap_percent=nan,
        blend=index * 0,
        rule=index * 0,
        linear=nan,
        turning=nan,
        override=np.ones(n),
        wrist_joint=no,
        orientation_law=index * 0,
        arc_angle=nan,
        block=index * 0 - 1,
        curved=no,
        reason=index * 0,
        reasons=("",),
        pred_start=np.arange(n + 1),
        pred=index - 1,
        measure_id=("",) * n,
        literals=literals,
        dialect=PDL2_DIALECT,
    )


def decisions_of(visits: Visits, seed: int) -> Decisions:
    """Correct nine of ten visits; leave the others alone for various reasons."""
    n = len(visits)
    rng = np.random.default_rng(seed)
    turn = np.linspace(0.0, 12.0 * np.pi, n)
    side = np.sign(np.sin(turn[:, None] * np.arange(1, 7) + 0.3)).astype(np.int64)
    side[:: max(n // 7, 1), 4] = 0
    status = np.zeros(n, dtype=np.int64)
    kinds = [Status.CONFLICT, Status.RUNTIME, Status.REJECTED, Status.UNCHANGED]
    for k, kind in enumerate(kinds):
        status[3 + k :: 40] = kind
    why = np.array([0, 1, 2, 3, 4])[status]
    correction = 1e-3 * np.column_stack(
        [0.6 * np.cos(turn), 0.5 + 0.2 * side[:, 0], 0.4 * np.sin(turn)]
    ) + rng.normal(0.0, 2e-5, (n, 3))
    correction[status != Status.CORRECTED] = 0.0
    corrected = np.array(visits.target.values)
    corrected[:, :3] += correction * 1e3
    q = rng.uniform(-1.5, 1.5, (n, 6))
    std = np.full((n, 3), 1.2e-5)
    return Decisions(status, why, REASONS, q, side, side, corrected, correction, std)


def outcome_of(
    n: int = 200,
    name: str = "panel.pdl",
    names: tuple[str, ...] = ("", "hole_1", "hole_2"),
    extra: str = "",
    seed: int = 1,
    sources: Mapping[str, bytes] | None = None,
) -> Outcome:
    """Make the outcome of a program of n moves."""
    visits = visits_of(n, name, names)
    decisions = decisions_of(visits, seed)
    safe = decisions.status == Status.CORRECTED
    left = np.random.default_rng(seed).normal(0.0, 5e-6, (int(safe.sum()), 3))
    return Outcome(
        program=name,
        model="0123456789abcdef",
        outputs={},
        record=Sidecar("0", "model", {}),
        visits=visits,
        decisions=decisions,
        before=ErrorStatistics.of(decisions.correction[safe]),
        after=ErrorStatistics.of(left),
        diagnostics=(Diagnostic(name, 1, "assumed", f"taken to be off {extra}"),),
        stages={"parse": 0.1, "plan": 0.5, "solve": 0.2},
        position=path(n) * 1e-3 + [1.6, -0.3, 0.9],
        sources={name: program_text(n, extra)} if sources is None else sources,
    )
