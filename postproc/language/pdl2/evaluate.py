"""Evaluate expressions as far as the program text tells."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

from postproc.diagnostics import NO_REASON, Code, Reason
from postproc.language import ir
from postproc.language.analysis.call_context import Context
from postproc.language.analysis.values import FUNCTIONS, WrittenNumber, apply_function
from postproc.language.pdl2 import syntax as ast
from postproc.language.pdl2.abstract_state import FRAMES, Store
from postproc.language.pdl2.job import Place, World, base_variable
from postproc.language.pdl2.values import (
    COMPONENTS,
    FARTHEST,
    RUN_TIME,
    Component,
    Location,
    Nothing,
    Position,
    Value,
    Vector,
    add_unknown,
    invert_frame,
    number_in,
    operate,
    part_of,
    shift_position,
)

_DEFAULT_ARM = ("prog_arm", "dft_arm")  # the arm of all that names none
_TRUTH = {"true": True, "on": True, "false": False, "off": False}
_POSITION_TYPES = ast.POINTS | {"vector"}
_FIELDS = frozenset({*COMPONENTS, "pos", "aux"})


@dataclass
class Execution:
    """A point of the execution: where, what is known there, and what led to it.

    Attributes:
        reason: Why nothing here may be compensated.
    """

    world: World
    place: Place
    row: int
    store: Store
    context: Context = field(default_factory=Context)
    reason: Reason = NO_REASON

    def report_once(self, code: Code, what: str, text: str) -> None:
        """Report something of a thing, at the row where it comes up first."""
        self.world.report_once(self.place.program, self.row, code, what, text)

    # ---- arms -----------------------------------------------------------------------
    def is_ours(self, arm: ir.Operand | None) -> bool | None:
        """Tell whether an arm is ours, None where that is not sure.

        Args:
            arm: ``ARM[n]``, None where it is not said.
        """
        if arm is None:
            return None if self.other_default() else True
        number = self.integer(arm)
        return None if number is None else number == self.world.arm

    def other_default(self) -> str:
        """Say why what names no arm may be another's, "" where it is our arm's."""
        ours, settings = float(self.world.arm), self.store.settings
        said = self.place.program.arm
        if said and said != self.world.arm:
            return (
                f"its program says PROG_ARM = {said}, and the cell is of arm {ours:g}"
            )
        for name in _DEFAULT_ARM:
            if settings.get(name, ours) != ours:
                return f"${name.upper()} may not be {ours:g}, the arm of the cell, here"
        return ""

    # ---- places ---------------------------------------------------------------------
    def integer(self, expression: ir.Operand) -> int | None:
        """Return a whole number, None where it is not known."""
        value = self.real(expression)
        return int(value) if value.is_integer() else None

    def locate(self, reference: ir.DataObject) -> Location:
        """Find what a reference means, as far as its indices are known."""
        root = self.world.root(self.place, reference.name)
        held = self.store.values.get(root)
        keys, exact = frozenset({root}), True
        if isinstance(held, Location):
            keys, exact = held.keys, held.exact
        type_ = self.world.type_of(self.place, reference.name)
        plain = type_ is not None and type_.name in _POSITION_TYPES and not type_.path
        array = type_ is not None and type_.array
        for at, step in enumerate(reference.steps):
            rest = reference.steps[at:]
            if (plain and not array) or (
                not plain and at > 0 and isinstance(step, str) and step in _FIELDS
            ):
                return Location(keys, exact, self._component(rest))
            if isinstance(step, str):
                keys = frozenset(f"{key}.{step}" for key in keys)
                continue
            array = False
            held = None if plain else self.store.read(next(iter(keys)))
            if isinstance(held, Position) and held.joints:
                return Location(keys, exact, self._component(rest))
            index = [self.integer(one) for one in step.subscripts]
            if None in index:
                return Location(keys, False)
            text = ",".join(map(str, index))
            keys = frozenset(f"{key}[{text}]" for key in keys)
        return Location(keys, exact and len(keys) == 1)

    def _component(self, steps: tuple[str | ir.ElementStep, ...]) -> Component:
        match steps:
            case (str(name),) | ("pos", str(name)) if name in COMPONENTS:
                return COMPONENTS[name]
            case ("pos",):
                return "pos"
            case ("aux", ir.ElementStep((index,))):
                axis = self.integer(index)
                return None if axis is None else ("aux", axis)
            case (ir.ElementStep((index,)),):
                axis = self.integer(index)
                if axis is None or 1 <= axis <= 6:
                    return None if axis is None else axis - 1
                return "aux", axis - 6
        return None

    # ---- reading --------------------------------------------------------------------
    def value(self, expression: ir.Operand | None) -> Value:
        """Return what an expression is worth to what computes with it.

        A number that a part of a position holds must stay then.
        """
        return self._use(self.evaluate(expression))

    def _use(self, found: Value | WrittenNumber) -> Value:
        if not isinstance(found, WrittenNumber):
            return found
        if found.along:
            self.world.pin_number(found.slot, "the program computes with a part of it")
        if math.isnan(found.value):
            return RUN_TIME if found.along else Nothing("the number cannot be read")
        return found.value

    def real(self, expression: ir.Operand | None) -> float:
        """Return a real number to compute with, NaN where it is not known."""
        return number_in(self.value(expression))

    def number(self, expression: ir.Operand | None) -> WrittenNumber:
        """Return a number, and where in the text it is written or comes from."""
        found = self.evaluate(expression)
        if isinstance(found, WrittenNumber):
            return found
        return WrittenNumber(number_in(found))

    def evaluate(self, expression: ir.Operand | None) -> Value | WrittenNumber:
        """Return what an expression is worth, a number with where it comes from."""
        match expression:
            case ir.Num(slot):
                lines = self.place.program.lines
                at = int(lines.first[self.row]) + slot
                value = float(lines.value[at])
                value = value if math.isfinite(value) else math.nan
                return WrittenNumber(value, self.place.first + at)
            case ir.StringLiteral(text):
                return text
            case ir.DataObject():
                return self.read(expression)
            case ir.Operation("()", (operand,)):
                return self.evaluate(operand)
            case ir.Operation("+" | "-" as sign, (left, right)):
                return self._add(sign, self.evaluate(left), right)
            case ir.Operation(sign, operands):
                values = [*map(self.value, operands)]
                for frame in values if sign == ":" else ():
                    self.world.pin(frame, "the program composes it with a frame (`:`)")
                return operate(sign, *map(self.find_taught, values))
            case ir.Composite(items) if len(items) >= 6:
                own = enumerate(items[6:], start=1)
                aux = tuple((axis, self.real(item)) for axis, item in own)
                return replace(self._components(items[:6]), joints=True, aux=aux)
            case ir.Composite():
                return Nothing("it has fewer than six joint values")
            case ir.FunctionCall(name):
                answer = self.store.get_assigned(self.answer_key(expression))
                if answer is not None:
                    return answer
                return self._invoke(name, expression.values)
        return RUN_TIME

    def _add(
        self, sign: str, left: Value | WrittenNumber, right: ir.Operand
    ) -> Value | WrittenNumber:
        """Add to a value; a part of a position plus a constant moves along with it."""
        if not (isinstance(left, WrittenNumber) and left.along):
            return operate(sign, self._use(left), self.value(right))
        by = self.real(right)
        value = left.value + (by if sign == "+" else -by)
        known = abs(by) <= FARTHEST and not math.isnan(value)
        return replace(left, value=value if known else math.nan)

    def answer_key(self, call: ir.FunctionCall) -> str:
        """Return where it is kept what a function of the job has returned."""
        return f"{self.place.program.name}:{self.place.body.name}/{hash(call)}"

    def read(self, reference: ir.DataObject) -> Value | WrittenNumber:
        """Return what a variable holds."""
        name = reference.name
        if name.startswith("$"):
            return self._system(reference)
        if not reference.steps and self.world.type_of(self.place, name) is None:
            if name in _TRUTH:
                return _TRUTH[name]
            if name in ast.NAMES["word"]:
                return name
        if self.world.is_function(self.place, name):
            return self.value(ir.FunctionCall(name, ()))
        target = self.locate(reference)
        if not target.exact:
            for key in target.keys:
                self.world.loosen(key, "only the run tells which element a move uses")
            return Nothing("its index is known only at run time")
        if self._unsteady(target):
            changed = Nothing("a condition handler changes it")
            return add_unknown(changed, self.store.read(target.key))
        held = self.store.read(target.key)
        if target.component == ():
            return held
        at = target.number
        if at >= 0 and isinstance(held, Nothing):
            self.world.pin(held, "the program computes with a part of it")
        if at >= 0 and isinstance(held, Position) and held.parts[at].slot >= 0:
            return replace(held.parts[at], along=True)
        return part_of(held, target.component)

    def _unsteady(self, target: Location) -> bool:
        """Tell whether a handler may change a variable, whatever name it has here."""
        names = {base_variable(key.rpartition("/")[2]) for key in target.keys}
        return not names.isdisjoint(self.world.volatile)

    def _system(self, reference: ir.DataObject) -> Value:
        name, component = self.locate_setting(reference)
        if name is None or f"${name}" in self.world.volatile:
            return RUN_TIME
        held = self.store.settings.get(name, RUN_TIME)
        if component == ():
            return held
        return part_of(held, component) if isinstance(held, Position) else RUN_TIME

    def locate_setting(self, reference: ir.DataObject) -> tuple[str | None, Component]:
        """Find our arm's setting, and which of the six numbers of a frame is meant.

        Returns:
            Its name, None for another arm's or none; () for the whole setting.
        """
        match reference:
            case ir.DataObject(
                "$arm_data", (ir.ElementStep((index,)), str(name), *steps)
            ):
                name, ours = name.lstrip("$"), self.is_ours(index) is True
            case ir.DataObject(name, steps):
                name = name[1:]
                ours = name in _DEFAULT_ARM or not self.other_default()
        match [*steps]:
            case [] if ours:
                return name, ()
            case [str(part)] if ours and name in FRAMES and part in COMPONENTS:
                return name, COMPONENTS[part]
        return None, ()

    def _components(self, items: tuple[ir.Operand | None, ...]) -> Position:
        parts = tuple(map(self.number, items))
        return Position(parts=parts, taught=any(map(self.takes_taught, items)))

    def find_taught(self, value: Value) -> Value:
        """Return a value, as taught where it is a taught frame of the cell."""
        records = self.world.start.taught_records
        if records and isinstance(value, Position) and value.numbers in records:
            return replace(value, taught=True)
        return value

    def takes_taught(self, expression: ir.Operand | None) -> bool:
        """Return True if a number is computed from a part of a taught position."""
        if expression is None or isinstance(expression, ir.Num):
            return False
        parts = (one for one in ir.data_in(expression) if one.steps)
        places = (self.locate(one) for one in parts if not one.name.startswith("$"))
        held = (self.store.read(key) for place in places for key in place.keys)
        return any(isinstance(one, Position) and one.taught for one in held)

    def _invoke(self, name: str, arguments: tuple[ir.Operand | None, ...]) -> Value:
        if name == "pos":
            return self._position(arguments)
        values = [self.value(a) for a in arguments]
        if name not in ("vec", "pos_shift"):
            for value in values:
                self.world.pin(value, f"{name.upper()} computes with it")
        match name, [*map(self.find_taught, values)]:
            case "vec", [_, _, _]:
                x, y, z = (self.real(a) for a in arguments)
                return Vector((x, y, z))
            case "pos_shift", [Position() as p, Vector() as by]:
                return shift_position(p, by)
            case "pos_inv", [Position() as p]:
                return invert_frame(p)
            case _, [float(x)] if name in FUNCTIONS:
                found = apply_function(name, x)
                known = not math.isnan(found)
                return found if known else Nothing("the root of a negative number")
        why = f"it comes from {name.upper()}, known only at run time"
        return add_unknown(Nothing(why), *values)

    def _position(self, arguments: tuple[ir.Operand | None, ...]) -> Value:
        config = None
        if len(arguments) == 7:
            text = self.value(arguments[6])
            if not isinstance(text, str):
                why = "its configuration is known only at run time"
                return add_unknown(Nothing(why), self._components(arguments[:6]))
            config = text
        elif len(arguments) == 1 and self.real(arguments[0]) == 0.0:
            why = "its numbers are not written one by one"
            return Position(parts=(WrittenNumber(0.0),) * 6, derived=why)
        elif len(arguments) != 6:
            return Nothing("POS has not six numbers")
        return replace(self._components(arguments[:6]), config=config)


# Whole records, arrays and nodes: what they hold is copied part by part.

SINGLE = _POSITION_TYPES.union("integer real boolean string semaphore".split())


def copy_parts(here: Execution, value: ir.Operand, target: ir.DataObject) -> bool:
    """Let a variable hold the parts of another one; tell whether it has parts."""
    origin = bare(value)
    if origin is None:
        return False
    type_ = here.world.type_of(here.place, origin.name)
    if type_ and not (type_.array or type_.path) and type_.name in SINGLE:
        return False
    parts = parts_of(here, origin)
    place, source = here.locate(target), here.locate(origin)
    if not parts or place.component != () or source.component != ():
        return False
    if place.exact and source.exact and origin.name not in here.world.volatile:
        fill(here, place.key, target.name, origin.name, parts)
        return True
    for part in parts.values():
        here.world.pin(part, f"{origin.name} is copied, to where only the run tells")
    for key in place.keys:
        invalidate_key(here, key, f"a copy of {origin.name} is assigned")
    return True


def bare(value: ir.Operand | None) -> ir.DataObject | None:
    """Return the variable that an expression is, with or without parentheses."""
    if isinstance(value, ir.Operation) and value.operator == "()":
        (value,) = value.operands
    named = isinstance(value, ir.DataObject) and not value.name.startswith("$")
    return value if named and isinstance(value, ir.DataObject) else None


def parts_of(here: Execution, origin: ir.DataObject) -> dict[str, Value]:
    """Return what is known of the elements and fields of a variable.

    Where what they hold is not known, those count too that may be positions of the
    text, and standard fields of nodes.

    Returns:
        Values by what follows the variable's own key: ``[2]``, ``.place``.
    """
    found: dict[str, Value] = {}
    for key in sorted(here.locate(origin).keys):
        for part in parts_under(here, key):
            value = here.store.read(part)
            standard = part.rpartition(".")[2].startswith("$")  # a node's: $main_pos
            if not isinstance(value, Nothing) or value.of or standard:
                found[part[len(key) :]] = value
    return found


def parts_under(here: Execution, key: str) -> list[str]:
    """Return the keys of elements and fields that a key has or ever had."""
    world = here.world
    return world.first_parts(key) + world.later_parts(key) + here.store.parts(key)


def invalidate_key(here: Execution, key: str, why: str) -> None:
    """Forget what a key and its parts hold: any of it may still be there."""
    if key in here.store.compound or here.world.first_parts(key):
        here.world.loosen(key, why)
    here.store.forget(key, Nothing(why))


def fill(
    here: Execution, key: str, name: str, origin: str, parts: dict[str, Value]
) -> None:
    """Let a key hold parts, and nothing else."""
    why = f"{origin}, of which it is a copy, has no value for it"
    here.store.forget(key, Nothing(why))
    for suffix, value in parts.items():
        if isinstance(value, Position):
            value = set_owner(here, name, key + suffix, value)
        if isinstance(value, Nothing):
            value = add_unknown(value, here.store.read(key + suffix))
        here.store.write(key + suffix, value)


def set_owner(here: Execution, name: str, key: str, value: Position) -> Position:
    """Say which variable a literal is the value of."""
    declared = here.world.find_declaration(here.place, name)
    shared = value.shared or bool(declared and declared.exported)
    owner = value.name or here.world.spell(key)
    taught = value.taught or bool(declared and declared.taught)
    taught = taught or here.world.is_listed(owner)
    return replace(value, name=owner, shared=shared, taught=taught)
