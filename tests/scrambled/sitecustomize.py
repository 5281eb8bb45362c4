"""Scramble all messages of a process: Python runs this file when it starts.

Stands in front of the package on PYTHONPATH, see `tests.scrambled.test_scrambled`.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from importlib import import_module
from typing import Any

# Reasons first: modules that are imported behind them hold some as constants.
TEXTS = (
    ("postproc.diagnostics", "Reason", "text"),
    ("postproc.language.visits", "Diagnostic", "message"),
    ("postproc.batch.check", "CheckFinding", "message"),
)


def scrambled(text: str) -> str:
    """Return other letters, and the same ones for the same text."""
    digits = hashlib.sha256(text.encode("utf-8", "replace")).hexdigest()
    return "zq" + digits[:12].translate(str.maketrans("0123456789", "ghijklmnop"))


def scramble(module: str, name: str, field: str) -> None:
    """Let a frozen class scramble one of its texts when it is made."""
    kind = getattr(import_module(module), name)
    made: Callable[..., None] = kind.__init__

    def make(self: Any, *given: Any, **named: Any) -> None:
        made(self, *given, **named)
        if text := getattr(self, field):
            object.__setattr__(self, field, scrambled(text))

    kind.__init__ = make


def scramble_all() -> None:
    """Scramble the texts of findings, reasons, refusals and codes."""
    for place in TEXTS:
        scramble(*place)
    exceptions = import_module("postproc.exceptions")
    exceptions.PostprocError.__str__ = lambda self: scrambled(repr(self.args))
    for code in import_module("postproc.diagnostics").Code:
        code.meaning, code.cure = scrambled(code.meaning), scrambled(code.cure)


if __name__ == "sitecustomize":  # not where tests are only collected
    scramble_all()
