"""Rows of text from columns are what Python writes one by one."""

import ast
import json
from pathlib import Path

import numpy as np
import pytest

from postproc import _native, arrays
from postproc.arrays import Cells, format_fixed, format_texts, shortest, text_of, whole

AWKWARD = (
    0.0, -0.0, 0.5, -0.5, 1.5, 0.125, 2.675, 1e-5, 9.9999e-5, 1e-4, -1e-12, 9999.5,
    9999.99999, 10000.0, 99999999.0, 123456789.125, 1e15, 4e14, 999999999999.5, 1e22,
    -1e300, 0.1 + 0.2, 1 / 3, float("inf"), float("-inf"), float("nan"), 5e-324,
    0.0000000005, 0.00000000049999, 1e12 + 0.5, 4503599627370496.5, 0.30000000000000004,
)  # fmt: skip


@pytest.fixture(scope="module")
def numbers() -> np.ndarray:
    rng = np.random.default_rng(8)
    size = 10.0 ** rng.integers(-8, 10, 20_000)
    free = rng.normal(0.0, 1.0, 20_000) * size
    few = [
        round(v, int(k)) for v, k in zip(free, rng.integers(0, 10, 20_000), strict=True)
    ]
    ties = (rng.integers(-(10**6), 10**6, 2000) + 0.5) / 10.0 ** rng.integers(
        0, 10, 2000
    )
    beside = np.nextafter(np.concatenate([few, ties]), 1e300)
    return np.concatenate([AWKWARD, free, few, ties, beside])


def lines(column: Cells, n: int) -> list[str]:
    return text_of(n, [column, Cells(b"\n")]).decode().split("\n")[:-1]


@pytest.mark.parametrize("decimals", [*range(11), 15, 16, 18, 25, 400])
def test_fixed_is_what_python_writes(numbers, decimals: int) -> None:
    wanted = [f"{v:.{decimals}f}".replace("nan", "null") for v in numbers.tolist()]
    assert lines(format_fixed(numbers, decimals), len(numbers)) == wanted


@pytest.mark.parametrize("decimals", [None, 0, 2, 4, 9, 10, 17])
def test_shortest_is_what_python_writes(numbers, decimals: int | None) -> None:
    given = numbers.tolist()
    if decimals is not None:
        given = [round(v, decimals) for v in given]
    wanted = [repr(v).replace("nan", "null") for v in given]
    assert lines(shortest(numbers, decimals), len(numbers)) == wanted


def test_whole_numbers():
    values = np.array(
        [0, 7, -7, 10**18, np.iinfo(np.int64).min, np.iinfo(np.int64).max]
    )
    assert lines(whole(values), 6) == list(map(str, values.tolist()))


def test_rows_are_json() -> None:
    values = np.array([[0.5, np.nan], [1.0, 2.0]])
    rows = [
        whole(np.array([1, 20_000])).behind(b'{"a": '),
        format_fixed(values, 2).bracket_rows().unless(np.array([False, True]), b"[]"),
        format_texts(("x", 'é "b"'), np.array([1, 0]), json.dumps).behind(b', "c": '),
        format_texts("-0+", np.array([[0, 1], [2, 2]]), json.dumps).bracket_rows(),
        Cells(b"}\n"),
    ]
    rows[1] = rows[1].behind(b', "b": ')
    rows[3] = rows[3].behind(b', "d": ')
    told = [json.loads(line) for line in text_of(2, rows).splitlines()]
    assert told == [
        {"a": 1, "b": [0.5, None], "c": 'é "b"', "d": ["-", "0"]},
        {"a": 20_000, "b": [], "c": "x", "d": ["+", "+"]},
    ]


def test_rows_of_different_lengths() -> None:
    first = np.array([0, 2, 2, 3])
    column = Cells(b"", numbers=np.array([[1.5], [2.0], [np.nan]]), first=first)
    assert lines(column.bracket_rows(), 3) == ["[1.5, 2.0]", "[]", "[null]"]


def test_texts_are_strings_of_json() -> None:
    texts = [bytes([c]) + b"x" for c in range(256)] + [b"", b"1.25", b"a\0b"]
    given = np.array(texts, "S")
    quoted = given.view(np.uint8).reshape(len(texts), -1)
    wanted = [json.dumps(text.decode("latin-1")) for text in given.tolist()]
    assert lines(Cells(quoted=quoted), len(texts)) == wanted


def test_what_does_not_fit_is_refused() -> None:
    values = np.ones((3, 1))
    for column in (
        Cells(numbers=values),
        Cells(left=np.zeros(3, dtype=bool)),
        Cells(numbers=values, first=np.array([0, 2, 4])),
        Cells(numbers=values, first=np.array([0, 2, 1])),
        Cells(numbers=values, first=np.array([0, 3])),
        Cells(numbers=np.ones((3, 2)), first=np.array([0, 1, 2])),
    ):
        with pytest.raises(ValueError, match="columns of other lengths"):
            text_of(2, [column])
    with pytest.raises(IndexError, match="a text that is not there"):
        text_of(1, [Cells(names=(b"a",), index=np.array([[1]]))])
    with pytest.raises(ValueError, match="one behind the other"):
        text_of(3, [Cells(numbers=np.asfortranarray(np.ones((3, 2))))])


def test_no_rows() -> None:
    empty = np.empty((0, 3))
    assert (
        text_of(0, [format_fixed(empty, 2), format_texts((), np.empty(0, int), str)])
        == b""
    )


def below(rows, left, gap, widths):
    """Put cells below each other, row by row; a column is as wide as what is above."""
    widths = list(widths)
    for row in rows:
        pairs = zip(row, widths, left, strict=True)
        cells = [c.ljust(w) if is_left else c.rjust(w) for c, w, is_left in pairs]
        yield gap.join(cells).rstrip(" ")
        widths = [max(w, len(c)) for w, c in zip(widths, row, strict=True)]
        widths[-1] *= not left[-1]


@pytest.mark.parametrize("left", [(True, False, True), (False, True, False)])
def test_tables_stand_below_each_other(left: tuple[bool, ...]) -> None:
    rng, n = np.random.default_rng(4), 9000  # more than a thread's
    texts = ("", "a", "éà", "a longer one ", "\u2191\u2193")
    index, size = rng.integers(0, 5, n), rng.normal(0, 10.0 ** rng.integers(-3, 5, n))
    given = {7: ["as", "it", "is"], n - 1: ["x" * 60, "", "y "]}
    columns = [format_texts(texts, index, str), format_fixed(size, 2), whole(index)]
    rows = [
        given.get(k, [texts[i], f"{s:.2f}", str(i)])
        for k, (i, s) in enumerate(zip(index.tolist(), size.tolist(), strict=True))
    ]
    told = {k: [(t.encode(), len(t)) for t in row] for k, row in given.items()}
    for most in (n, 20, 0):
        text, widths = _native.aligned(n, most, columns, left, b"|", [3, 1, 0], told)
        wanted = [*below(rows[:most], left, "|", [3, 1, 0])]
        assert text.decode().split("\n") == [*wanted, ""]
        longest = [max([w, *(len(row[c]) for row in rows[:most])])
                   for c, w in enumerate((3, 1, 0))]  # fmt: skip
        assert widths == [*longest[:2], 0 if left[-1] else longest[2]]


def test_tables_of_other_columns_are_refused() -> None:
    one = whole(np.array([1]))
    for left, widths in (((), ()), ((True,), ()), ((True, True), (0, 0))):
        with pytest.raises(ValueError, match="a side and a width"):
            _native.aligned(1, 1, [one], left, b"", widths, {})
    for given in ({1: [(b"", 0)]}, {0: []}):
        with pytest.raises(IndexError, match="a row that is not there"):
            _native.aligned(1, 1, [one], [True], b"", [0], given)


# Bytes are looked at in the core alone.

# The type, and texts as rows of it.
DOORS = {"arrays.py": 1, "language/text/source.py": 1}


def test_no_array_of_bytes_is_handled_outside_the_doors() -> None:
    root, found = Path(arrays.__file__).parent, {}
    for path in root.rglob("*.py"):
        names = [
            node.attr if isinstance(node, ast.Attribute) else node.value
            for node in ast.walk(ast.parse(path.read_text()))
            if isinstance(node, ast.Attribute)
            or (isinstance(node, ast.Constant) and isinstance(node.value, str))
        ]
        if count := sum(name in ("uint8", "ubyte", "u1", "B") for name in names):
            found[path.relative_to(root).as_posix()] = count
    assert found == DOORS
