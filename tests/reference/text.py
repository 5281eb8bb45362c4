"""What a number, a string, a comment and a numbered name are, one line at a time."""

from __future__ import annotations

import re
from dataclasses import dataclass

from postproc.language.text.lexer import mask_of
from postproc.language.text.templates import Shapes

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
        if kind == "string":
            text = text.replace(NAME_MARK, HIDDEN)
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


NAME_MARK = "\x01"
HIDDEN = "\r"  # stands for that character in a string

# A name up to its first digit, and the rest: what cannot begin one is passed over, and
# nothing is tried twice.
_NUMBERED = r"[A-Za-z_](?<![\w$].)[A-Za-z_]*+[^\W\d]*+\d\w*+(?! *::)"
_STRING_OR_NAME = re.compile(
    rf"(?P<string>'(?:\\.|[^'\\])*'|'[^']*'|\"[^\"]*\")|{_NUMBERED}"
)


def masks_of(shapes: Shapes) -> list[str]:
    """Return the masks of some shapes, with their names."""
    forms = [shapes.texts[k] for k in shapes.form.tolist()]
    return [mask_of(form, shapes.names_of(k)) for k, form in enumerate(forms)]


def form_of(mask: str) -> tuple[str, tuple[str, ...]]:
    r"""Take the numbered names out of the mask of a line.

    Returns:
        Its form and the names.

    >>> form_of("MOVE TO WP_1 WITH CONDITION[spot('g2', x3)]")
    ("MOVE TO \x01 WITH CONDITION[spot('g2', \x01)]", ('WP_1', 'x3'))
    """
    names: list[str] = []

    def mark(found: re.Match[str]) -> str:
        if found["string"] is not None:
            return found.group()
        names.append(found.group())
        return NAME_MARK

    return _STRING_OR_NAME.sub(mark, mask), tuple(names)
