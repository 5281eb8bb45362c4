"""The first sentence of a diagnosis: what is named, what has no law, what remains."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc.calibration.diagnosis.result import Diagnosis, Finding
from postproc.model.statistics import ErrorStatistics


def finding(effect: str, joint: int | None, share: float, **more: bool) -> Finding:
    return Finding(
        effect, joint, more.get("nameless", False), False, None, 1e-9, 50.0, share,
        0.1, {}, (), {}, (1.0, 0.1),
    )  # fmt: skip


def statistics(mean: float) -> ErrorStatistics:
    return ErrorStatistics(mean, 0.01, 2 * mean, 3 * mean, 100)


DIAGNOSED = Diagnosis(
    "effect", 0.05, "data sheets", 80, 100, statistics(0.2), statistics(0.06), None,
    (finding("compliance", 3, 0.5), finding("compliance", 2, 0.3),
     finding("curve", 4, 0.2, nameless=True)),
    (), (), np.zeros((0, 6)), "", (), None, explained=0.9,
)  # fmt: skip


def test_the_share_with_a_law_is_named_and_the_rest_has_a_shape() -> None:
    assert DIAGNOSED.named == pytest.approx(0.72)
    assert DIAGNOSED.story() == (
        "72% of the error is named: compliance of joints 2, 3; 18% has a shape and no "
        "law: curve of joint 4; 0.0600 mm remain, 1.2 times the noise floor"
    )
    mapped = replace(DIAGNOSED, findings=(finding("joint_map", 1, 1.0),))
    assert mapped.named == 0.0
    assert "named: nothing; 90% has a shape and no law: joint_map" in mapped.story()


def test_nothing_is_named_where_nothing_was_added() -> None:
    empty = replace(DIAGNOSED, verdict="noise", findings=(), explained=None)
    assert empty.story().startswith("nothing was added: 0.0600 mm remain")
    assert empty.to_dict()["named_share"] is None


def test_a_rejected_diagnosis_says_what_both_models_leave() -> None:
    worse = replace(DIAGNOSED, verdict="rejected", after=statistics(0.3))
    assert "0.3000 mm with the extended model and 0.2000 mm" in worse.story()
