"""The given model's effects, fitted to the rows that are to be diagnosed."""

from __future__ import annotations

from postproc.accuracy.diagnosis.revision import few, only_arm, revise
from postproc.accuracy.fit import fit_effects
from postproc.accuracy.fitted import Fit
from postproc.accuracy.measurement import Measurements
from postproc.arrays import Floats
from postproc.exceptions import PostprocError
from postproc.model.effects import propose
from postproc.model.kinematics import Batch
from postproc.model.model import Model
from postproc.robot.arm import Arm

FEWEST = 12  # rows


def refit(
    survey: Measurements,
    arm: Arm,
    model: Model,
    tracker: Floats | None,
    setup: tuple[str, ...] = (),
) -> Fit:
    """Fit the given model's effects to the rows, or revise it where they are few.

    Raises:
        PostprocError: The model was not made by the full method, or there are hardly
            any rows.
    """
    model.check_arm(arm)
    if model.method != "full":
        raise PostprocError(
            f"a model of method {model.method} has no named effects to extend. "
            "Fit one with --method full and diagnose that"
        )
    if len(survey) < FEWEST:
        raise PostprocError(
            f"{survey.path} has {len(survey)} rows; tracing an effect takes at least "
            f"{FEWEST}. Measure more points"
        )
    origin = None if tracker is None else (tracker[0], tracker[1], tracker[2])
    batch = Batch(arm, survey.states)
    effects = model.effects.effects
    if model.data_sha256 != survey.sha256:
        effects = only_arm(model).effects.effects
    missing = [name for name in setup if name not in {e.name for e in effects}]
    placed = propose(missing, arm, survey.states)
    if model.data_sha256 != survey.sha256 and few(survey, model):
        return revise(survey, model, batch, origin, placed)
    return fit_effects(batch, survey.position, (*effects, *placed), origin)
