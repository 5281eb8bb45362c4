"""Where a statement of KRL ends, what its form, its numbers and its names are."""

from __future__ import annotations

import re

from tests.reference.statements import StatementText
from tests.reference.text import HIDDEN, NUMBER, UNARY_CONTEXT

WORDS = frozenset("E6POS E6AXIS A1 A2 A3 A4 A5 A6 E1 E2 E3 E4 E5 E6 STOOL2".split())
_BLANK = r"[\x01-\x09\x0b\x0c\x0e-\x20\x7f]"
_IDLE = re.compile(rf"(?:{_BLANK}|;[^\r\n]*)*")
_BETWEEN = re.compile(r"(?:[\x01-\x20\x7f]|;[^\r\n]*)*")
_TOKEN = re.compile(
    rf"(?P<string>\"[^\"\r\n]*\")|(?P<open>\"[^\"\r\n]*)"
    rf"|(?P<number>{NUMBER}|'[hH][0-9a-fA-F]+'|'[bB][01]+')|(?P<word>\w+)|(?P<other>.)",
    re.DOTALL,
)


def krl_lines(text: str) -> list[StatementText]:
    """Read the statements of a text."""
    found = []
    at = _BETWEEN.match(text, 3 if text.startswith("\xef\xbb\xbf") else 0).end()
    while at < len(text):
        one = _header(text, at) if text[at] == "&" else _statement(text, at)
        found.append(one)
        at = _BETWEEN.match(text, one.end).end()
    return found


def _header(text, at):
    end = re.compile(r"[^\r\n]*").match(text, at).end()
    return StatementText("&", at, end, (), (), -1)


def _statement(text, begin):
    tokens, at = [], begin
    while at < len(text) and text[at] not in "\r\n":
        tokens.append(_TOKEN.match(text, at))
        at = _IDLE.match(text, tokens[-1].end()).end()
    return _written(tokens)


def _written(tokens):
    form, numbers, names, brackets = [], [], [], []
    sign, before, component, opened = None, "", False, -1
    for token in tokens:
        kind, text = token.lastgroup, token.group()
        if kind == "open" and opened < 0:
            opened = token.start()
        named = before in ("{", ",", ":") and brackets[-1:] == ["{"]
        if kind in ("string", "open"):
            text = text.replace("\x01", HIDDEN)
        if kind == "number":
            numbers.append((sign if sign is not None else token.start(), token.end()))
            if sign is not None:
                form.pop()
            text = "\x00"
        elif kind == "word" and re.match(r"[A-Za-z_]\w*[0-9]", text):
            if text.upper() not in WORDS:
                names.append(text)
                text = "\x01"
        unary = component or (before != "" and before in UNARY_CONTEXT)
        sign = token.start() if text in ("-", "+") and unary else None
        component = kind == "word" and named
        if text in ("{", "[", "("):
            brackets.append(text)
        elif text in ("}", "]", ")") and brackets:
            brackets.pop()
        wordy = r'[\w\x00\x01"]'
        if form and re.match(wordy, form[-1][-1]) and re.match(wordy, text[0]):
            form.append(" ")
        form.append(text)
        before = text[-1]
    begin, end = tokens[0].start(), tokens[-1].end()
    return StatementText(
        "".join(form), begin, end, tuple(numbers), tuple(names), opened
    )
