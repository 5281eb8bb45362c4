"""Which lines a statement of PDL2 stands on, and which blocks open behind another."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

_OPENS = re.compile(r"(?:\w+ *:: *)?(?:MOVE|MOVEFLY|OPEN)\b.*,\Z", re.I | re.A | re.S)
_CLAUSE = re.compile(r"(?:WITH|ADVANCE|TIL|VIA|SYNCMOVE|CONDITION|\$)", re.I)
_WITH = re.compile(r"(?:WITH|SYNCMOVE|SYNCMOVEFLY)\b", re.I | re.A)
_CLOSES = re.compile(r"(?:ENDMOVE|ENDOPEN)\b", re.I | re.A)
_IN_PARENTHESES = r"\((?:'[^']*'|[^'()]|\([^()]*\))*\)"
_DIVIDED = re.compile(
    rf"(CASE *{_IN_PARENTHESES} *:|ELSE *:) *"
    r"((?:IF|SELECT|FOR|WHILE|CONDITION)\b.*|REPEAT *;?)",
    re.I | re.A | re.S,
)
_CLOSED = re.compile(r"\bEND(?:IF|SELECT|FOR|WHILE|CONDITION)\b", re.I | re.A)


class LogicalLine(NamedTuple):
    """A row: its form, and the line on which its statement begins, from 1 on."""

    form: str
    line: int


def logical_lines(forms: Sequence[str]) -> list[LogicalLine]:
    """Join the forms of the physical lines of a text, and divide them."""
    code = [(form.rstrip(" "), k) for k, form in enumerate(forms, start=1)]
    code = [(form, k) for form, k in code if form]
    found: list[LogicalLine] = []
    while code:
        form, line = code.pop(0)
        last, more = form, bool(_OPENS.match(form))
        while more and code:
            following = code[0][0]
            closes = bool(_CLOSES.match(following))
            goes_on = (_CLAUSE if last.endswith(",") else _WITH).match(following)
            more = bool(goes_on) and not closes
            if closes or more:
                last = code.pop(0)[0]
                form += f" {last}"
        parts = _DIVIDED.fullmatch(form)
        if parts and not _CLOSED.search(parts[2]):
            found += [LogicalLine(parts[1], line), LogicalLine(parts[2], line)]
        else:
            found.append(LogicalLine(form, line))
    return found
