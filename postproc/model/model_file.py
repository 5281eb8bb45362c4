"""The model file: JSON, checked when it is read."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import pydantic
from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    NonNegativeFloat,
    PositiveInt,
)

from postproc.arrays import Floats
from postproc.exceptions import ModelError
from postproc.model.noise import ALIKE
from postproc.model.registration import Registration
from postproc.robot.arm import FLOOR

FORMAT = 2
NOT_CONTENT = ("id", "provenance")  # what an id is not made from
MAX_BYTES = 200_000_000
NO_MODEL = "Give the model that postproc fit or diagnose wrote"

Method = Literal["full", "eja-elm", "elm", "interpolation", "kinematic-elm", "kriging"]


class ModelSection(BaseModel):
    """A part of the file: unknown keys and non-finite numbers are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class ArmSection(ModelSection):
    """The arm that the model was made for."""

    name: str
    id: str


class EffectSection(ModelSection):
    """An effect and its settings."""

    name: str
    settings: dict[str, Any]


class ParameterSection(ModelSection):
    """One parameter, SI units."""

    name: str
    unit: str
    value: float
    std_error: NonNegativeFloat
    prior_std: NonNegativeFloat


class NoiseSection(ModelSection):
    """The noise components of `postproc.model.noise.Noise`."""

    tracker: NonNegativeFloat
    joint: NonNegativeFloat
    origin: tuple[float, float, float] | None
    stop: NonNegativeFloat = 0.0
    pose_joint: NonNegativeFloat = 0.0
    pose: NonNegativeFloat = 0.0
    rounding: NonNegativeFloat = 0.0
    by_joint: tuple[NonNegativeFloat, ...] = Field(ALIKE, min_length=6, max_length=6)


class RangesSection(ModelSection):
    """The ranges of `postproc.model.validity.Ranges`."""

    lower: tuple[float, ...] = Field(min_length=6, max_length=6)
    upper: tuple[float, ...] = Field(min_length=6, max_length=6)
    tools: tuple[tuple[float, float, float], ...]
    payload: tuple[float, float] | None
    temperature: tuple[float, float] | None
    speed: tuple[float, float] | None
    oriented: bool = False


class ProbeSection(ModelSection):
    """A probe point in the flange frame [m]."""

    tool_id: int
    xyz_m: Annotated[tuple[float, ...], Field(min_length=3, max_length=3)]


Rotation = Annotated[tuple[float, ...], Field(min_length=9, max_length=9)]
Shift = Annotated[tuple[float, ...], Field(min_length=3, max_length=3)]


class StationSection(ModelSection):
    """One place of the tracker: P_base = R P_tracker + t."""

    name: str
    rotation: Rotation
    shift_m: Shift


class MonumentSection(ModelSection):
    """A fixed point that the survey read, base frame [m]."""

    name: str
    xyz_m: tuple[float, float, float]


class DoubtSection(ModelSection):
    """What may be there besides the effects, see `postproc.model.doubt.Doubt`."""

    effects: tuple[EffectSection, ...]
    covariance: tuple[float, ...]


class RegistrationSection(ModelSection):
    """Where the survey's tracker stood: P_base = R P_tracker + t.

    Attributes:
        rotation, shift_m: Of the first station, row by row.
        probes: The probe points.
        station: Name of the first station.
        further: The other stations.
    """

    rotation: Rotation
    shift_m: Shift
    probes: tuple[ProbeSection, ...]
    station: str = ""
    further: tuple[StationSection, ...] = ()

    @classmethod
    def of(cls, found: Registration) -> RegistrationSection:
        """Write a registration, row by row."""
        stations = [
            StationSection(
                name=name,
                rotation=tuple(T[:3, :3].reshape(-1).tolist()),
                shift_m=tuple(T[:3, 3].tolist()),
            )
            for name, T in zip(found.stations, found.transforms, strict=True)
        ]
        points = zip(found.tool_ids.tolist(), found.probes.tolist(), strict=True)
        probes = tuple(ProbeSection(tool_id=k, xyz_m=tuple(xyz)) for k, xyz in points)
        first, *further = stations
        return cls(
            rotation=first.rotation, shift_m=first.shift_m, probes=probes,
            station=first.name, further=tuple(further),
        )  # fmt: skip

    def content(self) -> dict[str, Any]:
        """Return what a file holds: keys of several stations only where they are."""
        return self.model_dump(exclude_defaults=True)

    def read(self) -> Registration:
        """Make the registration."""
        first = StationSection(
            name=self.station, rotation=self.rotation, shift_m=self.shift_m
        )
        stations = (first, *self.further)
        T = np.tile(np.eye(4), (len(stations), 1, 1))
        for k, each in enumerate(stations):
            T[k, :3, :3] = np.reshape(each.rotation, (3, 3))
            T[k, :3, 3] = each.shift_m
        points = sorted(self.probes, key=lambda p: p.tool_id)
        probes = np.array([p.xyz_m for p in points]).reshape(-1, 3)
        ids = np.array([p.tool_id for p in points], dtype=np.int64)
        return Registration(T, probes, ids, tuple(s.name for s in stations))


class ProvenanceSection(ModelSection):
    """Where the model comes from: `postproc.model.provenance.Provenance`."""

    date: str
    arm: str
    serial_number: str | None
    instrument: str | None
    software: str


WidthSection = tuple[NonNegativeFloat, NonNegativeFloat]


class ModelFile(ModelSection):
    """A whole model file."""

    format: Literal[1, 2]
    id: str
    parent: str | None
    method: Method
    arm: ArmSection
    data_sha256: str
    rows: PositiveInt
    effects: tuple[EffectSection, ...]
    parameters: tuple[ParameterSection, ...]
    covariance: tuple[float, ...]
    spread: tuple[float, float, float]
    noise: NoiseSection
    ranges: RangesSection
    statistics: dict[str, float]
    history: tuple[dict[str, Any], ...]
    registration: RegistrationSection | None = None
    flank_widths: Annotated[tuple[WidthSection | None, ...], Field(max_length=6)] = ()
    weight: tuple[float, float, float] = FLOOR
    monuments: tuple[MonumentSection, ...] = ()
    provenance: ProvenanceSection | None = None
    doubt: DoubtSection | None = None


def content_id(data: dict[str, Any]) -> str:
    """Hash everything but the id and the provenance: equal data give equal ids.

    Format 2 added the provenance alone: a model has the same id in both formats.
    """
    rest = {k: v for k, v in data.items() if k not in NOT_CONTENT}
    rest |= {"format": 1} if rest.get("format") == FORMAT else {}
    text = json.dumps(rest, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def read_model_file(path: Path) -> ModelFile:
    """Read and check a model file.

    Raises:
        ModelError: Naming the file, the place and the cure.
    """
    try:
        raw = path.read_bytes()
    except OSError as exc:
        cure = "Make a model with postproc fit"
        raise ModelError(path, f"cannot be read ({exc.strerror})", cure) from None
    return parse_model_file(path, raw)


def parse_model_file(path: Path, raw: bytes) -> ModelFile:
    """Check the bytes of a model file.

    Raises:
        ModelError: As `read_model_file` does.
    """
    if len(raw) > MAX_BYTES:
        raise ModelError(path, "is too large for a model", "Check the path")
    try:
        data = json.loads(raw)
        own = content_id(data) if isinstance(data, dict) else ""
    except (ValueError, RecursionError):  # also a number of thousands of digits
        raise ModelError(path, "is not valid JSON", NO_MODEL) from None
    if not isinstance(data, dict) or "format" not in data:
        raise ModelError(path, "is no model: it states no format", NO_MODEL)
    try:
        file = ModelFile.model_validate(data)
    except pydantic.ValidationError as exc:
        first = exc.errors()[0]
        place = "$" + "".join(f".{key}" for key in first["loc"])
        cure = "Make the model again with postproc fit"
        raise ModelError(path, first["msg"], cure, place=place) from None
    if own != file.id:
        raise ModelError(
            path,
            "has been changed since it was made: its id does not match its content",
            "Make the model again with postproc fit",
            place="$.id",
        )
    return file


def pack_symmetric(square: Floats) -> list[float]:
    """Pack a symmetric matrix as its upper triangle, row by row."""
    upper: list[float] = square[np.triu_indices(len(square))].tolist()
    return upper


def square_of(values: Floats, count: int) -> Floats:
    """Unpack an upper triangle, row by row."""
    if len(values) == 0:
        return np.zeros((0, 0))
    full = np.zeros((count, count))
    full[np.triu_indices(count)] = values
    return np.asarray(full + np.triu(full, 1).T)
