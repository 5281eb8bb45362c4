"""All files of a KRL job: what its names mean, and which data never change."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from postproc.diagnostics import Code
from postproc.language import ir
from postproc.language.analysis.assigned_points import (
    AssignedPoint,
    FunctionBody,
    NamesUsed,
    PointPart,
    Scope,
    TaskSymbols,
    is_point,
)
from postproc.language.analysis.control_flow import HeadedRows
from postproc.language.analysis.functions import ALIKE, apply_function
from postproc.language.ir import is_odd
from postproc.language.krl import syntax as said
from postproc.language.krl.abstract_state import TABLES
from postproc.language.krl.external_routines import package_routines
from postproc.language.krl.pose_encoding import (
    COMMENTS,
    COMPONENTS,
    compose_numbers,
)
from postproc.language.krl.program import KrlDatum, KrlFile, whole

CONFIG = "$config"
ANY = -1  # an entry of a table whose number is not known
POSITIONS = ("pos", "e6pos")  # types
MOVE_WORDS = frozenset(
    """
    ptp lin circ sptp slin scirc spl ptp_rel lin_rel circ_rel sptp_rel slin_rel
    scirc_rel spl_rel
    """.split()
)
"""Words that a move begins with."""
POINTS = (*POSITIONS, "axis", "e6axis", "frame")
AXES = tuple(f"a{k}" for k in range(1, 7))
OUTSIDE = tuple(f"e{k}" for k in range(1, 7))
FIELDS: Mapping[str, Collection[str]] = {
    "frame": COMPONENTS[:6],
    "pos": COMPONENTS,
    "e6pos": (*COMPONENTS, *OUTSIDE),
    "axis": AXES,
    "e6axis": (*AXES, *OUTSIDE),
}
"""Components of points by type."""
WHOLE_NUMBERS = COMPONENTS[6:]
NUMBERS = ("int", "real")
FOLLOWED = (*POINTS, *NUMBERS)  # types of data whose assignments are followed
DEEPEST = 20  # names that stand for names


@dataclass(frozen=True)
class KrlNumber:
    """A number: its value, and where it is written.

    Attributes:
        value: Its value.
        file, slot: Where it stands; slot -1 where it is computed.
    """

    value: float
    file: int = -1
    slot: int = -1


@dataclass(frozen=True)
class KrlRecord:
    """The components of an aggregate by name, those that are known.

    Attributes:
        fields: Names and values.
        whole: All that are written are known.
    """

    fields: tuple[tuple[str, KrlValue], ...]
    whole: bool = True

    def get(self, name: str) -> KrlValue | None:
        """Return a component, None where it is not there."""
        return next((value for key, value in self.fields if key == name), None)

    def number(self, name: str) -> float:
        """Return a component that is a number, NaN where it is none."""
        found = self.get(name)
        return found.value if isinstance(found, KrlNumber) else math.nan


KrlValue = KrlNumber | KrlRecord | str

# Routines and functions that do not move; of these, those that change what they get.
STILL = frozenset(
    """
    ir_stopm pulse clear_pulse cread cwrite sread swrite copen cclose cioctl cast_to
    cast_from varstate strlen strdeclen strclear stradd strcomp strcopy strfind
    msgnotify msgquit msgstate msgdialog msgloop set_kuka_msg clear_kuka_msg
    exists_kuka_msg set_krlmsg clear_krlmsg exists_krlmsg set_krldlg exists_krldlg
    mbx_rec on_error_proceed err_clear err_raise timer_limit delete_backward_buffer
    rob_timer get_decl_place m_comment setinfo lock unlock
    eki_init eki_open eki_close eki_clear eki_clearbuffer eki_checkbuffer eki_send
    eki_lock eki_unlock eki_setint eki_setreal eki_setbool eki_setstring eki_setframe
    eki_getint eki_getreal eki_getbool eki_getstring eki_getframe eki_getintarray
    eki_getrealarray eki_getboolarray eki_getframearray
    """.split()
)
WRITING = frozenset(
    """
    cread sread cast_from mbx_rec strcopy strclear stradd eki_getint eki_getreal
    eki_getbool eki_getstring eki_getframe eki_getintarray eki_getrealarray
    eki_getboolarray eki_getframearray exists_krldlg
    """.split()
)
FUNCTIONS = frozenset(
    """
    abs sqrt sin cos tan acos atan2 frand round trunc b_not inverse forward inv_pos
    strlen strdeclen strcomp strfind varstate cast_from_bits get_system_data
    stool stool2 sbase sipo_mode sload svel_cp svel_joint sacc_cp sacc_joint sapo
    sapo_ptp sori_typ scirc_typ sjerk sgear_jerk use_cm_pro_values exists_kuka_msg
    ek lk ey eb eb_abs euler mat_to_rpy rpy_to_mat scirc_m s_exax_ign s_exax_ign2
    k_root k_type k_offs lk_offs k_addr k_name k_shift sync arcgetdelay arcgetpath
    """.split()
)
KEEPING = ((STILL - WRITING) | FUNCTIONS | package_routines().keys()) | {"bas"}
"""Routines that change nothing of what they get."""


@dataclass
class KrlTask(TaskSymbols):
    """The files of a job.

    Attributes:
        files: The source first.
        taught: Lower-case names of data that were taught with the arm, by the cell.
    """

    files: Sequence[KrlFile]
    taught: Collection[str] = frozenset()
    _own: dict[tuple[str, str, str], dict[tuple[int, ...], tuple[int, KrlDatum]]] = (
        field(default_factory=lambda: defaultdict(dict))
    )
    _shared: dict[str, set[str]] = field(default_factory=lambda: defaultdict(set))

    def __post_init__(self) -> None:
        """Index data by the scopes that declare them."""
        for number, file in enumerate(self.files):
            for datum in file.data:
                place = self._own[file.name, datum.routine, datum.name]
                if datum.index in place and place[datum.index][1].value is not None:
                    if datum.value is None:
                        continue
                    datum = replace(datum, value=None)  # which of the two holds?
                place[datum.index] = number, datum
                if not datum.routine and (datum.shared or file.name == CONFIG):
                    self._shared[datum.name].add(file.name)

    # Names.

    @cached_property
    def routines(self) -> Mapping[str, list[tuple[int, HeadedRows, bool]]]:
        """Routines by name: file, place, and whether other files know each."""
        found = defaultdict(list)
        for number, file in enumerate(self.files):
            for k, scope in enumerate(() if file.is_submit else file.routines):
                shared = k == 0 or scope.head.shared
                found[scope.head.name].append((number, scope, shared))
        return found

    def routine(self, name: str, here: Scope) -> tuple[int, str, HeadedRows] | None:
        """Find the routine that a name means, None where it is not sure."""
        known = self.routines.get(name, [])
        own = [one for one in known if one[0] == here.file]
        found = own or [one for one in known if one[2]]
        if len(found) != 1:
            return None
        file, scope, _ = found[0]
        return file, self.files[file].name, scope

    def scope_of(self, file: int, module: str, routine: HeadedRows) -> Scope:
        """Return where the statements of a routine stand."""
        given = frozenset(getattr(routine.head, "parameters", ()))
        return Scope(file, module, routine.head.name, given)

    def place(self, name: str, here: Scope) -> tuple[str, str] | None:
        """Find the file and the routine whose data a name means."""
        if name in here.parameters:
            return None
        for place in ((here.module, here.routine), (here.module, "")):
            if (*place, name) in self._own:
                return place
        shared = self._shared.get(name, set())
        return (next(iter(shared)), "") if len(shared) == 1 else None

    def datum(
        self, name: str, here: Scope, index: tuple[int, ...] = ()
    ) -> tuple[int, KrlDatum] | None:
        """Find data, or an element of an array, None where it is not known."""
        place = self.place(name, here)
        return None if place is None else self._own[(*place, name)].get(index)

    def declared(
        self, place: tuple[str, str, str]
    ) -> Mapping[tuple[int, ...], tuple[int, KrlDatum]]:
        """Return data by their index: the file, the routine and the name of them."""
        return self._own.get(place, {})

    def explain_unknown(self, name: str, here: Scope) -> tuple[Code, str]:
        """Say why a name stands for no known value; the text goes behind the name."""
        code = Code.RUNTIME_VALUE
        if name in here.parameters:
            return code, "is a parameter: what is given for it is not followed"
        if self.place(name, here) is None:
            text = "is declared in none of the given files, or in several of them"
            return Code.UNDECLARED_VARIABLE, text
        if name in self.written:
            text = "may be changed by the program: it is known only when that runs"
            return code, text
        return Code.NO_VALUE, "has no value that is known before the program runs"

    @cached_property
    def written(self) -> frozenset[str]:
        """Names of data that something may change."""
        return frozenset(self.uses.written | self.uses.changed)

    def locate(self, data: ir.DataObject, row: int, here: Scope) -> PointPart | None:
        """Find the point that only assignments change, see `TaskSymbols.locate`."""
        name, steps = data.name, data.steps
        place = self.place(name, here)
        if place is None or name in self.uses.changed or name.startswith("$"):
            return None
        file, datum = self._own[(*place, name)].get((), (-1, None))
        if datum is None or datum.type not in FOLLOWED or name in self.counted:
            return None
        index: tuple[int, ...] | None = ()
        if datum.dimensions:
            index = self._find_element(file, datum, steps[:1], row, here)
            steps = steps[1:]
        component = ".".join(step for step in steps if isinstance(step, str))
        known = not component or component in FIELDS.get(datum.type, ())
        known = known and all(isinstance(step, str) for step in steps)
        return PointPart((file, *place, name), index if known else None, component)

    def _find_element(
        self, file: int, datum: KrlDatum, steps: Sequence[str | ir.ElementStep],
        row: int, here: Scope,
    ) -> tuple[int, ...] | None:  # fmt: skip
        """Return the index of an element, None where it is not known, or no element."""
        there = Scope(file, self.files[file].name, datum.routine)
        sizes = [self.number(one, datum.row, there) for one in datum.dimensions]
        found = self.index(steps[0], row, here) if steps else None
        if found is None or len(found) != len(sizes):
            return None
        inside = all(1 <= at <= n for at, n in zip(found, sizes, strict=True))
        return found if inside else None

    def evaluate_components(
        self, part: PointPart, value: ir.Operand, row: int, here: Scope
    ) -> list[tuple[str, float | None]]:
        """Return what an assignment gives to components, see `TaskSymbols`."""
        found = self.value(value, row, here)
        _, module, routine, name = part.place
        type_ = self._own[module, routine, name][()][1].type
        if part.component or type_ in NUMBERS:
            number = found.value if isinstance(found, KrlNumber) else None
            if part.component in WHOLE_NUMBERS or type_ == "int":
                number = None if number is None or whole(number) is None else number
            return [(part.component, number)]
        fields = found.fields if isinstance(found, KrlRecord) and found.whole else ()
        known = {key: one.value for key, one in fields if isinstance(one, KrlNumber)}
        return [(key, known.get(key)) for key in known or COMPONENTS[:6]]

    def open_function(
        self, call: ir.FunctionCall, row: int, here: Scope
    ) -> FunctionBody | None:
        """Return the statements of a function, see `TaskSymbols.open_function`."""
        found = self.routine(call.name, here)
        if found is None or getattr(found[2].head, "kind", "") != "deffct":
            return None
        file, module, routine = found
        names = getattr(routine.head, "parameters", ())
        if len(names) != len(call.arguments):
            return None
        given = tuple(
            (name, argument.value, row, here)
            for name, argument in zip(names, call.arguments, strict=True)
            if argument.value is not None and name not in self.written
        )
        scope = replace(self.scope_of(file, module, routine), given=given)
        text = self.files[file].text
        rows = range(routine.first + 1, routine.last)
        every = ((k, text.statement(k)) for k in rows)
        body = [(k, o) for k, o in every if not isinstance(o, said.KrlDeclaration)]
        return FunctionBody(scope, body)

    @cached_property
    def assigned(self) -> frozenset[str]:
        """Names of data that statements other than loops may change."""
        programs = (file for file in self.files if file.routines)
        said_ones = (one for file in programs for one in file.text.said)
        changed = (
            data for one in said_ones for data in list_changes(one, self.routines)
        )
        return frozenset(data.name for data in changed) | self.beside | self.odd_words

    @cached_property
    def odd_words(self) -> frozenset[str]:
        """Words of what is not understood: each may name what is set there."""
        found = set[str]()
        for file in (f for f in self.files if not f.is_submit):
            words = file.text.words(file.text.where(is_odd), MOVE_WORDS)
            found |= words if file.routines else words.difference(TABLES)
        return frozenset(found)

    @cached_property
    def _odd_reads(self) -> frozenset[str]:
        """Words of moves that are not understood: these set nothing."""
        programs = (file.text for file in self.files if not file.is_submit)
        return frozenset().union(*(one.words(one.where(is_odd)) for one in programs))

    @cached_property
    def counted(self) -> Counter[str]:
        """Names of the variables of loops, and how many loops count each."""
        found = Counter[str]()
        for file in self.files:
            rows = np.bincount(file.text.shape, minlength=len(file.text.said.shapes))
            for one, count in zip(file.text.said, rows.tolist(), strict=False):
                if isinstance(one, ir.ForLoop):
                    found[one.name] += count
        return found

    def is_global(self, name: str, here: Scope) -> bool:
        """Return True if a name means data that all programs share."""
        if name in here.parameters:
            return False
        place = self.place(name, here)
        return place is None or place[0] == CONFIG

    def is_steady(self, table: str, number: int) -> bool:
        """Return True if no statement of the files may change an entry of a table."""
        return not ({number, ANY} & self._entries_written[table])

    @cached_property
    def _entries_written(self) -> Mapping[str, frozenset[int]]:
        """Collect the entries of tables that statements may change."""
        found: dict[str, set[int]] = {table: set() for table in TABLES}
        for table in self.odd_words.intersection(TABLES):
            found[table].add(ANY)
        for number, file in enumerate(self.files):
            here = Scope(number, file.name, "")
            changing = file.text.where(
                lambda one: bool(list_changes(one, self.routines))
            )
            for row in changing:
                for target in list_changes(file.text.statement(row), self.routines):
                    given = not (file.routines or _is_of_part(target))
                    if target.name in found and not given:
                        found[target.name].add(self._entry(target, row, here))
        return {table: frozenset(numbers) for table, numbers in found.items()}

    def _entry(self, target: ir.DataObject, row: int, here: Scope) -> int:
        """Return the number of an entry, ANY where it is not known."""
        index = self.index(target.steps[0], row, here) if target.steps else None
        return index[0] if index is not None and len(index) == 1 else ANY

    def initial_switch(self, name: str) -> bool | None:
        """Return a switch that the program has not set so far, None if not known.

        A switch that no file sets is FALSE, unless a list declares it TRUE: what ran
        before may have left it so.
        """
        own = [
            datum for file in self.files for datum in file.data if datum.name == name
        ]
        values = [one.value for one in own if one.value is not None]
        off = all(is_word(value, "false") for value in values)
        return False if off and name not in self.written else None

    @cached_property
    def read(self) -> frozenset[str]:
        """Names of data that something but the destination of a move takes."""
        return frozenset(self.uses.read)

    @cached_property
    def beside(self) -> frozenset[str]:
        """Names of data that submit programs may change at any time."""
        return self._uses_beside[0]

    @cached_property
    def called_beside(self) -> frozenset[str]:
        """Names that submit programs call, and words of what is not understood."""
        return frozenset().union(*(part.find_calls for part in self._beside))

    @cached_property
    def _beside(self) -> list[_Beside]:
        """Read submit programs, and the routines at hand that they call."""
        found = [_Beside.of_file(file) for file in self.files if file.is_submit]
        waiting, seen = {name for part in found for name in part.find_calls}, set[str]()
        while waiting:
            seen.add(name := min(waiting))
            for number, scope, _ in self.routines.get(name, ()):
                found.append(_Beside.of_routine(self.files[number], scope))
                waiting |= found[-1].find_calls
            waiting -= seen
        return found

    @cached_property
    def _uses_beside(self) -> tuple[frozenset[str], frozenset[str]]:
        """Collect the names that submit programs may change, and those they take."""
        written, read = set[str](), set[str]()
        for part in self._beside:
            uses = _Uses(own=self.routines, points=self._points)
            for one in part.said:
                uses.note(one)
            written |= (uses.written | uses.changed | part.words) - part.own
            read |= uses.read - part.own
        return frozenset(written), frozenset(read)

    @cached_property
    def uses(self) -> _Uses:
        """The names that statements change and take."""
        uses = _Uses(own=self.routines, points=self._points)
        for file in (f for f in self.files if not f.is_submit):
            lists = file.routines == ()
            for one in file.text.said:
                if not (lists and isinstance(one, ir.Assignment)):
                    uses.note(one)
                    continue
                uses.take(one.value)
                if _is_of_part(one.target):
                    uses.written.add(one.target.name)
        written, read = self._uses_beside
        uses.changed |= written | self.odd_words
        uses.read |= read | written | self._odd_reads
        alone = self._alone
        uses.read |= {one for target, one in uses.copies if target not in alone}
        uses.pass_on()
        return uses

    @property
    def _alone(self) -> frozenset[str]:
        """Names of data that hold what they are given for one run of a routine alone.

        Parameters may stand for any data.
        """
        data = [one for file in self.files for one in file.data]
        kept = {one.name for one in data if not one.routine}
        for own in self.routines.values():
            for _, scope, _ in own:
                kept.update(getattr(scope.head, "parameters", ()))
        return frozenset(one.name for one in data) - kept

    @cached_property
    def _points(self) -> frozenset[str]:
        """Names of data that are positions."""
        data = (datum for file in self.files for datum in file.data)
        return frozenset(one.name for one in data if one.type in POSITIONS)

    @cached_property
    def _taught_lines(self) -> list[frozenset[int]]:
        return [COMMENTS.list_taught(file.text.source) for file in self.files]

    def is_taught(self, name: str, file: int, row: int) -> bool:
        """Tell whether data of a statement were taught, by the cell or a comment."""
        line = self.files[file].text.line(row)
        return name in self.taught or line in self._taught_lines[file]

    # Values.

    def number(self, operand: ir.Operand | None, row: int, here: Scope) -> float:
        """Evaluate a number, NaN where it is not known before the program runs."""
        found = self.value(operand, row, here)
        return found.value if isinstance(found, KrlNumber) else math.nan

    def value(
        self, operand: ir.Operand | None, row: int, here: Scope, depth: int = 0
    ) -> KrlValue | None:
        """Evaluate an operand, None where it is not known."""
        if depth > DEEPEST:
            return None
        match operand:
            case ir.Num(slot=slot):
                text = self.files[here.file].text
                at = int(text.first[row]) + slot
                value = float(text.value[at])
                return KrlNumber(value, here.file, at) if math.isfinite(value) else None
            case said.EnumValue(name=name):
                return name
            case ir.StringLiteral(text=written):
                return written
            case said.KrlAggregate(fields=fields):
                return self._aggregate(fields, row, here, depth)
            case ir.Operation(operator=operator, operands=operands):
                parts = [self.value(one, row, here, depth + 1) for one in operands]
                return _link(parts) if operator == ":" else _compute(operator, parts)
            case ir.DataObject():
                return self._data(operand, row, here, depth)
            case ir.FunctionCall(name=name, arguments=arguments):
                returned = self.find_returned(operand, row, here)
                if returned is not None:
                    return self.value(*returned, depth + 1)
                return self._apply(name, arguments, row, here)
            case _:
                return None

    def _apply(
        self, name: str, arguments: Sequence[ir.Argument], row: int, here: Scope
    ) -> KrlNumber | None:
        """Return what a function of the controller gives for a number."""
        if name in self.routines or name not in ALIKE or len(arguments) != 1:
            return None
        found = apply_function(name, self.number(arguments[0].value, row, here))
        return KrlNumber(found) if math.isfinite(found) else None

    def _aggregate(
        self, fields: Sequence[said.NamedField], row: int, here: Scope, depth: int
    ) -> KrlRecord:
        """Read components; what one is that is written twice is not known."""
        times = Counter(f.name for f in fields)
        once = [f for f in fields if times[f.name] == 1]
        pairs = [(f.name, self.value(f.value, row, here, depth + 1)) for f in once]
        known = tuple((name, value) for name, value in pairs if value is not None)
        return KrlRecord(known, len(known) == len(fields))

    def _data(
        self, data: ir.DataObject, row: int, here: Scope, depth: int
    ) -> KrlValue | None:
        """Evaluate data by name, and what the steps behind it lead to."""
        name, loops, rest = data.name, dict(here.loops), list(data.steps)
        if name in loops:
            return None if rest else KrlNumber(loops[name])
        if name in here.parameters:
            return self._read_parameter(data, here, depth)
        point = data if is_point(data) else replace(data, steps=data.steps[:-1])
        held = self.find_held(point, row, here)
        if held is not None:
            record = self.evaluate_held(held, depth + 1)
            return record if point is data else _part_of(record, rest[-1])
        index: tuple[int, ...] | None = ()
        if rest and isinstance(rest[0], ir.ElementStep):
            index = self.index(rest.pop(0), row, here)
        if index is None or name in self.written or name.startswith("$"):
            return None
        found = self.datum(name, here, index)
        if found is None or found[1].value is None:
            return None
        file, datum = found
        there = Scope(file, self.files[file].name, datum.routine)
        value = self.value(datum.value, datum.row, there, depth + 1)
        for step in rest:
            value = _part_of(value, step)
        return value

    def _read_parameter(
        self, data: ir.DataObject, here: Scope, depth: int
    ) -> KrlValue | None:
        """Evaluate a parameter, None where what is given for it is not known."""
        given = next((one for one in here.given if one[0] == data.name), None)
        if given is None or not all(isinstance(step, str) for step in data.steps):
            return None
        value = self.value(*given[1:], depth + 1)
        for step in data.steps:
            value = _part_of(value, step)
        return value

    def evaluate_held(self, held: AssignedPoint, depth: int = 0) -> KrlValue | None:
        """Evaluate what assignments gave to data, None where it is not known."""
        type_ = self._own[held.place[1:]][()][1].type
        if type_ in NUMBERS:
            return self._evaluate_number(held, type_, depth)
        base = KrlRecord((), held.operand is None)
        if held.operand is not None:
            found = self.value(held.operand, held.row, held.scope, depth)
            base = found if isinstance(found, KrlRecord) and found.whole else base
        fields, known = dict(base.fields), base.whole
        for one in held.components:
            fields.pop(one.name, None)
            if one.value is not None:
                fields[one.name] = KrlNumber(one.value)
        known = known and all(one.value is not None for one in held.components)
        return KrlRecord(tuple(fields.items()), known)

    def _evaluate_number(
        self, held: AssignedPoint, type_: str, depth: int
    ) -> KrlNumber | None:
        """Evaluate what assignments gave to a number; whole ones are rounded to."""
        if held.components:
            value = held.components[0].value
            return None if value is None else KrlNumber(value)
        found = self.value(held.operand, held.row, held.scope, depth)
        if not isinstance(found, KrlNumber):
            return None
        known = type_ == "real" or whole(found.value) is not None
        return KrlNumber(found.value) if known else None

    def index(
        self, step: ir.ElementStep | str, row: int, here: Scope
    ) -> tuple[int, ...] | None:
        """Return the index of an element, None where it is not known."""
        if isinstance(step, str):
            return None
        values = [whole(self.number(one, row, here)) for one in step.subscripts]
        known = tuple(k for k in values if k is not None)
        return known if len(known) == len(values) and known else None


def _part_of(value: KrlValue | None, step: str | ir.ElementStep) -> KrlValue | None:
    """Return a component of a value, None where it has none of that name."""
    if isinstance(step, str) and isinstance(value, KrlRecord):
        return value.get(step)
    return None


def _link(parts: Sequence[KrlValue | None]) -> KrlRecord | None:
    """Link two frames: what stands on the right tells what comes out."""
    records = [part for part in parts if isinstance(part, KrlRecord) and part.whole]
    numbers = [[one.number(name) for name in COMPONENTS[:6]] for one in records]
    if len(records) != 2 or np.isnan(numbers).any():
        return None
    place = zip(COMPONENTS[:6], compose_numbers(*numbers), strict=True)
    fields = dict(records[1].fields) | {key: KrlNumber(one) for key, one in place}
    return KrlRecord(tuple(fields.items()))


def _compute(operator: str, parts: Sequence[KrlValue | None]) -> KrlNumber | None:
    """Compute what an operator gives, None where that is no known number."""
    numbers = [part.value for part in parts if isinstance(part, KrlNumber)]
    found = math.nan
    if len(numbers) == len(parts):
        found = _result(operator, numbers)
    return KrlNumber(found) if math.isfinite(found) else None


def _result(operator: str, numbers: Sequence[float]) -> float:
    """Compute with numbers; whole ones divide otherwise than others: that is left."""
    match operator, numbers:
        case "-", [a]:
            return -a
        case "+", [a]:
            return a
        case "+", [a, b]:
            return a + b
        case "-", [a, b]:
            return a - b
        case "*", [a, b]:
            return a * b
    return math.nan


# What runs beside the program.


@dataclass(frozen=True)
class _Beside:
    """What runs in a submit program, or in a routine that one calls.

    Attributes:
        said: Its statements.
        own: Names of data that nothing else knows.
        words: Names in what is not understood: each may be set there, or called.
    """

    said: Sequence[ir.SourceStatement]
    own: frozenset[str]
    words: frozenset[str]

    @classmethod
    def of_file(cls, file: KrlFile) -> _Beside:
        """Read a submit program."""
        own = frozenset(datum.name for datum in file.data if not datum.shared)
        return cls._of_rows(file, range(len(file.text)), own)

    @classmethod
    def of_routine(cls, file: KrlFile, scope: HeadedRows) -> _Beside:
        """Read a routine."""
        own = (d.name for d in file.data if d.routine == scope.head.name)
        return cls._of_rows(file, range(scope.first + 1, scope.last), frozenset(own))

    @classmethod
    def _of_rows(cls, file: KrlFile, rows: range, own: frozenset[str]) -> _Beside:
        statements = [file.text.statement(row) for row in rows]
        words = file.text.words(file.text.where(is_odd, rows.start, rows.stop))
        return cls(statements, own, words)

    @property
    def find_calls(self) -> frozenset[str]:
        """Names of routines that it may call."""
        found = {name for one in self.said for name in list_calls(one)}
        return self.words | found


def list_calls(one: ir.SourceStatement) -> Iterator[str]:
    """Yield the names of the routines that a statement calls, also later."""
    match one:
        case said.InterruptDeclared(action=action) | said.PathTrigger(action=action):
            yield from list_calls(action)
        case ir.Instruction(name=name):
            yield name
    for part in ir.walk(*operands_of(one)):
        if isinstance(part, ir.FunctionCall):
            yield part.name


# What statements take and change.


@dataclass
class _Uses(NamesUsed):
    """Names that statements may change, and those that they take.

    Attributes:
        own: Names of the routines of the job.
        points: Names of positions.
    """

    own: Collection[str] = field(kw_only=True)
    points: Collection[str] = field(kw_only=True)

    def note(self, one: ir.SourceStatement) -> None:
        """Note what a statement takes and changes."""
        match one:
            case ir.Assignment(target=target, value=value):
                self.written.add(target.name)
                self._subscripts(target)
                self._note_assignment(target, value)
            case ir.ForLoop(name=name):
                self.changed.add(name)
            case ir.Instruction(name=name, arguments=arguments):
                self._call(name, arguments)
            case said.KrlMove(word=word, to=to, via=via, settings=settings):
                note = self.take if word.endswith("_rel") else self._destination
                for end in (to, via):
                    note(end)
                for setting in settings:
                    self.take(setting.value)
            case (
                said.InterruptDeclared(action=action) | said.PathTrigger(action=action)
            ):
                self.note(action)
        if not isinstance(one, ir.Assignment | said.KrlMove | ir.Instruction):
            for operand in operands_of(one):
                self.take(operand)

    def _note_assignment(self, target: ir.DataObject, value: ir.Operand) -> None:
        """Note what an assignment takes: a point that moves go to by another name."""
        if isinstance(value, ir.DataObject) and is_point(value) and is_point(target):
            self.copies.add((target.name, value.name))
            self._subscripts(value)
        else:
            self.take(value)

    def take(self, operand: ir.Operand | None) -> None:
        """Note what an operand takes, and what its functions may change."""
        match operand:
            case ir.DataObject(name=name):
                self.read.add(name)
                self._subscripts(operand)
            case ir.FunctionCall(name=name, arguments=arguments):
                self._call(name, arguments)
            case ir.Operation(operands=operands):
                for one in operands:
                    self.take(one)
            case said.KrlAggregate(fields=fields):
                for part in fields:
                    self.take(part.value)

    def _subscripts(self, target: ir.DataObject) -> None:
        for step in target.steps:
            if isinstance(step, ir.ElementStep):
                for one in step.subscripts:
                    self.take(one)

    def _call(self, name: str, arguments: Sequence[ir.Argument]) -> None:
        """Note arguments: a routine may change them, unless it is known not to."""
        changed = _list_changed_arguments(name, arguments, self.own)
        self.changed |= {one.name for one in changed}
        for argument in arguments:
            self.take(argument.value)

    def _destination(self, operand: ir.Operand | None) -> None:
        """Note what a destination takes besides the point itself."""
        match operand:
            case ir.DataObject():
                self._subscripts(operand)
            case ir.Operation(operator=":", operands=(first, second)):
                behind = isinstance(first, ir.DataObject) and first.name in self.points
                point, shift = (first, second) if behind else (second, first)
                self._destination(point)
                self.take(shift)
            case _:
                self.take(operand)


def list_changes(
    one: ir.SourceStatement, own: Collection[str] = ()
) -> Iterator[ir.DataObject]:
    """Yield data that a statement may change, also what it does later.

    Args:
        one: The statement.
        own: Names of the routines of the job.
    """
    match one:
        case said.InterruptDeclared(action=action) | said.PathTrigger(action=action):
            yield from list_changes(action, own)
        case ir.Assignment(target=target):
            yield target
        case ir.Instruction(name=name, arguments=arguments):
            yield from _list_changed_arguments(name, arguments, own)
    for part in ir.walk(*operands_of(one)):
        if isinstance(part, ir.FunctionCall):
            yield from _list_changed_arguments(part.name, part.arguments, own)


def _list_changed_arguments(
    name: str, arguments: Sequence[ir.Argument], own: Collection[str]
) -> Iterator[ir.DataObject]:
    """Yield the arguments that a routine may change: all, unless it is known."""
    if name in KEEPING and name not in own:
        return
    for argument in arguments:
        if isinstance(argument.value, ir.DataObject):
            yield argument.value


def _is_of_part(target: ir.DataObject) -> bool:
    """Return True if a component is meant: a list that sets one is not followed."""
    return any(isinstance(step, str) for step in target.steps)


def is_word(operand: ir.Operand | None, word: str) -> bool:
    """Return True if an operand is a word such as TRUE."""
    return operand == ir.DataObject(word)


def operands_of(one: ir.SourceStatement) -> Sequence[ir.Operand | None]:
    """Return the values that a statement takes."""
    match one:
        case said.KrlDeclaration(items=items):
            return [item.value for item in items]
        case ir.Assignment(target=target, value=value):
            return [target, value]
        case ir.Branch(values=values):
            return values
        case ir.ForLoop(first=first, last=last, step=step):
            return [first, last, step]
        case ir.Leave(value=value) | said.Waiting(value=value):
            return [value]
        case ir.Instruction(arguments=arguments):
            return [argument.value for argument in arguments]
        case said.KrlMove(to=to, via=via, angle=angle, settings=settings):
            return [to, via, angle, *(one.value for one in settings)]
        case said.SplineBlock(settings=settings):
            return [one.value for one in settings]
        case said.PathTrigger(values=values):
            return values
        case _:
            return []
