"""Names, help, messages and pages use the words of the field; counts may only fall."""

from __future__ import annotations

import ast
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "docs" / "tools"))

import words  # noqa: E402


def test_no_file_has_more_than_is_allowed():
    assert not words.problems(), "\n".join(words.problems())


def test_words_are_found_where_users_and_readers_see_them():
    code = '''
def told_once(): """Say what was told."""
class LeftAlone: pass
option(help="Whatever is left.")
fail("row 12 was left: nobody knows why")
key = "left"
'''
    tree = ast.parse(code)
    named = {(kind, what) for kind, *_, what in words.names("x.py", tree)}
    assert named == {
        ("names", "LeftAlone"),
        ("names", "told_once"),
        ("participle", "told_once"),
    }
    seen = {(kind, line) for kind, line, _ in words.texts("x.py", tree)}
    assert seen == {("help", 4), ("messages", 5)}
    assert words.PROSE.findall("row 12 was left: nobody knows why") == [
        "left",
        "nobody knows",
    ]


def test_left_is_a_side_beside_right():
    assert not words.PROSE.findall("wave to the left; left or right; on the left")
    assert words.PROSE.findall("it is left, and left to themselves") == ["left"] * 2


def test_pages_that_commands_write_count_too(tmp_path):
    page, script = tmp_path / "a.html.j2", tmp_path / "a.js"
    page.write_text('<i id="left">{% if left %}left alone{% endif %}</i>')
    script.write_text('const left = "left"; say("left alone", `what ${x} left`);')
    found = [words.PROSE.findall(t) for p in (page, script) for _, t in words.assets(p)]
    assert found == [["left"], ["left"], ["left"]]


def test_sentences_are_counted_one_by_one():
    assert not words.long_sentences("word " * 24 + "end. " + "word " * 24 + "end.")
    assert len(words.long_sentences("word " * 30 + "end. Short one.")) == 1
