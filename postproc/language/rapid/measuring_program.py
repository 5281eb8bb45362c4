"""Write a measuring program in RAPID."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from postproc.language.measuring_program import (
    CORNER_MM,
    SLOW,
    MeasuringLine,
    MeasuringProgram,
    MeasuringStep,
    MountedProbe,
    number_list,
)
from postproc.language.rapid.pose_encoding import (
    COUNTED,
    QUARTER,
    quaternion_from_rotation,
)
from postproc.robot.pose import MM

_NO_LOAD = "[0.001,[0,0,0.001],[1,0,0,0],0,0,0]"  # as of tool0: it states nothing
_OUTSIDE = "[9E9,9E9,9E9,9E9,9E9,9E9]"  # external axes stay where they are


def write(program: MeasuringProgram) -> str:
    """Write a module: a tooldata for each probe point, moves and waits in main.

    The tool is a local persistent, which no other module or task can mean.
    """
    load = _write_load(program)
    tools = (
        f"  LOCAL PERS tooldata {_tool(one)}:="
        f"[TRUE,[[{number_list(one.xyz_mm, 3)}],[1,0,0,0]],{load}];"
        for one in program.probes
    )
    lines = [
        f"MODULE {program.name}",
        *(f"  ! {text}" for text in program.heading),
        *dict.fromkeys(tools),
        "  PROC main()",
    ]
    mounted = ""
    for step in program.steps:
        mounted = _tool(step) if isinstance(step, MountedProbe) else mounted
        lines += _write_step(step, mounted, program)
    return "\n".join([*lines, "  ENDPROC", "ENDMODULE", ""])


def _tool(probe: MountedProbe) -> str:
    return f"tProbe{probe.number}"


def _write_load(program: MeasuringProgram) -> str:
    """Write the load that the arm carries with every tool."""
    if not program.mass_kg > 0.0:
        return _NO_LOAD
    centre = number_list(program.centre_mm, 3)
    return f"[{program.mass_kg:g},[{centre}],[1,0,0,0],0,0,0]"


def _write_step(
    step: MeasuringStep, tool: str, program: MeasuringProgram
) -> Iterator[str]:
    if isinstance(step, MountedProbe):
        yield f"    ! probe point {step.number}"
        return
    if isinstance(step, MeasuringLine):
        zone = f"z{CORNER_MM}" if step.flown else "fine"
        yield f"    MoveL {_write_target(step)},v{SLOW:.0f},{zone},{tool};"
        return
    if step.measured:
        yield f"    ! MEASURE {step.measured}"
    joints = f"[[{number_list(step.joints_deg, 5)}],{_OUTSIDE}]"
    yield f"    MoveAbsJ {joints},v{SLOW:.0f},fine,{tool};"
    if step.measured:
        yield f"    WaitTime \\InPos,{program.settle_s:g};"


def _write_target(line: MeasuringLine) -> str:
    """Write the end of a line as a robtarget in the world, which is wobj0."""
    quaternion = quaternion_from_rotation(line.pose[None, :3, :3])[0]
    counts = np.floor(line.q[0, list(COUNTED)] / QUARTER).astype(int)
    place = number_list(tuple((line.pose[:3, 3] / MM).tolist()), 4)
    turned = number_list(tuple(quaternion.tolist()), 7)
    w, s, e = line.slot >> 2 & 1, line.slot >> 1 & 1, line.slot & 1
    config = ",".join(map(str, (*counts, 4 * s + 2 * e + w)))
    return f"[[{place}],[{turned}],[{config}],{_OUTSIDE}]"
