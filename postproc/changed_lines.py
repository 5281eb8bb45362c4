"""Lines of the same two places in two files: which numbers differ, or what more."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import compress, islice
from operator import ne

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from postproc.arrays import Bools, Floats, Ints, pieces
from postproc.compensation.parallel import in_turns
from postproc.language.scan import BLANKS, Masked, mask_lines
from postproc.number_pairs import Pairs, pair_numbers
from postproc.rows import Rows, joined_rows

PIECE = 5_000  # lines that are masked at a time
WIDEST = 64  # bytes of beginnings that are compared; wider: line by line

_ASSIGNED = re.compile(r"\s*([A-Za-z_$][\w$.\[\]]*)\s*(?::=|:)")
_TWO_WORDS = re.compile(r"\s*([A-Za-z_]+)\s+([A-Za-z_]+)")
_WORD = re.compile(r"[A-Za-z_]+")
_LEAD = re.compile(
    r"\s*(?:ELSE\s*:|CASE\s*\(.*?\)\s*:|WHEN\b.*?\bDO\b|[A-Za-z_]\w*\s*::)"
    r"(?=\s*[A-Za-z_$])",
    re.I,
)  # what may stand before a statement on its line
_LED = re.compile(r"\s*(?:ELSE\s*:|CASE\s*\(|WHEN\b|[A-Za-z_]\w*\s*::)", re.I)
_AS_BLANKS = bytes(32 if chr(c) in BLANKS else c for c in range(256))


def changed_rows(
    file: str, lines: Sequence[int], before: Sequence[bytes], after: Sequence[bytes]
) -> Rows:
    """Describe those of equally many lines that differ.

    Args:
        file: Name of the original.
        lines: Numbers of its lines.
        before: Its lines, without their endings.
        after: Those of the other file.
    """

    def compare(some: slice) -> Rows:
        old, new = before[some], after[some]
        differ = np.fromiter(map(ne, old, new), bool, len(old))
        numbers = np.array(lines[some], dtype=np.int64)[differ]
        if not differ.all():
            old, new = (list(compress(texts, differ)) for texts in (old, new))
        return _compare(file, numbers, old, new)

    tasks = list(pieces(len(before), PIECE))
    return joined_rows(file, list(in_turns(compare, tasks)))


def _compare(
    file: str, lines: Ints, before: Sequence[bytes], after: Sequence[bytes]
) -> Rows:
    """Describe how pairs of lines differ."""
    if not len(lines):
        return joined_rows(file, ())
    pairs = pair_numbers(before, after)
    rest = np.flatnonzero(~pairs.alike)
    if len(rest):
        own = [[texts[k] for k in rest.tolist()] for texts in (before, after)]
        pairs = pairs.with_more(rest, _by_shapes(*own))
    differ = pairs.owner[pairs.old != pairs.new]
    moved = np.bincount(differ, minlength=len(lines)) > 0
    mine = moved[pairs.owner]
    owner, old, new = pairs.owner[mine], pairs.old[mine], pairs.new[mine]
    first = np.append(np.searchsorted(owner, np.arange(len(lines))), len(owner))
    has, change = _changes(first, old, new, before)
    begins = np.full(len(lines), -1)
    begins[moved] = pairs.place[mine][first[:-1][moved]]
    names, target = _targets(before, begins)
    texts = {
        k: f"{before[k].decode('latin-1')} -> {after[k].decode('latin-1')}"
        for k in np.flatnonzero(~moved).tolist()
    }
    return Rows(file, lines, names, target, first, old, new, change, has, texts)


def _by_shapes(before: Sequence[bytes], after: Sequence[bytes]) -> Pairs:
    """Read the numbers of pairs of lines that have the same shape."""
    a, b = _masked(before), _masked(after)
    count = np.diff(a.first)
    alike = _only_numbers(before, after, a, b) & (count == np.diff(b.first))
    mine, own = (np.repeat(alike, np.diff(m.first)) for m in (a, b))
    owner = np.repeat(np.arange(len(before)), count)[mine]
    place = a.start[mine] - _starts(before)[owner]
    return Pairs(alike, owner, a.value[mine], b.value[own], place)


def _only_numbers(
    before: Sequence[bytes], after: Sequence[bytes], a: Masked, b: Masked
) -> Bools:
    """Tell which pairs of lines differ in nothing but numbers."""
    same = np.array([x == y for x, y in zip(a.masks, b.masks, strict=True)])
    if (a.comment >= 0).any() or (b.comment >= 0).any():
        comments = zip(_comments(before, a), _comments(after, b), strict=True)
        same &= np.array([x == y for x, y in comments])
    same[[*a.unterminated, *b.unterminated]] = False
    return same


def _comments(lines: Sequence[bytes], masked: Masked) -> list[bytes]:
    """Return the comment of every line, b"" where it has none."""
    places = zip(lines, masked.comment - _starts(lines), masked.comment, strict=True)
    return [line[own:] if at >= 0 else b"" for line, own, at in places]


def _changes(
    first: Ints, old: Floats, new: Floats, before: Sequence[bytes]
) -> tuple[Bools, Floats]:
    """Return which lines hold a position, and how far it moved, NaN elsewhere."""
    has = np.diff(first) >= 3
    text = np.frombuffer(b"\n".join(before), dtype=np.uint8)
    braces = np.flatnonzero(text == ord("{"))
    has[np.searchsorted(_starts(before), braces, side="right") - 1] = False
    at = first[:-1][has, None] + np.arange(3)
    change = np.full(len(has), np.nan)
    with np.errstate(invalid="ignore"):  # numbers too long for a float are infinite
        change[has] = np.linalg.norm(new[at] - old[at], axis=1)
    return has, change


def _targets(before: Sequence[bytes], begins: Ints) -> tuple[list[str], Ints]:
    """Name what the numbers of lines belong to, once for lines that begin alike.

    Args:
        before: The lines.
        begins: Where their first number starts, -1 for a line without a name.

    Returns:
        Names, and the index of each line's, (n,).
    """
    lead = np.flatnonzero(~_begin_as_before(before, begins))
    known: dict[bytes, str | None] = {}
    told: list[str | None] = []
    for k, length in zip(lead.tolist(), begins[lead].tolist(), strict=True):
        begin = before[k][: max(length, 0)]
        if begin not in known:
            known[begin] = _told_by(begin.translate(_AS_BLANKS).decode("latin-1"))
        told.append(known[begin] if length >= 0 else "")
    names: dict[str, int] = {}
    code = [-1 if t is None else names.setdefault(t, len(names)) for t in told]
    index = np.repeat(code, np.diff(lead, append=len(before)))
    for k in np.flatnonzero(index < 0).tolist():
        name = target_name(before[k].decode("latin-1"))
        index[k] = names.setdefault(name, len(names))
    return list(names), index


def _begin_as_before(lines: Sequence[bytes], length: Ints) -> Bools:
    """Tell which lines begin with the same so many bytes as the one before them."""
    same: Bools = np.diff(length, prepend=-2) == 0
    width = int(length.max(initial=0))
    if width > WIDEST:
        return np.zeros_like(same)
    if not width:
        return same
    text = np.frombuffer(b"\n".join([*lines, bytes(width)]), dtype=np.uint8)
    begin = sliding_window_view(text, width)[_starts(lines)]
    other = (begin[1:] != begin[:-1]) & (np.arange(width) < length[1:, None])
    same[1:] &= ~other.any(axis=1)
    return same


def _told_by(begin: str) -> str | None:
    """Name what numbers belong to by what is before the first, None if not told."""
    if _LED.match(begin):
        return None
    words, assigned = _TWO_WORDS.match(begin), _ASSIGNED.match(begin)
    if words:
        return f"{words[1]} {words[2]}"
    return assigned[1] if assigned else None


def target_name(line: str) -> str:
    """Name what a line's numbers belong to.

    >>> target_name("CASE (2): MOVE LINEAR TO POS(1, 2, 3, 4, 5, 6, '')")
    'MOVE LINEAR'
    """
    while lead := _LEAD.match(line):
        line = line[lead.end() :]
    assigned = _ASSIGNED.match(line)
    if assigned:
        return assigned.group(1)
    return " ".join(found.group() for found in islice(_WORD.finditer(line), 2))


def _starts(lines: Sequence[bytes]) -> Ints:
    """Return where lines begin once they are joined."""
    return np.cumsum([0, *map(len, lines[:-1])]) + np.arange(len(lines))


def _masked(lines: Sequence[bytes]) -> Masked:
    """Mask lines without their endings; at least one."""
    return mask_lines(b"\n".join([*lines, b""]), _starts(lines))


def shapes(lines: Sequence[bytes]) -> list[bytes]:
    """Return the masks of all lines."""
    return _masked(lines).masks if lines else []
