"""Numbers written by the column are those that Python writes one by one."""

import json

import numpy as np
import pytest

from postproc.byte_columns import blanked, fixed, joined, listed, named, shortest, whole

AWKWARD = (
    0.0, -0.0, 0.5, -0.5, 1.5, 0.125, 2.675, 1e-5, 9.9999e-5, 1e-4, -1e-12, 9999.5,
    9999.99999, 10000.0, 99999999.0, 123456789.125, 1e15, 1e22, -1e300, 0.1 + 0.2,
    1 / 3, float("inf"), float("-inf"), float("nan"),
)  # fmt: skip


def numbers() -> np.ndarray:
    rng = np.random.default_rng(8)
    size = 10.0 ** rng.integers(-8, 12, 3000)
    free = rng.normal(0.0, 1.0, 3000) * size
    few = [
        round(v, int(k)) for v, k in zip(free, rng.integers(0, 9, 3000), strict=True)
    ]
    ties = (rng.integers(-(10**6), 10**6, 500) + 0.5) / 10.0 ** rng.integers(0, 7, 500)
    return np.concatenate([AWKWARD, free, few, ties])


def lines(column: np.ndarray) -> list[str]:
    return joined([column, b"\n"]).decode().split("\n")[:-1]


@pytest.mark.parametrize("decimals", range(9))
def test_fixed_is_what_python_writes(decimals: int) -> None:
    values = numbers()
    wanted = [f"{v:.{decimals}f}".replace("nan", "null") for v in values.tolist()]
    assert lines(fixed(values, decimals)) == wanted


@pytest.mark.parametrize("decimals", [None, 2, 9])
def test_shortest_is_what_python_writes(decimals: int | None) -> None:
    values = numbers()
    given = values.tolist()
    if decimals is not None:
        given = [round(v, decimals) for v in given]
    wanted = [repr(v).replace("nan", "null") for v in given]
    assert lines(shortest(values, decimals)) == wanted


def test_rows_are_json() -> None:
    rows = listed([whole(np.array([1, 20_000])), fixed(np.array([0.5, np.nan]), 2)])
    rows = blanked(rows, np.array([False, True]), b"[]")
    texts = named(("a", 'é "b"'), np.array([1, 0]), json.dumps)
    told = [json.loads(line) for line in lines(listed([rows, texts]))]
    assert told == [[[1, 0.5], 'é "b"'], [[], "a"]]


@pytest.mark.parametrize("decimals", [8, 9, 18, 19, 25, 400])
def test_any_number_of_decimals_is_written_as_python_does(decimals):
    values = np.array([0.0, -1.5, 1234.0625, 1 / 3, np.nan])
    text = joined([fixed(values, decimals), b" "]).decode()
    wanted = [f"{v:.{decimals}f}" for v in values[:4].tolist()]
    assert text.split() == [*wanted, "null"]
