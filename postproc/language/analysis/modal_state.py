"""What moves are carried out with, until another statement changes it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar, TypeVar

from postproc.diagnostics import Reason

M = TypeVar("M", bound="ModalState")


@dataclass(frozen=True, kw_only=True)
class ModalState(ABC):
    """What holds until another statement changes it; a language adds its own.

    Attributes:
        collected: Names of sets that grow where ways meet, and are never forgotten.
        blocked: Why no target can be compensated; more than one reason.
    """

    collected: ClassVar[tuple[str, ...]] = ("blocked",)
    blocked: frozenset[Reason] = frozenset()

    @abstractmethod
    def unknown_state(self: M) -> M:
        """Return it where nothing is known."""

    def with_(self: M, **changed: Any) -> M:
        """Return it with other values; itself where they are no others."""
        same = all(getattr(self, name) is value for name, value in changed.items())
        return self if same else replace(self, **changed)

    def join(self: M, other: M) -> M:
        """Keep what is the same on another way here."""
        lost = self.unknown_state()
        found = {
            f.name: getattr(lost, f.name)
            for f in fields(self)
            if getattr(self, f.name) != getattr(other, f.name)
        }
        for name in self.collected:
            found[name] = getattr(self, name) | getattr(other, name)
        return replace(self, **found)

    def forget(self: M) -> M:
        """Forget all but why targets cannot be compensated."""
        kept = {name: getattr(self, name) for name in self.collected}
        return replace(self.unknown_state(), **kept)
