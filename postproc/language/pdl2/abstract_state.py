"""The abstract store: what variables hold, and where the arm came from."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace

from postproc.diagnostics import Code
from postproc.language.analysis.origins import NOWHERE, Origins, join_origins
from postproc.language.analysis.shared_map import SharedMap
from postproc.language.pdl2.values import (
    Nothing,
    Value,
    add_unknown,
    join,
    join_components,
    may_be,
)

Settings = Mapping[str, Value]
FRAMES = ("tool", "base", "uframe")  # those of the settings that are frames

Log = tuple[str, "Log | None"]
"""A key that was given a value, and those before it: copies share what they share."""


class GivenValues:
    """What variables are given while a program runs, by key, in whatever order."""

    def __init__(self) -> None:
        """Begin with none."""
        self._values: dict[str, Value] = {}
        self._numbers: dict[str, set[int]] = {}  # a set takes in many

    def note(self, key: str, value: Value) -> None:
        """Note that a key is given a value at some time."""
        known = self._values.setdefault(key, value)
        if known is not value:
            known = join_components(known, value)
        self._numbers.setdefault(key, set()).update(may_be(value), may_be(known))
        if isinstance(known, Nothing):
            known = replace(known, of=frozenset())
        self._values[key] = known

    def value(self, key: str) -> Value:
        """Return what a key is given, whenever it is."""
        value = self._values[key]
        if isinstance(value, Nothing):
            return replace(value, of=self.numbers(key))
        return value

    def numbers(self, key: str) -> frozenset[int]:
        """Return the numbers of the positions that a key is ever given."""
        return frozenset(self._numbers.get(key, ()))

    def __iter__(self) -> Iterator[str]:
        """Go through the keys."""
        return iter(self._values)


NEVER_SET = Nothing(
    "it has no value in the program or its variable file", code=Code.NO_VALUE
)


@dataclass
class Store:
    """What is known at one point of a program.

    Keys are ``program/name`` or ``program:routine/name``, followed by constant indices
    and record fields: ``job/tab[3].place``. Only what the program has assigned is kept;
    the rest is what it was when the program started.

    Attributes:
        values: Assigned values. A Nothing at ``job/tab`` hides its elements.
        settings: Frames and motion variables; replaced, never changed.
        last: Where the arm may come from.
        logs: Elements and fields that a key has been given since it was forgotten,
            by key; some of them may hold nothing any more.
        compound: Keys that ever had elements or fields; shared by all copies.
        changing: Variables, by key, that another program may write at any time.
        exposed: Those of them that hold what this program has given them.
        given: What keys are given at any time; shared by all copies.
        lost: Visits behind which the arm goes on nobody knows where; likewise.
    """

    initial: Callable[[str], Value | None]
    values: SharedMap[str, Value] = field(default_factory=SharedMap)
    logs: SharedMap[str, Log] = field(default_factory=SharedMap)
    settings: Settings = field(default_factory=dict)
    last: Origins = frozenset()
    compound: set[str] = field(default_factory=set)
    changing: frozenset[str] = frozenset()
    exposed: frozenset[str] = frozenset()
    given: GivenValues = field(default_factory=GivenValues)
    lost: set[int] = field(default_factory=set)

    def copy(self) -> Store:
        """Return a store that can change on its own."""
        values, logs = self.values.copy(), self.logs.copy()
        return replace(self, values=values, logs=logs)

    def read(self, key: str) -> Value:
        """Return what a key holds."""
        found = self.get_assigned(key)
        if found is None:
            found = self.initial(key)
        return NEVER_SET if found is None else found

    def get_assigned(self, key: str) -> Value | None:
        """Return what the program has given a key, None where it has not."""
        found = self.values.get(key)
        if found is not None:
            return found
        for whole in wholes(key):
            hidden = self.values.get(whole)
            if isinstance(hidden, Nothing):  # the array or record of the element
                return add_unknown(hidden, self.initial(key))
        return None

    def write(self, key: str, value: Value) -> None:
        """Let a key hold a value."""
        if self.changing and (root := root_of(key)) in self.changing:
            self.exposed |= {root}
        if self.values.get(key) is None:
            for whole in wholes(key):
                self.logs[whole] = (key, self.logs.get(whole))
                self.compound.add(whole)
        self.values[key] = value
        self.given.note(key, value)

    def parts(self, key: str) -> list[str]:
        """Return the keys of elements and fields that a key has."""
        found: dict[str, None] = {}
        log = self.logs.get(key)
        while log is not None:
            part, log = log
            if self.values.get(part) is not None:
                found[part] = None
        return [*reversed(found)]

    def drop(self, key: str) -> None:
        """Let a key and all its elements and fields hold nothing."""
        self._drop_parts(key)
        del self.values[key]

    def _drop_parts(self, key: str) -> None:
        for part in self.parts(key):
            del self.values[part]
            del self.logs[part]
        del self.logs[key]

    def forget(self, key: str, unknown: Nothing) -> None:
        """What a variable and all its elements hold is no longer known."""
        held = self.read(key)
        self._drop_parts(key)
        self.write(key, add_unknown(unknown, held))

    def lose_place(self) -> None:
        """Where the arm is is no longer known."""
        self.lost |= self.last
        self.last = NOWHERE

    def set(self, **settings: Value) -> None:
        """Change frames or motion variables (names without ``$``).

        Those are the same settings after a number, a text or a switch that they have.
        """
        if not all(self._has(*setting) for setting in settings.items()):
            self.settings = {**self.settings, **settings}

    def _has(self, name: str, value: Value) -> bool:
        held = self.settings.get(name)
        plain = isinstance(value, float | bool | str) and type(held) is type(value)
        return plain and held == value

    def forget_frames(self, why: str) -> None:
        """Which frames hold is no longer known."""
        self.set(**dict.fromkeys(FRAMES, Nothing(why)))

    def forget_surroundings(self, why: str) -> None:
        """Forget where the arm is, its frames, and all motion settings."""
        self.set(**dict.fromkeys((*FRAMES, *self.settings), Nothing(why)))
        self.lose_place()

    def join(self, other: Store) -> Store:
        """Return what may hold on either way; itself where the other adds nothing."""
        both = self.copy()
        last = join_origins(self.last, other.last, self.lost)
        changed, both.last = last is not self.last, last
        if other.settings is not self.settings and other.settings != self.settings:
            a, b, unset = (
                self.settings,
                other.settings,
                Nothing("it is set on one way only"),
            )
            merged = {n: join(a.get(n, unset), b.get(n, unset)) for n in {**a, **b}}
            changed |= merged != self.settings
            both.settings = merged
        found = []  # before anything is written: an array hides its elements
        for key in self.values.differing(other.values):
            mine, theirs = self.values.get(key), other.values.get(key)
            before = self.read(key) if mine is None else mine
            after = join(before, other.read(key) if theirs is None else theirs)
            if after is not mine:
                found.append((key, before, after))
        for key, before, after in found:
            changed |= after != before
            both.write(key, after)
        return both if changed else self


def root_of(key: str) -> str:
    """Return the key of the variable that a key belongs to."""
    return key.partition("[")[0].partition(".")[0]


def wholes(key: str) -> Iterator[str]:
    """Yield the keys of what a key is an element or a field of, the innermost first.

    >>> list(wholes("job/tab[3].place"))
    ['job/tab[3]', 'job/tab']
    """
    at = len(key)
    while (at := max(key.rfind("[", 0, at), key.rfind(".", 0, at))) > 0:
        yield key[:at]
