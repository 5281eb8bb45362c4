"""Write a measuring program in PDL2."""

from __future__ import annotations

from collections.abc import Iterator

from postproc.language.measuring_program import (
    CORNER_MM,
    SHARE,
    SLOW,
    MeasuringLine,
    MeasuringProgram,
    MeasuringStep,
    MountedProbe,
    number_list,
)

# Of all speeds: links that run on as an arm brakes rest on other flanks than at work.
_GENTLY = f"  $PROG_SPD_OVR := {SHARE}"
# Speed of lines, at that override, and where they leave them for the next one.
_LINES = (
    f"  $LIN_SPD := {SLOW / 10 / SHARE:g}",
    "  $FLY_TYPE := FLY_CART",
    "  $FLY_TRAJ := FLY_FROM",
    f"  $FLY_DIST := {CORNER_MM}",
)


def write(program: MeasuringProgram) -> str:
    """Write it with $TOOL for the probe points, and a DELAY at every measured stop."""
    lines = [
        *(f"-- {text}" for text in program.heading),
        f"PROGRAM {program.name} EZ, HOLD",
        "BEGIN",
        "  $TERM_TYPE := FINE",
        _GENTLY,
        *(_LINES if program.has_lines else ()),
    ]
    for step in program.steps:
        lines += _write_step(step, program)
    return "\n".join([*lines, f"END {program.name}", ""])


def _write_step(step: MeasuringStep, program: MeasuringProgram) -> Iterator[str]:
    if isinstance(step, MountedProbe):
        yield f"  -- probe point {step.number}"
        yield f"  $TOOL := POS({number_list(step.xyz_mm, 3, ', ')}, 0, 0, 0, '')"
        return
    joints = f"{{{number_list(step.joints_deg, 5, ', ')}}}"
    if isinstance(step, MeasuringLine):
        end = " ADVANCE" if step.flown else ""
        yield f"  MOVE{'FLY' if step.flown else ''} LINEAR TO {joints}{end}"
        return
    if step.measured:
        yield f"  -- MEASURE {step.measured}"
    yield f"  MOVE JOINT TO {joints}"
    if step.measured:
        yield f"  DELAY {1000 * program.settle_s:.0f}"
