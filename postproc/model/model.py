"""The accuracy model: what it predicts, and how surely."""

from __future__ import annotations

import json
from collections.abc import Collection
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Bools, Floats, all_in_rows, any_in_rows, map_chunks
from postproc.exceptions import ModelError
from postproc.files import write_all
from postproc.model.cache import ArmCache
from postproc.model.doubt import Doubt
from postproc.model.effect_sum import Combination
from postproc.model.effects import restore
from postproc.model.evaluator import (
    Evaluator,
    PredictedErrors,
    Scatter,
    Spread,
    make_evaluator,
)
from postproc.model.kinematics import ArmStates
from postproc.model.model_file import (
    FORMAT,
    DoubtSection,
    Method,
    ModelFile,
    RegistrationSection,
    content_id,
    pack_symmetric,
    parse_model_file,
    read_model_file,
    square_of,
)
from postproc.model.noise import Noise
from postproc.model.provenance import Provenance
from postproc.model.registration import Registration
from postproc.model.validity import Ranges
from postproc.model.variance import (
    beyond_variance,
    covariance_of,
    moment_variance,
    parameter_covariance,
    parameter_variance,
    side_covariance,
    side_variance,
    unknown_variance,
)
from postproc.robot.arm import FLOOR, Arm
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
        covariance: Of the error of one arrival, (n, 6) [m^2]: with repeatability; xx,
            yy, zz, then xy, xz, yz.
        outside: Reasons why states lie outside what was surveyed, with the states,
            (n,) each. No reason: all inside.
    """

    error: Floats
    std_model: Floats
    covariance: Floats
    outside: dict[str, NDArray[np.bool_]]

    @property
    def std_arrival(self) -> Floats:
        """Standard deviation of one arrival per axis, (n, 3) [m]."""
        return np.asarray(np.sqrt(np.maximum(self.covariance[:, :3], 0.0)))

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
        covariance: Of one reading, (n, 6) [m^2]: xx, yy, zz, then xy, xz, yz.
    """

    error: Floats
    covariance: Floats

    @property
    def std(self) -> Floats:
        """Standard deviation of one reading, (n, 3) [m]: 1.96 of it hold 95 %."""
        return np.asarray(np.sqrt(self.covariance[:, :3]))


# A fitted model: what the arm does wrong, and how well that is known.

CHUNK = 5000  # states evaluated together: the columns stay in the cache
COMPENSATED = ("arm", "state")
READING = "reading_spread"  # statistic: see `Fit.reading_spread`
WORST_STD = "worst_std_mm"  # statistic: largest standard error at a surveyed pose
UNSURE = "standard error above three times the survey's worst"
Monument = tuple[str, tuple[float, float, float]]
Width = tuple[float, float]  # least and largest way from flank to flank [gaps]
Direction = tuple[float, float, float]
TILTED = 1.0  # [deg] by which a cell may say that weight pulls another way
UNTOLD: Width = 1.0, np.inf
UNLIKE: Width = 0.0, 0.0  # the steps are not those of the model's backlash
CONFIRMED, UNCERTAIN = "confirmed", "uncertain"  # what a measured path says of a joint


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
        weight: Direction in which weight pulled, unit vector in the base frame.
        provenance: When, for which robot and by what it was fitted, None where that is
            not known; no part of the id.
        monuments: Fixed points that the survey read.
        doubt: What may be there besides the effects; None where that is hardly any.
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
    weight: Direction = FLOOR
    monuments: tuple[Monument, ...] = ()
    provenance: Provenance | None = None
    doubt: Doubt | None = None

    @cached_property
    def id(self) -> str:
        """Hash of the content."""
        return str(self.to_dict()["id"])

    @property
    def in_motion(self) -> dict[str, str]:
        """What the newest measured path says of joints ("1" to "6") in motion.

        Empty where none was measured; see `paths.backlash_steps` for verdicts. Those
        of other versions that have no meaning here are uncertain.
        """
        told = (r["in_motion"] for r in reversed(self.history) if "in_motion" in r)
        newest = dict(next(told, {}))
        known = (CONFIRMED, "refuted", "elsewhere")
        return {j: word if word in known else UNCERTAIN for j, word in newest.items()}

    @property
    def reading_spread(self) -> float:
        """How much wider readings scatter than their noise, see `Fit`."""
        return self.statistics.get(READING, 1.0)

    @property
    def needs(self) -> frozenset[str]:
        """Covariates that the compensated effects cannot do without."""
        used = self.compensable()[0].effects
        return frozenset(need for e in used for need in e.requires())

    @property
    def bent(self) -> frozenset[str]:
        """Covariates that drive compensated effects by laws that are no lines."""
        used = self.compensable()[0].effects
        return frozenset(name for e in used for name in e.list_nonlinear_drivers())

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
        theta, q = np.zeros(6), np.zeros(6)
        for effect, part in pairs:
            theta += effect.zero_errors(values[part])
            q += effect.joint_zeros(values[part])
        return np.asarray(np.linalg.solve(arm.dh.mix, arm.dh.sense * theta) + q)

    def __getstate__(self) -> dict[str, Any]:
        """Travel between processes without what was made of it, but for its id.

        A model of an older release has that of its file, not the hash of its content.
        """
        names = [f.name for f in fields(self)] + ["id"]
        return {name: value for name, value in vars(self).items() if name in names}

    @cached_property
    def _evaluators(self) -> ArmCache[Evaluator]:
        return ArmCache()

    def evaluator(self, arm: Arm) -> Evaluator:
        """Return the effects that may be compensated in the core's terms."""
        return self._evaluators.of(arm, self._make_evaluator)

    @cached_property
    def arms(self) -> ArmCache[Arm]:
        """Arms with the play that this model has found."""
        return ArmCache()

    def _make_evaluator(self, arm: Arm) -> Evaluator:
        effects, values, covariance = self.compensable()
        keep = self.effects.where(*COMPENSATED)
        prior_std = self.prior_std[keep] if len(self.prior_std) else self.prior_std
        both, doubt = effects, self.doubt
        if doubt is not None:
            doubt = doubt.get_settings(keep)
            both = Combination((*effects.effects, *doubt.effects.effects))
            own, covariance = len(covariance), np.array(doubt.covariance)
            if own:
                covariance[:own, :own] += self.compensable()[2]
        spread = Spread(both, covariance) if len(covariance) else None
        scatter = Scatter(self.noise, self.spread)
        return make_evaluator(arm, effects, values, prior_std, spread, scatter)

    def error(self, arm: Arm, states: States) -> Floats:
        """Predict the error without its uncertainty, (n, 3) [m]."""
        return self.evaluator(arm).errors(states)

    @property
    def share_names(self) -> tuple[str, ...]:
        """Names of the shares of the error: see `Combination.shares`."""
        return self.compensable()[0].share_names

    def shares(self, arm: Arm, states: States) -> Floats:
        """Split the error into the shares of the effects, (n, k, 3) [m], base frame."""
        effects, values, _ = self.compensable()
        parts = map_chunks(
            lambda rows: effects.shares(ArmStates(arm, states[rows]), values),
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
        parts = map_chunks(
            lambda rows: self._free_part(arm, states[rows]), len(states), CHUNK
        )
        nothing = (np.zeros((0, 3)), np.zeros((0, 3)))
        error, std = (np.concatenate(p) for p in zip(nothing, *parts, strict=True))
        return FreePart(self.free_forms, error, std)

    def _free_part(self, arm: Arm, states: States) -> tuple[Floats, Floats]:
        """Evaluate free forms alone: errors and standard errors, (n, 3) [m] each."""
        effects, values, covariance = self.compensable()
        free, own = effects.free
        batch = ArmStates(arm, states)
        at = effects.at(batch, values)
        prior_std = self.prior_std[self.effects.where(*COMPENSATED)][own]
        variance = side_variance(free, at, values[own])
        variance += beyond_variance(free, at, prior_std)
        variance += parameter_variance(free, at, covariance[np.ix_(own, own)])
        return free.error(batch, values[own]), np.sqrt(np.maximum(variance, 0.0))

    def predict_measured(self, arm: Arm, states: States) -> Floats:
        """Predict what the survey's set-up would measure, (n, 3) [m]."""
        return self.effects.error(ArmStates(arm, states), self.values)

    def predict(self, arm: Arm, states: States) -> Prediction:
        """Predict the error that may be compensated, and how sure it is.

        Where a direction is not known (0), the error is that of the middle of the gap,
        and half the gap enters both standard deviations.
        """
        return self.describe(states, self.evaluator(arm).predict(states))

    def describe(self, states: States, found: PredictedErrors) -> Prediction:
        """Say how sure errors are that were predicted of states, as `predict` does."""
        outside = self.ranges.outside(states, self.needs, self.bent)
        unsure = _on_flanks(states) & any_in_rows(found.std > self._certain_up_to)
        if unsure.any():
            outside[UNSURE] = unsure
        return Prediction(found.error, found.std, found.arrival, outside)

    def std_error(self, arm: Arm, states: States) -> Floats:
        """Standard error of the predicted error, (n, 3) [m], as `predict` gives it."""
        return self.evaluator(arm).predict(states).std

    def predict_on_flanks(self, arm: Arm, states: States) -> PredictedErrors:
        """Predict errors where the directions of all joints are known.

        NaN elsewhere, and everywhere where a survey does not say what is too large a
        standard error.
        """
        out = PredictedErrors.unknown(len(states))
        rows = np.flatnonzero(_on_flanks(states))
        if len(rows) and np.isfinite(self._certain_up_to):
            out.put(rows, self.evaluator(arm).predict(states[rows]))
        return out

    def unsure(self, std_on_flanks: Floats) -> Bools:
        """Tell which states have a standard error beyond all of the survey, (n,).

        States with unknown directions are no such: their error is said to be the
        middle's.

        Args:
            std_on_flanks: Of the states, (n, 3) [m], see above.
        """
        return any_in_rows(std_on_flanks > self._certain_up_to)

    @property
    def _certain_up_to(self) -> float:
        """Standard error per axis up to which the survey vouches for it [m]."""
        return 3 * (self.statistics.get(WORST_STD, np.inf) * MM)

    def unmodelled_covariance(
        self, effects: Combination, at: ArmStates, values: Floats
    ) -> Floats:
        """Return what the parameters' covariance does not hold, (n, 6) [m^2].

        Unknown directions, free forms beyond their range, what no effect describes of a
        pose that was not measured, and what no row shows of the set-up.

        Args:
            effects: All effects, or those that may be compensated.
            at: n states, with the kinematics taken at the parameters.
            values: Of these effects' parameters.
        """
        prior_std = self.prior_std
        if effects is not self.effects and len(prior_std):
            prior_std = prior_std[self.effects.where(*COMPENSATED)]
        out = side_covariance(effects, at, values)
        out[:, :3] += beyond_variance(effects, at, prior_std) + np.square(self.spread)
        out[:, :3] += moment_variance(effects, at, values)
        out[:, :3] += unknown_variance(effects, at)
        if self.noise.pose_joint or self.noise.pose:
            out += covariance_of(self.noise.pose_columns(at.jacobian))
        if (doubt := self.doubt) is not None:
            if effects is not self.effects:
                doubt = doubt.get_settings(self.effects.where(*COMPENSATED))
            out += doubt.error_covariance(effects, at)
        return out

    def without_clock(self, known: Collection[str]) -> Model:
        """Return it for rows of an unknown moment: what passes with time at its mean.

        Args:
            known: Clocks that the rows have, of "time" and "order".
        """
        effects = tuple(e.without_clock(known) for e in self.effects.effects)
        return replace(self, effects=Combination(effects))

    def reading(self, arm: Arm, states: States) -> PredictedReading:
        """Predict what the survey's own set-up reads, and how sure one reading is.

        All effects count, those of the set-up too: what nobody can know of base and
        probe apart is known of their sum, which is what is read.
        """
        parts = map_chunks(
            lambda rows: self._read(arm, states[rows]), len(states), CHUNK
        )
        nothing = PredictedReading(np.zeros((0, 3)), np.zeros((0, 6)))
        all_parts = ((p.error, p.covariance) for p in (nothing, *parts))
        error, covariance = zip(*all_parts, strict=True)
        return PredictedReading(np.concatenate(error), np.concatenate(covariance))

    def _read(self, arm: Arm, states: States) -> PredictedReading:
        batch = ArmStates(arm, states)
        at = self.effects.at(batch, self.values)
        known = self.unmodelled_covariance(self.effects, at, self.values)
        if len(self.covariance):
            known += parameter_covariance(self.effects, at, self.covariance)
        error = self.effects.error_at(at, batch, self.values)
        return PredictedReading(error, self.reading_covariance(at, known))

    def reading_covariance(self, at: ArmStates, known: Floats) -> Floats:
        """Return the covariance of one row, the mean of its readings, (n, 6) [m^2].

        Args:
            at: n states, with the kinematics taken at the parameters.
            known: That of the mean of many arrivals, (n, 6) [m^2].
        """
        read = self.noise.tracker_std(at.tcp) ** 2 / at.states.readings
        out = known + covariance_of(self.noise.scatter_columns(at.jacobian))
        out[:, :3] += self.noise.rounding_variance(at.states.q, at.jacobian)
        out[:, :3] += read[:, None]
        return np.asarray(self.reading_spread**2 * out)

    def check_arm(self, arm: Arm, path: str | Path = "model") -> None:
        """Check that the model was made for an arm, mounted as it is.

        Raises:
            ModelError: The kinematics differ, or the direction of weight.
        """
        if arm.id != self.arm_id:
            raise ModelError(
                path,
                f"was made for arm {self.arm_name} ({self.arm_id}), not for "
                f"{arm.name} ({arm.id})",
                "Use the model of this arm, or fit one",
                place="$.arm",
            )
        across = np.linalg.norm(np.cross(self.weight, arm.weight))
        apart = float(np.degrees(np.arctan2(across, np.dot(self.weight, arm.weight))))
        if apart > TILTED:
            raise ModelError(
                path,
                f"was fitted with weight along {_format(self.weight)} in the base "
                f"frame of the arm, {apart:.0f} deg from {_format(arm.weight)} as the "
                "cell has it",
                "Correct mounting under [robot], or [base], of the cell; an arm that "
                "was mounted in another way needs a survey of its own",
                place="$.weight",
            )

    def to_dict(self) -> dict[str, Any]:
        """Return the content of the model file."""
        data = {
            "format": FORMAT,
            "parent": self.parent,
            "method": self.method,
            "arm": {"name": self.arm_name, "id": self.arm_id},
            "data_sha256": self.data_sha256,
            "rows": self.rows,
            "effects": _list_effects(self.effects),
            "parameters": self._list_parameters(),
            "covariance": pack_symmetric(self.covariance),
            "spread": list(self.spread),
            "noise": asdict(self.noise),
            "ranges": asdict(self.ranges),
            "statistics": self.statistics,
            "history": list(self.history),
            **self._optional_sections(),
        }
        data = json.loads(json.dumps(data))
        return {"id": content_id(data), **data}

    def _list_parameters(self) -> list[dict[str, Any]]:
        """List the parameters as the model file does."""
        std = np.zeros(len(self.values))
        if len(self.covariance):
            std = np.sqrt(np.diag(self.covariance))
        return [
            {
                "name": name,
                "unit": p.unit,
                "value": float(self.values[k]),
                "std_error": float(std[k]),
                "prior_std": float(self.prior_std[k]),
            }
            for k, (name, p) in enumerate(
                zip(self.effects.names, self.effects.parameters, strict=True)
            )
        ]

    def _optional_sections(self) -> dict[str, Any]:
        """Return the sections of the model file that not every model has."""
        data: dict[str, Any] = {}
        if self.registration is not None:
            data["registration"] = RegistrationSection.of(self.registration).content()
        if self.flank_widths:
            data["flank_widths"] = [
                None if width == UNTOLD else list(width) for width in self.flank_widths
            ]
        if self.weight != FLOOR:
            data["weight"] = list(self.weight)
        if self.monuments:
            data["monuments"] = [
                {"name": name, "xyz_m": xyz} for name, xyz in self.monuments
            ]
        if self.provenance is not None:
            data["provenance"] = asdict(self.provenance)
        if self.doubt is not None:
            data["doubt"] = {
                "effects": _list_effects(self.doubt.effects),
                "covariance": pack_symmetric(self.doubt.covariance),
            }
        return data

    def save(self, path: str | Path) -> None:
        """Write the model file, whole or not at all.

        Raises:
            OutputError: The place cannot be written to.
        """
        text = json.dumps(self.to_dict(), indent=1) + "\n"
        write_all({Path(path): text.encode()})


def as_model(model: Model | str | Path, arm: Arm) -> Model:
    """Return a model that is given itself, or by its file, which must be the arm's.

    Raises:
        ModelError: See `load_model`; or the file's is another arm's.
    """
    if isinstance(model, Model):
        return model
    found = load_model(model)
    found.check_arm(arm, model)
    return found


def load_model(file: str | Path | bytes, *, name: str = "model.json") -> Model:
    """Read a model file.

    Args:
        file: Its path, or its text as bytes.
        name: Of text, for messages.

    Raises:
        ModelError: It cannot be read or does not hold together.
    """
    if isinstance(file, bytes):
        return _model_of(Path(name), parse_model_file(Path(name), file))
    return _model_of(Path(file), read_model_file(Path(file)))


def _model_of(path: Path, file: ModelFile) -> Model:
    """Make a model of what its file says.

    Raises:
        ModelError: It does not hold together.
    """
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
        weight=file.weight,
        monuments=tuple((m.name, m.xyz_m) for m in file.monuments),
        provenance=None
        if (origin := file.provenance) is None
        else Provenance(**origin.model_dump()),
        doubt=None if file.doubt is None else _doubt_of(path, file.doubt, count),
    )
    # A file of an older release lacks keys that have been added since: it keeps its id.
    vars(model)["id"] = file.id
    return model


def _doubt_of(path: Path, section: DoubtSection, count: int) -> Doubt:
    """Read what may be there besides the effects of a model.

    Args:
        path: The file.
        section: Its section.
        count: Number of the model's own parameters.

    Raises:
        ModelError: It does not hold together.
    """
    cure = "Make the model again with postproc fit"
    try:
        effects = Combination(
            tuple(restore(e.name, e.settings) for e in section.effects)
        )
        size = count + len(effects.parameters)
    except (ValueError, TypeError) as exc:
        raise ModelError(path, str(exc), cure, place="$.doubt.effects") from None
    if len(section.covariance) != size * (size + 1) // 2:
        problem = "covariance does not match the parameters"
        raise ModelError(path, problem, cure, place="$.doubt.covariance")
    return Doubt(effects, square_of(np.array(section.covariance), size))


def _list_effects(effects: Combination) -> list[dict[str, Any]]:
    """Write effects as a file holds them."""
    return [{"name": e.name, "settings": e.settings()} for e in effects.effects]


def weight_of(arm: Arm) -> Direction:
    """Return the direction of an arm's weight, as a model keeps it."""
    x, y, z = arm.weight.tolist()
    return x, y, z


def _format(direction: Direction | Floats) -> str:
    """Write a direction.

    >>> _format((0.0, -0.0, -1.0))
    '[0, 0, -1]'
    """
    return "[" + ", ".join(f"{round(v, 3) + 0.0:g}" for v in direction) + "]"


def _on_flanks(states: States) -> Bools:
    """Tell for which states the directions of all joints are known, (n,)."""
    return all_in_rows(np.abs(states.direction) == 1)
