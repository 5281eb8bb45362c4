"""Some of the generated programs that `python -m tests.verify.generated` judges."""

from __future__ import annotations

import pytest

from tests.verify.generated import files_of, judged
from tests.verify.judged import compensated, row


@pytest.mark.parametrize("seed", range(8))
def test_generated_programs_agree(seed: int, bench_cell, bench_model) -> None:
    visits, opinion = judged(
        compensated(files_of(seed, bench_cell), bench_cell, bench_model)
    )
    assert opinion.agrees, opinion.to_dict()
    poses, joints = (
        row(opinion, f"output: {what}").compared for what in ("place", "joint targets")
    )
    assert poses + joints > (0.7 if seed % 4 < 3 else 0.3) * visits
