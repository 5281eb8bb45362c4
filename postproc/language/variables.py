"""Declared variables: a list of names is one declaration, whatever its length."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from itertools import repeat

import numpy as np

from postproc.arrays import Bools, Ints
from postproc.language import pdl2 as ast
from postproc.language.forms import lower


@dataclass(frozen=True)
class Variable:
    """A declared variable or constant.

    Attributes:
        name: As it is written.
        row: Logical line of its declaration.
        type: Its type, None for a constant.
        initial: Its initial value or None.
        exported: The program it is exported from, or "".
        constant: Declared in a CONST section.
        taught: Marked ``-- TAUGHT``.
    """

    name: str
    row: int
    type: ast.Type | None = None
    initial: ast.Expression | None = None
    exported: str = ""
    constant: bool = False
    taught: bool = False


class Variables(Mapping[str, Variable]):
    """Variables by lower-case name; each is made when it is asked for.

    A name that is declared again means what the last declaration says.
    """

    def __init__(self) -> None:
        """Begin without any."""
        self._at: dict[str, int] = {}  # index into the names, by lower-case name
        self._names: list[str] = []
        self._begins: list[int] = []  # the first name of every declaration
        self._said: list[Variable] = []  # what holds for all names of a declaration
        self._made: dict[str, Variable] = {}

    def declare(self, names: Sequence[str], said: Variable) -> None:
        """Enter the names of one declaration.

        Args:
            names: As they are written.
            said: What holds for all of them, under any name.
        """
        begin = len(self._names)
        own = lower(names)
        if self._made:
            for name in own:
                self._made.pop(name, None)
        self._at.update(zip(own, range(begin, begin + len(own)), strict=True))
        self._names += names
        self._begins.append(begin)
        self._said.append(said)

    def declare_all(self, others: Variables) -> None:
        """Enter all variables of others behind the own ones."""
        for variable in others.values():
            self.declare([variable.name], variable)

    def some(self, names: Iterable[str]) -> Variables:
        """Return those of some lower-case names that there are."""
        found = Variables()
        for name in names:
            if name in self._at:
                found.declare([self[name].name], self[name])
        return found

    def __len__(self) -> int:
        """Return the number of names."""
        return len(self._at)

    def __iter__(self) -> Iterator[str]:
        """Go through the lower-case names."""
        return iter(self._at)

    def __contains__(self, name: object) -> bool:
        """Tell whether a lower-case name is declared."""
        return name in self._at

    def __getitem__(self, name: str) -> Variable:
        """Return the variable of a lower-case name."""
        made = self._made.get(name)
        if made is None:
            at = self._at[name]
            said = self._said[bisect_right(self._begins, at) - 1]
            made = self._made[name] = replace(said, name=self._names[at])
        return made

    def get(self, name: str, default: object = None) -> Variable | None:  # type: ignore[override]
        """Return the variable of a lower-case name, None where there is none."""
        return self[name] if name in self._at else None

    @property
    def names(self) -> Set[str]:
        """Return the lower-case names."""
        return self._at.keys()

    def written(self) -> list[str]:
        """Return the names as they are written, in order."""
        return [self._names[at] for at in self._at.values()]

    def which(self, test: Callable[[Variable], bool]) -> list[str]:
        """List the lower-case names whose declaration passes a test, in order.

        Args:
            test: What no name decides.
        """
        passed = self._passed(test)
        if not passed.any():
            return []
        index = np.fromiter(self._at.values(), np.int64, len(self._at))
        names = [*self._at]
        return [names[k] for k in np.flatnonzero(passed[self._declaration(index)])]

    def passing(self, names: Sequence[str], test: Callable[[Variable], bool]) -> Bools:
        """Tell which lower-case names are declared, and so that it passes a test."""
        index = np.fromiter(map(self._at.get, names, repeat(-1)), np.int64, len(names))
        found = index >= 0
        own = [bisect_right(self._begins, at) - 1 for at in index[found].tolist()]
        passed = {k: test(self._said[k]) for k in set(own)}
        found[found] = [passed[k] for k in own]
        return found

    def _passed(self, test: Callable[[Variable], bool]) -> Bools:
        return np.array([test(said) for said in self._said], dtype=bool)

    def _declaration(self, index: Ints) -> Ints:
        begins = np.array(self._begins, dtype=np.int64)
        found: Ints = np.searchsorted(begins, index, side="right") - 1
        return found
