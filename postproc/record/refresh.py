"""A model made new by a few readings: what the survey knew, an event, and a check."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from postproc.arrays import Floats
from postproc.model.kinematics import ArmStates
from postproc.model.model import WORST_STD, Model
from postproc.model.statistics import ErrorStatistics
from postproc.model.variance import parameter_variance
from postproc.record.check_rows import CheckRows
from postproc.record.control import errors_of
from postproc.record.knowledge import Knowledge
from postproc.robot.pose import MM


@dataclass(frozen=True, eq=False)
class Refresh:
    """A refreshed model.

    Attributes:
        model: The model.
        before: What the model before leaves of the readings.
        after: What the new one leaves of poses that it was made without.
    """

    model: Model
    before: ErrorStatistics
    after: ErrorStatistics


def refresh(
    known: Knowledge, rows: CheckRows, given: Model, sha256: str, why: str
) -> Refresh:
    """Revise a model by the readings of a check.

    Args:
        known: Of the arm, after all events.
        rows: The readings.
        given: The model that is in use.
        sha256: Hash of the readings' file.
        why: What happened, in words.
    """
    first = Knowledge.of(given, known.arm).visiting(rows)
    before = ErrorStatistics.of_sizes(errors_of(first.expect(rows), rows))
    left_out = np.concatenate([e for _, e in _leave_out_poses(known, rows)])
    after = ErrorStatistics.of_sizes(left_out)
    updated = known.update(rows)
    model = _surest(updated.to_model(), rows, known)
    record: dict[str, Any] = {
        "parent": given.id, "data_sha256": sha256, "added": [],
        "verdict": f"refreshed: {why}", "n_fit": len(rows), "n_held_out": len(rows),
        "before": asdict(before), "after": asdict(after),
    }  # fmt: skip
    model = replace(
        model, parent=given.id, history=(*given.history, record),
        data_sha256=sha256, provenance=given.provenance,
    )  # fmt: skip
    return Refresh(model, before, after)


def _leave_out_poses(known: Knowledge, rows: CheckRows) -> Iterator[tuple[int, Floats]]:
    """Yield each pose with the errors of its readings by a model made without it."""
    for pose in np.unique(rows.pose):
        out = rows.pose == pose
        if out.all():
            continue
        less = known.update(rows, ~out).visiting(rows)
        yield int(pose), errors_of(less.expect(rows), rows, ~out)[out]


def _surest(model: Model, rows: CheckRows, known: Knowledge) -> Model:
    """Keep what a model is at the least sure of, where it has been: see `Model`."""
    effects, values, covariance = model.compensable()
    at = effects.at(ArmStates(known.arm, rows.states), values)
    worst = np.sqrt(parameter_variance(effects, at, covariance).max()) / MM
    given = model.statistics.get(WORST_STD, 0.0)
    return replace(
        model, statistics=model.statistics | {WORST_STD: max(given, float(worst))}
    )
