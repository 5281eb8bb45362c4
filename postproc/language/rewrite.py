"""New numbers into old text: edits of the numbers of targets, and nothing else."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Bools, Bytes, Floats, Indices, Ints, chunks
from postproc.exceptions import ProgramError
from postproc.language.lines import Lines, read_lines
from postproc.language.scan import number_value
from postproc.language.shapes import Shapes
from postproc.language.source import Replacements, Source, apply, as_bytes
from postproc.language.visits import Literals

# What new numbers must leave alone: the shapes of lines and where numbers stand.

AT_ONCE = 200_000  # numbers compared: what that takes is small beside two texts


@dataclass(frozen=True)
class Skeleton:
    """A text as it was read: n lines of code with m numbers.

    It is kept while a program is worked on.

    Attributes:
        source: The text.
        shapes: The distinct masks of its lines.
        shape: Index into `shapes`, (n,).
        line: 1-based physical lines, (n,).
        start, end: Byte offsets of the numbers, (m,).
    """

    source: Source
    shapes: Shapes
    shape: Indices
    line: Indices
    start: Indices
    end: Indices

    @classmethod
    def of(cls, lines: Lines) -> Skeleton:
        """Take over what the lines of a text tell."""
        return cls(
            lines.source, lines.shapes, lines.shape, lines.line, lines.start, lines.end
        )

    @classmethod
    def read(cls, source: Source) -> Skeleton:
        """Read a text.

        Raises:
            ProgramError: A string does not end on its line.
        """
        return cls.of(read_lines(source))


def difference(
    before: Source | Skeleton,
    after: Source | Skeleton,
    allowed: Replacements,
    stamp: int = 0,
) -> str:
    """Say where a text differs from its origin otherwise than by the edits meant.

    Its bytes must be those of the edited original. Read by itself, every line must
    have the shape it had, every edit must replace one whole number, and every number
    must stand where the edits move it to.

    Args:
        before: The original; it is read where it has not been yet.
        after: The rewritten text, likewise.
        allowed: The edits of numbers that were meant.
        stamp: Bytes of the stamp line that the rewritten text begins with.

    Returns:
        What is wrong, "" where all is well.
    """
    old, new = (s.source if isinstance(s, Skeleton) else s for s in (before, after))
    if not _is_meant(old.data, allowed, new.data, stamp):
        return _first_difference(apply(old.data, allowed), new, stamp)
    try:
        a = before if isinstance(before, Skeleton) else Skeleton.read(before)
        b = after if isinstance(after, Skeleton) else Skeleton.read(after)
    except ProgramError as problem:
        return str(problem)
    if len(a.shape) != len(b.shape) or len(a.start) != len(b.start):
        return "the rewritten text has other lines or numbers than the original"
    if a.shapes != b.shapes or (a.shape != b.shape).any():
        row = int(np.flatnonzero(a.shape != b.shape)[:1].sum())
        return f"line {a.line[row]}: the rewritten line has another shape"
    return _part_of_a_number(a, allowed) or _number_elsewhere(a, b, allowed, stamp)


def _part_of_a_number(before: Skeleton, allowed: Replacements) -> str:
    """Say which edit does not replace one whole number."""
    for rows in chunks(len(allowed), AT_ONCE):
        some = allowed[rows]
        at = np.searchsorted(before.start, some.start)
        whole = at < len(before.start)
        at[~whole] = 0
        if len(before.start):
            whole &= before.start[at] == some.start
            whole &= before.end[at] == some.end
        if not whole.all():
            line = before.source.line_of(int(some.start[~whole][0]))
            return f"line {line}: an edit does not replace one whole number"
    return ""


def _number_elsewhere(
    before: Skeleton, after: Skeleton, allowed: Replacements, stamp: int
) -> str:
    """Say which number does not stand where the edits move it to."""
    growth = np.char.str_len(allowed.new) - (allowed.end - allowed.start)
    shift = stamp + np.cumsum(np.append(0, growth))
    for rows in chunks(len(before.start), AT_ONCE):
        start, end = before.start[rows], before.end[rows]
        edits = np.searchsorted(allowed.start, start)  # before the number
        wrong = after.start[rows] != start + shift[edits]
        edits = np.searchsorted(allowed.start, start, side="right")  # and its own
        wrong |= after.end[rows] != end + shift[edits]
        if wrong.any():
            line = before.source.line_of(int(start[wrong][0]))
            return f"line {line}: a number stands elsewhere than it should"
    return ""


def _is_meant(old: bytes, allowed: Replacements, new: bytes, stamp: int) -> bool:
    """Tell whether a text is another one with edits, without making it once more."""
    at = stamp
    for piece in allowed.applied(old):
        if not new.startswith(piece, at):
            return False
        at += len(piece)
    return at == len(new)


def _first_difference(meant: bytes, after: Source, stamp: int) -> str:
    length = min(len(meant), len(after.data) - stamp)
    pairs = zip(meant, after.data[stamp:], strict=False)
    at = next((i for i, (a, b) in enumerate(pairs) if a != b), length)
    line = after.line_of(min(at + stamp, max(len(after.data) - 1, 0)))
    return f"line {line}: the text is not what was meant"


# Numbers as text, a million at a time: fixed-width rows of bytes instead of strings.
#
# Only plain decimal numbers are treated here, and only values that round without doubt;
# the functions tell which. The others are for `mask_line` and Python's own formatting,
# one by one, which define what all of it means.

WIDEST = 24  # bytes of a number that is read here
MOST_DIGITS = 15  # of a number that is written here: exact as a float
TIE = 1e-4  # nearer to halfway than this the last digit is not sure
_TENS = 10.0 ** np.arange(MOST_DIGITS + 1)
_DOT, _MINUS, _ZERO = 46, 45, 48


def cut(data: bytes, start: Ints, end: Ints) -> tuple[Texts, Bools]:
    """Cut numbers out of a text.

    Args:
        data: The text.
        start: Offsets at which numbers begin, (m,).
        end: Offsets at which they end, (m,).

    Returns:
        The texts, (m,), and which of them are plain: digits with or without a dot,
        after a minus or nothing.
    """
    a = np.frombuffer(data, dtype=np.uint8)
    length = end - start
    width = int(min(length.max(initial=1), WIDEST))
    rows = np.zeros((len(start), width), dtype=np.uint8)
    plain, dots = length <= width, np.zeros(len(start), dtype=np.int64)
    for k in range(width):
        inside = k < length
        byte = np.where(inside, a[np.minimum(start + k, len(a) - 1)], 0)
        digit = (byte >= _ZERO) & (byte < _ZERO + 10)
        dot = byte == _DOT
        dots += dot
        plain &= digit | dot | ~inside | ((byte == _MINUS) & (k == 0))
        rows[:, k] = byte
    digits = length - dots - (rows[:, 0] == _MINUS)
    plain &= (dots <= 1) & (digits > 0)
    return _as_texts(rows), plain


def decimals(texts: Texts) -> Ints:
    """Count the decimals of plain numbers, (m,)."""
    dot = np.char.find(texts, b".")
    return np.where(dot < 0, 0, np.char.str_len(texts) - dot - 1)


def fixed(values: Floats, decimals: Ints) -> tuple[Texts, Bools]:
    """Write numbers with so many decimals each; a zero carries no sign.

    Args:
        values: (m,).
        decimals: (m,).

    Returns:
        The texts, (m,), and which of them are sure.

    >>> fixed(np.array([12.34567, -0.00001]), np.array([3, 4]))[0].tolist()
    [b'12.346', b'0.0000']
    """
    scaled = np.abs(values) * _TENS[np.minimum(decimals, MOST_DIGITS)]
    sure = (scaled < _TENS[-1] / 10) & (decimals < MOST_DIGITS)
    scaled[~sure] = 0.0
    whole = np.rint(scaled).astype(np.int64)
    sure &= np.abs(scaled - np.floor(scaled) - 0.5) > TIE
    negative = (values < 0) & (whole > 0)
    count = np.searchsorted(_TENS, whole, side="right")
    before = np.maximum(count - decimals, 1)
    rows = np.zeros((len(values), 2 * MOST_DIGITS), dtype=np.uint8)
    layout = (decimals * 32 + before) * 2 + negative
    for key in np.unique(layout[sure]).tolist():
        mine = np.flatnonzero(sure & (layout == key))
        rest, sign = divmod(key, 2)
        after, ahead = divmod(rest, 32)
        rows[mine] = _written(whole[mine], ahead, after, bool(sign), rows.shape[1])
    return _as_texts(rows), sure


def _written(whole: Ints, ahead: int, after: int, sign: bool, width: int) -> Bytes:
    """Write scaled numbers that have one layout, (g, width)."""
    rows = np.zeros((len(whole), width), dtype=np.uint8)
    at = sign + ahead + after + (after > 0)
    for k in range(ahead + after):
        if k == after and after > 0:
            at -= 1
            rows[:, at] = _DOT
        at -= 1
        whole, digit = np.divmod(whole, 10)
        rows[:, at] = digit + _ZERO
    if sign:
        rows[:, 0] = _MINUS
    return rows


def _as_texts(rows: Bytes) -> Texts:
    """See rows of bytes as texts."""
    texts: Texts = np.ascontiguousarray(rows).view(f"S{rows.shape[1]}")[:, 0]
    return texts


# New numbers into old text: edits of the numbers of targets, and nothing else.

Texts = NDArray[np.bytes_]

MM_DECIMALS, DEGREE_DECIMALS, JOINT_DECIMALS = 3, 4, 5
_PIECE = 100_000  # numbers rewritten at a time
_POSE_DECIMALS = (MM_DECIMALS,) * 3 + (DEGREE_DECIMALS,) * 3
_JOINT_DECIMALS = (JOINT_DECIMALS,) * 6


def decimals_of(text: str) -> int:
    """Return how many decimals a number is written with.

    >>> decimals_of("-12.50"), decimals_of("7"), decimals_of("1.25e1")
    (2, 0, 1)
    """
    if text.replace(".", "", 1).lstrip("-").isdecimal():
        return len(text.partition(".")[2])
    mantissa, _, exponent = text.lower().partition("e")
    if "x" in mantissa:
        return 0
    written = len(mantissa.partition(".")[2])
    return max(written - int(exponent or 0), 0)


def number_text(value: float, decimals: int, least: int) -> str:
    """Write a number with the decimals it had and at least `least`.

    The sign stands directly before the digits; a zero carries none.

    >>> number_text(12.34567, 1, 3), number_text(-0.00001, 4, 3)
    ('12.346', '0.0000')
    """
    text = f"{value:.{max(decimals, least)}f}"
    return text.lstrip("-") if float(text) == 0.0 else text


def edits(
    literals: Literals,
    sources: Sequence[Source],
    rows: Ints | Sequence[int],
    new_values: Floats | Sequence[Floats],
) -> tuple[Replacements, ...]:
    """Return the edits that give literals new values, file by file.

    A number is edited only where it changes by more than half of its last digit as it
    will be written.

    Args:
        literals: Where the numbers stand.
        sources: The files that `literals.file` means.
        rows: Literals to change, (r,).
        new_values: Their new numbers, (r, 6) [mm, deg].

    Raises:
        ValueError: A new value is not finite.
    """
    new_values = np.asarray(new_values, dtype=float).reshape(-1, 6)
    if not np.isfinite(new_values).all():
        raise ValueError("a new value of a target is not finite")
    rows = np.asarray(rows, dtype=np.int64)
    found = []
    for file, source in enumerate(sources):
        mine = np.flatnonzero(literals.file[rows] == file)
        start, end = literals.start[rows[mine]], literals.end[rows[mine]]
        joints = literals.joints[rows[mine], None]
        least = np.where(joints, _JOINT_DECIMALS, _POSE_DECIMALS)
        written = start >= 0
        order = np.argsort(start[written], kind="stable")
        start, end = start[written][order], end[written][order]
        values, least = new_values[mine][written][order], least[written][order]
        parts = [
            _edits_of(source, start[some], end[some], values[some], least[some])
            for some in chunks(len(start), _PIECE)
        ]
        found.append(Replacements.joined(parts))
    return tuple(found)


def _edits_of(
    source: Source, start: Ints, end: Ints, values: Floats, least: Ints
) -> Replacements:
    """Return the edits of one file's numbers, which are in ascending order."""
    old, plain = cut(source.data, start, end)
    had, before = np.zeros(len(old), dtype=np.int64), np.empty(len(old))
    had[plain], before[plain] = decimals(old[plain]), old[plain].astype(float)
    for row in np.flatnonzero(~plain).tolist():
        text = source.text[start[row] : end[row]]
        had[row], before[row] = decimals_of(text), number_value(text)
    moved = ~(np.abs(values - before) <= 0.5 * 10.0 ** -np.maximum(had, least))
    rows = np.flatnonzero(moved)
    new = _texts(values[rows], had[rows], least[rows])
    new = _with_plus(new, old[rows])
    other = new.astype(float) != before[rows]
    return Replacements(start[rows[other]], end[rows[other]], new[other])


def _with_plus(new: Texts, old: Texts) -> Texts:
    """Keep the plus of numbers that had one and are not below zero."""
    rows = np.char.startswith(old, b"+") & ~np.char.startswith(new, b"-")
    if not rows.any():
        return new
    signed: Texts = np.where(rows, np.char.add(b"+", new), new)
    return signed


def _texts(values: Floats, decimals: Ints, least: Ints) -> NDArray[np.bytes_]:
    """Write numbers with the decimals they had and at least `least`, (m,)."""
    new, sure = fixed(values, np.maximum(decimals, least))
    rest = np.flatnonzero(~sure)
    triples = zip(values[rest], decimals[rest], least[rest], strict=True)
    texts = [number_text(v, d, few).encode("ascii") for v, d, few in triples]
    widest = max([_width(new), *map(len, texts)])
    new = new.astype(f"S{widest}")
    new[rest] = texts
    return new


def _width(texts: Texts) -> int:
    """Return the length of the longest text, at least 1."""
    used = np.flatnonzero(as_bytes(texts).any(axis=0))
    return 1 + int(used.max(initial=0))
