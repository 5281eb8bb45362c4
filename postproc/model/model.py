"""The accuracy model: what it predicts, how surely, and its file."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import pydantic
from numpy.typing import NDArray
from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    NonNegativeFloat,
    PositiveFloat,
    PositiveInt,
)

from postproc import _native
from postproc.arrays import Bools, Floats, all_in_rows, any_in_rows, chunks, in_chunks
from postproc.exceptions import ModelError
from postproc.files import write_all
from postproc.model.combination import Combination
from postproc.model.effects import restore
from postproc.model.effects.effect import JointEffect
from postproc.model.effects.geometry import Geometry
from postproc.model.kinematics import Batch, base_of, deviated
from postproc.model.noise import Noise
from postproc.model.registration import Registration
from postproc.robot.arm import Arm
from postproc.robot.pose import MM
from postproc.robot.state import States

# What a model says about states.


@dataclass(frozen=True)
class Prediction:
    """Predicted errors of n states: actual minus nominal TCP position, base frame.

    Attributes:
        error: (n, 3) [m].
        std_model: Standard error of `error` per axis, (n, 3) [m]: how well the error is
            known on average over arrivals.
        std_arrival: Standard deviation of one arrival, (n, 3) [m]: with repeatability.
        outside: Reasons why states lie outside what was surveyed, with the states,
            (n,) each. No reason: all inside.
    """

    error: Floats
    std_model: Floats
    std_arrival: Floats
    outside: dict[str, NDArray[np.bool_]]

    @property
    def any_outside(self) -> NDArray[np.bool_]:
        """Which states lie outside for any reason, (n,)."""
        out = np.zeros(len(self.error), dtype=bool)
        for rows in self.outside.values():
            out |= rows
        return out

    def why(self, row: int) -> tuple[str, ...]:
        """Give the reasons why one state lies outside."""
        return tuple(text for text, rows in self.outside.items() if rows[row])


@dataclass(frozen=True)
class FreePart:
    """What free forms predict of the errors of n states: effects without a law.

    Attributes:
        names: Of the free forms that the model has; none: the other two are 0.
        error: The error that the arm would have with them alone, (n, 3) [m].
        std: Standard error of it per axis, (n, 3) [m].
    """

    names: tuple[str, ...]
    error: Floats
    std: Floats


@dataclass(frozen=True)
class PredictedReading:
    """What a survey's set-up reads in n states.

    Attributes:
        error: Reading minus nominal TCP position, base frame, (n, 3) [m].
        std: Of one reading, (n, 3) [m]: 1.96 of it hold 95 % of the readings.
    """

    error: Floats
    std: Floats


# How far off errors may be: parameters are not known exactly, nor are all sides.

NONE = np.empty(0, dtype=np.int64)


def parameter_variance(effects: Combination, at: Batch, covariance: Floats) -> Floats:
    """Variance that uncertain parameters give, (n, 3) [m^2].

    Args:
        effects: The effects.
        at: n states, with the kinematics taken at the parameters.
        covariance: Of the parameters, (p, p).
    """
    placing = sum(isinstance(e, Geometry) for e in effects.effects)
    turning = sum(isinstance(e, JointEffect) for e in effects.effects)
    if placing == 1 and 1 + turning == len(effects.effects):
        return _variance_by_joints(effects, at, covariance)
    columns = effects.columns(at)
    rows = columns.T.reshape(columns.shape[2], -1)  # one large product
    summed = np.einsum("pr,pr->r", covariance @ rows, rows)
    return np.asarray(summed.reshape(3, -1).T)


def _variance_by_joints(effects: Combination, at: Batch, covariance: Floats) -> Floats:
    """Do it for one geometry and joint effects, whose columns are the Jacobian's."""
    parts = list(zip(effects.effects, effects.slices, strict=True))
    ((geometry, first),) = [(e, s) for e, s in parts if isinstance(e, Geometry)]
    turning = [(e, s) for e, s in parts if isinstance(e, JointEffect)]
    acts_on = np.concatenate([NONE, *(e.acts_on() for e, _ in turning)])
    by_joint = np.argsort(acts_on, kind="stable")
    columns = np.arange(len(covariance))
    turns = np.concatenate([NONE, *(columns[s] for _, s in turning)])[by_joint]
    order = np.concatenate([columns[first], turns])
    given = [np.empty((len(at), 0)), *(e.basis(at) for e, _ in turning)]
    basis = np.ascontiguousarray(np.concatenate(given, axis=1)[:, by_joint])
    tool = at.states.tool + at.deviation.tool
    return _native.variance(
        deviated(at.arm.dh, at.deviation).packed(at.deviation.link[:, 4]),
        base_of(at.deviation),
        (np.ascontiguousarray(at.angles), np.ascontiguousarray(tool)),
        (geometry.base, geometry.links, True),
        (basis, np.bincount(acts_on, minlength=6).tolist()),
        np.ascontiguousarray(covariance[np.ix_(order, order)]),
    )


def side_variance(effects: Combination, at: Batch, values: Floats) -> Floats:
    """Variance that unknown directions give, (n, 3) [m^2]."""
    unknown = 1.0 - np.clip(at.states.direction, -1.0, 1.0) ** 2
    out = np.zeros((len(at), 3))
    rows = np.flatnonzero(any_in_rows(unknown > 0.0))
    if len(rows):
        slopes = effects.direction_slopes(at[rows], values)
        out[rows] = np.einsum("nij,nj->ni", slopes**2, unknown[rows])
    return out


def beyond_variance(effects: Combination, at: Batch, prior_std: Floats) -> Floats:
    """Variance that free forms may have beyond the surveyed ranges, (n, 3) [m^2].

    Args:
        effects: The effects.
        at: n states, with the kinematics taken at the parameters.
        prior_std: Prior standard deviations of the parameters, (p,).
    """
    out = np.zeros((len(at), 3))
    for effect, part in zip(effects.effects, effects.slices, strict=True):
        turned = effect.beyond(at, prior_std[part])
        if turned is not None and turned.any():
            out += np.einsum("nij,nj->ni", at.jacobian**2, turned)
    return out


# Where a survey has been, and which states lie outside.

Interval = tuple[float, float]

MARGIN = 0.05  # of a joint's surveyed range: random poses do not reach its ends
SAME_TOOL = 1e-3  # [m] tools closer than this count as one
REACH_OF_PLATE = 0.5  # [m] how far from three or more probe points a tool may be
PAYLOAD_MARGIN = 0.5  # [kg]
TEMPERATURE_MARGIN = 1.0  # [K] steel of 2.5 m grows by 0.03 mm


@dataclass(frozen=True)
class Ranges:
    """What a survey covered.

    Attributes:
        lower, upper: Joint angles, (6,) [rad].
        tools: Surveyed probe points in the flange frame, (k, 3) [m].
        payload: [kg], or None where it was not recorded.
        temperature: [deg C], or None.
        speed: [m/s], or None.
        oriented: Whether orientations were measured with a probe of known mounting.
    """

    lower: tuple[float, ...]
    upper: tuple[float, ...]
    tools: tuple[tuple[float, ...], ...]
    payload: Interval | None
    temperature: Interval | None
    speed: Interval | None
    oriented: bool = False

    @classmethod
    def of(cls, states: States, oriented: bool = False) -> Ranges:
        """Take the ranges of a survey."""
        tools = np.unique(np.round(states.tool, 9), axis=0)
        return cls(
            lower=tuple(map(float, states.q.min(axis=0))),
            upper=tuple(map(float, states.q.max(axis=0))),
            tools=tuple(tuple(map(float, t)) for t in tools),
            payload=_interval(states.payload),
            temperature=_interval(states.temperature),
            speed=_interval(states.speed),
            oriented=oriented,
        )

    def outside(self, states: States, needs: frozenset[str]) -> dict[str, Bools]:
        """Say which states lie outside, by reason; reasons without states are left out.

        Args:
            states: n states.
            needs: Covariates that the model cannot do without.
        """
        found = {**self._joints(states.q), **self._tools(states.tool)}
        for name, unit, margin in (
            ("payload", "kg", PAYLOAD_MARGIN),
            ("temperature", "deg C", TEMPERATURE_MARGIN),
        ):
            value, span = getattr(states, name), getattr(self, name)
            if span is not None:
                low, high = span[0] - margin, span[1] + margin
                text = f"{name} outside the surveyed {span[0]:g} to {span[1]:g} {unit}"
                found[text] = (value < low) | (value > high)
        for name in sorted(needs):
            value = getattr(states, name)
            unknown = np.isnan(value) if value.ndim == 1 else np.isnan(value).any(1)
            found[f"{name} is not known, and the model needs it"] = unknown
        return {reason: rows for reason, rows in found.items() if rows.any()}

    def _joints(self, q: Floats) -> dict[str, Bools]:
        """Compare joint angles; an axis surveyed all around has no outside."""
        low, high = np.array(self.lower), np.array(self.upper)
        middle, margin = (low + high) / 2, MARGIN * (high - low) + 1e-6
        near = middle + np.mod(q - middle + np.pi, 2 * np.pi) - np.pi
        whole = (high - low) * (1 + MARGIN) >= 2 * np.pi * 0.95
        out = ~whole & ((near < low - margin) | (near > high + margin))
        ends = np.rad2deg(np.stack([low, high], axis=1))
        return {
            f"axis {j + 1} outside the surveyed {ends[j, 0]:.1f} to "
            f"{ends[j, 1]:.1f} deg": out[:, j]
            for j in range(6)
        }

    def _tools(self, tool: Floats) -> dict[str, Bools]:
        """Compare the tool with the probe points."""
        points = np.array(self.tools).reshape(-1, 3)
        gap = np.linalg.norm(tool[:, None] - points, axis=2).min(axis=1, initial=np.inf)
        if self.see_all_rotations:
            text = f"tool more than {REACH_OF_PLATE / MM:.0f} mm from the probe points"
            return {text: gap > REACH_OF_PLATE}
        text = "tool not surveyed: the survey's probe points fix it at one point only"
        return {text: gap > SAME_TOOL}

    @property
    def see_all_rotations(self) -> bool:
        """Whether flange rotations show: points that span a plane, or orientations."""
        if self.oriented:
            return True
        points = np.array(self.tools).reshape(-1, 3)
        spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
        return len(spread) > 1 and bool(spread[1] > 0.02)  # [m]


def _interval(values: Floats) -> Interval | None:
    """Return the least and the largest of the known values."""
    known = values[~np.isnan(values)]
    return (float(known.min()), float(known.max())) if len(known) else None


# The model file: JSON, checked when it is read.

FORMAT = 1
MAX_BYTES = 200_000_000

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


class RangesSection(ModelSection):
    """The ranges of `postproc.model.model.Ranges`."""

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


class RegistrationSection(ModelSection):
    """Where the survey's tracker stood: P_base = R P_tracker + t."""

    rotation: Annotated[tuple[float, ...], Field(min_length=9, max_length=9)]
    shift_m: Annotated[tuple[float, ...], Field(min_length=3, max_length=3)]
    probes: tuple[ProbeSection, ...]

    @classmethod
    def of(cls, found: Registration) -> RegistrationSection:
        """Write a registration, row by row."""
        T = found.base_from_tracker
        rotation, shift = T[:3, :3].reshape(-1).tolist(), T[:3, 3].tolist()
        points = zip(found.tool_ids.tolist(), found.probes.tolist(), strict=True)
        probes = tuple(ProbeSection(tool_id=k, xyz_m=tuple(xyz)) for k, xyz in points)
        return cls(rotation=tuple(rotation), shift_m=tuple(shift), probes=probes)

    def read(self) -> Registration:
        """Make the registration."""
        T = np.eye(4)
        T[:3, :3] = np.reshape(self.rotation, (3, 3))
        T[:3, 3] = self.shift_m
        points = sorted(self.probes, key=lambda p: p.tool_id)
        probes = np.array([p.xyz_m for p in points]).reshape(-1, 3)
        ids = np.array([p.tool_id for p in points], dtype=np.int64)
        return Registration(T, probes, ids)


WidthSection = tuple[PositiveFloat, PositiveFloat]


class ModelFile(ModelSection):
    """A whole model file."""

    format: Literal[1]
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


def content_id(data: dict[str, Any]) -> str:
    """Hash everything but the id."""
    rest = {k: v for k, v in data.items() if k != "id"}
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
    if len(raw) > MAX_BYTES:
        raise ModelError(path, "is too large for a model", "Check the path")
    try:
        data = json.loads(raw)
        own = content_id(data) if isinstance(data, dict) else ""
    except (ValueError, RecursionError):  # also a number of thousands of digits
        cure = "Make it again with postproc fit"
        raise ModelError(path, "is not valid JSON", cure) from None
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


def packed(square: Floats) -> list[float]:
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


# A fitted model: what the arm does wrong, and how well that is known.

CHUNK = 5000  # states evaluated together: the columns stay in the cache
COMPENSATED = ("arm", "state")
READING = "reading_spread"  # statistic: see `Fit.reading_spread`
UNSURE = "standard error above three times the survey's worst"
Width = tuple[float, float]  # least and largest way from flank to flank [gaps]
UNTOLD: Width = 1.0, np.inf
CONFIRMED, NOT_SURE = "confirmed", "not sure"  # what a measured path says of a joint


@dataclass(frozen=True, eq=False)
class Model:
    """Effects with their parameters, their covariance and where they hold.

    Attributes:
        method: How it was made.
        arm_name, arm_id: The arm it was made for.
        effects: All fitted effects, those of the set-up included.
        values: Parameters, (p,) [SI].
        covariance: Of the parameters, (p, p); empty where the method has none.
        prior_std: Prior standard deviations, (p,).
        spread: Further standard error per axis, of methods without a covariance [m].
        noise: Tracker and repeatability.
        ranges: What the survey covered.
        rows: Number of rows fitted.
        data_sha256: Hash of the measurement files.
        parent: Id of the model that this one extends.
        statistics: Figures of the fit, units in their names.
        history: What was added to the ancestors, oldest first.
        registration: Of the survey, where it was in the tracker's frame.
        flank_widths: Over how many gaps at the least and at the most each of the 6
            joints goes from flank to flank, by reversals of the survey; UNTOLD where
            they do not tell, empty where none were measured.
    """

    method: Method
    arm_name: str
    arm_id: str
    effects: Combination
    values: Floats
    covariance: Floats
    prior_std: Floats
    noise: Noise
    ranges: Ranges
    rows: int
    data_sha256: str
    spread: tuple[float, float, float] = (0.0, 0.0, 0.0)
    parent: str | None = None
    statistics: dict[str, float] = field(default_factory=dict)
    history: tuple[dict[str, Any], ...] = ()
    registration: Registration | None = None
    flank_widths: tuple[Width, ...] = ()

    @cached_property
    def id(self) -> str:
        """Hash of the content."""
        return str(self.to_dict()["id"])

    @property
    def in_motion(self) -> dict[str, str]:
        """What the newest measured path says of joints ("1" to "6") in motion.

        Empty where none was measured; the verdicts are those of `compensation.flanks`.
        """
        told = (r["in_motion"] for r in reversed(self.history) if "in_motion" in r)
        return dict(next(told, {}))

    @property
    def reading_spread(self) -> float:
        """How much wider readings scatter than their noise, see `Fit`."""
        return self.statistics.get(READING, 1.0)

    @property
    def needs(self) -> frozenset[str]:
        """Covariates that the compensated effects cannot do without."""
        used = [e for e in self.effects.effects if e.belongs_to() in COMPENSATED]
        return frozenset(need for e in used for need in e.requires())

    def compensable(self) -> tuple[Combination, Floats, Floats]:
        """Return the effects that may be compensated, their values and covariance."""
        return self._compensable

    @cached_property
    def _compensable(self) -> tuple[Combination, Floats, Floats]:
        """Choose them once: a program asks some twenty times."""
        keep = self.effects.where(*COMPENSATED)
        part = tuple(e for e in self.effects.effects if e.belongs_to() in COMPENSATED)
        covariance = self.covariance
        if len(covariance):
            covariance = covariance[np.ix_(keep, keep)]
        return Combination(part), self.values[keep], covariance

    def joint_offset(self, arm: Arm) -> Floats:
        """Return what every joint is off by wherever it stands, (6,) [rad].

        Zero errors of the joints, among the effects that may be compensated: D-H angle
        = offset + sense * (mix @ q), so that q is off by inverse(mix) (sense * theta).
        """
        effects, values, _ = self.compensable()
        pairs = zip(effects.effects, effects.slices, strict=True)
        theta = np.sum([e.zero_errors(values[part]) for e, part in pairs], axis=0)
        return np.asarray(np.linalg.solve(arm.dh.mix, arm.dh.sense * theta))

    def error(self, arm: Arm, states: States) -> Floats:
        """Predict the error without its uncertainty, (n, 3) [m]."""
        effects, values, _ = self.compensable()
        parts = in_chunks(
            lambda rows: effects.error(Batch(arm, states[rows]), values),
            len(states),
            CHUNK,
        )
        return np.concatenate([np.zeros((0, 3)), *parts])

    @property
    def share_names(self) -> tuple[str, ...]:
        """Names of the shares of the error: see `Combination.shares`."""
        return self.compensable()[0].share_names

    def shares(self, arm: Arm, states: States) -> Floats:
        """Split the error into the shares of the effects, (n, k, 3) [m], base frame."""
        effects, values, _ = self.compensable()
        parts = in_chunks(
            lambda rows: effects.shares(Batch(arm, states[rows]), values),
            len(states),
            CHUNK,
        )
        return np.concatenate([np.zeros((0, len(effects.share_names), 3)), *parts])

    @property
    def free_forms(self) -> tuple[str, ...]:
        """Name the free forms among what is compensated."""
        free, _ = self.compensable()[0].free
        return tuple(dict.fromkeys(e.name for e in free.effects))

    def free_part(self, arm: Arm, states: States) -> FreePart:
        """Tell what free forms have in the predicted errors, and how sure that is."""
        if not self.free_forms:
            return FreePart((), np.zeros((len(states), 3)), np.zeros((len(states), 3)))
        parts = in_chunks(
            lambda rows: self._free_part(arm, states[rows]), len(states), CHUNK
        )
        nothing = (np.zeros((0, 3)), np.zeros((0, 3)))
        error, std = (np.concatenate(p) for p in zip(nothing, *parts, strict=True))
        return FreePart(self.free_forms, error, std)

    def _free_part(self, arm: Arm, states: States) -> tuple[Floats, Floats]:
        """Evaluate free forms alone: errors and standard errors, (n, 3) [m] each."""
        effects, values, covariance = self.compensable()
        free, own = effects.free
        batch = Batch(arm, states)
        at = effects.at(batch, values)
        prior_std = self.prior_std[self.effects.where(*COMPENSATED)][own]
        variance = side_variance(free, at, values[own])
        variance += beyond_variance(free, at, prior_std)
        variance += parameter_variance(free, at, covariance[np.ix_(own, own)])
        return free.error(batch, values[own]), np.sqrt(np.maximum(variance, 0.0))

    def measured_error(self, arm: Arm, states: States) -> Floats:
        """Predict what the survey's set-up would measure, (n, 3) [m]."""
        return self.effects.error(Batch(arm, states), self.values)

    def predict(self, arm: Arm, states: States) -> Prediction:
        """Predict the error that may be compensated, and how sure it is.

        Where a direction is not known (0), the error is that of the middle of the gap,
        and half the gap enters both standard deviations.
        """
        model, arrival = np.empty((len(states), 3)), np.empty((len(states), 3))
        for rows in chunks(len(states), CHUNK):
            model[rows], at = self._variance(arm, states[rows])
            arrival[rows] = model[rows] + self.noise.arrival_variance(at.jacobian)
        model, arrival = (np.sqrt(np.maximum(v, 0.0)) for v in (model, arrival))
        outside = self.ranges.outside(states, self.needs)
        unsure = _on_flanks(states) & any_in_rows(model > self._sure_up_to)
        if unsure.any():
            outside[UNSURE] = unsure
        return Prediction(self.error(arm, states), model, arrival, outside)

    def std_error(self, arm: Arm, states: States) -> Floats:
        """Standard error of the predicted error, (n, 3) [m], as `predict` gives it."""
        parts = in_chunks(
            lambda rows: self._variance(arm, states[rows])[0], len(states), CHUNK
        )
        variance = np.concatenate([np.zeros((0, 3)), *parts])
        return np.asarray(np.sqrt(np.maximum(variance, 0.0)))

    def std_on_flanks(self, arm: Arm, states: States) -> Floats:
        """Standard error where the directions of all joints are known, (n, 3) [m].

        NaN elsewhere, and everywhere where a survey does not say what is too large.
        """
        out = np.full((len(states), 3), np.nan)
        rows = np.flatnonzero(_on_flanks(states))
        if len(rows) and np.isfinite(self._sure_up_to):
            out[rows] = self.std_error(arm, states[rows])
        return out

    def unsure(self, std_on_flanks: Floats) -> Bools:
        """Tell which states have a standard error beyond all of the survey, (n,).

        States with unknown directions are no such: their error is said to be the
        middle's.

        Args:
            std_on_flanks: Of the states, (n, 3) [m], see above.
        """
        return any_in_rows(std_on_flanks > self._sure_up_to)

    @property
    def _sure_up_to(self) -> float:
        """Standard error per axis up to which the survey vouches for it [m]."""
        return 3 * (self.statistics.get("worst_std_mm", np.inf) * MM)

    def _variance(self, arm: Arm, states: States) -> tuple[Floats, Batch]:
        """Variance of the error, (n, 3) [m^2], and the kinematics that it is of."""
        effects, values, covariance = self.compensable()
        at = effects.at(Batch(arm, states), values)
        variance = self.untold_variance(effects, at, values)
        if len(covariance):
            variance += parameter_variance(effects, at, covariance)
        return variance, at

    def untold_variance(
        self, effects: Combination, at: Batch, values: Floats
    ) -> Floats:
        """Variance that the parameters' covariance does not hold, (n, 3) [m^2].

        Args:
            effects: All effects, or those that may be compensated.
            at: n states, with the kinematics taken at the parameters.
            values: Of these effects' parameters.
        """
        prior_std = self.prior_std
        if effects is not self.effects and len(prior_std):
            prior_std = prior_std[self.effects.where(*COMPENSATED)]
        beyond = beyond_variance(effects, at, prior_std)
        return side_variance(effects, at, values) + np.square(self.spread) + beyond

    def reading(self, arm: Arm, states: States) -> PredictedReading:
        """Predict what the survey's own set-up reads, and how sure one reading is.

        All effects count, those of the set-up too: what nobody can know of base and
        probe apart is known of their sum, which is what is read.
        """
        parts = in_chunks(
            lambda rows: self._read(arm, states[rows]), len(states), CHUNK
        )
        nothing = PredictedReading(np.zeros((0, 3)), np.zeros((0, 3)))
        error, std = zip(*((p.error, p.std) for p in (nothing, *parts)), strict=True)
        return PredictedReading(np.concatenate(error), np.concatenate(std))

    def _read(self, arm: Arm, states: States) -> PredictedReading:
        """Predict some readings."""
        batch = Batch(arm, states)
        at = self.effects.at(batch, self.values)
        known = self.untold_variance(self.effects, at, self.values)
        if len(self.covariance):
            known = known + parameter_variance(self.effects, at, self.covariance)
        error = self.effects.error_at(at, batch, self.values)
        return PredictedReading(error, self.reading_std(at, known))

    def reading_std(self, at: Batch, known: Floats) -> Floats:
        """Standard deviation of one reading, (n, 3) [m].

        Args:
            at: n states, with the kinematics taken at the parameters.
            known: Variance of the mean of many readings, (n, 3) [m^2].
        """
        tracker = self.noise.tracker_std(at.tcp)[:, None]
        scatter = self.noise.arrival_variance(at.jacobian) + tracker**2
        std = np.sqrt(np.maximum(known, 0.0) + scatter)
        return np.asarray(self.reading_spread * std)

    def check_arm(self, arm: Arm, path: str | Path = "model") -> None:
        """Refuse an arm that the model was not made for.

        Raises:
            ModelError: The kinematics differ.
        """
        if arm.id != self.arm_id:
            raise ModelError(
                path,
                f"was made for arm {self.arm_name} ({self.arm_id}), not for "
                f"{arm.name} ({arm.id})",
                "Use the model of this arm, or fit one",
                place="$.arm",
            )

    def to_dict(self) -> dict[str, Any]:
        """Return the content of the model file."""
        std = np.sqrt(np.diag(self.covariance)) if len(self.covariance) else None
        data: dict[str, Any] = {
            "format": FORMAT,
            "parent": self.parent,
            "method": self.method,
            "arm": {"name": self.arm_name, "id": self.arm_id},
            "data_sha256": self.data_sha256,
            "rows": self.rows,
            "effects": [
                {"name": e.name, "settings": e.settings()} for e in self.effects.effects
            ],
            "parameters": [
                {
                    "name": name,
                    "unit": p.unit,
                    "value": float(self.values[k]),
                    "std_error": 0.0 if std is None else float(std[k]),
                    "prior_std": float(self.prior_std[k]),
                }
                for k, (name, p) in enumerate(
                    zip(self.effects.names, self.effects.parameters, strict=True)
                )
            ],
            "covariance": packed(self.covariance),
            "spread": list(self.spread),
            "noise": asdict(self.noise),
            "ranges": asdict(self.ranges),
            "statistics": self.statistics,
            "history": list(self.history),
        }
        if self.registration is not None:
            kept = RegistrationSection.of(self.registration)
            data["registration"] = kept.model_dump()
        if self.flank_widths:
            data["flank_widths"] = [
                None if width == UNTOLD else list(width) for width in self.flank_widths
            ]
        data = json.loads(json.dumps(data))
        return {"id": content_id(data), **data}

    def save(self, path: str | Path) -> None:
        """Write the model file, whole or not at all.

        Raises:
            OutputError: The place cannot be written to.
        """
        text = json.dumps(self.to_dict(), indent=1) + "\n"
        write_all({Path(path): text.encode()})


def load_model(path: str | Path) -> Model:
    """Read a model file.

    Raises:
        ModelError: It cannot be read or does not hold together.
    """
    file = read_model_file(Path(path))
    cure = "Make the model again with postproc fit"
    try:
        effects = Combination(tuple(restore(e.name, e.settings) for e in file.effects))
        names = effects.names
    except (ValueError, TypeError) as exc:
        raise ModelError(path, str(exc), cure, place="$.effects") from None
    count = len(names)
    if tuple(p.name for p in file.parameters) != names:
        problem = "parameters do not match the effects"
        raise ModelError(path, problem, cure, place="$.parameters")
    if len(file.covariance) not in (0, count * (count + 1) // 2):
        problem = "covariance does not match the parameters"
        raise ModelError(path, problem, cure, place="$.covariance")
    model = Model(
        method=file.method,
        arm_name=file.arm.name,
        arm_id=file.arm.id,
        effects=effects,
        values=np.array([p.value for p in file.parameters]),
        covariance=square_of(np.array(file.covariance), count),
        prior_std=np.array([p.prior_std for p in file.parameters]),
        noise=Noise(**file.noise.model_dump()),
        ranges=Ranges(**file.ranges.model_dump()),
        rows=file.rows,
        data_sha256=file.data_sha256,
        spread=file.spread,
        parent=file.parent,
        statistics=file.statistics,
        history=file.history,
        registration=None if file.registration is None else file.registration.read(),
        flank_widths=tuple(UNTOLD if w is None else w for w in file.flank_widths),
    )
    # A file of an older release lacks keys that have been added since: it keeps its id.
    vars(model)["id"] = file.id
    return model


def _on_flanks(states: States) -> Bools:
    """Tell for which states the directions of all joints are known, (n,)."""
    return all_in_rows(np.abs(states.direction) == 1)
