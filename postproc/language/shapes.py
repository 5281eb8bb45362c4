"""The shapes of the lines of a file: few forms, with many names filled in."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Ints
from postproc.language.numbered import NAME_MARK, WHOLE, form_of, mask_of
from postproc.language.sequences import Numbers, alike, in_order

AnyInts = NDArray[np.signedinteger[Any]]


@dataclass(frozen=True, eq=False)
class Shapes(Sequence[str]):
    """k distinct masks of lines; the text of one is made when it is asked for.

    Attributes:
        texts: The distinct forms: masks with their numbered names marked.
        form: Index into `texts`, (k,).
        first: CSR offsets into `name`, (k + 1,).
        name: Index into `names`, (p,).
        names: Distinct names, as they are written.
    """

    texts: tuple[str, ...]
    form: Ints
    first: Ints
    name: Ints
    names: tuple[str, ...]

    def __len__(self) -> int:
        """Return the number of shapes."""
        return len(self.form)

    @overload
    def __getitem__(self, shape: int) -> str: ...
    @overload
    def __getitem__(self, shape: slice) -> Sequence[str]: ...
    def __getitem__(self, shape: int | slice) -> str | Sequence[str]:
        """Return the mask of a shape."""
        if isinstance(shape, slice):
            return [self[k] for k in range(*shape.indices(len(self)))]
        if not 0 <= shape < len(self):
            raise IndexError(shape)
        return mask_of(self.texts[self.form[shape]], self.names_of(shape))

    def __iter__(self) -> Iterator[str]:
        """Go through the masks."""
        return (self[k] for k in range(len(self)))

    def __eq__(self, other: object) -> bool:
        """Tell whether the masks are those of other shapes."""
        if not isinstance(other, Shapes):
            return NotImplemented
        return (
            self.texts == other.texts
            and np.array_equal(self.form, other.form)
            and np.array_equal(self.first, other.first)
            and self._same_names(other)
        )

    __hash__ = None  # type: ignore[assignment]

    def _same_names(self, other: Shapes) -> bool:
        if self.names == other.names:
            return np.array_equal(self.name, other.name)
        pairs = zip(self.name.tolist(), other.name.tolist(), strict=True)
        return all(self.names[a] == other.names[b] for a, b in pairs)

    def names_of(self, shape: int) -> tuple[str, ...]:
        """Return the names in a shape."""
        own = self.name[self.first[shape] : self.first[shape + 1]].tolist()
        return tuple([self.names[k] for k in own])

    def names_at(self, shapes: Ints) -> Ints:
        """Return the names of shapes of one form, (m, c), as indices into `names`."""
        count = self.first[shapes[:1] + 1] - self.first[shapes[:1]]
        width = int(count[0]) if len(count) else 0
        found: Ints = self.name[self.first[shapes][:, None] + np.arange(width)]
        return found


def find_shapes(
    texts: Sequence[bytes],
    text: AnyInts,
    at: AnyInts,
    name: Ints,
    names: Numbers[str],
) -> tuple[Shapes, Ints]:
    """Find the distinct shapes of lines, in the order of appearance.

    Args:
        texts: Masks with their names marked, or `WHOLE` and the mask.
        text: Index into `texts` of every line, (n,).
        at: Index into `name` of the first name of every line, (n,).
        name: Numbers of all names in order, as in `names`.
        names: Their numbers; names that only whole masks hold are entered, too.

    Returns:
        The shapes, and that of every line, (n,).
    """
    forms: dict[str, int] = {}
    form = np.zeros(len(texts), dtype=np.int64)
    count = np.zeros(len(texts), dtype=np.int64)
    own = np.full(len(texts), -1, dtype=np.int64)
    more: list[int] = []
    for k in text[in_order(text)[1]].tolist():
        one = texts[k].decode("latin-1")
        found: tuple[str, ...] = ()
        if texts[k][:1] == WHOLE:
            one, found = form_of(one[1:])
            own[k], count[k] = len(name) + len(more), len(found)
            more += names.of(found).tolist()
        else:
            count[k] = one.count(NAME_MARK)
        form[k] = forms.setdefault(one, len(forms))
    name = np.append(name, np.array(more, dtype=np.int64))
    begin = np.where(own[text] >= 0, own[text], at).astype(np.int64)
    shape, example = _numbered(form[text], begin, count[text], name, len(names))
    kept = text[example]
    first = np.append(0, np.cumsum(count[kept]))
    steps = np.arange(first[-1]) - np.repeat(first[:-1], count[kept])
    own_names = name[np.repeat(begin[example], count[kept]) + steps]
    return Shapes(tuple(forms), form[kept], first, own_names, tuple(names)), shape


def _numbered(
    form: Ints, begin: Ints, count: Ints, name: Ints, names: int
) -> tuple[Ints, Ints]:
    """Number lines by their forms and their names; as `in_order`."""
    if not len(form) or not count.any():
        return in_order(form)
    said = np.zeros(len(form), dtype=np.int64)
    one, many = np.flatnonzero(count == 1), np.flatnonzero(count > 1)
    said[one] = 1 + name[begin[one]]
    said[many] = 1 + names + alike(name, begin[many], (begin + count)[many])
    return in_order(form * (int(said.max()) + 1) + said)
