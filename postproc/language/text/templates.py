"""Lines that differ in numbers or numbered names only are parsed once."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from operator import itemgetter
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from postproc import _native
from postproc.arrays import Bools, Indices, Interned, Ints
from postproc.language.text.lexer import NAME_MARK
from postproc.language.text.symbol_column import NameColumn


def alike(values: AnyInts, first: AnyInts, last: AnyInts) -> Ints:
    """Number sequences of whole numbers so that equal ones have the same number, (k,).

    Args:
        values: The numbers, (m,).
        first: Every sequence is values[first:last], (k,).
        last: See there.

    >>> alike(np.array([7, 8, 7, 8, 9]), np.array([0, 2, 2]), np.array([2, 4, 5]))
    array([0, 0, 1])
    """
    values, first, last = (
        np.ascontiguousarray(x, np.int64) for x in (values, first, last)
    )
    return _native.number_in_order(values, (first, last))[0]


def number_in_order(keys: AnyInts) -> tuple[Ints, Ints]:
    """Number keys in the order in which they appear.

    Args:
        keys: Whole numbers, (n,).

    Returns:
        The number of every row, (n,), and the first row of every number.

    >>> number_in_order(np.array([5, 2, 5]))
    (array([0, 1, 0]), array([0, 1]))
    """
    return _native.number_in_order(np.ascontiguousarray(keys, np.int64), None)


def split_by(values: AnyInts) -> Iterator[tuple[int, Ints]]:
    """Yield each of some values, ascending, and where it stands, (m,)."""
    order = np.argsort(values, kind="stable")
    ascending = values[order]
    cuts = np.flatnonzero(np.diff(ascending)) + 1
    for own in np.split(order, cuts) if len(order) else ():
        yield int(values[own[0]]), own


# The shapes of the lines of a file: few forms, with many names filled in.

AnyInts = NDArray[np.signedinteger[Any]]


@dataclass(frozen=True, eq=False)
class Shapes:
    """k distinct masks of lines; the text of one is made when it is asked for.

    Attributes:
        texts: The distinct forms: masks with their numbered names marked.
        form: Index into `texts`, (k,).
        first: CSR offsets into `name`, (k + 1,).
        name: Index into `names`, (p,).
        names: Distinct names, as they are written.
    """

    texts: tuple[str, ...]
    form: Indices
    first: Indices
    name: Indices
    names: NameColumn

    def __len__(self) -> int:
        """Return the number of shapes."""
        return len(self.form)

    def __eq__(self, other: object) -> bool:
        """Tell whether the masks are those of other shapes."""
        if not isinstance(other, Shapes):
            return NotImplemented
        if self.texts != other.texts or not np.array_equal(self.form, other.form):
            return False
        if not np.array_equal(self.first, other.first):
            return False
        if self.names == other.names:
            return np.array_equal(self.name, other.name)
        pairs = zip(self.name.tolist(), other.name.tolist(), strict=True)
        return all(self.names[a] == other.names[b] for a, b in pairs)

    __hash__ = None  # type: ignore[assignment]

    def names_of(self, shape: int) -> tuple[str, ...]:
        """Return the names in a shape."""
        own = self.name[self.first[shape] : self.first[shape + 1]].tolist()
        return tuple([self.names[k] for k in own])

    def names_at(self, shapes: Indices) -> Indices:
        """Return the names of shapes of one form, (m, c), as indices into `names`."""
        count = self.first[shapes[:1] + 1] - self.first[shapes[:1]]
        width = int(count[0]) if len(count) else 0
        found: Indices = self.name[self.first[shapes][:, None] + np.arange(width)]
        return found


def find_shapes(
    texts: Sequence[bytes], text: AnyInts, at: AnyInts, name: Ints, names: NameColumn
) -> tuple[Shapes, Ints]:
    """Find the distinct shapes of lines, in the order of appearance.

    Args:
        texts: Masks with their names marked.
        text: Index into `texts` of every line, (n,).
        at: Index into `name` of the first name of every line, (n,).
        name: Index into `names` of all names in order.
        names: The distinct ones.

    Returns:
        The shapes, and that of every line, (n,).
    """
    forms, used = Interned[str](), text[number_in_order(text)[1]]
    form, count = np.zeros((2, len(texts)), dtype=np.int64)
    form[used] = forms.of([texts[k].decode("latin-1") for k in used.tolist()])
    count[used] = [texts[k].count(NAME_MARK.encode()) for k in used.tolist()]
    names.settle()
    form, count, begin = form[text], count[text], at.astype(np.int64)
    said, some = np.zeros(len(form), dtype=np.int64), np.flatnonzero(count)
    said[some] = 1 + alike(name, begin[some], (begin + count)[some])
    shape, example = number_in_order(form * (int(said.max(initial=0)) + 1) + said)
    own = count[example]
    first = np.append(np.int32(0), np.cumsum(own, dtype=np.int32))
    steps = np.arange(first[-1]) - np.repeat(first[:-1], own)
    own_names = name[np.repeat(begin[example], own) + steps]
    short = form[example].astype(np.int32), first, own_names.astype(np.int32)
    return Shapes(tuple(forms), *short, names), shape


# What forms say.
#
# Programs name points ``p1`` to ``p3000``: every line has a shape of its own, but all
# have one form. What a form says is built once, with its names left open; what a line
# says is that with the line's names filled in, when somebody asks.

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
        return lambda names: _match_case(names[index], letters)
    if _PLACE.search(part) is None:
        return None
    return lambda names: _PLACE.sub(
        lambda at: _match_case(names[int(at[2])], at[1]), part
    )


def _match_case(name: str, letters: str) -> str:
    if letters == "aa":
        return name.lower()
    return name.upper() if letters == "AA" else name


@dataclass(frozen=True, eq=False)
class ParsedShapes(Generic[T]):
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

    def __getitem__(self, shape: int) -> T:
        """Return what a shape says."""
        made = self._made.get(shape)
        if made is None:
            made = self._made[shape] = self.once(shape)
        return made

    def once(self, shape: int) -> T:
        """Make what a shape says for who asks for it once alone."""
        form, names = int(self.form[shape]), self.shapes.names_of(shape)
        made = self.said[form]
        if not names:
            return made
        if form not in self._fillers:
            self._fillers[form] = filler(made)
        fill = self._fillers[form]
        return made if fill is None else fill(names)  # type: ignore[return-value]

    def __iter__(self) -> Iterator[T]:
        """Go through the shapes."""
        return (self[k] for k in range(len(self)))

    @property
    def form(self) -> Indices:
        """Return the form of every shape, as an index into `said`, (k,)."""
        return self.shapes.form

    def distinct(self, shapes: Ints, free: Sequence[Sequence[int]]) -> Ints:
        """Return one of all shapes that differ in names alone that do not count.

        Args:
            shapes: Some shapes, (m,).
            free: Which names of each form do not count.
        """
        some = np.array([*map(bool, free)], dtype=bool)[self.form[shapes]]
        kept, shapes = [shapes[~some]], shapes[some]
        for form, at in split_by(self.form[shapes]):
            own = shapes[at]
            names = np.delete(self.shapes.names_at(own), [*free[form]], axis=1)
            ends = names.shape[1] * np.arange(1, len(own) + 1)
            kind = alike(names.ravel(), ends - names.shape[1], ends)
            kept.append(own[number_in_order(kind)[1]])
        return np.concatenate(kept)

    def tell(self, names: NameColumn) -> Bools:
        """Tell which names, in lower case, are words in the shapes, (m,)."""
        found: Bools = self.shapes.names.lower().find(names) >= 0
        words = {*_WORD.findall("\n".join(self.shapes.texts).lower())}
        rest = np.flatnonzero(~found)
        found[rest] = [names[k] in words for k in rest.tolist()]
        return found

    def which(self, test: Callable[[T], bool]) -> Bools:
        """Tell which shapes pass a test that no name in them decides, (k,)."""
        passed = np.array([test(one) for one in self.said], dtype=bool)
        found: Bools = passed[self.form]
        return found


def parse_shapes(shapes: Shapes, parse: Callable[[str], T]) -> ParsedShapes[T]:
    """Parse the form of every shape.

    Args:
        shapes: Masks of lines.
        parse: Says what a form says.
    """
    return ParsedShapes(tuple(map(parse, shapes.texts)), shapes)
