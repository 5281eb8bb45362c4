"""Write a measuring program in PDL2."""

from __future__ import annotations

from collections.abc import Iterator

from postproc.language.measuring_program import (
    MeasuringMove,
    MeasuringProgram,
    MountedProbe,
    number_list,
)


def write_pdl2(program: MeasuringProgram) -> str:
    """Write it with $TOOL for the probe points, and a DELAY at every measured stop."""
    lines = [
        *(f"-- {text}" for text in program.heading),
        f"PROGRAM {program.name} EZ, HOLD",
        "BEGIN",
        "  $TERM_TYPE := FINE",
    ]
    for step in program.steps:
        lines += _write_step(step, program)
    return "\n".join([*lines, f"END {program.name}", ""])


def _write_step(
    step: MountedProbe | MeasuringMove, program: MeasuringProgram
) -> Iterator[str]:
    if isinstance(step, MountedProbe):
        yield f"  -- probe point {step.number}"
        yield f"  $TOOL := POS({number_list(step.xyz_mm, 3, ', ')}, 0, 0, 0, '')"
        return
    if step.measured:
        yield f"  -- MEASURE {step.measured}"
    yield f"  MOVE JOINT TO {{{number_list(step.joints_deg, 5, ', ')}}}"
    if step.measured:
        yield f"  DELAY {1000 * program.settle_s:.0f}"
