"""What a reader needs to judge a diagnosis: residuals, rivals, rows, the chain."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from postproc.accuracy.diagnosis.choice import ranking
from postproc.accuracy.diagnosis.diagnose import Extension
from postproc.accuracy.diagnosis.locate import Profile, profile
from postproc.accuracy.diagnosis.projection import Projection
from postproc.arrays import Floats
from postproc.robot.pose import MM

LISTED = 25  # candidates
SHOWN = 3000  # rows: more say nothing more


def evidence_of(found: Extension) -> dict[str, Any]:
    """Write a diagnosis with all that it rests on, as plain data.

    To the report come, of every effect, ``evidence``: its residual against its
    covariate, with and without it; ``candidates``: what the given model's residual
    calls for, best first; ``rows``: error vectors of held-out rows; ``history``: the
    chain of models.
    """
    report = found.diagnosis.to_dict()
    search = found.search
    effects = [
        effect | {"evidence": _seen(profile(search.fit, search.place(k), a.candidate))}
        for k, (effect, a) in enumerate(
            zip(report["effects"], search.additions, strict=True)
        )
    ]
    return report | {
        "effects": effects,
        "candidates": _candidates(found),
        "rows": _rows(found),
        "history": [dict(record) for record in found.model.history],
    }


def dumped(report: Mapping[str, Any]) -> str:
    """Write a report as JSON text, a key a line, rows in one."""
    keys = [f" {json.dumps(k)}: {json.dumps(v)}" for k, v in report.items()]
    return "{\n" + ",\n".join(keys) + "\n}\n"


def _seen(shown: Profile) -> Mapping[str, Any]:
    """Write a profile, in millimetres of the TCP."""
    some = thinned(len(shown.values))
    before, after = (
        (values * shown.lever)[some] for values in (shown.before, shown.after)
    )
    return {
        "covariate": shown.label,
        "unit": shown.unit,
        "direction": shown.direction.partition(" [")[0],
        "x": _plain(shown.values[some]),
        "before_mm": _plain(before),
        "after_mm": _plain(after),
    }


def _candidates(found: Extension) -> list[dict[str, Any]]:
    """List what the residual of the given model calls for."""
    search = found.search
    scores = ranking(Projection.of(search.base), search.library)[:LISTED]
    return [
        {
            "effect": s.family.effect,
            "joint": s.family.joint,
            "source": s.best.source,
            "p_value": search.null.p_value(s.evidence),
            "evidence_nats": round(s.evidence, 3),
        }
        for s in scores
    ]


def _rows(found: Extension) -> dict[str, list[Any]]:
    """List error vectors of held-out rows [mm]."""
    rows = found.held_out
    some = thinned(len(rows.rows))
    return {
        "before_mm": _plain(rows.before[some] / MM),
        "after_mm": _plain(rows.after[some] / MM),
    }


def thinned(count: int) -> NDArray[np.int64]:
    """Choose at most so many rows, evenly.

    >>> len(thinned(10)), len(thinned(100_000))
    (10, 3000)
    """
    places = np.linspace(0, count - 1, min(count, SHOWN))
    return np.unique(places.astype(np.int64))


def _plain(values: Floats) -> list[Any]:
    """Write numbers as short as they deserve, unknown ones as none."""
    listed = np.round(values, 5).astype(object)
    listed[~np.isfinite(values)] = None
    plain: list[Any] = listed.tolist()
    return plain
