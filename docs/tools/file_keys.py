"""Write docs/files.md: the keys of cell, project, plan and arm files, from the code.

python docs/tools/file_keys.py
"""

from __future__ import annotations

import inspect
import re
import types
import typing
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from postproc.batch.plan import PlanFile
from postproc.robot.arm_file import ArmFile, Sextuple, Strict, Triple
from postproc.robot.cell import CellFile
from postproc.robot.project_file import ProjectFile

PAGE = Path(__file__).parents[1] / "files.md"
HEAD = """# Files: every key

Written from the code by `python docs/tools/file_keys.py`. The files are TOML. An
unknown key is refused, with the place and the known keys. Units stand in the names
of keys.
"""
FILES: tuple[tuple[str, str, type[Strict]], ...] = (
    ("The cell file", "`cell.toml`, the option `--cell`. "
     "[What its settings do](cell.md).", CellFile),
    ("The project file", "`postproc.toml`. "
     "[How it is found](cell.md#the-project-file).", ProjectFile),
    ("The plan file", "The option `--plan` of `batch` names it. "
     "[An example](cluster.md).", PlanFile),
    ("The arm file", "`robot.arm` of the cell names it. "
     "[How to write one](arm-files.md).", ArmFile),
)  # fmt: skip
MEANINGS = {
    "SurveySection": "Probe points (SMR nests) in the flange frame, and poses. A 6D "
    "probe also needs its orientation there.",
    "SurveySection.points_mm": "the points, `tool_id` 0, 1 and so on",
    "CompensationSection.path_tolerance_mm": "points are inserted into moves with a "
    "larger predicted path error",
    "CompensationSection.shared_points": "what a point with "
    "several arrivals gets, see [settings](cell.md#compensation)",
    "LimitSection.averaged_mm": "largest error of an arrival at a point with one "
    "correction for all; more is listed, and the exit code is 1",
    "CellFile.tool": "TCP in the flange frame at the start of the program",
    "CellFile.base": "the arm's base in the world at the start of the program",
    "CellFile.uframe": "the user frame in the world at the start of the program",
    "CellFile.home": "`$HOME`",
    "CellFile.calibration": "`$CAL_SYS`",
    "CellFile.aux": 'auxiliary axes by number: `1 = "track"`',
    "CellFile.routines": "what outside routines do, by name; `motionless` lists names",
    "CellFile.taught": "names of points that were taught with the robot",
    "FrameSection.xyz_mm": "place of the frame",
    "FrameSection.euler_zyz_deg": "its orientation, Euler angles about z, y, z",
    "FrameSection.source": "origin of the numbers; `taught` holds the error of the arm",
    "FrameSection.taught_deg": "joint angles: origin, on +x, at +y",
    "FrameSection.taught_direction": "approach directions there: -1, 0 (unknown), 1",
    "JointPositionSection.joints_deg": "joint angles",
    "PayloadSection.mass_kg": "mass, tool included",
    "PayloadSection.com_mm": "centre of mass in the flange frame",
    "EnvironmentSection.temperature_c": "temperature of the correction",
    "TrackerSection.xyz_mm": "place of the tracker in the base frame",
    "VerifySection.second_opinion": "ask for a second opinion on the output",
    "VariablesSection.constant": "variables and data that no other program changes",
    "FramesSection.routines": "frames that a routine sets, by its name and arguments",
    "FrameTableEntry.tool": "TCP after the call",
    "FrameTableEntry.base": "base after the call",
    "FrameTableEntry.uframe": "user frame after the call",
    "PlanFile.rule": "rules; the first that fits a program counts",
    "RuleSection.pattern": "programs below the source folder: `*`, `?`, `**`",
    "RuleSection.arm": "only programs of this arm of a controller",
    "RuleSection.cell": "cell file, relative to the plan",
    "RuleSection.model": "model file, relative to the plan",
    "ArmFile.name": "name of the arm",
    "ArmFile.controller": "whose controller: it decides the language",
    "ArmFile.repeatability_mm": "repeatability of the data sheet",
    "DhSection.a_mm": "lengths a of the D-H rows",
    "DhSection.d_mm": "lengths d",
    "DhSection.alpha_deg": "angles alpha",
    "DhSection.offset_deg": "what is added to a joint angle",
    "DhSection.sense": "1 or -1 for each joint",
    "DhSection.shift_deg": "offset between the controller's angle and the joint's",
    "DhSection.axis2_in_axis3": "what joint angle 2 adds to joint angle 3: -1, 0 or 1",
    "DhSection.axis3_adds_axis2": "the same of older files, without the sign",
    "ArmJointSection.lower_deg": "lower limits",
    "ArmJointSection.upper_deg": "upper limits",
    "ArmJointSection.velocity_deg_s": "largest speeds; needed to plan programs",
    "ArmJointSection.acceleration_deg_s2": "without it full speed is reached in 0.4 s",
    "ArmJointSection.jerk_deg_s3": "without it full acceleration is reached in 0.1 s",
    "ArmJointSection.guessed": "which of these limits are guesses",
    "ArmJointSection.play_deg": "a joint turns by more than this to have a direction",
    "ArmJointSection.gear_ratio": "motor turns per joint turn, 0 if unknown",
    "ArmJointSection.drive_coupling": "drive angles are this matrix times joint angles",
    "LinkSection.mass_kg": "masses of the links",
    "LinkSection.com_mm": "centres of mass, in the D-H frames",
    "LinkSection.spread": "how far true moments may differ, a share",
    "OpwSection.offsets_deg": "zero offsets of the joints",
    "OpwSection.flip_axes": "joints that turn the other way",
    **{f"OpwSection.{n}_mm": "length of the ortho-parallel basis"
       for n in ("a1", "a2", "b", "c1", "c2", "c3", "c4")},
}  # fmt: skip
"""Meanings of keys whose class does not describe them, or not for a page."""


def written() -> str:
    """Write the page."""
    parts = [HEAD]
    for title, text, kind in FILES:
        parts += [f"## {title}\n", f"{text}\n"]
        parts += [table(kind, own_keys(kind))] if own_keys(kind) else []
        for section, names in grouped(kind).items():
            what = kind.__name__.removesuffix("File").lower()
            parts += [f"### {what}: {', '.join(names)}\n", f"{intro(section)}\n"]
            parts += [table(section, list(section.model_fields))]
    return "\n".join(parts)


def grouped(kind: type[Strict]) -> dict[type[Strict], list[str]]:
    """Return the names of sections by their class: equal sections stand once."""
    found: dict[type[Strict], list[str]] = {}
    for name, section in sections(kind):
        found.setdefault(section, []).append(name)
    return found


def own_keys(kind: type[Strict]) -> list[str]:
    """Return the keys of a file that are no sections."""
    inner = {name.strip("[]") for name, _ in sections(kind)}
    return [key for key in kind.model_fields if key not in inner]


def sections(kind: type[Strict], above: str = "") -> Iterator[tuple[str, type[Strict]]]:
    """Yield the sections of a file, those within sections, too."""
    for key, field in kind.model_fields.items():
        for part in parts_of(field.annotation):
            if isinstance(part, type) and issubclass(part, Strict):
                listed = typing.get_origin(field.annotation) is list
                name = f"{above}{key}"
                yield (f"[[{name}]]" if listed else f"[{name}]"), part
                yield from sections(part, f"{name}.")


def parts_of(annotation: Any) -> Iterator[Any]:
    """Yield the types that an annotation is made of."""
    yield annotation
    for part in typing.get_args(annotation):
        yield from parts_of(part)


def intro(section: type[Strict]) -> str:
    """Return the description of a section, without its attributes."""
    if section.__name__ in MEANINGS:
        return MEANINGS[section.__name__]
    text = inspect.getdoc(section) or ""
    return (
        re.split(r"\n\nAttributes:", text)[0].replace("\n\n", "\n").replace("\n", " ")
    )


def attributes(section: type[Strict]) -> dict[str, str]:
    """Return the meanings of keys that a section describes itself."""
    text = (inspect.getdoc(section) or "").partition("Attributes:\n")[2]
    found = {}
    for names, meaning in re.findall(r"(?m)^    ([\w, ]+): (.*(?:\n {5,}.*)*)", text):
        for name in names.split(", "):
            found[name] = re.sub(r"\s+", " ", meaning).removesuffix(".")
    return found


def meaning(section: type[Strict], key: str) -> str:
    """Return what a key means.

    Raises:
        KeyError: Neither the class nor MEANINGS says it.
    """
    name = f"{section.__name__}.{key}"
    return MEANINGS[name] if name in MEANINGS else attributes(section)[key]


def table(section: type[Strict], keys: list[str]) -> str:
    """Write the table of keys."""
    rows = ["| key | value | default | meaning |", "|---|---|---|---|"]
    for key in keys:
        field = section.model_fields[key]
        rows.append(
            f"| `{key}` | {value_text(field)} | {default_text(field)} | "
            f"{meaning(section, key)} |"
        )
    return "\n".join([*rows, ""])


def value_text(field: FieldInfo) -> str:
    """Describe the values of a key in words."""
    return " or ".join(dict.fromkeys(type_text(field.annotation, field.metadata)))


def type_text(kind: Any, metadata: list[Any] | None = None) -> list[str]:
    """Describe a type in words, one for each alternative."""
    origin, args = typing.get_origin(kind), typing.get_args(kind)
    if kind is type(None):
        return []
    if kind in (Triple, Sextuple):
        return [f"{3 if kind == Triple else 6} numbers"]
    if origin is typing.Annotated:
        return type_text(args[0], list(args[1:]))
    if origin in (typing.Union, types.UnionType):
        return [text for part in args for text in type_text(part)]
    if origin is typing.Literal:
        return [f"`{str(a).lower() if isinstance(a, bool) else a}`" for a in args]
    if origin is list:
        lengths = (getattr(m, "min_length", None) for m in flat(metadata or []))
        length = next((n for n in lengths if n), None)
        inner = " or ".join(type_text(args[0]))
        many = inner if inner.endswith(("s", "`")) else f"{inner}s"
        if isinstance(args[0], type) and issubclass(args[0], Strict):
            return ["sections"]
        if length and many[0].isdigit():
            return [f"{length} times {many}"]
        return [f"{length or 'a list of'} {many}"]
    if origin is dict:
        return [f"by name: {' or '.join(type_text(args[1]))}"]
    if isinstance(kind, type) and issubclass(kind, Strict):
        return ["a section"]
    names = {str: "text", bool: "`true` or `false`", int: "whole number"}
    return [names.get(kind, "number")]


def flat(metadata: list[Any]) -> Iterator[Any]:
    """Yield the constraints of a field, those within a pydantic field, too."""
    for part in metadata:
        yield part
        yield from getattr(part, "metadata", [])


def default_text(field: FieldInfo) -> str:
    """Describe the default of a key."""
    if field.is_required():
        return "required"
    value = field.get_default(call_default_factory=True)
    if value is None or value is PydanticUndefined or value in ([], {}):
        return "none"
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    return f"`{value}`" if not isinstance(value, Strict) else "as below"


if __name__ == "__main__":
    PAGE.write_text(written(), encoding="utf-8")
