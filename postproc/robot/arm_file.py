"""The arm file: what is known of an arm, as plain numbers."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import Field, PositiveFloat, model_validator

from postproc.exceptions import ArmError
from postproc.robot.schema import Sextuple, Strict, Triple, read_toml

ARMS = Path(__file__).parent / "arms"


class DhSection(Strict):
    """Standard Denavit-Hartenberg parameters and the controller's angle convention."""

    a_mm: Sextuple
    d_mm: Sextuple
    alpha_deg: Sextuple
    offset_deg: Sextuple = [0.0] * 6
    sense: Sextuple = [1.0] * 6
    shift_deg: Sextuple = [0.0] * 6
    axis3_adds_axis2: bool = False

    @model_validator(mode="after")
    def _signs(self) -> DhSection:
        if any(abs(s) != 1 for s in self.sense):
            raise ValueError("sense must be +1 or -1")
        return self


class JointSection(Strict):
    """Limits, play and gears of the six joints."""

    lower_deg: Sextuple
    upper_deg: Sextuple
    velocity_deg_s: Sextuple
    acceleration_deg_s2: Sextuple
    jerk_deg_s3: Sextuple
    play_deg: Sextuple = [0.01] * 6
    gear_ratio: Sextuple | None = None
    drive_coupling: (
        Annotated[list[Sextuple], Field(min_length=6, max_length=6)] | None
    ) = None

    @model_validator(mode="after")
    def _ranges(self) -> JointSection:
        for j in range(6):
            if self.lower_deg[j] >= self.upper_deg[j]:
                raise ValueError(
                    f"lower_deg[{j + 1}] must be less than upper_deg[{j + 1}]"
                )
        for name in (
            "velocity_deg_s",
            "acceleration_deg_s2",
            "jerk_deg_s3",
            "play_deg",
        ):
            if min(getattr(self, name)) <= 0:
                raise ValueError(f"{name} must be positive")
        return self


class LinkSection(Strict):
    """Masses and centres of mass of the six links, in their D-H frames."""

    mass_kg: Sextuple
    com_mm: Annotated[list[Triple], Field(min_length=6, max_length=6)]


class OpwSection(Strict):
    """Parameters of the closed-form inverse kinematics (ortho-parallel basis)."""

    a1_mm: float
    a2_mm: float
    b_mm: float
    c1_mm: float
    c2_mm: float
    c3_mm: float
    c4_mm: float
    offsets_deg: Sextuple
    flip_axes: Annotated[list[bool], Field(min_length=6, max_length=6)]


class ArmFile(Strict):
    """A whole arm file."""

    name: str
    repeatability_mm: PositiveFloat
    dh: DhSection
    joints: JointSection
    links: LinkSection | None = None
    opw: OpwSection | None = None


def arm_path(name: str, beside: Path | None = None) -> Path:
    """Find an arm file by shipped name, or by path (relative to `beside`).

    Raises:
        ArmError: No such arm; the message lists the shipped ones.
    """
    shipped = ARMS / f"{name}.toml"
    if shipped.parent == ARMS and shipped.is_file():
        return shipped
    path = Path(name) if beside is None else beside / name
    if path.is_file():
        return path
    known = ", ".join(sorted(p.stem for p in ARMS.glob("*.toml")))
    raise ArmError(name, "no such arm", f"Shipped arms: {known}; or give a path")


def read_arm_file(path: Path) -> ArmFile:
    """Read and validate an arm file.

    Raises:
        ArmError: Naming the place and the cure.
    """
    return read_toml(path, ArmFile, ArmError)
