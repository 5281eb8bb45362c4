"""Comments that mark measured moves, in every language."""

from __future__ import annotations

import pytest

from postproc.language.text.comment_directives import MEASURE, TAUGHT, Comments
from postproc.language.text.source import source_from_bytes

TEXT = """say "{sign} MEASURE no" move
{sign} MEASURE P1
move p;  {sign}measure P2 x
move p;  {sign} then {sign} MEASURE no
{sign}{sign} MEASURE
say "a" and "b"  {sign} MEASURE P3
{sign} MEASURED no
"""


@pytest.mark.parametrize(("sign", "quote"), [("--", "'"), ("!", '"'), (";", '"')])
@pytest.mark.parametrize("ends", ["\n", "\r\n"])
def test_marks_are_comments_not_strings(sign, quote, ends):
    text = TEXT.format(sign=sign).replace(";  ", "  ").replace('"', quote)
    source = source_from_bytes("x", text.replace("\n", ends).encode())
    comments = Comments(sign, quote)
    found = [(2, "P1"), (3, "P2"), (5, ""), (6, "P3")]
    assert list(comments.marks(source, MEASURE)) == found
    assert not list(comments.marks(source, TAUGHT)) and not comments.list_taught(source)


def test_points_that_were_taught():
    source = source_from_bytes("x", b"a ! TAUGHT\nb ! not TAUGHT\nc !taught by me")
    assert Comments("!", '"').list_taught(source) == {1, 3}
