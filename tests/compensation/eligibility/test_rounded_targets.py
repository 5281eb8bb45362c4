"""Flags of targets that are passed in a zone: of the target, not of the corner."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from postproc.compensation.compensate import compensate
from postproc.compensation.outcome import Status
from postproc.compensation.program import plan_visits, read_program
from postproc.diagnostics import Code
from postproc.robot.pose import MM
from tests.any_controller import any_controller
from tests.compensation.curved import (  # noqa: F401
    KR,
    TOOL,
    curved_cell,
    curved_model,
    tool_pose,
)

PASSED = 1  # the visit that is passed
NONE = "[9E9,9E9,9E9,9E9,9E9,9E9]"
LOAD = "[0.001,[0,0,0.001],[1,0,0,0],0,0,0]"
AROUND = [0.0, -80.0, 90.0, 10.0, 45.0, 10.0]  # [deg]


def pose_of(degrees):
    """Return where the tool is with joints (6,) [deg]."""
    return KR.flange(np.deg2rad([degrees]))[0] @ tool_pose()


def rapid(begin, there, away, turned, zone):
    """Write a job in RAPID; the target counts the quarter turns of joints `turned`."""

    def target(q, own):
        pose = pose_of(q)
        x, y, z, w = Rotation.from_matrix(pose[:3, :3]).as_quat().tolist()
        place = ",".join(f"{v:.4f}" for v in (pose[:3, 3] / MM).tolist())
        count = np.floor(np.array(own)[[0, 3, 5]] / 90.0).astype(int).tolist()
        slot = int(KR.branch(np.deg2rad([q]))[0])
        cfx = 4 * bool(slot & 2) + 2 * bool(slot & 1) + bool(slot & 4)
        flags = ",".join(map(str, [*count, cfx]))
        return f"[[{place}],[{w:.12f},{x:.12f},{y:.12f},{z:.12f}],[{flags}],{NONE}]"

    tool = f"[TRUE,[[{TOOL[0]},{TOOL[1]},{TOOL[2]}],[1,0,0,0]],{LOAD}]"
    joints = ",".join(f"{v:.5f}" for v in begin)
    return f"""MODULE job
  TASK PERS tooldata tTip:={tool};
  PROC main()
    MoveAbsJ [[{joints}],{NONE}],v200,fine,tTip;
    MoveJ {target(there, turned)},v200,{"z50" if zone else "fine"},tTip;
    MoveJ {target(away, away)},v200,fine,tTip;
    EXIT;
  ENDPROC
ENDMODULE
"""


def krl(begin, there, away, turned, zone):
    """Write the same in KRL; T of the target is that of joints `turned`."""

    def target(q, own):
        pose = pose_of(q)
        x, y, z = (pose[:3, 3] / MM).tolist()
        a, b, c = Rotation.from_matrix(pose[:3, :3]).as_euler("ZYX", True).tolist()
        slot = int(KR.branch(np.deg2rad([q]))[0])
        s = bool(slot & 2) + 2 * (not slot & 1) + 4 * bool(slot & 4)
        t = sum(2**k for k in range(6) if own[k] < 0)
        return (f"{{X {x:.4f},Y {y:.4f},Z {z:.4f},A {a:.10f},B {b:.10f},C {c:.10f},"
                f"S {s},T {t}}}")  # fmt: skip

    joints = ",".join(f"A{k} {v:.5f}" for k, v in enumerate(begin, 1))
    return f"""DEF job ( )
$TOOL={{X {TOOL[0]},Y {TOOL[1]},Z {TOOL[2]},A 0,B 0,C 0}}
$BASE=$NULLFRAME
$APO.CPTP=100
PTP {{{joints}}}
PTP {target(there, turned)}{" C_PTP" if zone else ""}
PTP {target(away, away)}
END
"""


@pytest.mark.parametrize("zone", [False, True])
@pytest.mark.parametrize(("name", "write"), [("job.mod", rapid), ("job.src", krl)])
def test_flags_are_those_of_the_target(cell, model, name, write, zone):
    """Joint 1 has passed 0 where the corner passes a target beside 0."""
    cell, rng, crossed = any_controller(cell), np.random.default_rng(7), 0
    for k in range(6):
        side = (-1.0) ** k
        there = np.array(AROUND) + rng.uniform(-3.0, 3.0, 6)
        begin, away, other = np.array(there), np.array(there), np.array(there)
        begin[0], away[0] = side * np.array([20.0, -20.0])
        begin[1] -= 15.0
        there[0] = other[0] = side * rng.uniform(0.05, 0.15)
        other[0] *= -1.0
        text = write(begin, there, away, there, zone).encode()
        plan = plan_visits(read_program({name: text}, cell).visits, cell).plan
        crossed += plan.q[PASSED, 0] * side < 0
        d = compensate(text, cell, model, name=name).decisions
        assert d.status[PASSED] == Status.CORRECTED, d.reasons[d.why[PASSED]]
        assert (d.corrected[PASSED, 6:] == read_program({name: text}, cell)
                .visits.target.values[PASSED, 6:]).all()  # fmt: skip
        text = write(begin, there, away, other, zone).encode()
        d = compensate(text, cell, model, name=name).decisions
        assert d.reasons[d.why[PASSED]].code is Code.CONFIGURATION_CONTRADICTED
    assert crossed == 6 * zone
