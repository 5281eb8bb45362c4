"""Only the numbers of targets change, and they keep their digits."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from postproc.exceptions import ProgramError
from postproc.language.pdl2.interpreter import resolve
from postproc.language.pdl2.pose_encoding import PDL2_DIALECT
from postproc.language.pdl2.program import parse
from postproc.language.text.number_edits import difference, edits
from postproc.language.text.source import (
    Edit,
    Replacements,
    Source,
    Span,
    apply,
    source_from_bytes,
)
from tests.language.digits import number_texts
from tests.reference.text import decimals_of

PROGRAM = (
    "PROGRAM a -- caf\xe9\r\n"
    "BEGIN\r\n"
    "\tMOVE LINEAR TO POS(1.5,- 2.25 , 3, -0.00000, 45.123456, 1e1, 'W T1:0')  \r\n"
    "  MOVE JOINT TO {1, 2.5, 3, 4, 5, 6}"
).encode("latin-1")


def test_new_numbers_have_enough_digits_and_nothing_else_changes() -> None:
    source = source_from_bytes("a.pdl", PROGRAM)
    literals = resolve(parse(source)).visits.literals
    new = np.array(
        [[1.25, 2.5, 3.0001, -0.5, 45.1234561, 10.5], [1.000006, 2.5, -3, 4, 5, 6]]
    )
    (mine,) = edits(literals, (source,), np.array([0, 1]), new, PDL2_DIALECT)
    out = apply(source.data, mine)
    assert out == PROGRAM.replace(b"1.5,- 2.25 ", b"1.250,2.500 ").replace(
        b"-0.00000", b"-0.50000"
    ).replace(b"1e1", b"10.5000").replace(b"{1, 2.5, 3,", b"{1.00001, 2.5, -3.00000,")
    assert difference(source, Source("a.pdl", out), mine) == ""


@pytest.mark.parametrize("digits", [1_001, 65_540])
def test_a_number_with_too_many_digits_is_refused(digits) -> None:
    long = PROGRAM.replace(b"{1, ", b"{1." + b"0" * digits + b", ")
    source = source_from_bytes("a.pdl", long)
    literals = resolve(parse(source)).visits.literals
    new = np.array([[2.0, 2.5, 3.0, 4.0, 5.0, 6.0]])
    with pytest.raises(ProgramError, match=r"a\.pdl:4: .*1,000 digits.*15"):
        edits(literals, (source,), np.array([1]), new, PDL2_DIALECT)


def test_a_difference_that_was_not_meant_is_found() -> None:
    source = source_from_bytes("a.pdl", PROGRAM)
    at = PROGRAM.index(b"1.5")
    meant = Replacements.of([Edit(Span(at, at + 3), b"1.7")])
    good = Source("a", apply(PROGRAM, meant))
    assert difference(source, good, meant) == ""
    assert difference(source, Source("a", good.data.replace(b"45.1", b"45.2")), meant)
    assert difference(source, Source("a", good.data.replace(b"\xe9", b"e")), meant)
    assert difference(source, Source("a", good.data + b"\r\nx"), meant)
    assert difference(source, Source("a", good.data.replace(b"1.7", b"1.8")), meant)
    assert difference(source, source, meant)


def test_a_value_that_is_none_is_refused() -> None:
    source = source_from_bytes("a.pdl", PROGRAM)
    literals = resolve(parse(source)).visits.literals
    with pytest.raises(ValueError, match="not finite"):
        edits(literals, (source,), np.array([0]), np.full((1, 6), np.nan), PDL2_DIALECT)


@given(st.floats(-1e4, 1e4), st.integers(0, 8))
def test_digits_written(value: float, decimals: int) -> None:
    assert decimals_of(f"{12.5:.{decimals}f}") == decimals
    text = number_texts([value], [decimals])[0]
    assert decimals_of(text) == decimals
    assert abs(float(text) - value) <= 0.5 * 10.0**-decimals + 1e-11
    assert not text.startswith("-0.000") or float(text) != 0.0


def test_a_plus_belongs_to_its_number_and_stays_while_it_is_not_below_zero() -> None:
    move = b"MOVE TO POS(+1500.0, + 2, +0.01, +90, -45, +1.5e1, '')"
    text = b"PROGRAM a\nBEGIN\n" + move + b"\nEND a\n"
    source = source_from_bytes("a.pdl", text)
    visits = resolve(parse(source)).visits
    assert visits.target.values[0].tolist() == [1500.0, 2.0, 0.01, 90.0, -45.0, 15.0]
    wanted = np.array([[1501.25, 3.5, -0.02, 91.0, 44.0, 16.0]])
    (mine,) = edits(visits.literals, (source,), np.array([0]), wanted, PDL2_DIALECT)
    out = apply(source.data, mine)
    assert b"POS(+1501.250, +3.500, -0.020, +91.0000, 44.0000, +16.0000, '')" in out
    again = resolve(parse(source_from_bytes("a.pdl", out))).visits
    np.testing.assert_array_equal(again.target.values, wanted)
    assert difference(source, Source("a.pdl", out), mine) == ""
