"""What moves are carried out with: displacement, checks, singularities, sensors."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

from postproc.diagnostics import Code, Reason
from postproc.language import ir
from postproc.language.analysis.conditions import ModalState
from postproc.language.rapid.instructions import NAMES
from postproc.language.visits import OrientationLaw, Switch

NO_SHIFT = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)  # position [mm] and quaternion
UNKNOWN_SHIFT: tuple[float, ...] = ()
EMPTY_HAND = (0.0, 0.0, 0.0, 0.0)  # mass [kg] and its centre [mm]
UNKNOWN_GRIP: tuple[float, ...] = ()


@dataclass(frozen=True)
class Modes(ModalState):
    """What holds until another instruction changes it.

    Attributes:
        shift: Program displacement, position [mm] and quaternion; empty: not known.
        confl, confj: Whether confdata is checked on lines and on joint moves.
        law: How the tool turns on lines.
        arc_law: .. on arcs.
        wrist: Lines with the wrist's joints in proportion.
        override: Share of the programmed speed, NaN where not known.
        grip: What GripLoad has put into the hand: mass [kg] and its centre in the tool
            frame [mm]; empty: not known.
        pending: Modes, and values that a procedure may give them while the program
            runs ahead, until the arm has stopped.
    """

    collected = ("blocked", "pending")
    shift: tuple[float, ...] = NO_SHIFT
    confl: Switch = Switch.ON
    confj: Switch = Switch.ON
    law: OrientationLaw = OrientationLaw.ONE_AXIS
    arc_law: OrientationLaw = OrientationLaw.ALONG_PATH
    wrist: bool = False
    override: float = 1.0
    grip: tuple[float, ...] = EMPTY_HAND
    pending: frozenset[tuple[str, Any]] = frozenset()

    def allowing(self, more: frozenset[tuple[str, Any]] = frozenset()) -> Modes:
        """Allow for values that a procedure may have set, or sets later.

        Args:
            more: Those of a procedure that the arm's motion calls from here on.
        """
        pending = self.pending | more
        found = replace(self, pending=pending)
        for name, value in pending:
            found = found.join(replace(found, **{name: value}))
        return found

    def settle(self) -> Modes:
        """Return what holds where the arm has stopped: procedures have run."""
        return replace(self, pending=frozenset()) if self.pending else self

    @classmethod
    def names(cls) -> tuple[str, ...]:
        """Return the names of all modes."""
        return tuple(f.name for f in fields(cls) if f.name != "pending")

    def continue_cycle(
        self, end: Modes, names: Iterable[str], own: Container[str]
    ) -> Modes:
        """Allow for what holds where a cycle ends.

        Args:
            end: What holds there; what is unknown there does not count.
            names: Modes that go on into the next cycle.
            own: Those of them that count where they are unknown, too.
        """
        counted = {
            name: getattr(end, name)
            for name in names
            if getattr(end, name) != getattr(LOST, name) or name in own
        }
        return self.join(replace(self, **counted))

    def unknown_state(self) -> Modes:
        """Return it where nothing is known."""
        return LOST


AT_START = Modes()
LOST = Modes(
    shift=UNKNOWN_SHIFT,
    confl=Switch.UNKNOWN,
    confj=Switch.UNKNOWN,
    law=OrientationLaw.UNKNOWN,
    arc_law=OrientationLaw.UNKNOWN,
    override=0.0,
    grip=UNKNOWN_GRIP,
)

ANYTHING: frozenset[tuple[str, Any]] = frozenset(
    (name, getattr(LOST, name)) for name in Modes.names() if name != "blocked"
)
"""What a procedure may set that is not known."""

OTHERWISE = replace(LOST, wrist=True)  # differs from `AT_START` in every mode

OFFSET = Reason(Code.AXIS_OFFSET, "external axes are offset (EOffsOn, EOffsSet)")
# Instructions that let the arm go elsewhere than targets say, and those that end it.
BLOCKING = {
    "softact": ("softdeact", Reason(Code.SOFT_AXIS, "an axis is soft (SoftAct)")),
    "corrcon": (
        "corrdiscon corrclear",
        Reason(Code.SENSOR_GUIDED, "a sensor may correct the path (CorrCon)"),
    ),
    "syncmoveon": (
        "syncmoveoff",
        Reason(
            Code.COORDINATED_ARMS, "it moves together with another arm (SyncMoveOn)"
        ),
    ),
    "eoffson": ("eoffsoff", OFFSET),
    "eoffsset": ("eoffsoff", OFFSET),
    "waitwobj": (
        "dropwobj",
        Reason(Code.CONVEYOR, "the work object is on a conveyor (WaitWObj)"),
    ),
}
_ENDING = {name: why for ends, why in BLOCKING.values() for name in ends.split()}
ONE_OF_MANY = frozenset(["corrcon", "corrdiscon", "waitwobj", "dropwobj"])
"""Those of them that begin and end one of several: what they name tells which."""
HARMLESS = NAMES["harmless"]


Read = Callable[[ir.Operand | None], tuple[float, ...]]


@dataclass(frozen=True)
class RapidModeReader:
    """Carries out instructions that change how the moves after them are.

    Attributes:
        number: Evaluates a number, NaN where it is not known.
        pose, load: Evaluate a pose and a load, empty where they are not known.
    """

    number: Callable[[ir.Operand | None], float]
    pose: Read
    load: Read

    def list_set(self, one: ir.Instruction) -> frozenset[tuple[str, Any]]:
        """Return the modes that an instruction sets, whatever holds before it."""
        plain, other = (self.change(one, modes) for modes in (AT_START, OTHERWISE))
        return frozenset(
            (name, getattr(plain, name))
            for name in Modes.names()
            if getattr(plain, name) != getattr(AT_START, name)
            or getattr(other, name) != getattr(OTHERWISE, name)
        )

    def change(self, one: ir.Instruction, modes: Modes) -> Modes:
        """Carry an instruction out."""
        name = one.name
        switches = {a.name for a in one.arguments if a.name and a.value is None}
        placed = [a.value for a in one.arguments if not a.name]
        match name:
            case "confl" | "confj":
                checked = Switch.ON if switches <= {"on"} else Switch.UNKNOWN
                checked = Switch.OFF if switches == {"off"} else checked
                if name == "confl":
                    return modes.with_(confl=checked)
                return modes.with_(confj=checked)
            case "pdispoff":
                return modes.with_(shift=NO_SHIFT)
            case "pdispset":
                return modes.with_(shift=self.pose(placed[0] if placed else None))
            case "pdispon":
                return modes.with_(shift=UNKNOWN_SHIFT)
            case "singarea":
                return _singular(switches, modes)
            case "cirpathmode":
                return modes.with_(arc_law=_ARC_LAWS.get(frozenset(switches), LOST.law))
            case "velset":
                share = self.number(placed[0] if placed else None) / 100.0
                return modes.with_(override=share if 0.0 < share <= 1.0 else 0.0)
            case "speedlimaxis" | "speedlimcheckpoint":
                return modes.with_(override=0.0)
            case "gripload":
                return modes.with_(grip=self.load(placed[0] if placed else None))
        which = _which(name, placed)
        if name in BLOCKING:
            begun = _about(BLOCKING[name][1], which)
            return modes.with_(blocked=modes.blocked | {begun})
        if name in _ENDING:
            kept = {why for why in modes.blocked if not _ends(name, which, why)}
            return modes.with_(blocked=frozenset(kept))
        return modes if name in HARMLESS else replace(LOST, blocked=modes.blocked)


def _which(name: str, placed: Sequence[ir.Operand | None]) -> str:
    """Say which of several couplings an instruction begins or ends, "" for all.

    That is ``?`` where it is not known.
    """
    if name not in ONE_OF_MANY:
        return ""
    one = placed[0] if placed else None
    plain = isinstance(one, ir.DataObject) and not one.steps
    return one.name if plain and isinstance(one, ir.DataObject) else _ANY


_ANY = "?"


def _about(reason: Reason, which: str) -> Reason:
    """Say of a reason which of several couplings it is about."""
    if not which:
        return reason
    return replace(reason, text=f"{reason.text}: {which}", about=which)


def _ends(name: str, which: str, why: Reason) -> bool:
    """Return True if an instruction ends what leaves targets."""
    if why.code is not _ENDING[name].code:
        return False
    return name not in ONE_OF_MANY or why.about == which != _ANY


# Only \CirPointOri takes the tool through the orientation of the circle's point.
_ARC_LAWS = {
    frozenset[str](): OrientationLaw.ALONG_PATH,
    frozenset(["pathframe"]): OrientationLaw.ALONG_PATH,
    frozenset(["objectframe"]): OrientationLaw.ALONG_PATH,
    frozenset(["cirpointori"]): OrientationLaw.ONE_AXIS,
}


def _singular(switches: set[str], modes: Modes) -> Modes:
    laws = {"off": OrientationLaw.ONE_AXIS, "wrist": OrientationLaw.WRIST_JOINTS}
    (word,) = switches if len(switches) == 1 else ("",)
    law = laws.get(word, OrientationLaw.UNKNOWN)
    return modes.with_(law=law, wrist=word == "wrist")
