"""Points of which it is not known whether the arm stops there, or how it passes."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from postproc.compensation.outcome import Status
from postproc.compensation.program import read_program
from postproc.compensation.solver.targets import find_open_corners
from postproc.language.visits import ZoneRule
from postproc.motion.spline_moves import turns_at_unknown_blends
from postproc.motion.targets import Fly
from postproc.report.simulation import setup_of
from postproc.robot.arm import load_arm
from postproc.robot.trajectory import Motion
from postproc.simulation import land, virtual_arm
from tests.conftest import SEED
from tests.language.neutral_job import compensated, drawn, krl
from tests.made_targets import make_targets

SIZE = re.compile(rb"\$APO\.CDIS=[^\r\n]+")


def of_any_size(files):
    """Return a job whose zones have a size that it does not say."""
    return {name: SIZE.sub(b"$VEL.CP=0.2", text) for name, text in files.items()}


def executed(files, size):
    """Return what a controller runs whose zones have a size [mm], or that stops."""
    if size is None:
        return {n: re.sub(rb"(?m)( C_SPL)", b"", text) for n, text in files.items()}
    given = b"$VEL.CP=0.2\r\n$APO.CDIS=%g" % size
    return {n: text.replace(b"$VEL.CP=0.2", given) for n, text in files.items()}


@pytest.mark.parametrize("seed", range(4))
def test_the_arm_lands_there_whatever_the_controller_does(
    bench_cell, bench_model, seed
):
    source = of_any_size(krl(drawn(bench_cell, seed)))
    found = compensated("job.src", source, bench_cell, bench_model)
    v, d = found.visits, found.decisions
    assert (v.zone.rule == ZoneRule.UNKNOWN).sum() > 5
    assert "fly-unknown" in {one.code for one in found.diagnostics}
    body, setup = (
        virtual_arm(SEED, tool=setup_of(bench_cell).tool),
        setup_of(bench_cell),
    )
    for size in (None, 1.0, 8.0, 60.0):
        given, made = (
            read_program(executed(files, size), bench_cell).visits
            for files in (source, {**source, **found.outputs})
        )
        before, after = land(body, setup, given), land(body, setup, given, made)
        rows = after.visit
        points = (d.status[rows] == Status.CORRECTED) & ~v.motion.via[rows] & (rows > 0)
        points &= v.zone.rule[rows] == ZoneRule.UNKNOWN
        sure = points & (d.direction[rows] != 0).all(axis=1)
        was, is_ = (1e3 * np.linalg.norm(x.error, axis=1) for x in (before, after))
        assert points.sum() > 5
        assert is_[sure].max(initial=0.0) <= 0.1
        assert (is_[points] < was[points]).all()  # beside that: half of a gap
        assert is_[points].mean() < 0.3 * was[points].mean()


def moves(*q):
    """Return joint moves and the joint angles that they lead to."""
    angles = np.tile(np.deg2rad([0.0, -80.0, 100.0, 0.0, 50.0, 0.0]), (len(q), 1))
    angles[:, 0] += q
    fly = np.arange(len(q)) < len(q) - 1
    targets = make_targets(
        np.ones(len(q)), joints=angles, move=np.zeros(len(q)), fly=fly,
        rounding=np.full(len(q), int(Fly.UNKNOWN)),
    )  # fmt: skip
    return targets, angles


@pytest.mark.parametrize(
    ("angles", "side", "unknown"),
    [
        ((0.0, 0.1, 0.2), 1.0, False),  # it goes on
        ((0.0, 0.1, 0.0), 1.0, True),  # it turns back
        ((0.0, 0.1, 0.1), 1.0, False),  # it rests behind the point
        ((0.1, 0.1, 0.2), 1.0, False),  # it came from there before
        ((0.1, 0.1, 0.2), -1.0, True),  # it sets out to the other side
        ((0.0, 0.1, 0.2), -1.0, True),  # it turned back on the way
        ((0.0, 0.1, 0.2), 0.0, True),
        ((0.1, 0.1, 0.1 - 1e-6), 1.0, False),  # by less than its play
    ],
)
def test_which_joints_may_arrive_on_another_side(angles, side, unknown):
    arm = load_arm("nj220-2.7")
    targets, q = moves(*angles)
    sides = np.ones((3, 6))
    sides[:, 0] = side
    found = turns_at_unknown_blends(arm, targets, q, sides)
    assert found[1].tolist() == [unknown, *(False,) * 5]
    assert not found[2].any()  # the arm stops there


WAYS = {  # predecessors of four moves, and whether axis 1 is sure at the second
    "one way": ([[-1], [0], [1], [2]], True),
    "one way in of two turns back": ([[-1], [0, 3], [1], [1]], False),
    "one way out of two turns back": ([[-1], [0], [1], [1]], False),
    "from anywhere, too": ([[-1], [0, -1], [1], [2]], True),
    "no known way out": ([[-1], [0], [-1], [2]], False),
    "from nowhere": ([[-1], [-1], [1], [2]], True),
}


@pytest.mark.parametrize("ways", WAYS)
def test_several_ways(ways):
    preds, sure = WAYS[ways]
    arm = load_arm("nj220-2.7")
    targets, q = moves(0.0, 0.1, 0.2, 0.05)
    targets = replace(
        targets, pred=np.array([p for own in preds for p in own]),
        pred_start=np.cumsum([0, *map(len, preds)]), fly=np.array([False, True] * 2),
    )  # fmt: skip
    found = turns_at_unknown_blends(arm, targets, q, np.ones((4, 6)))
    assert found[1, 0] != sure


def test_a_joint_on_a_coupled_drive():
    """Axis 4 goes on, but its turn turns the drive of axis 5 back behind the point."""
    arm = load_arm("kr210-r2700-extra")
    assert arm.coupling[4, 3] > 0.0
    targets, q = moves(0.0, 0.0, 0.0)
    q[:, 3] = [0.0, 0.2, -2.0]
    q[:, 4] = [0.5, 0.51, 0.515]
    sides = np.ones((3, 6))
    found = turns_at_unknown_blends(arm, targets, q, sides)
    assert found[1, 3] and found[1, 4]


@pytest.mark.parametrize("number", [np.nan, 0.0])
def test_what_is_not_known_or_singular_is_not_sure(number):
    arm = load_arm("nj220-2.7")
    targets, q = moves(0.0, 0.1, 0.2)
    targets = replace(targets, move=np.ones(3, dtype=np.int64))
    q[1, 4] = number
    found = turns_at_unknown_blends(arm, targets, q, np.ones((3, 6)))
    assert found[1].any()


def test_a_line_that_begins_backwards():
    """Axis 2 goes back at first on a line at the end of which it is farther on."""
    arm = load_arm("nj220-2.7")
    q = np.deg2rad([[0, 0, -90, 0, 60, 0.0]] * 2)
    start = arm.flange(q)
    found = []
    for x in np.linspace(-0.5, 0.5, 41):
        for z in np.linspace(-0.5, 0.5, 41):
            end = np.array(start[1:])
            end[0, [0, 2], 3] += x, z
            end_q = arm.inverse(end).q[0, int(arm.branch(q[:1])[0])]
            way = (end_q - q[0])[1]
            targets = make_targets(
                np.zeros(2), np.stack([start[0], end[0]]), move=[0, Motion.LINEAR],
                fly=[True, False], rounding=[Fly.UNKNOWN] * 2,
            )  # fmt: skip
            sides = np.sign(way) * np.ones((2, 6))
            both = np.stack([q[0], end_q])
            rate = np.linalg.solve(
                arm.jacobian(q[:1], np.zeros(3))[0], [x, 0, z, 0, 0, 0]
            )[1]
            if abs(way) > 0.01 and way * rate < -1e-3:
                unknown = turns_at_unknown_blends(arm, targets, both, sides)
                found.append(bool(unknown[0, 1]))
    assert len(found) > 5 and all(found)


FLY = "  MOVEFLY LINEAR TO POS(100, 200, 150, 0, 175, 0, '') ADVANCE"
ON = "  MOVE LINEAR TO POS(200, 100, 50, 0, 175, 0, '')"
BACK = "  MOVE LINEAR TO POS(0, 200, 150, 0, 175, 0, '')"
FIRST = "  MOVE JOINT TO {5, 10, -95, 20, 50, 30}"
CORNERS = {  # what stands round a fly point, and whether its corner is not known
    "one way": ([FIRST, FLY, ON], False),
    "two ways on": ([FIRST, FLY, "IF $DIN[1] THEN", ON, "ENDIF", BACK], True),
    "two ways in": ([FIRST, "IF $DIN[1] THEN", BACK, "ENDIF", FLY, ON], True),
    "to a place that is not known": ([FIRST, FLY, "  MOVE LINEAR TO p", ON], True),
    "in a frame that is not known": ([FIRST, FLY, "$UFRAME := f", ON], True),
    "to joints in such a frame": ([FIRST, FLY, "$UFRAME := f", FIRST], False),
    "before a wait": ([FIRST, FLY, "WAIT FOR $DIN[1]", ON], True),
    "before a wait in a routine": ([FIRST, FLY, "rest", ON], True),
    "before a delay": ([FIRST, FLY, "DELAY 200", ON], True),
    "before a question": ([FIRST, FLY, "READ (n)", ON], True),
    "before an output": ([FIRST, FLY, "$DOUT[1] := TRUE", ON], False),
    "before a signal": ([FIRST, FLY, "SIGNAL s", ON], False),
    "behind a wait": ([FIRST, "DELAY 200", FLY, ON], False),
    "passed exactly": ([FIRST, "$FLY_DIST := -1", FLY, "DELAY 200", ON], False),
    "at the end": ([FIRST, "IF $DIN[1] THEN", ON, "ENDIF", FLY], False),
}


@pytest.mark.parametrize("title", CORNERS)
def test_which_corners_are_not_known(bench_cell, title):
    lines, wanted = CORNERS[title]
    head = ["PROGRAM job", "VAR p, f : POSITION", "n : INTEGER", "s : SEMAPHORE"]
    head += ["ROUTINE rest", "BEGIN", "DELAY 200", "END rest", "BEGIN"]
    text = "\n".join([*head, *lines, "END job", ""]).encode()
    visits = read_program({"job.pdl": text}, bench_cell).visits
    assert find_open_corners(visits)[visits.motion.fly].tolist() == [wanted]


def test_a_stop_before_two_ways_is_no_corner(bench_cell):
    stop = FLY.replace("MOVEFLY", "MOVE").replace(" ADVANCE", "")
    lines = [FIRST, stop, "IF $DIN[1] THEN", ON, "ENDIF", BACK]
    text = "\n".join(["PROGRAM job", "BEGIN", *lines, "END job", ""]).encode()
    visits = read_program({"job.pdl": text}, bench_cell).visits
    assert not find_open_corners(visits).any()


ZONE = "MoveL [[119,77,-105],[0.21,-0.144,0.921,-0.294],[0,0,0,0],{}],v200,z10,tool0;"
WAYS_ON = {
    "WaitDI di1,1;": True,
    "WaitTime 0.2;": True,
    "Stop;": True,
    "n:=UINumEntry();": True,
    "drill_hole;": True,  # of which the cell says that it moves nothing
    "SetDO do1,1;": False,
    "n:=n+1;": False,
}


@pytest.mark.parametrize("line", WAYS_ON)
def test_what_may_stop_the_arm_at_a_zone(bench_cell, line):
    move = ZONE.format("[9E9,9E9,9E9,9E9,9E9,9E9]")
    lines = ["MODULE job", "VAR num n;", "PROC main()", move, line]
    lines += [move.replace("z10", "fine"), "EXIT;", "ENDPROC", "ENDMODULE"]
    text = "\n".join(lines).encode()
    visits = read_program({"job.mod": text}, bench_cell).visits
    assert find_open_corners(visits).tolist() == [WAYS_ON[line], False]
