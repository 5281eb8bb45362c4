"""Forms of lines: what differs in numbered names only is parsed once.

Programs name points ``p1`` to ``p3000``: every line has a shape of its own, but all
have one form. What a form says is built once, with its names left open; what a line
says is that with the line's names filled in, when somebody asks.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from operator import itemgetter
from typing import Generic, TypeVar, overload

import numpy as np

from postproc.arrays import Bools, Ints
from postproc.language.shapes import Shapes

T = TypeVar("T")
Filler = Callable[[Sequence[str]], object]

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
    fill = filler(part)
    return fill(names) if fill is not None else part


def filler(part: object) -> Filler | None:
    """Return what fills names into a part, None where none is open in it."""
    if isinstance(part, str):
        return _text_filler(part)
    if isinstance(part, tuple):
        at = [name_index(one) if isinstance(one, str) else -1 for one in part]
        if len(part) > 1 and part == tuple(map(open_name, at)):
            return itemgetter(*at)  # a list of names, as they are written
        return _all_filler(tuple, part)
    own = getattr(part, "__match_args__", None)
    if own is None:
        return None
    made = type(part)
    return _all_filler(lambda parts: made(*parts), [getattr(part, n) for n in own])


def _all_filler(
    made: Callable[[list[object]], object], parts: Sequence[object]
) -> Filler | None:
    """Return what fills names into some parts and makes something of them."""
    pairs = [(filler(part), part) for part in parts]
    if all(fill is None for fill, _ in pairs):
        return None
    return lambda names: made(
        [part if fill is None else fill(names) for fill, part in pairs]
    )


def _text_filler(part: str) -> Filler | None:
    if part[:1] == OPEN == part[-1:] and part.count(OPEN) == 2:
        index, letters = int(part[3:-1]), part[1:3]
        return lambda names: _cased(names[index], letters)
    if _PLACE.search(part) is None:
        return None
    return lambda names: _PLACE.sub(lambda at: _cased(names[int(at[2])], at[1]), part)


def _cased(name: str, letters: str) -> str:
    if letters == "aa":
        return name.lower()
    return name.upper() if letters == "AA" else name


@dataclass(frozen=True, eq=False)
class Formed(Sequence[T], Generic[T]):
    """What each of k shapes says, made from its form when it is asked for.

    Attributes:
        said: What each form says, its names open.
        shapes: The shapes.
    """

    said: tuple[T, ...]
    shapes: Shapes
    _made: dict[int, T] = field(default_factory=dict)
    _fillers: dict[int, Filler | None] = field(default_factory=dict)

    def __len__(self) -> int:
        """Return the number of shapes."""
        return len(self.shapes)

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
            form, names = int(self.form[shape]), self.shapes.names_of(shape)
            made = self.said[form]
            if names:
                if form not in self._fillers:
                    self._fillers[form] = filler(made)
                fill = self._fillers[form]
                made = made if fill is None else fill(names)  # type: ignore[assignment]
            self._made[shape] = made
        return made

    def __iter__(self) -> Iterator[T]:
        """Go through the shapes."""
        return (self[k] for k in range(len(self)))

    @property
    def form(self) -> Ints:
        """Return the form of every shape, as an index into `said`, (k,)."""
        return self.shapes.form

    def words(self) -> frozenset[str]:
        """Return all words in the shapes, in lower case; a name is one word."""
        words = _WORD.findall("\n".join(self.shapes.texts).lower())
        return frozenset((*words, *lower(self.shapes.names)))

    def which(self, test: Callable[[T], bool]) -> Bools:
        """Tell which shapes pass a test that no name in them decides, (k,)."""
        passed = np.array([test(one) for one in self.said], dtype=bool)
        found: Bools = passed[self.form]
        return found


def formed(shapes: Shapes, parse: Callable[[str], T]) -> Formed[T]:
    """Parse the form of every shape.

    Args:
        shapes: Masks of lines.
        parse: Says what a form says.
    """
    return Formed(tuple(map(parse, shapes.texts)), shapes)


def lower(names: Sequence[str]) -> list[str]:
    """Return names in lower case, all at once.

    >>> lower(["WP_1", "p2"])
    ['wp_1', 'p2']
    """
    return "\n".join(names).lower().split("\n") if names else []
