"""What a rename changes: words of this version against those of an older commit.

translation.toml lists it. The base commit is run with its own words, and what it prints
and writes is translated before it is compared, so that a rename shows as no difference.
Programs are never translated: a rename changes no byte of them.
"""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from tests.golden.case import HERE, Case, kept
from tests.golden.record import Record

TABLE = HERE / "translation.toml"
PROGRAMS = (".pdl", ".lsv", ".mod", ".src", ".dat")
PRINTED, TOML = ("stdout", "stderr"), ".toml"
BLANKS = re.compile(r" {2,}|[-\u2500]{2,}")  # columns are as wide as their words


@dataclass(frozen=True)
class Translation:
    """The words that differ.

    Attributes:
        commands: Patterns of whole commands, this version's -> the base's.
        arguments: Words of commands, likewise.
        cells: Text of cells and plans, likewise.
        keys: Keys of JSON, the base's -> this version's.
        words: Codes and statuses, likewise, as whole words of any text.
        messages: Parts of messages, likewise.
        added: What this version writes and the base does not: patterns, and what
            stands for them.
    """

    commands: Mapping[str, str] = field(default_factory=dict)
    arguments: Mapping[str, str] = field(default_factory=dict)
    cells: Mapping[str, str] = field(default_factory=dict)
    keys: Mapping[str, str] = field(default_factory=dict)
    words: Mapping[str, str] = field(default_factory=dict)
    messages: Mapping[str, str] = field(default_factory=dict)
    added: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def read(cls) -> Translation:
        """Read the table."""
        told: dict[str, Any] = tomllib.loads(TABLE.read_text("utf-8"))
        return cls(**told)

    @property
    def digest(self) -> bytes:
        """Return what decides how the base is run."""
        return json.dumps([self.commands, self.arguments, self.cells]).encode()

    def case(self, case: Case) -> Case:
        """Return a case in the words of the base."""
        given = {k: kept()[name] for k, name in case.files.items() if k.endswith(TOML)}
        texts = {
            place: _replaced(data.decode("latin-1"), self.cells).encode("latin-1")
            if place.endswith(TOML)
            else data
            for place, data in {**given, **case.texts}.items()
        }
        commands = tuple(
            " ".join(self.arguments.get(word, word) for word in line.split(" "))
            for line in map(self._command, case.commands)
        )
        return replace(case, commands=commands, texts=texts)

    def base(self, record: Record) -> Record:
        """Return what the base wrote, in the words of this version."""
        return {
            what: text if _is_program(what) else self._translated(what, text)
            for what, text in record.items()
        }

    def here(self, record: Record) -> Record:
        """Return what this version wrote without what the base does not write."""
        out = {}
        for what, text in record.items():
            if not _is_program(what):
                text = _even(what, self._without(text))
            out[what] = text
        return out

    def _command(self, line: str) -> str:
        for pattern, stands in self.commands.items():
            line = re.sub(pattern, stands, line)
        return line

    def _without(self, text: str) -> str:
        for pattern, stands in self.added.items():
            text = re.sub(pattern, stands, text)
        return text

    def _translated(self, what: str, text: str) -> str:
        for old, new in self.keys.items():
            text = text.replace(f'"{old}":', f'"{new}":')
        text = _replaced(self._without(text), self.messages)
        if self.words:
            some = "|".join(map(re.escape, self.words))
            pattern = rf"(?<![\w-])(?:{some})(?![\w-])"
            text = re.sub(pattern, lambda found: self.words[found[0]], text)
        return _even(what, text)


def _replaced(text: str, table: Mapping[str, str]) -> str:
    """Replace the longest texts first."""
    for old in sorted(table, key=len, reverse=True):
        text = text.replace(old, table[old])
    return text


def _is_program(what: str) -> bool:
    return what.endswith(PROGRAMS)


def _even(what: str, text: str) -> str:
    """Take the columns out of what was printed."""
    return BLANKS.sub(" ", text) if what.endswith(PRINTED) else text
