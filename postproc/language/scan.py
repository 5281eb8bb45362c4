"""Numbers, strings, comments and numbered names of whole files, found in arrays."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Bools, Bytes, Floats, Ints

# What a number, a string and a comment are, one line at a time.
#
# This is the definition; `mask_lines` computes the same for whole files with arrays. A
# *mask* is the code of a line in which every number is one NUL (no program holds any),
# the comment is gone and idle blanks are dropped: lines that differ in their numbers
# only have the same mask, their *shape*.

NUMBER_MARK = "\0"

NUMBER = (
    r"0[xX][0-9A-Fa-f]+|0[oO][0-7]+|0[bB][01]+"
    r"|(?:[0-9]+(?:\.(?!\.)[0-9]*)?|(?<![A-Za-z0-9_$.\])])\.[0-9]+)(?:[eE][-+]?[0-9]+)?"
)
UNARY_CONTEXT = "(,{[=<>*/:@#&+"
"""A sign that follows one of these, or starts a line, is that of its number."""
SIGNS = "-+"

_STRINGS = (r"'(?:\\.|[^'\\])*'", r"'[^']*'")
_UNICODE = r'"(?:\\.|[^"\\])*"'
BLANKS = "".join(chr(c) for c in (*range(1, 33), 127) if chr(c) not in "\r\n")
_BLANK = f"[{re.escape(BLANKS)}]"


def _tokens(string: str) -> re.Pattern[str]:
    return re.compile(
        rf"(?P<string>{string}|{_UNICODE})|(?P<comment>--.*)|(?P<open>['\"])"
        rf"|(?P<number>{NUMBER})"
        rf"|(?P<word>[A-Za-z0-9_$]+)|(?P<blank>{_BLANK}+)|(?P<other>.)",
        re.DOTALL,
    )


_ESCAPED, _PLAIN = map(_tokens, _STRINGS)


@dataclass(frozen=True)
class MaskedLine:
    """One physical line with its numbers masked.

    Attributes:
        mask: The shape of the line.
        start, end: Offsets of the numbers in the line, their sign included.
        comment: Offset at which the comment starts, -1 where there is none.
        unterminated: A string does not end on this line.
    """

    mask: str
    start: tuple[int, ...]
    end: tuple[int, ...]
    comment: int
    unterminated: bool


def mask_line(line: str) -> MaskedLine:
    r"""Mask the numbers of one physical line (without its line ending).

    A backslash escapes the character after it, unless the string would not end then.

    >>> mask_line("MOVE TO  {-1.5, 0x3F}  -- 'x").mask
    'MOVE TO {\x00,\x00} '
    """
    masked = _mask(line, _ESCAPED)
    if masked.unterminated and "\\" in line:
        plain = _mask(line, _PLAIN)
        masked = masked if plain.unterminated else plain
    return masked


def _mask(line: str, tokens: re.Pattern[str]) -> MaskedLine:
    out: list[str] = []
    starts: list[int] = []
    ends: list[int] = []
    comment = -1
    before, sign = "", -1  # last character of code; place of a sign that awaits it
    idle = True  # a blank here says nothing
    for found in tokens.finditer(line):
        kind, text = found.lastgroup, found.group()
        if kind == "comment":
            comment = found.start()
            break
        if kind == "open":
            return MaskedLine("", (), (), -1, True)
        if kind == "blank":
            if not idle:
                out.append(" ")
            idle = True
            continue
        if kind == "number":
            starts.append(found.start() if sign < 0 else sign)
            if sign >= 0:
                del out[_last_sign(out) :]
            ends.append(found.end())
            text = NUMBER_MARK
        out.append(text)
        sign = -1
        if text in SIGNS and (not before or before in UNARY_CONTEXT):
            sign = found.start()
        before = text[-1]
        idle = text[-1] in ",({" and kind == "other"
    return MaskedLine("".join(out), tuple(starts), tuple(ends), comment, False)


def _last_sign(out: list[str]) -> int:
    return max(k for k, text in enumerate(out) if text in SIGNS)


def number_value(text: str) -> float:
    """Return the value of a number as it is written, NaN where it is none.

    >>> number_value("- 0x1F"), number_value("+1.5e3")
    (-31.0, 1500.0)
    """
    digits = text.lstrip(SIGNS + BLANKS)
    try:
        if digits[0] != "0":
            return -float(digits) if text[0] == "-" else float(digits)
        base = {"x": 16, "o": 8, "b": 2}.get(digits[1:2].lower())
        value = float(int(digits, base)) if base else float(digits)
    except (ValueError, IndexError):
        return float("nan")
    return -value if text.startswith("-") else value


def decimals_of(text: str) -> int:
    """Return how many decimals a number is written with.

    >>> decimals_of("-12.50"), decimals_of("7"), decimals_of("1.25e1")
    (2, 0, 1)
    """
    mantissa, _, exponent = text.lower().partition("e")
    if "x" in mantissa:
        return 0
    written = len(mantissa.partition(".")[2])
    return max(written - int(exponent or 0), 0)


# Plain decimal numbers in a text: where they stand, what they are worth, in arrays.
#
# A pass over all bytes costs far more than one over the numbers, so that only digits
# and dots are looked for byte by byte; what is before and after is asked of each
# number.

Words = NDArray[np.uint64]

EXACT = 15  # digits of a number that is read here: exact as a float
_TENS = 10 ** np.arange(EXACT + 1, dtype=np.int64)
_SCALES = _TENS.astype(float)
_MAX_BLANKS = 60  # blanks between a sign and what is before it; more: line by line
DOT, _MINUS, _PLUS = 46, 45, 43
_PAIRED = tuple(
    (np.uint64(ten), np.uint64(shift), np.uint64(mask))
    for ten, shift, mask in (
        (10, 8, 0x00FF00FF00FF00FF),
        (100, 16, 0x0000FFFF0000FFFF),
        (10_000, 32, 0x00000000FFFFFFFF),
    )
)


def byte_table(characters: str) -> Bools:
    """Return which bytes are one of some characters, (256,)."""
    table = np.zeros(256, dtype=bool)
    table[[ord(c) for c in characters]] = True
    return table


_LETTERS = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ_$"
_IS_LETTER, _IS_WORD = byte_table(_LETTERS), byte_table(_LETTERS + "0123456789")
_IS_BLANK, _IS_UNARY = byte_table(BLANKS), byte_table(UNARY_CONTEXT + "\n\r")


@dataclass(frozen=True)
class PlainNumbers:
    """Runs of digits and dots, most of which are plain numbers.

    Attributes:
        first: Where they begin, (m,).
        point: Where the dot stands, or the end where there is none, (m,).
        end: Where they end, (m,).
        number: Which are digits with at most one dot, and no part of a word, (m,).
        odd: Which may be something else and need a closer look, (m,).
    """

    first: Ints
    point: Ints
    end: Ints
    number: Bools
    odd: Bools

    def take(self, some: Bools | Ints) -> PlainNumbers:
        """Return some of them."""
        return PlainNumbers(*(column[some] for column in vars(self).values()))


def numeric_bytes(a: Bytes) -> Bools:
    """Tell which bytes are digits or dots."""
    numeric: Bools = (a - np.uint8(DOT)) < 12  # from the dot to 9, the slash too
    numeric &= a != 47
    return numeric


def runs_of(numeric: Bools) -> tuple[Ints, Ints]:
    """Find where runs of bytes begin and end."""
    edge = np.zeros(len(numeric) + 1, dtype=bool)
    edge[:-1] = numeric
    edge[1:] ^= numeric
    at = np.flatnonzero(edge)
    return at[0::2], at[1::2]


def plain_numbers(a: Bytes, start: Ints, end: Ints) -> PlainNumbers:
    """Tell which runs of digits and dots are plain numbers.

    Args:
        a: The text.
        start: Where the runs outside of strings and comments begin, (m,).
        end: Where they end, (m,).
    """
    before = np.where(start > 0, a[start - 1], 10)
    after = np.where(end < len(a), a[np.minimum(end, len(a) - 1)], 10)
    dot = np.append(np.flatnonzero(a == DOT), [len(a)] * 2)
    at = np.searchsorted(dot, start)
    dotted, more = dot[at] < end, np.flatnonzero(dot[at + 1] < end)
    dots = dotted.astype(np.int64)
    dots[more] = np.searchsorted(dot, end[more]) - at[more]
    digits = dots < end - start
    in_word = _IS_WORD[before]
    # `1..n`, `1e5`, `0x3F`, `].5`, `x1.5`: rare, and not worth an array pass
    odd = digits & ((dots > 1) | ~in_word & _IS_LETTER[after])
    leading = np.flatnonzero(digits & (a[start] == DOT))
    odd[leading] |= in_word[leading] | np.isin(before[leading], (41, 93))
    odd |= digits & in_word & dotted & (a[end - 1] != DOT)
    point = np.where(dotted, dot[at], end)
    return PlainNumbers(start, point, end, digits & ~odd & ~in_word, odd)


def with_signs(a: Bytes, first: Ints) -> tuple[Ints, Ints]:
    """Move the starts of numbers to their signs.

    Returns:
        The starts, and places too far from what is before them to tell.
    """
    sign, lost = _previous(a, first)
    signed = (sign >= 0) & ((a[sign] == _MINUS) | (a[sign] == _PLUS))
    start, tied = first.copy(), np.flatnonzero(signed)
    context, far = _previous(a, sign[tied])
    unary = (context < 0) | _IS_UNARY[a[context]]
    lost[tied] |= far
    start[tied[unary]] = sign[tied[unary]]
    return start, first[lost]


def _previous(a: Bytes, at: Ints) -> tuple[Ints, Bools]:
    """Return where the last byte before `at` stands that is no blank, -1 if none."""
    at = at - 1
    for _ in range(_MAX_BLANKS):
        blank = np.flatnonzero(_IS_BLANK[a[at]] & (at >= 0))
        if not len(blank):
            break
        at[blank] -= 1
    return at, _IS_BLANK[a[at]] & (at >= 0)


def values(a: Bytes, numbers: PlainNumbers, start: Ints) -> Floats:
    """Return what numbers are worth, (m,).

    Up to 15 digits the digits are an exact integer and the power of ten an exact float,
    so that one rounded division gives what reading the text would.

    Args:
        a: The text.
        numbers: The numbers.
        start: Where they start, the sign included, (m,).
    """
    if not len(start):
        return np.zeros(0)
    before = numbers.point - numbers.first
    after = np.maximum(numbers.end - numbers.point - 1, 0)
    whole = _short(a, numbers.end, before, after, numbers.point < numbers.end)
    long = np.flatnonzero(numbers.end - numbers.first > 8)
    if len(long):
        whole[long] = _digits(a, numbers.point[long], before[long])
        whole[long] *= _TENS[np.minimum(after[long], EXACT)]
        whole[long] += _digits(a, numbers.end[long], after[long])
    value: Floats = whole / _SCALES[np.minimum(after, EXACT)]
    value[a[start] == _MINUS] *= -1.0
    for i in np.flatnonzero(before + after > EXACT).tolist():
        text = a[start[i] : numbers.end[i]].tobytes()
        value[i] = number_value(text.decode("latin-1"))
    return value


def read_numbers(data: bytes, start: Ints, end: Ints) -> tuple[Floats, Ints]:
    """Read numbers that stand at known places of a text.

    Args:
        data: The text.
        start: Where they start, the sign included, ascending, (m,).
        end: Where they end, (m,).

    Returns:
        What they are worth, and how many decimals they are written with, (m,).
    """
    value, decimals = np.zeros(len(start)), np.zeros(len(start), dtype=np.int64)
    if not len(start):
        return value, decimals
    a = np.frombuffer(data, dtype=np.uint8)[start[0] : end[-1]]
    begin, stop = start - start[0], end - start[0]
    first = begin + ((a[begin] == _MINUS) | (a[begin] == _PLUS))
    runs = runs_of(numeric_bytes(a))
    at = np.minimum(np.searchsorted(runs[0], first), len(runs[0]) - 1)
    plain = np.flatnonzero((runs[0][at] == first) & (runs[1][at] == stop))
    numbers = plain_numbers(a, first[plain], stop[plain])
    plain, numbers = plain[numbers.number], numbers.take(numbers.number)
    value[plain] = values(a, numbers, begin[plain])
    decimals[plain] = np.maximum(numbers.end - numbers.point - 1, 0)
    for k in np.setdiff1d(np.arange(len(start)), plain, assume_unique=True).tolist():
        text = data[start[k] : end[k]].decode("latin-1")
        value[k], decimals[k] = number_value(text), decimals_of(text)
    return value, decimals


def _short(a: Bytes, end: Ints, before: Ints, after: Ints, dotted: Bools) -> Ints:
    """Read numbers of at most 8 bytes: what is before the dot moves over it."""
    word = _words(a, end)
    cut = _shift(8 - after)
    decimals = (word >> cut) << cut
    front = (word << _shift(after + 1)) >> _shift(after)
    return _read(np.where(dotted, decimals | front, word), before + after)


def _digits(a: Bytes, end: Ints, count: Ints) -> Ints:
    """Read up to 15 digits that end at places of a text."""
    value = _read(_words(a, end), np.minimum(count, 8))
    long = np.flatnonzero(count > 8)
    if len(long):
        more = np.minimum(count[long] - 8, 8)
        value[long] += 10**8 * _read(_words(a, end[long] - 8), more)
    return value


def _words(a: Bytes, end: Ints) -> Words:
    """Return the eight bytes before places of a text as words, the last one on top."""
    padded = np.concatenate([np.zeros(8, dtype=np.uint8), a])
    words: Words = np.ndarray(len(a) + 1, "<u8", padded, strides=(1,))
    return words[end]


def _shift(count: Ints) -> Words:
    """Return the bits of some bytes; eight bytes and more shift everything out."""
    return (8 * np.maximum(count, 0)).astype(np.uint64)


def _read(word: Words, count: Ints) -> Ints:
    """Read words of up to 8 digits: pairs, fours, then all of them."""
    drop = _shift(8 - count)
    word = (word >> drop) << drop & np.uint64(0x0F0F0F0F0F0F0F0F)
    for ten, shift, mask in _PAIRED:
        word = (word * ten + (word >> shift)) & mask
    return word.astype(np.int64)


# Numbered names: ``WP_12``, ``p1``. Lines that differ in them only have one form.
#
# `form_of` is the definition, one line at a time; `find_names` computes the same for
# whole files with arrays, where lines hold nothing out of the ordinary.

NAME_MARK = "\x01"  # a numbered name, in a form
UNREADABLE = NAME_MARK * 2  # begins the form of a line that holds such a mark itself
WHOLE = b"\n"  # begins a mask with its names still in it: no other mask holds it

# A name up to its first digit, and the rest: what cannot begin one is passed over, and
# nothing is tried twice.
_NUMBERED = r"[A-Za-z_](?<![\w$].)[A-Za-z_]*+[^\W\d]*+\d\w*+(?! *::)"
_STRING_OR_NAME = re.compile(
    rf"(?P<string>'(?:\\.|[^'\\])*'|'[^']*'|\"[^\"]*\")|{_NUMBERED}"
)
_DOLLAR, _COLON = 36, 58
_NAME_LETTERS = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ_"
_IS_FIRST, _IS_NAME = (
    byte_table(_NAME_LETTERS),
    byte_table(_NAME_LETTERS + "0123456789"),
)


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


# Mask the numbers of whole files with array passes; `mask_line` is the definition.
#
# CAM programs hold a million lines of a handful of shapes. A few passes over the bytes
# find strings, comments and plain decimal numbers; the lines in which anything is out
# of the ordinary (escapes, exponents, hexadecimal, ranges, open strings) are left to
# `mask_line`, one by one.

_IS_IDLE = byte_table(BLANKS + ",({\n\r")


@dataclass(frozen=True)
class MaskedLines:
    """The physical lines of a piece of a file.

    Attributes:
        masks: The mask of every line, n strings of bytes.
        comment: Offset of each line's comment, (n,), -1 where there is none.
        first: CSR offsets into the numbers, (n + 1,).
        start, end: Offsets of each number, its sign included, (m,).
        value: Its value, (m,).
        unterminated: Lines (from 0) with a string that does not end.
    """

    masks: list[bytes]
    comment: Ints
    first: Ints
    start: Ints
    end: Ints
    value: Floats
    unterminated: tuple[int, ...]


@dataclass(frozen=True)
class MarkedLines:
    """The physical lines of a piece of a file, their numbered names marked too.

    Attributes:
        masked: The lines; in the mask of one whose names are taken out each is one
            `NAME_MARK`, the mask of any other begins with `WHOLE`.
        name: The names, in order.
        name_first: CSR offsets into them, (n + 1,).
    """

    masked: MaskedLines
    name: list[str]
    name_first: Ints


@dataclass(frozen=True)
class _Code:
    """What array passes find in a text: `runs` of digits and dots are in code."""

    a: Bytes
    line_starts: Ints
    quotes: Ints
    comment: Ints
    odd: Bools
    runs: PlainNumbers
    numbers: PlainNumbers
    start: Ints


def mask_lines(data: bytes, line_starts: Ints) -> MaskedLines:
    """Mask every physical line of a text that starts at a line start.

    Args:
        data: The text; no NUL.
        line_starts: Offset of every line in `data`, ascending from 0.
    """
    code = _code(data, line_starts)
    none = np.zeros(0, dtype=np.int64)
    return _with_odd_lines(data, line_starts, code.odd, _masked(code, none, none))


def mark_lines(data: bytes, line_starts: Ints) -> MarkedLines:
    """Mask every line, and mark its numbered names where that is not out of the way.

    Args:
        data: The text; no NUL.
        line_starts: Offset of every line in `data`, ascending from 0.
    """
    code = _code(data, line_starts)
    a, runs = code.a, code.runs
    in_word = ~runs.number & ~runs.odd & (a[runs.first] != DOT)
    start, end, far = find_names(a, runs.first[in_word])
    whole = code.odd.copy()
    unusual = np.flatnonzero((a >= 128) | (a == ord(NAME_MARK)))
    for place in (np.sort(far), unusual):
        line = line_of(line_starts, place)
        behind = code.comment[line]
        whole[line[(behind < 0) | (place < behind)]] = True
    if whole.any():
        named = ~whole[line_of(line_starts, start)]
        start, end = start[named], end[named]
    masked = _with_odd_lines(data, line_starts, code.odd, _masked(code, start, end))
    for k in np.flatnonzero(whole).tolist():
        masked.masks[k] = WHOLE + masked.masks[k]
    first = np.append(np.searchsorted(start, line_starts), len(start))
    return MarkedLines(masked, texts_of(a, start, end), first)


def _code(data: bytes, line_starts: Ints) -> _Code:
    """Find numbers, strings and comments."""
    a = np.frombuffer(data, dtype=np.uint8)
    quotes, comment, odd_line = quotes_and_comments(a, line_starts)
    start, end = runs_of(numeric_bytes(a))
    code = in_code(start, quotes, comment, line_starts)
    runs = plain_numbers(a, start[code], end[code])
    numbers = runs.take(runs.number)
    start, far = with_signs(a, numbers.first)
    odd_line[line_of(line_starts, runs.first[runs.odd])] = True
    odd_line[line_of(line_starts, far)] = True
    if odd_line.any():
        plain = ~odd_line[line_of(line_starts, start)]
        numbers, start = numbers.take(plain), start[plain]
    return _Code(a, line_starts, quotes, comment, odd_line, runs, numbers, start)


def _masked(code: _Code, names: Ints, name_ends: Ints) -> MaskedLines:
    """Mask the lines that are not odd, with the names from some places to others."""
    a, start, line_starts = code.a, code.start, code.line_starts
    dropped = _cover(len(a), start, code.numbers.end)
    if len(names):
        dropped |= _cover(len(a), names, name_ends)
    if (code.comment >= 0).any():
        dropped |= _in_comments(a, code.comment, line_starts)
    masks = _squeeze(a, dropped, code.quotes, start, names)
    first = np.append(np.searchsorted(start, line_starts), len(start))
    value = values(a, code.numbers, start)
    return MaskedLines(masks, code.comment, first, start, code.numbers.end, value, ())


def line_of(line_starts: Ints, place: Ints) -> Ints:
    """Return the line of every place, ascending."""
    first = np.append(np.searchsorted(place, line_starts), len(place))
    line: Ints = np.repeat(np.arange(len(line_starts)), np.diff(first))
    return line


def _inside(quotes: Ints, place: Ints) -> Bools:
    """Tell which places, ascending, are in a string."""
    count = np.diff(np.searchsorted(place, quotes), prepend=0, append=len(place))
    inside: Bools = np.repeat(np.arange(len(count)) % 2 == 1, count)
    return inside


def _cover(n: int, start: Ints, end: Ints) -> Bools:
    """Return what n bytes lie in the (disjoint) spans."""
    change = np.zeros(n + 1, dtype=bool)
    change[start] = True
    change[end] ^= True
    covered: Bools = np.logical_xor.accumulate(change[:-1])
    return covered


def quotes_and_comments(a: Bytes, line_starts: Ints) -> tuple[Ints, Ints, Bools]:
    """Find the quotes of plain strings, the comments, and the lines that are odd.

    The first ``--`` with an even number of quotes before it on its line starts the
    comment, for all quotes before it are code.
    """
    quotes = np.flatnonzero(a == 39)
    comment = np.full(len(line_starts), -1, dtype=np.int64)
    dashes = np.flatnonzero((a[:-1] == 45) & (a[1:] == 45))
    if len(dashes):
        before_line = np.searchsorted(quotes, line_starts)
        line = line_of(line_starts, dashes)
        even = (np.searchsorted(quotes, dashes) - before_line[line]) % 2 == 0
        first_line, first = np.unique(line[even], return_index=True)
        comment[first_line] = dashes[even][first]

    line = line_of(line_starts, quotes)
    real = (comment[line] < 0) | (quotes < comment[line])
    quotes, line = quotes[real], line[real]
    odd = np.bincount(line, minlength=len(line_starts)) % 2 == 1
    odd[line_of(line_starts, np.flatnonzero((a == 34) | (a == 92)))] = True
    return quotes[~odd[line]], comment, odd


def in_code(place: Ints, quotes: Ints, comment: Ints, line_starts: Ints) -> Bools:
    """Tell which places, ascending, are in no string and no comment."""
    code = ~_inside(quotes, place)
    if (comment >= 0).any():
        own = comment[line_of(line_starts, place)]
        code &= (own < 0) | (place < own)
    return code


def _in_comments(a: Bytes, comment: Ints, line_starts: Ints) -> Bools:
    """Return what bytes are in a comment; the end of its line is not."""
    line_ends = np.append(line_starts[1:], len(a))
    has = comment >= 0
    covered = _cover(len(a), comment[has], line_ends[has])
    covered &= (a != 10) & (a != 13)
    return covered


def _squeeze(
    a: Bytes, dropped: Bools, quotes: Ints, start: Ints, names: Ints
) -> list[bytes]:
    """Return the masks: numbers to NUL, comments and idle blanks dropped."""
    out, keep = a.copy(), ~dropped
    blank = np.flatnonzero((a <= 32) & (a != 10) & (a != 13) & (a > 0) | (a == 127))
    blank = blank[~_inside(quotes, blank)]
    idle = blank[(blank == 0) | _IS_IDLE[a[blank - 1]]]
    out[blank] = 32
    keep[idle] = False
    keep[start] = True
    out[start] = 0
    keep[names] = True
    out[names] = ord(NAME_MARK)
    returns = np.flatnonzero(a == 13)
    alone = a[np.minimum(returns + 1, len(a) - 1)] != 10
    alone |= returns == len(a) - 1
    keep[returns] = alone
    out[returns] = 10
    masks = out[keep].tobytes().split(b"\n")
    if len(a) and out[-1] == 10:
        masks.pop()
    return masks


def _with_odd_lines(
    data: bytes, line_starts: Ints, odd: Bools, plain: MaskedLines
) -> MaskedLines:
    """Mask the odd lines one by one and merge them with the plain ones."""
    if not odd.any():
        return plain
    starts, ends, numbers = [plain.start], [plain.end], [plain.value]
    unterminated: list[int] = []
    line_ends = np.append(line_starts[1:], len(data))
    for line in np.flatnonzero(odd).tolist():
        at = int(line_starts[line])
        text = data[at : int(line_ends[line])].rstrip(b"\r\n").decode("latin-1")
        masked = mask_line(text)
        plain.masks[line] = masked.mask.encode("latin-1")
        plain.comment[line] = masked.comment + at if masked.comment >= 0 else -1
        starts.append(np.array(masked.start, dtype=np.int64) + at)
        ends.append(np.array(masked.end, dtype=np.int64) + at)
        spans = zip(masked.start, masked.end, strict=True)
        numbers.append(np.array([number_value(text[s:e]) for s, e in spans], float))
        if masked.unterminated:
            unterminated.append(line)
    start = np.concatenate(starts)
    order = np.argsort(start, kind="stable")
    start = start[order]
    return MaskedLines(
        plain.masks,
        plain.comment,
        np.append(np.searchsorted(start, line_starts), len(start)).astype(np.int64),
        start,
        np.concatenate(ends)[order],
        np.concatenate(numbers)[order],
        tuple(unterminated),
    )
