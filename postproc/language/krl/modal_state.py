"""What moves are carried out with: frames, speeds, blending, orientation."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

from postproc.diagnostics import Code, Reason
from postproc.language import ir
from postproc.language.analysis.assigned_points import Scope
from postproc.language.analysis.conditions import ModalState, TaskFrame
from postproc.language.analysis.symbols import whole
from postproc.language.analysis.values import KnownRecord, without_places
from postproc.language.krl import symbols
from postproc.language.krl import syntax as said
from postproc.language.krl.frames import (
    NUMBERS,
    ZERO,
    FrameReader,
    no_frame,
    set_component,
)
from postproc.language.krl.symbols import KrlTask, is_word
from postproc.language.visits import OrientationLaw
from postproc.robot.pose import MM

UNKNOWN = -1.0  # a number that is not known
CELL_LOAD: tuple[float, ...] = ()
LOST_LOAD: tuple[float, ...] = (-1.0,)
LOST_FRAME = no_frame(
    "$TOOL and $BASE are not known here: set them after the statement that is not "
    "followed, or in every branch that leads here"
)


@dataclass(frozen=True)
class KrlModes(ModalState):
    """What holds until another statement changes it.

    Attributes:
        tool, base: ``$TOOL`` and ``$BASE``.
        interpolation: ``$IPO_MODE``: #base, #tcp or "" where not known.
        speed: ``$VEL.CP`` [m/s].
        share: Of the speed of joints, by ``$VEL_AXIS``.
        distance: ``$APO.CDIS`` [mm].
        overlap: ``$APO.CPTP`` [%].
        orientation: ``$ORI_TYPE``: #var, #constant, #joint or "" where not known.
        circle: ``$CIRC_TYPE``: #base, #path or "" where not known.
        through: Arcs of the spline planner take the tool through the orientation of
            their points (``$CIRC_MODE``).
        ahead: ``$ADVANCE`` is not 0; None where that is not known.
        halted: The arm has stopped since the last move; None where that is not known.
        goes_on: ``CONTINUE`` stands before.
        load: What the arm carries, as the program states it: mass [kg], and its centre
            in the flange frame [m] where that is known; `CELL_LOAD` where it states
            nothing, `LOST_LOAD` where what it states is not known.
        store: What the program has set of tables, corrections and switches, and of
            ``FDAT_ACT``, ``PDAT_ACT`` and ``LDAT_ACT``.
        perhaps: The next statement is skipped where an error comes up in it.
        declared: Interrupts that may move the arm or end its moves, by number, and why
            targets are left while one of them is on.
        active: Those of them that may be on.
    """

    collected = ("declared", "active", "blocked")
    tool: TaskFrame
    base: TaskFrame
    interpolation: str = "#base"
    speed: float = UNKNOWN
    share: float = UNKNOWN
    distance: float = UNKNOWN
    overlap: float = UNKNOWN
    orientation: str = "#var"
    circle: str = ""
    through: bool = False
    ahead: bool | None = True
    halted: bool | None = False
    goes_on: bool = False
    load: tuple[float, ...] = CELL_LOAD
    store: Mapping[str, object] = field(default_factory=dict)
    perhaps: bool = False
    declared: frozenset[tuple[int, Reason]] = frozenset()
    active: frozenset[tuple[int, Reason]] = frozenset()

    def __hash__(self) -> int:
        """Allow to look modes up by what inline forms set of them."""
        held = frozenset(self.store.items())
        return hash((self.speed, self.share, self.distance, self.overlap, held))

    def unknown_state(self) -> KrlModes:
        """Return it where nothing is known."""
        return LOST

    def join(self, other: KrlModes) -> KrlModes:
        """Keep what is the same on another way here."""
        both = {k: v for k, v in self.store.items() if other.store.get(k) == v}
        return replace(super().join(other), store=both)

    def hold(self, name: str, value: object | None) -> KrlModes:
        """Return it with what the program sets a name to; None forgets it."""
        if self.store.get(name) is value:
            return self
        store = {k: v for k, v in self.store.items() if k != name}
        return replace(self, store=store if value is None else store | {name: value})

    def record(self, name: str) -> KnownRecord:
        """Return the components that the program has set a name to, as far as known."""
        held = self.store.get(name)
        return held if isinstance(held, KnownRecord) else KnownRecord((), whole=False)

    def drop(self, name: str) -> KrlModes:
        """Forget what the program has set a name, or any entry of a table, to."""
        lost = [k for k in self.store if k.partition("[")[0] == name]
        kept = {k: v for k, v in self.store.items() if k not in lost}
        return replace(self, store=kept) if lost else self

    def beside(self, task: KrlTask) -> KrlModes:
        """Return it where submit programs may change what they set at any time."""
        changed, why = _find_unsettled(task.beside, task.called_beside)
        if not (changed or why):
            return self
        return replace(self, **changed, blocked=self.blocked | why)

    @property
    def law(self) -> OrientationLaw:
        """Return how the tool turns on lines."""
        return _LAWS.get(self.orientation, OrientationLaw.UNKNOWN)


LOST = KrlModes(
    tool=LOST_FRAME,
    base=LOST_FRAME,
    interpolation="",
    orientation="",
    ahead=None,
    halted=None,
    load=LOST_LOAD,
)
_LAWS = {
    "#var": OrientationLaw.ONE_AXIS,
    "#constant": OrientationLaw.ONE_AXIS,  # the end is not what is written: see collect
    "#joint": OrientationLaw.WRIST_JOINTS,
}
_BOOLS = ("true", "false")
_SWITCHED_OFF: Sequence[tuple[str, object]] = (
    *((name, False) for name in sorted(symbols.SWITCHES)),
    *((name, ZERO) for name in sorted(symbols.CORRECTION_FRAMES)),
)
_KEPT_ON = "tool_corr_on"  # old controllers take the frame back, but not the switch
BAS_HARMLESS = frozenset("#acc_ptp #acc_cp #acc_glue #out_sync #out_async".split())
"""Commands of BAS that change neither frames nor blending nor speed."""
UNKNOWN_LOAD = Reason(
    Code.LOAD_UNKNOWN,
    "which $LOAD holds here is not known: set it again on every way here",
)
SOFT = Reason(Code.SOFT_AXIS, "an axis is soft ($SOFT_PLCL)")
GENERATOR = Reason(
    Code.SETTING_UNTRACKED, "a function generator ($TECH) moves the tool off its path"
)
AXIS_LOAD = Reason(
    Code.SETTING_UNTRACKED, "the program sets a load on an axis ($LOAD_A1 to $LOAD_A3)"
)
IGNORED = Reason(
    Code.EXTERNAL_AXES, "the track need not go where targets say ($EX_AX_IGNORE)"
)
MOVED_BASE = Reason(Code.SETTING_UNTRACKED, "$ROBROOT or $WORLD is set by the program")
_BLOCKING = {
    "$soft_plcl": SOFT, "$softn": SOFT, "$tech": GENERATOR, "$tech_c": GENERATOR,
    "$load_a1": AXIS_LOAD, "$load_a2": AXIS_LOAD, "$load_a3": AXIS_LOAD,
    "$robroot": MOVED_BASE, "$world": MOVED_BASE,
}  # fmt: skip
"""Variables behind whose assignment no target can be compensated, and why."""
_WORDS = {
    "$ipo_mode": ("interpolation", "ipo_frame"),
    "$ori_type": ("orientation", "ori_typ"),
    "$circ_type": ("circle", "circ_typ"),
}
"""Variables that are set to words: modes, and components of data with such a word."""
_PARTS: Mapping[str, Mapping[str, str]] = {
    "$vel": {"cp": "speed"}, "$apo": {"cdis": "distance", "cptp": "overlap"},
}  # fmt: skip
"""Variables that are set to numbers: components, and the modes that they are."""
PLANNED, _SETTING = said.NAMES["planned"], said.NAMES["setting"]
HALTING = frozenset("$out $anout $in $anin $pos_act $axis_act $axis_act_meas".split())
HARMLESS = said.NAMES["harmless"]


SUBMIT = "a submit program may set {} at any time"
_TRACK_BESIDE = Reason(Code.BESIDE_PROGRAM, "a submit program may move external axes")
_SENSOR_BESIDE = Reason(
    Code.BESIDE_PROGRAM, "a submit program may switch on a sensor that moves the arm"
)
OF_TRACK = frozenset([IGNORED, _TRACK_BESIDE])
"""Reasons that count where the cell has a track."""
_ASYNCHRONOUS = frozenset("asyptp asycont asycancel asystop".split())
_BAS_SETS = frozenset(["$tool", "$base"])  # without them nothing else counts
_FIELDS: Mapping[str, Mapping[str, Any]] = {
    "$tool": {"tool": no_frame(SUBMIT.format("$TOOL"), Code.BESIDE_PROGRAM)},
    "$base": {"base": no_frame(SUBMIT.format("$BASE"), Code.BESIDE_PROGRAM)},
    "$vel": {"speed": UNKNOWN},
    "$vel_axis": {"share": UNKNOWN},
    "$apo": {"distance": UNKNOWN, "overlap": UNKNOWN},
    "$circ_type": {"circle": ""},
    "$advance": {"ahead": None},
}
"""What is not known of modes where something beside the program sets a variable."""


@cache
def _find_unsettled(
    written: frozenset[str], called: frozenset[str]
) -> tuple[Mapping[str, Any], frozenset[Reason]]:
    """Return the modes that submit programs unsettle, and why targets are left.

    Args:
        written: Names of data that they may change.
        called: Names that they call.
    """
    if "bas" in called:
        written |= _BAS_SETS
    changed, why = dict[str, Any](), set[Reason]()
    for name in sorted(n for n in written if n.startswith("$")):
        if name in _FIELDS:
            changed |= _FIELDS[name]
        elif name == "$ex_ax_ignore":
            why.add(IGNORED)
        elif name in _SETTING or name not in PLANNED | HALTING | HARMLESS:
            text = SUBMIT.format(name.upper())
            why.add(Reason(Code.BESIDE_PROGRAM, text))
    why |= {_TRACK_BESIDE} if called & _ASYNCHRONOUS else set()
    senses = any(n.startswith("rsi_") or n == "touchsense" for n in called)
    return changed, frozenset(why | ({_SENSOR_BESIDE} if senses else set()))


@dataclass(frozen=True)
class ModeReader:
    """Carries out what changes how the moves after it are made.

    Attributes:
        task: The files of the job.
        here: Where the statement stands.
    """

    task: KrlTask
    here: Scope

    def assign(self, modes: KrlModes, one: ir.Assignment) -> KrlModes | None:
        """Carry out ``$name = value``, None where nobody knows what that does."""
        found = self._assign(modes, one)
        return None if found is None else found.beside(self.task)

    def _assign(self, modes: KrlModes, one: ir.Assignment) -> KrlModes | None:
        """Carry an assignment out where nothing runs beside the program."""
        called = [call.name for call in ir.calls_in(one.value)]
        own = next((name for name in called if name in self.task.routines), "")
        if own:  # it gives a value, and is not followed
            one = replace(one, value=ir.FunctionCall(f"{own} of the files", ()))
        name, value = one.target.name, one.value
        match name:
            case "$tool" | "$base":
                return self._frame(modes, one)
            case _ if name in _WORDS:
                field_, component = _WORDS[name]
                return modes.with_(**{field_: self._word(value, component)})
            case _ if name in _BLOCKING:
                return modes.with_(blocked=modes.blocked | {_BLOCKING[name]})
            case "$circ_mode":
                return modes.with_(through=self._goes_through(one))
            case "$vel" | "$vel_axis" | "$apo":
                return self._speed(modes, one)
            case "$advance":
                number = self._number(value)
                ahead = None if math.isnan(number) else number > 0
                return modes.with_(ahead=ahead)
            case "$load":
                return self._load(modes, one)
            case "$ex_ax_ignore":
                off = self._number(value) == 0.0
                rest = modes.blocked - {IGNORED}
                return modes.with_(blocked=rest if off else rest | {IGNORED})
            case _ if name in symbols.TABLES:
                return self._entry(modes, one)
            case "fdat_act" | "pdat_act" | "ldat_act":
                return self._hold(modes, one)
            case _ if name in symbols.HELD:
                return self._hold(modes, one)
        known = not name.startswith("$") or name in PLANNED | HALTING | HARMLESS
        return modes if known else None

    def _frame(self, modes: KrlModes, one: ir.Assignment) -> KrlModes:
        """``$TOOL = ..``, ``$BASE = ..``, or a component of them."""
        which = one.target.name[1:]
        if one.target.steps:
            new = self._component(getattr(modes, which), one.target.steps, one.value)
            if isinstance(new, TaskFrame):
                return modes.with_(**{which: new})
            why = f"a component of {one.target.name.upper()} is set by the program"
            return modes.with_(**{which: no_frame(why)})
        found = self.frames(modes).frame(one.value)
        return modes.with_(**{which: found})

    def frames(self, modes: KrlModes) -> FrameReader:
        """Return what reads frames here."""
        return FrameReader(self.task, self.here, modes.tool, modes.base, modes.store)

    def _entry(self, modes: KrlModes, one: ir.Assignment) -> KrlModes:
        """``BASE_DATA[20] = {..}``: known where the entry and all of it are known."""
        table, index = one.target.name, None
        if one.target.steps:
            index = self.task.index(one.target.steps[0], self.here)
        if index is None or len(index) != 1:
            return modes.drop(table)
        key, parts = symbols.entry_name(table, index[0]), one.target.steps[1:]
        value: object | None = None
        if not self.task.is_global(table, self.here):
            return modes.hold(key, value)
        if table == "load_data":
            load = LOST_LOAD if parts else load_of(self._record(one.value))
            value = None if load == LOST_LOAD else load
        elif parts:
            value = self._component(modes.store.get(key), parts, one.value)
        else:
            found = self.frames(modes).frame(one.value)
            value = None if found.why or not found.pose else found
        if isinstance(value, TaskFrame) and table in self.task.start.taught:
            value = replace(value, taught=True)
        return modes.hold(key, value)

    def _component(
        self, held: object, parts: Sequence[str | ir.ElementStep], value: ir.Operand
    ) -> TaskFrame | KnownRecord | None:
        """Set a component of a frame, None where what it then is is not known."""
        if len(parts) != 1 or not isinstance(parts[0], str):
            return None
        return set_component(held, parts[0], self._number(value))

    def _hold(self, modes: KrlModes, one: ir.Assignment) -> KrlModes:
        """``M_BASE_CORR = {..}``, ``M_BAS_COR_ON = TRUE``, ``FDAT_ACT = FP1``.

        Where a component of ``FDAT_ACT`` is set, the others are not known.
        """
        name = one.target.name
        value: object | None = None
        if one.target.steps or not self.task.is_global(name, self.here):
            return modes.hold(name, None)
        if name in symbols.SWITCHES:
            value = next((w == "true" for w in _BOOLS if is_word(one.value, w)), None)
        elif name in symbols.HELD:
            found = self.frames(modes).frame(one.value)
            value = None if found.why else found
        elif name not in self.task.beside:  # which of the forms' data it is counts not
            value = without_places(self.task.value(one.value, self.here))
        return modes.hold(name, value)

    def _number(self, operand: ir.Operand | None) -> float:
        return self.task.number(operand, self.here)

    def _argument(self, operand: ir.Operand) -> ir.Operand | None:
        """Return the first argument of a function, None where it is not there."""
        given = operand.arguments if isinstance(operand, ir.FunctionCall) else ()
        return given[0].value if given else None

    def _record(self, operand: ir.Operand | None) -> KnownRecord:
        found = self.task.value(operand, self.here)
        return found if isinstance(found, KnownRecord) else KnownRecord((), whole=False)

    def _word(self, operand: ir.Operand, field: str) -> str:
        """Read ``#BASE``, or what ``SIPO_MODE(FP1.IPO_FRAME)`` gives, "" if unknown."""
        found = self.task.value(operand, self.here)
        if isinstance(operand, ir.FunctionCall):
            inside = self._argument(operand)
            found = self.task.value(inside, self.here)
            if isinstance(found, KnownRecord):
                found = found.get(field)
        return found.lower() if isinstance(found, str) else ""

    def _goes_through(self, one: ir.Assignment) -> bool:
        """Tell whether both points of an arc have the orientation that they say."""
        found = self._record(one.value)
        if one.target.steps:
            return False
        ways = [found.get(name) for name in ("aux_pt", "target_pt")]
        return all(
            isinstance(way, KnownRecord) and way.get("ori") == "#interpolate"
            for way in ways
        )

    def _speed(self, modes: KrlModes, one: ir.Assignment) -> KrlModes:
        """``$VEL.CP``, ``$VEL_AXIS[i]``, ``$APO.CDIS``, all of ``$VEL`` or ``$APO``."""
        name, value, step = one.target.name, one.value, (*one.target.steps, "")[0]
        given, parts = self._argument(value), _PARTS.get(name, {})
        found = dict[str, float]()
        if name == "$vel_axis":
            if isinstance(step, ir.ElementStep):
                percent = self._number(value if given is None else given)
                return modes.with_(share=_share(percent))
        elif step in parts:
            found = {str(step): self._number(value)}
        elif step == "" and not isinstance(value, ir.FunctionCall):
            record = self._record(value)
            found = {part: record.number(part) for part in parts}
        elif step == "" and name == "$vel":  # SVEL_CP(2, , LCPDAT1)
            found = {"cp": self._number(given)}
        elif step == "":  # SAPO(LCPDAT1), SAPO_PTP(PPDAT1)
            found = {"cdis": self._record(given).number("apo_dist")}
        changed = {parts[part]: number_or_unknown(x) for part, x in found.items()}
        return modes.with_(**changed)

    def _load(self, modes: KrlModes, one: ir.Assignment) -> KrlModes:
        """``$LOAD = LOAD_DATA[n]``, ``$LOAD = SLOAD(n)``, ``$LOAD.M = 50``."""
        operand: ir.Operand | None = one.value
        match one.target.steps, operand:
            case ("m",), _:
                mass, centre = self._number(operand), modes.load[1:]
                return modes.with_(load=_load_of(mass, centre))
            case ("cm",), _:
                centre = _centre_of(self._record(operand))
                known = centre and modes.load and modes.load != LOST_LOAD
                load = (modes.load[0], *centre) if known else LOST_LOAD
                return modes.with_(load=load)
            case ("cm", *_), _:
                return modes.with_(load=LOST_LOAD)
            case (), ir.FunctionCall(name="sload"):
                return self.take_load(modes, self._number(self._argument(operand)))
            case (), ir.DataObject(name="load_data", steps=(ir.ElementStep() as step,)):
                index = self.task.index(step, self.here) or (math.nan,)
                return self.take_load(modes, index[0])
            case (), _:
                return modes.with_(load=load_of(self._record(operand)))
        return modes

    def take_load(self, modes: KrlModes, number: float) -> KrlModes:
        """Take the load of a tool's number, as BAS and SLOAD do."""
        entry = whole(number)
        if entry is None:
            return modes.with_(load=LOST_LOAD)
        held = modes.store.get(symbols.entry_name("load_data", entry))
        if isinstance(held, tuple) and "load_data" not in self.task.beside:
            return modes.with_(load=held)
        if not self.task.is_steady("load_data", (entry,)):
            return modes.with_(load=LOST_LOAD)
        if entry <= 0 or self.task.datum("load_data", self.here, (entry,)) is None:
            return modes.with_(load=CELL_LOAD)
        value = self.task.entry("load_data", entry, self.here)
        load = load_of(value) if isinstance(value, KnownRecord) else LOST_LOAD
        return modes.with_(load=load)

    # BAS(#command, value), as the controller's bas.src carries it out.

    def bas(self, modes: KrlModes, arguments: Sequence[ir.Argument]) -> KrlModes:
        """Carry out ``BAS(#command, value)``."""
        return self._bas(modes, arguments).beside(self.task)

    def _bas(self, modes: KrlModes, arguments: Sequence[ir.Argument]) -> KrlModes:
        """Carry a command out where nothing runs beside the program."""
        command = arguments[0].value if arguments else None
        word = command.name if isinstance(command, said.EnumValue) else ""
        value = self._number(arguments[1].value) if len(arguments) > 1 else math.nan
        match word:
            case "#initmov":
                return self._initial(modes)
            case "#frames":
                return self._frames(modes)
            case "#tool" | "#base":
                name = f"${word[1:]}"
                found = self.frames(modes).read_numbered(name, value)
                modes = self.take_load(modes, value) if word == "#tool" else modes
                return modes.with_(**{word[1:]: found})
            case "#vel_ptp":
                return modes.with_(share=_share(value))
            case "#vel_cp":
                return modes.with_(speed=number_or_unknown(value))
            case "#ptp_dat":
                return self._joint_data(modes)
            case "#cp_dat":
                return self._path_data(modes)
            case "#ptp_params":
                changed = self._frames(self._joint_data(modes))
                return changed.with_(share=_share(value))
            case "#cp_params":
                changed = self._frames(self._path_data(modes))
                return changed.with_(speed=number_or_unknown(value))
        return modes if word in BAS_HARMLESS else modes.forget()

    def _initial(self, modes: KrlModes) -> KrlModes:
        """Set what ``INITMOV`` of ``bas.src`` sets: no base, the first tool, no links.

        Speeds and distances are those of ``$config.dat``. The load stays what it is.
        """
        linked = modes.store.get(_KEPT_ON) in (True, symbols.PERHAPS)
        for name, value in _SWITCHED_OFF:
            modes = modes.hold(name, value)
        modes = modes.hold(_KEPT_ON, symbols.PERHAPS) if linked else modes
        reader = self.frames(modes)

        def number(name: str) -> float:
            return self._number(ir.DataObject(name))

        advance = number("def_advance")
        return modes.with_(
            tool=reader.entry("tool_data", 1),
            base=reader.read_numbered("$base", 0),
            interpolation="#base",
            speed=UNKNOWN,
            share=_share(number("def_vel_ptp")),
            distance=number_or_unknown(number("def_apo_cdis")),
            overlap=number_or_unknown(number("def_apo_cptp")),
            orientation="#var",
            circle=self._default_circle,
            through=False,
            ahead=math.isnan(advance) or advance > 0,
        )

    @property
    def _default_circle(self) -> str:
        """Return ``DEF_CIRC_TYP`` of ``$config.dat``, "" where it is not known."""
        return self._word(ir.DataObject("def_circ_typ"), "")

    def _frames(self, modes: KrlModes) -> KrlModes:
        """Take the frames of FDAT_ACT, and the load of its tool."""
        held, reader = modes.record("fdat_act"), self.frames(modes)
        found = {
            name[1:]: reader.read_numbered(name, held.number(field))
            for name, field in NUMBERS.items()
        }
        word = held.get("ipo_frame")
        modes = self.take_load(modes, held.number("tool_no"))
        frame = word if isinstance(word, str) else ""
        if frame != "#base":
            found = {name: replace(one, remote=True) for name, one in found.items()}
        return modes.with_(interpolation=frame, **found)

    def _joint_data(self, modes: KrlModes) -> KrlModes:
        """Take the blending of PDAT_ACT."""
        held = modes.record("pdat_act")
        size = number_or_unknown(held.number("apo_dist"))
        if held.get("apo_mode") == "#cdis":
            return modes.with_(distance=size, overlap=UNKNOWN)
        return modes.with_(overlap=size)

    def _path_data(self, modes: KrlModes) -> KrlModes:
        """Take blending and orientation of LDAT_ACT."""
        held = modes.record("ldat_act")
        word, circle = held.get("ori_typ"), held.get("circ_typ")
        if held.whole and circle is None:  # which may be left out
            circle = self._default_circle
        return modes.with_(
            distance=number_or_unknown(held.number("apo_dist")),
            orientation=word if isinstance(word, str) else "",
            circle=circle if isinstance(circle, str) else "",
        )


def load_of(record: KnownRecord) -> tuple[float, ...]:
    """Return the load that a record states, see `KrlModes.load`."""
    centre = record.get("cm")
    known = _centre_of(centre) if isinstance(centre, KnownRecord) else ()
    return _load_of(record.number("m"), known)


def _load_of(mass: float, centre: tuple[float, ...]) -> tuple[float, ...]:
    """Return a load; a negative mass states none, and stands for the arm's default."""
    if math.isnan(mass):
        return LOST_LOAD
    return (mass, *centre) if mass >= 0 else CELL_LOAD


def _centre_of(record: KnownRecord) -> tuple[float, ...]:
    """Return a centre of mass [m], () where it is not known."""
    found = tuple(record.number(name) * MM for name in ("x", "y", "z"))
    return () if any(map(math.isnan, found)) else found


def number_or_unknown(value: float) -> float:
    """Return a number from 0 on, -1 for what is not known."""
    return value if value >= 0 else UNKNOWN


def _share(percent: float) -> float:
    return percent / 100.0 if percent > 0 else UNKNOWN
