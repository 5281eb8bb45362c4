from __future__ import annotations

import numpy as np
import pytest

from postproc.calibration.regression import observe


def test_redundant_columns_are_named_with_their_partners() -> None:
    rng = np.random.default_rng(0)
    X = rng.standard_normal((50, 4))
    X = np.column_stack([X, 2 * X[:, 0] - X[:, 2]])
    found = observe(X, ("a", "b", "c", "d", "sum"))
    assert found.rank == 4
    assert len(found.unseen) == 1
    named = {found.unseen[0].name, *found.unseen[0].partners}
    assert named == {"a", "c", "sum"}


def test_a_column_below_the_floor_is_unseen() -> None:
    X = np.diag([100.0, 50.0, 0.2])
    found = observe(X, ("a", "b", "c"), floor=1.0)
    assert found.rank == 2
    assert str(found.unseen[0]) == "c (too small to see)"


def test_indices_follow_their_definitions() -> None:
    X = np.diag([8.0, 4.0, 2.0])
    found = observe(X, ("a", "b", "c"))
    assert found.condition == pytest.approx(4.0)
    assert found.o1 == pytest.approx(4.0 / np.sqrt(3))


def test_fewer_rows_than_columns() -> None:
    found = observe(np.eye(2, 5), ("a", "b", "c", "d", "e"))
    assert found.rank == 2 and len(found.unseen) == 3
    assert observe(np.zeros((3, 0)), ()).rank == 0
