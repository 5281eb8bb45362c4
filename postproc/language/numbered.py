"""Numbered names: ``WP_12``, ``p1``. Lines that differ in them only have one form.

`form_of` is the definition, one line at a time; `find_names` computes the same for
whole files with arrays, where lines hold nothing out of the ordinary.
"""

from __future__ import annotations

import re

import numpy as np

from postproc.arrays import Bytes, Ints
from postproc.language.lexis import BLANKS
from postproc.language.plain_numbers import byte_table, runs_of

NAME_MARK = "\x01"  # a numbered name, in a form
UNREADABLE = NAME_MARK * 2  # begins the form of a line that holds such a mark itself
WHOLE = b"\n"  # begins a mask with its names still in it: no other mask holds it

# A name up to its first digit, and the rest: what cannot begin one is passed over, and
# nothing is tried twice.
_NUMBERED = r"[A-Za-z_](?<![\w$].)[A-Za-z_]*+[^\W\d]*+\d\w*+(?! *::)"
_STRING_OR_NAME = re.compile(
    rf"(?P<string>'(?:\\.|[^'\\])*'|'[^']*'|\"[^\"]*\")|{_NUMBERED}"
)
_MAX_BLANKS = 60  # between a name and what is behind it; more: line by line
_DOLLAR, _COLON = 36, 58
_LETTERS = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ_"
_IS_FIRST, _IS_NAME = byte_table(_LETTERS), byte_table(_LETTERS + "0123456789")
_IS_BLANK = byte_table(BLANKS)


def form_of(mask: str) -> tuple[str, tuple[str, ...]]:
    r"""Take the numbered names out of the mask of a line.

    Returns:
        Its form and the names.

    >>> form_of("MOVE TO WP_1 WITH CONDITION[spot('g2', x3)]")
    ("MOVE TO \x01 WITH CONDITION[spot('g2', \x01)]", ('WP_1', 'x3'))
    """
    if NAME_MARK in mask:  # the text holds that character: no line of any grammar
        return UNREADABLE + mask, ()
    names: list[str] = []

    def mark(found: re.Match[str]) -> str:
        if found["string"] is not None:
            return found.group()
        names.append(found.group())
        return NAME_MARK

    return _STRING_OR_NAME.sub(mark, mask), tuple(names)


def mask_of(form: str, names: tuple[str, ...]) -> str:
    """Fill the names into a form again."""
    if not names:
        return form.removeprefix(UNREADABLE)
    parts = form.split(NAME_MARK)
    pairs = zip(parts, names, strict=False)
    return "".join([text for pair in pairs for text in pair]) + parts[-1]


def find_names(a: Bytes, digits: Ints) -> tuple[Ints, Ints, Ints]:
    """Find the numbered names of a text in which only names hold other than ASCII.

    Args:
        a: The text.
        digits: Where runs of digits begin that follow a letter or digit, ascending.

    Returns:
        Where the names begin and where they end, and places too far from what is behind
        them to tell whether they are labels.
    """
    if not len(digits):
        return digits, digits, digits
    start, end = runs_of(_IS_NAME[a])
    word = np.searchsorted(start, digits, side="right") - 1
    word = word[np.append(True, word[1:] != word[:-1])]
    start, end = start[word], end[word]
    before = np.where(start > 0, a[start - 1], 10)
    name = _IS_FIRST[a[start]] & (before != _DOLLAR)
    start, end = start[name], end[name]
    padded = np.append(a, np.zeros(2, dtype=np.uint8))
    behind = end.copy()
    for _ in range(_MAX_BLANKS):
        blank = np.flatnonzero(_IS_BLANK[padded[behind]])
        if not len(blank):
            break
        behind[blank] += 1
    far = _IS_BLANK[padded[behind]]
    label = (padded[behind] == _COLON) & (padded[behind + 1] == _COLON)
    return start[~label], end[~label], start[far]


def texts_of(a: Bytes, start: Ints, end: Ints) -> list[str]:
    """Cut words out of a text; something that is no word follows each but the last.

    Args:
        a: The text.
        start: Where they begin, ascending, (m,).
        end: Where they end, (m,).
    """
    if not len(start):
        return []
    out = np.append(a, np.uint8(10))
    out[end] = 10
    change = np.zeros(len(out) + 1, dtype=bool)
    change[start] = True
    change[end + 1] ^= True
    words = out[np.logical_xor.accumulate(change[:-1])]
    return words.tobytes().decode("latin-1").split("\n")[:-1]
