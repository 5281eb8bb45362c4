"""The arm file: what is known of an arm, as plain numbers."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, TypeVar

import numpy as np
import pydantic
from pydantic import BaseModel, ConfigDict, Field, PositiveFloat, model_validator

from postproc.arrays import Floats
from postproc.exceptions import ArmError, FileError
from postproc.files import path_in

# Reading TOML files with messages that name the place.

MAX_BYTES = 1_000_000  # no arm or cell file is longer; a longer one is a mistake

Triple = Annotated[list[float], Field(min_length=3, max_length=3)]
Sextuple = Annotated[list[float], Field(min_length=6, max_length=6)]


class Strict(BaseModel):
    """A section of a file: unknown keys and non-finite numbers are errors.

    Attributes:
        RENAMED: Keys of earlier versions, and what they are called now.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
    RENAMED: ClassVar[Mapping[str, str]] = {}


Schema = TypeVar("Schema", bound=Strict)


def read_toml(path: Path, schema: type[Schema], error: type[FileError]) -> Schema:
    """Read and validate a TOML file.

    Raises:
        FileError: Of the given type, naming the file and the first wrong place.
    """
    try:
        raw = path.read_bytes()
    except OSError as exc:
        raise error(
            path, f"cannot be read ({exc.strerror})", "Check the path"
        ) from None
    if len(raw) > MAX_BYTES:
        raise error(path, f"is longer than {MAX_BYTES} bytes", "Check the path")
    return parse_toml(path, raw, schema, error)


def parse_toml(
    path: Path, raw: bytes, schema: type[Schema], error: type[FileError]
) -> Schema:
    """Validate the bytes of a TOML file.

    Raises:
        FileError: Of the given type, naming the file and the first wrong place.
    """
    return validate(path, load_toml(path, raw, error), schema, error)


def load_toml(path: Path, raw: bytes, error: type[FileError]) -> dict[str, Any]:
    """Read the bytes of a TOML file.

    Raises:
        FileError: Of the given type, naming the file and the place of the mistake.
    """
    try:
        return tomllib.loads(raw.decode("utf-8-sig"))
    except UnicodeDecodeError:
        raise error(path, "is not UTF-8 text", "Save it as UTF-8") from None
    except tomllib.TOMLDecodeError as exc:
        text, _, place = str(exc).partition(" (at line ")
        numbers = [int(n) for n in re.findall(r"\d+", place)]
        line, column = numbers if len(numbers) == 2 else (None, None)
        problem, cure = f"is not valid TOML: {text}", "Mend the syntax"
        raise error(path, problem, cure, line=line, column=column) from None
    except RecursionError:
        raise error(path, "is nested too deeply", "Write it flat") from None
    except ValueError:
        problem = "holds an integer of more digits than any number needs"
        raise error(path, problem, "Write it shorter") from None


def validate(
    path: str | Path,
    data: Mapping[str, object],
    schema: type[Schema],
    error: type[FileError],
) -> Schema:
    """Validate what a file, or a part of it, holds.

    Raises:
        FileError: Of the given type, naming the file and the first wrong place.
    """
    try:
        return schema.model_validate(data)
    except pydantic.ValidationError as exc:
        raise _explain(path, exc, schema, error) from None


def _explain(
    path: str | Path,
    exc: pydantic.ValidationError,
    schema: type[Strict],
    error: type[FileError],
) -> FileError:
    """Turn the first validation error into a message with place and cure."""
    found = exc.errors()
    # A key with another unit is unknown, and the right one missing: tell the former.
    unknown = [e for e in found if e["type"] == "extra_forbidden"]
    first = (unknown or found)[0]
    place = "$" + "".join(
        f"[{k + 1}]" if isinstance(k, int) else f".{k}" for k in first["loc"]
    )
    if first["type"] == "extra_forbidden":
        section = _section(schema, first["loc"][:-1])
        if (new := section.RENAMED.get(str(first["loc"][-1]))) is not None:
            return error(path, f"is called {new}", "Rename the key", place=place)
        allowed = ", ".join(section.model_fields)
        return error(path, "unknown key", f"Known here: {allowed}", place=place)
    if first["type"] == "missing":
        return error(path, "required key is missing", "Add it", place=place)
    message = first["msg"].removeprefix("Value error, ")
    return error(path, message, "Correct the value", place=place)


def _section(schema: type[Strict], place: tuple[int | str, ...]) -> type[Strict]:
    here = schema
    for key in place:
        field = here.model_fields.get(str(key))
        nested = field.annotation if field else None
        options = getattr(nested, "__args__", (nested,))
        for option in options:
            if isinstance(option, type) and issubclass(option, Strict):
                here = option
    return here


# The arm file: what is known of an arm, as plain numbers.

ARMS = Path(__file__).parent / "arms"
NEARLY_PARALLEL = 0.01  # sine of the angle between axes 2 and 3 of a parallelogram


class DhSection(Strict):
    """Standard Denavit-Hartenberg parameters and the controller's angle convention.

    `axis2_in_axis3`: what joint angle 2 adds to joint angle 3 in the chain: -1 or 1
    where the forearm keeps its direction while joint 2 moves alone, else 0. Older
    files state it without its sign, as `axis3_adds_axis2`.
    """

    a_mm: Sextuple
    d_mm: Sextuple
    alpha_deg: Sextuple
    offset_deg: Sextuple = [0.0] * 6
    sense: Sextuple = [1.0] * 6
    shift_deg: Sextuple = [0.0] * 6
    axis2_in_axis3: float | None = Field(default=None, exclude=True)
    axis3_adds_axis2: bool = False

    @model_validator(mode="before")
    @classmethod
    def _one_key(cls, data: object) -> object:
        share = data.get("axis2_in_axis3") if isinstance(data, Mapping) else None
        if not isinstance(data, Mapping) or not isinstance(share, (int, float)):
            return data
        if "axis3_adds_axis2" in data:
            raise ValueError("axis2_in_axis3 replaces axis3_adds_axis2: leave one out")
        return {**data, "axis3_adds_axis2": share != 0}

    @model_validator(mode="after")
    def _signs(self) -> DhSection:
        if any(abs(s) != 1 for s in self.sense):
            raise ValueError("sense must be +1 or -1")
        return self

    @model_validator(mode="after")
    def _parallelogram(self) -> DhSection:
        share = self.axis2_in_axis3
        key = "axis3_adds_axis2" if share is None else "axis2_in_axis3"
        tilt = abs(math.sin(math.radians(self.alpha_deg[1])))
        if self.axis3_adds_axis2 and tilt > NEARLY_PARALLEL:
            raise ValueError(
                f"{key} needs axes 2 and 3 parallel: alpha_deg[2] of 0 or 180"
            )
        if share is not None and share != self.axis2_share:
            raise ValueError(
                f"axis2_in_axis3 = {share:g} makes the forearm turn with joint 2: for "
                f"these senses and angles it is {self.axis2_share:g}, or 0"
            )
        return self

    @property
    def axis2_share(self) -> float:
        """Share of joint angle 2 in the D-H angle of joint 3, before its sense.

        >>> lengths = {"a_mm": [0.0] * 6, "d_mm": [0.0] * 6, "alpha_deg": [0.0] * 6}
        >>> DhSection(**lengths, axis3_adds_axis2=True).axis2_share
        -1.0
        """
        if not self.axis3_adds_axis2:
            return 0.0
        return compensating_share(self.sense, math.radians(self.alpha_deg[1]))


def compensating_share(sense: Sequence[float], alpha2: float) -> float:
    """Compute the share of joint angle 2 that keeps the forearm's direction.

    The forearm turns by sense2 * q2 + cos(alpha2) * sense3 * (q3 + share * q2)
    about axis 2, and the share takes q2 out of this sum.

    Args:
        sense: Of the joints, +1 or -1, 6 numbers.
        alpha2: D-H angle from axis 2 to axis 3, near 0 or pi [rad].
    """
    return -1.0 if sense[1] * sense[2] * math.cos(alpha2) > 0 else 1.0


class ArmJointSection(Strict):
    """Limits, play and gears of the six joints.

    A gear ratio of 0 is one that is not known. Drive-side angles are `drive_coupling`
    times joint angles: which motors turn when a joint of the wrist does.
    Speeds are needed to plan programs, not to fit; where accelerations and jerks are
    not given, full speed is reached in 0.4 s and full acceleration in 0.1 s.
    """

    lower_deg: Sextuple
    upper_deg: Sextuple
    velocity_deg_s: Sextuple | None = None
    acceleration_deg_s2: Sextuple | None = None
    jerk_deg_s3: Sextuple | None = None
    guessed: list[Literal["velocity", "acceleration", "jerk"]] = []
    play_deg: Sextuple = [0.01] * 6
    gear_ratio: Sextuple | None = None
    drive_coupling: (
        Annotated[list[Sextuple], Field(min_length=6, max_length=6)] | None
    ) = None

    @model_validator(mode="after")
    def _ranges(self) -> ArmJointSection:
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
            if min(getattr(self, name) or [1.0]) <= 0:
                raise ValueError(f"{name} must be positive")
        if any(0.0 < abs(r) < 1.0 for r in self.gear_ratio or ()):
            raise ValueError(
                "gear_ratio is turns of the motor per turn of the joint, 1 or more; "
                "0 where not known"
            )
        coupling = np.array(self.drive_coupling or np.eye(6))
        if np.linalg.matrix_rank(coupling) < 6:
            raise ValueError("drive_coupling must be invertible")
        return self


class LinkSection(Strict):
    """Masses and centres of mass of the six links, in their D-H frames.

    Their true moments differ by `spread`, a share: 0.1 where a maker states them, 0.5
    where they are those of a URDF.
    """

    mass_kg: Sextuple
    com_mm: Annotated[list[Triple], Field(min_length=6, max_length=6)]
    spread: Annotated[float, Field(gt=0.0, le=1.0)] = 0.1


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


Controller = Literal["comau", "abb", "kuka", "other"]
"""Whose controller an arm has; it runs programs of one language."""


class ArmFile(Strict):
    """A whole arm file."""

    name: str
    controller: Controller | None = None
    repeatability_mm: PositiveFloat
    dh: DhSection
    joints: ArmJointSection
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
    path = Path(name) if beside is None else path_in(beside, name)
    if path.is_file():
        return path
    known = ", ".join(list_shipped_arms())
    raise ArmError(name, "no such arm", f"Shipped arms: {known}; or give a path")


def list_shipped_arms() -> list[str]:
    """Name the arms that come with the package.

    >>> "nj220-2.7" in list_shipped_arms()
    True
    """
    return sorted(path.name.removesuffix(".toml") for path in ARMS.glob("*.toml"))


def read_arm_file(path: Path) -> ArmFile:
    """Read and validate an arm file.

    Raises:
        ArmError: Naming the place and the cure.
    """
    return read_toml(path, ArmFile, ArmError)


# Numbers as they are written into arm files.


def number_text(value: float) -> str:
    """Write a number to 1e-9, without a sign of zero.

    >>> number_text(-0.0000000001), number_text(89.9999999999)
    ('0.0', '90.0')
    """
    return repr(round(float(value), 9) + 0.0)


def list_text(values: Sequence[float] | Floats) -> str:
    """Write a list of numbers."""
    return f"[{', '.join(map(number_text, values))}]"
