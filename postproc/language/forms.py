"""Forms of lines: what differs in numbered names only is parsed once.

Programs name points ``p1`` to ``p3000``: every line has a shape of its own, but all
have one form. What a form says is built once, with its names left open; what a line
says is that with the line's names filled in, when somebody asks.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import chain
from typing import Generic, TypeVar, overload

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
T = TypeVar("T")

OPEN = "\x01"  # no program text holds it
_WORD = re.compile(r"[A-Za-z_]\w*")
_PLACE = re.compile(rf"{OPEN}(aa|aA|AA)(\d+){OPEN}", re.ASCII)


def open_name(index: int) -> str:
    """Return what stands for the name of an index until it is filled in.

    Its letters remember whether a rule has made the name lower or upper case.
    """
    return f"{OPEN}aA{index}{OPEN}"


def name_index(text: str) -> int:
    """Return which name a text stands for, -1 where it is no open name.

    >>> name_index(open_name(2).lower()), name_index("weld")
    (2, -1)
    """
    found = _PLACE.fullmatch(text)
    return int(found[2]) if found else -1


def filled(part: object, names: Sequence[str]) -> object:
    """Fill names into a part of what a form says.

    >>> filled(("move", open_name(0).lower()), ["Weld_1"])
    ('move', 'weld_1')
    """
    if isinstance(part, str):
        if part[:1] == OPEN == part[-1:] and part.count(OPEN) == 2:
            return _cased(names[int(part[3:-1])], part[1:3])
        return _PLACE.sub(lambda at: _cased(names[int(at[2])], at[1]), part)
    if isinstance(part, tuple):
        return tuple(filled(one, names) for one in part)
    own = getattr(part, "__match_args__", None)
    if own is None:
        return part
    return type(part)(*(filled(getattr(part, name), names) for name in own))


def _cased(name: str, letters: str) -> str:
    if letters == "aa":
        return name.lower()
    return name.upper() if letters == "AA" else name


@dataclass(frozen=True, eq=False)
class Formed(Sequence[T], Generic[T]):
    """What each of k shapes says, made from its form when it is asked for.

    Attributes:
        said: What each form says, its names open.
        texts: The forms themselves.
        form: Index into `said`, (k,).
        names: The names of every shape.
    """

    said: tuple[T, ...]
    texts: tuple[str, ...]
    form: Ints
    names: Sequence[tuple[str, ...]]
    _made: dict[int, T] = field(default_factory=dict)

    def __len__(self) -> int:
        """Return the number of shapes."""
        return len(self.form)

    @overload
    def __getitem__(self, shape: int) -> T: ...
    @overload
    def __getitem__(self, shape: slice) -> Sequence[T]: ...
    def __getitem__(self, shape: int | slice) -> T | Sequence[T]:
        """Return what a shape says."""
        if isinstance(shape, slice):
            return [self[k] for k in range(*shape.indices(len(self)))]
        made = self._made.get(shape)
        if made is None:
            said = self.said[self.form[shape]]
            made = filled(said, self.names[shape]) if self.names[shape] else said  # type: ignore[assignment]
            self._made[shape] = made  # type: ignore[assignment]
        return made  # type: ignore[return-value]

    def __iter__(self) -> Iterator[T]:
        """Go through the shapes."""
        return (self[k] for k in range(len(self)))

    def words(self) -> frozenset[str]:
        """Return all words in the shapes, in lower case."""
        texts = "\n".join(chain(self.texts, chain.from_iterable(self.names)))
        return frozenset(_WORD.findall(texts.lower()))

    def which(self, test: Callable[[T], bool]) -> Bools:
        """Tell which shapes pass a test that no name in them decides, (k,)."""
        passed = np.array([test(one) for one in self.said], dtype=bool)
        found: Bools = passed[self.form]
        return found


def formed(
    shapes: Sequence[str],
    split: Callable[[Sequence[str]], Iterable[tuple[str, tuple[str, ...]]]],
    parse: Callable[[str], T],
) -> Formed[T]:
    """Parse the form of every shape.

    Args:
        shapes: Masks of lines.
        split: Takes masks apart into their forms and names.
        parse: Says what a form says.
    """
    number: dict[str, int] = {}
    form = np.empty(len(shapes), dtype=np.int64)
    names: list[tuple[str, ...]] = []
    for at, (text, own) in enumerate(split(shapes)):
        form[at] = number.setdefault(text, len(number))
        names.append(own)
    return Formed(tuple(map(parse, number)), tuple(number), form, names)
