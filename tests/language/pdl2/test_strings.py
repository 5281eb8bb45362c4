"""Strings of PDL2: two quotes are one inside of a string."""

from __future__ import annotations

import pytest

from postproc.language import ir
from postproc.language.pdl2.program import parse
from postproc.language.text.source import Source
from tests.language.pdl2.test_external_routines import FIRST, codes, followed, reasons

STRINGS = {
    "'l''utensile'": "l'utensile", "'x'''": "x'", "''''": "'", "''": "",
    "'a''b''c'": "a'b'c", "'''x'": "'x", "'it''s -- none'": "it's -- none",
}  # fmt: skip


@pytest.mark.parametrize("text", STRINGS)
def test_two_quotes_are_an_apostrophe(text):
    source = Source(
        "a.pdl", f"PROGRAM a\nBEGIN\n  s := {text} -- it's\nEND a\n".encode()
    )
    found = parse(source).lines.statement(2)
    assert isinstance(found, ir.Assignment) and found.value == ir.StringLiteral(
        STRINGS[text]
    )


@pytest.mark.parametrize("text", STRINGS)
def test_such_a_string_leaves_nothing(text):
    found = followed(f"WRITE LUN_CRT ({text}, NL)", FIRST)
    assert reasons(found) == [""] and "unknown-statement" not in codes(found)
