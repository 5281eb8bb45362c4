"""Write a measuring program in KRL."""

from __future__ import annotations

from collections.abc import Iterator

from postproc.language import measuring_program
from postproc.language.krl.pose_encoding import numbers_of
from postproc.language.krl.symbols import AXES

# What the inline form INI of every program says, then speed and acceleration.
_INI = (
    ";FOLD INI",
    "GLOBAL INTERRUPT DECL 3 WHEN $STOPMESS==TRUE DO IR_STOPM ( )",
    "INTERRUPT ON 3",
    "BAS (#INITMOV,0 )",
    ";ENDFOLD (INI)",
    f"BAS (#VEL_PTP,{measuring_program.SHARE} )",
    f"BAS (#ACC_PTP,{measuring_program.GENTLY} )",
)
# Lines are in the world, so fast, and leave for the next one so near their end.
_LINES = (
    "$BASE=$NULLFRAME",
    f"$VEL.CP={measuring_program.SLOW / 1000:g}",
    f"$APO.CDIS={measuring_program.CORNER_MM}",
)


def write(program: measuring_program.MeasuringProgram) -> str:
    """Write a source: its points stand in the moves, so it needs no data list."""
    lines = [
        "&ACCESS RVP",
        "&REL 1",
        f"DEF {program.name} ( )",
        *(f"; {text}" for text in program.heading),
        *_INI,
        *(_LINES if program.has_lines else ()),
        *_write_load(program),
    ]
    for step in program.steps:
        lines += _write_step(step, program)
    return "\r\n".join([*lines, "END", ""])


def _write_load(program: measuring_program.MeasuringProgram) -> Iterator[str]:
    """Write the load that the arm carries, nothing where it is not known."""
    if program.mass_kg > 0.0:
        centre = _frame(program.centre_mm)
        inertia = "{X 0.0,Y 0.0,Z 0.0}"
        yield f"$LOAD={{M {program.mass_kg:.3f},CM {centre},J {inertia}}}"


def _frame(xyz_mm: tuple[float, ...]) -> str:
    x, y, z = xyz_mm
    return f"{{X {x:.3f},Y {y:.3f},Z {z:.3f},A 0.0,B 0.0,C 0.0}}"


def _write_step(
    step: measuring_program.MeasuringStep, program: measuring_program.MeasuringProgram
) -> Iterator[str]:
    if isinstance(step, measuring_program.MountedProbe):
        yield f"; probe point {step.number}"
        yield f"$TOOL={_frame(step.xyz_mm)}"
        return
    if isinstance(step, measuring_program.MeasuringLine):
        yield f"LIN {_write_pose(step)}{' C_DIS' if step.flown else ''}"
        return
    if step.measured:
        yield f"; MEASURE {step.measured}"
    named = zip(AXES, step.joints_deg, strict=True)
    yield f"PTP {{{','.join(f'{name.upper()} {v:.5f}' for name, v in named)}}}"
    if step.measured:
        yield f"WAIT SEC {program.settle_s:.1f}"


def _write_pose(line: measuring_program.MeasuringLine) -> str:
    """Write the end of a line as a frame, which keeps the configuration."""
    named = zip("XYZABC", numbers_of(line.pose), strict=True)
    return f"{{{','.join(f'{name} {v:.5f}' for name, v in named)}}}"
