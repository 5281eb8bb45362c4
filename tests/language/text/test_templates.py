"""Lines that differ in numbered names share a form, and say what they would alone."""

from typing import cast

import pytest

from postproc.language import ir
from postproc.language.pdl2 import syntax as ast
from postproc.language.pdl2.parser import parse_form, parse_value_form
from postproc.language.text.source import source_from_bytes
from postproc.language.text.statement_table import read_lines
from postproc.language.text.templates import filler
from tests.reference.text import form_of


def parse_line(mask: str) -> ir.SourceStatement:
    """Parse the mask of one logical line of PDL2."""
    form, names = form_of(mask)
    said = parse_form(form)
    fill = filler(said)
    return said if fill is None else cast(ir.SourceStatement, fill(names))


@pytest.mark.parametrize(
    ("mask", "names"),
    [
        (
            "MOVE LINEAR TO WP_1 WITH CONDITION[Spot2(\x00, Id_3)]",
            ("WP_1", "Spot2", "Id_3"),
        ),
        ("v1, V2 : POSITION", ("v1", "V2")),
        ("x := 'p1' + $v2", ()),
    ],
)
def test_names_are_taken_out_and_filled_in(mask, names) -> None:
    assert form_of(mask)[1] == names
    plain = parse_line(mask.translate(str.maketrans("123", "abc")))
    said = repr(parse_line(mask)).replace("-1", "-")  # a slot that is not there
    said = said.translate(str.maketrans("123", "abc"))
    assert said == repr(plain).replace("-1", "-")


def test_case_is_kept_where_it_is_shown_only() -> None:
    declared = parse_line("Wp1, WP2 : POSITION")
    assert isinstance(declared, ast.Declare) and declared.names == ("Wp1", "WP2")
    moved = parse_line("MOVE TO Wp1")
    assert isinstance(moved, ast.Move) and moved.where == (ir.DataObject("wp1"),)
    source = source_from_bytes("job.lsv", b"Wp1 XTND Arm: 1 Priv")
    (entered,) = read_lines(source, parse_value_form).said
    assert entered is not None and entered.name == "Wp1"


@pytest.mark.parametrize("mask", ["?? Wp1 ?? x2", "MOVE TO '\r'"])
def test_what_is_not_understood_keeps_its_text(mask) -> None:
    assert parse_line(mask) == ir.NotUnderstood(mask)
