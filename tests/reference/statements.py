"""Where a statement of RAPID ends, what its form, its numbers and its names are."""

from __future__ import annotations

import re
from dataclasses import dataclass

from tests.reference.text import HIDDEN, NUMBER, UNARY_CONTEXT

BEGINNING = frozenset(
    "MODULE ENDMODULE PROC ENDPROC FUNC ENDFUNC TRAP ENDTRAP RECORD ENDRECORD ALIAS "
    "CONST LOCAL TASK ELSEIF ELSE ENDIF ENDFOR ENDWHILE TEST CASE DEFAULT ENDTEST "
    "ERROR UNDO BACKWARD".split()
)
ALONE = frozenset(
    "ENDMODULE ENDPROC ENDFUNC ENDTRAP ENDRECORD ELSE ENDIF ENDFOR ENDWHILE ENDTEST "
    "UNDO BACKWARD".split()
)
HEADS = {"MODULE": 2, "PROC": 2, "FUNC": 3, "TRAP": 2, "RECORD": 2, "ERROR": 1}
_IDLE = re.compile(r"(?:[\x01-\x20\x7f]|![^\r\n]*)*")
_TOKEN = re.compile(
    rf'(?P<string>"(?:""|[^"\r\n])*"(?!"))|(?P<open>"(?:""|[^"\r\n])*)'
    rf"|(?P<number>{NUMBER})|(?P<word>\w+)|(?P<other>:=|.)",
    re.DOTALL,
)


@dataclass(frozen=True)
class StatementText:
    """One statement of a text in Latin-1.

    Attributes:
        form: Its form, without the marks of unreadable ones.
        begin, end: Its place.
        numbers: Places of its numbers, their signs included.
        names: Its names with digits.
        open: Place of a string or a header that does not end, -1: none.
    """

    form: str
    begin: int
    end: int
    numbers: tuple[tuple[int, int], ...]
    names: tuple[str, ...]
    open: int


def statements(text: str) -> list[StatementText]:
    """Read the statements of a text."""
    found = []
    at = _IDLE.match(text, 3 if text.startswith("\xef\xbb\xbf") else 0).end()
    while at < len(text):
        one = _header(text, at) if text.startswith("%%%", at) else _statement(text, at)
        found.append(one)
        at = _IDLE.match(text, one.end).end()
    return found


def _header(text, at):
    closed = text.find("%%%", at + 3)
    end = closed + 3 if closed >= 0 else len(text)
    return StatementText("%%%", at, end, (), (), -1 if closed >= 0 else at)


def _statement(text, begin):
    tokens, opened, at = [], -1, begin
    while at < len(text):
        found = _TOKEN.match(text, at)
        if tokens and _begins(text, found, tokens):
            break
        tokens.append(found)
        if found.lastgroup == "open" and opened < 0:
            opened = found.start()
        at = _IDLE.match(text, found.end()).end()
        if _complete(tokens, text[at : at + 1]):
            break
    return _written(tokens, opened)


def _words(tokens):
    """Return the words that count for a head: LOCAL and TASK before it do not."""
    words = [t.group().upper() for t in tokens if t.lastgroup == "word"]
    firsts = [t.group().upper() for t in tokens]
    while words and firsts[:1] == words[:1] and words[0] in ("LOCAL", "TASK"):
        words, firsts = words[1:], firsts[1:]
    return words, firsts


def _last_sign(token):
    """Return what a token ends with; the dot of a number is its own."""
    return "" if token.lastgroup == "number" else token.group()[-1]


def _begins(text, found, tokens):
    word = found.group().upper()
    if found.lastgroup != "word" or _last_sign(tokens[-1]) in ("\\", "."):
        return False
    if not _words(tokens)[1]:
        return False
    between = text[tokens[-1].end() : found.start()]
    new_line = re.search(r"[\r\n]", between)
    return word in BEGINNING or (new_line and word in ("IF", "FOR", "WHILE"))


def _complete(tokens, following):
    last, before = tokens[-1], _last_sign(tokens[-2]) if len(tokens) > 1 else ""
    words, firsts = _words(tokens)
    head = words[0] if words and firsts[0] == words[0] else ""
    text = last.group().upper()
    if last.lastgroup == "word":
        if before in ("\\", ".") or not firsts:
            return False
        if (len(firsts) == 1 and text in ALONE) or text in ("THEN", "DO"):
            return True
        return len(words) == HEADS.get(head, -1) and following != "("
    if last.lastgroup != "other":
        return False
    depth = sum({"(": 1, ")": -1}.get(t.group(), 0) for t in tokens)
    if text == ":":
        label = len(words) == 1 and len(tokens) == 2
        return label or head in ("CASE", "DEFAULT")
    return text == ";" or (text == ")" and depth <= 0 and head in HEADS)


def _written(tokens, opened):
    form, numbers, names, sign, before = [], [], [], None, ""
    for token in tokens:
        kind, text = token.lastgroup, token.group()
        if kind in ("string", "open"):
            text = text.replace("\x01", HIDDEN)
        if kind == "number":
            numbers.append((sign if sign is not None else token.start(), token.end()))
            if sign is not None:
                form.pop()
            text = "\x00"
        elif kind == "word" and re.match(r"[A-Za-z_]\w*[0-9]", text):
            names.append(text)
            text = "\x01"
        unary = text in ("-", "+") and before != "" and before in UNARY_CONTEXT
        sign = token.start() if unary else None
        wordy = r'[\w\x00\x01"]'
        if form and re.match(wordy, form[-1][-1]) and re.match(wordy, text[0]):
            form.append(" ")
        form.append(text)
        before = text[-1]
    end = tokens[-1].end()
    begin = tokens[0].start()
    return StatementText(
        "".join(form), begin, end, tuple(numbers), tuple(names), opened
    )
