"""A fitted model: what the arm does wrong, and how well that is known."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from postproc.accuracy.batch import Batch
from postproc.accuracy.combination import Combination
from postproc.accuracy.library import restore
from postproc.accuracy.noise import Noise
from postproc.accuracy.prediction import Prediction
from postproc.accuracy.ranges import Ranges
from postproc.accuracy.schema import (
    FORMAT,
    Method,
    content_id,
    packed,
    read_model_file,
    square_of,
)
from postproc.accuracy.variance import parameter_variance, side_variance
from postproc.arrays import Bools, Floats, in_pieces, pieces
from postproc.exceptions import ModelError
from postproc.files import write_all
from postproc.robot.arm import Arm
from postproc.robot.pose import MM
from postproc.robot.state import States

CHUNK = 5000  # states evaluated together: the columns stay in the cache
COMPENSATED = ("arm", "state")
UNSURE = "standard error above three times the survey's worst"


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

    @cached_property
    def id(self) -> str:
        """Hash of the content."""
        return str(self.to_dict()["id"])

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

    def error(self, arm: Arm, states: States) -> Floats:
        """Predict the error without its uncertainty, (n, 3) [m]."""
        effects, values, _ = self.compensable()
        parts = in_pieces(
            lambda rows: effects.error(Batch(arm, states[rows]), values),
            len(states),
            CHUNK,
        )
        return np.concatenate([np.zeros((0, 3)), *parts])

    def measured_error(self, arm: Arm, states: States) -> Floats:
        """Predict what the survey's set-up would measure, (n, 3) [m]."""
        return self.effects.error(Batch(arm, states), self.values)

    def predict(self, arm: Arm, states: States) -> Prediction:
        """Predict the error that may be compensated, and how sure it is.

        Where a direction is not known (0), the error is that of the middle of the gap,
        and half the gap enters both standard deviations.
        """
        model, arrival = np.empty((len(states), 3)), np.empty((len(states), 3))
        for rows in pieces(len(states), CHUNK):
            model[rows], at = self._variance(arm, states[rows])
            arrival[rows] = model[rows] + self.noise.arrival_variance(at.jacobian)
        model, arrival = (np.sqrt(np.maximum(v, 0.0)) for v in (model, arrival))
        outside = self.ranges.outside(states, self.needs)
        unsure = _on_flanks(states) & (model > self._sure_up_to).any(axis=1)
        if unsure.any():
            outside[UNSURE] = unsure
        return Prediction(self.error(arm, states), model, arrival, outside)

    def std_error(self, arm: Arm, states: States) -> Floats:
        """Standard error of the predicted error, (n, 3) [m], as `predict` gives it."""
        parts = in_pieces(
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
        return np.asarray((std_on_flanks > self._sure_up_to).any(axis=1))

    @property
    def _sure_up_to(self) -> float:
        """Standard error per axis up to which the survey vouches for it [m]."""
        return 3 * (self.statistics.get("worst_std_mm", np.inf) * MM)

    def _variance(self, arm: Arm, states: States) -> tuple[Floats, Batch]:
        """Variance of the error, (n, 3) [m^2], and the kinematics that it is of."""
        effects, values, covariance = self.compensable()
        at = effects.at(Batch(arm, states), values)
        variance = side_variance(effects, at, values) + np.square(self.spread)
        if len(covariance):
            variance += parameter_variance(effects, at, covariance)
        return variance, at

    def measured_std(self, arm: Arm, states: States) -> Floats:
        """Standard deviation of one measured row, tracker included, (n, 3) [m]."""
        arrival = self.predict(arm, states).std_arrival
        tcp = Batch(arm, states).walk.tcp
        tracker = self.noise.tracker_std(tcp)[:, None]
        return np.asarray(np.hypot(arrival, tracker))

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
    )
    # A file of an older release lacks keys that have been added since: it keeps its id.
    vars(model)["id"] = file.id
    return model


def _on_flanks(states: States) -> Bools:
    """Tell for which states the directions of all joints are known, (n,)."""
    return np.asarray((np.abs(states.direction) == 1).all(axis=1))
