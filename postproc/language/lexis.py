"""What a number, a string and a comment are, one line at a time.

This is the definition; `masking` computes the same for whole files with arrays. A
*mask* is the code of a line in which every number is one NUL (no program holds any),
the comment is gone and idle blanks are dropped: lines that differ in their numbers
only have the same mask, their *shape*.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

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
