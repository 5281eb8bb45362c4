"""Programs drawn at random, within reach of the arm of the tests."""

from __future__ import annotations

import random
from collections.abc import Callable

import numpy as np
from scipy.spatial.transform import Rotation

from tests.generated.neutral.text import SHIFTS
from tests.generated.neutral.traits import Traits
from tests.generated.neutral.tree import (
    Ask,
    Assign,
    Body,
    Both,
    Call,
    Cond,
    Count,
    Displace,
    Element,
    Expr,
    For,
    Foreign,
    Function,
    If,
    Inline,
    Less,
    Lift,
    Loop,
    Made,
    MayFail,
    Move,
    Named,
    Not,
    Note,
    Output,
    Place,
    Point,
    Poll,
    Program,
    Read,
    Return,
    Routine,
    SetBase,
    SetElement,
    SetLoad,
    SetPart,
    SetPoint,
    SetSpeed,
    SetTool,
    SetZone,
    Shifted,
    Signal,
    Skip,
    Statement,
    Sum,
    Switch,
    Var,
    Wait,
)

MIDDLE = np.deg2rad([-20.0, 15.0, -100.0, 25.0, 58.0, 25.0])
OPENING = (np.deg2rad(26.0), np.deg2rad(13.0))  # all joints turn one way to the middle
DEPTH = 2
# Of each program half of these are drawn, so that one does not hide what another does.
FEATURES = (
    "arc", "call", "displace", "element", "fail", "frames", "given", "handler",
    "forms", "inline", "interrupt", "late", "lift", "load", "loop", "made", "meddle",
    "modal", "modules", "note", "offset", "parts", "poll", "repair", "rows", "shared",
    "shift", "step", "tool", "trigger", "variable", "zone",
)  # fmt: skip
FOREIGN = "foreign"  # in every fifth program: little is known behind it
TOOLS, BASES, LOADS = 2, 3, 2
ROW = 3  # points of a variable array
ENTRY = "job"


class Draw:
    """Draws one program for a language, or for all of them."""

    def __init__(self, seed: int, language: Traits) -> None:
        self.rng = random.Random(f"{language.name}:{seed}")
        self.language = language
        self.made = Program()
        drawn = {name for name in FEATURES if self.rng.random() < 0.5}
        drawn |= {FOREIGN} if seed % 5 == 4 else set()
        self.features = drawn - language.lacks
        self.marks = 0
        self.shifts = 0
        self.inputs = seed % 2 == 1
        self.own: tuple[str, ...] = ()
        self.given: tuple[str, ...] = ()  # points that are arguments
        self.file = 0
        self.callable: list[Routine] = []
        self.loops = 0

    def has(self, name: str) -> bool:
        """Tell whether something is drawn in this program."""
        return name in self.features

    def can(self, name: str) -> bool:
        """Tell whether the language has words for something."""
        return name not in self.language.lacks

    def program(self) -> Program:
        """Draw a program."""
        made, rng = self.made, self.rng
        self._data()
        self._functions()
        for number in range(rng.randint(1, 3), 0, -1):
            self.callable.append(self._routine(number))
        self.own, self.given, self.file = (), (), 0
        handler = self._handler()
        body = (*self._opening(), *self._body(rng.randint(6, 14), 0))
        main = Routine(ENTRY, (), body, ("m1",), handler, self._repair(handler))
        made.routines = [main, *reversed(self.callable)]
        made.ends = not self.can("again") or rng.random() < 0.6
        made.interrupts = self.has("interrupt")
        if self.inputs and made.interrupts and self.has("meddle"):
            made.interrupt = (self._change(),)
        made.shared = self.has("shared") or any(r.file for r in self.callable)
        return made

    # Data.

    def _data(self) -> None:
        made, rng = self.made, self.rng
        made.plain = self.can("splines") and rng.random() < 0.5
        if made.plain and not self.can("plain forms"):
            self.features.discard("forms")
        middle = Rotation.from_euler("ZYZ", [170.0, 60.0, -179.0], True).as_matrix()
        for k in range(TOOLS):
            tool = np.eye(4)
            turn = Rotation.from_euler("XYZ", [2.0 * k, 0.0, 1.0 * k], True).as_matrix()
            tool[:3, :3] = middle @ turn
            tool[:3, 3] = [0.08 + 0.01 * k, -0.04, 0.15 + 0.02 * k]
            made.tools.append(np.round(tool, 12))
        for _ in range(BASES):
            base = np.eye(4)
            turned = [rng.uniform(-2.0, 2.0) for _ in range(3)]
            base[:3, :3] = Rotation.from_euler("ZYX", turned, True).as_matrix()
            mm = [1600.0, -300.0, 900.0]
            base[:3, 3] = [round(x + rng.uniform(-25, 25), 3) / 1000 for x in mm]
            made.bases.append(base)
        made.fixed = rng.random() < 0.5
        made.tool_loads = [rng.choice([0.001, 0.001, 12.0]) for _ in range(TOOLS)]
        if not self.can("load"):
            made.tool_loads = [0.001] * TOOLS
        for _ in range(LOADS):
            centre = (0.0, float(rng.randint(-50, 50)), float(rng.randint(50, 250)))
            made.loads.append((float(rng.randint(5, 60)), centre))
        for k in range(1, rng.randint(4, 7)):
            made.points[f"p{k}"] = (self._literal(), 0)
        for k in range(1, 3):
            made.points[f"r{k}"] = (self._literal(), 1)
        made.points["j1"] = (self._literal(in_joints=True), 0)
        made.arrays["row"] = [self._literal() for _ in range(3)]
        made.variables = ["v1", "v2"]
        made.rows = {"s": ROW} if self.has("rows") else {}
        made.numbers = {name: rng.randint(0, 3) for name in ("n1", "n2", "n3")}

    def _literal(self, in_joints: bool = False) -> int:
        places, rng = self.made.places, self.rng
        turn = np.array([rng.uniform(-8.0, 8.0) for _ in range(6)])
        q = MIDDLE + np.deg2rad(turn)
        frames = rng.randint(1, TOOLS), rng.randint(1, BASES)
        places.append(Place(q, in_joints, *frames))
        return len(places) - 1

    def _functions(self) -> None:
        rng = self.rng
        self.made.functions = [
            Function("plus", "sum", rng.randint(1, 3)),
            Function("choice", "choice", rng.randint(1, 3)),
            Function("above", "point", rng.randint(2, 20), "p1"),
        ]

    def _routine(self, number: int) -> Routine:
        rng = self.rng
        kinds = ["value", "reference", *["point"] * self.has("given")]
        names = rng.sample(kinds, rng.randint(0, len(kinds)))
        parameters = tuple((f"{kind[0]}{number}a", kind) for kind in names)
        hides = ("n2",) if rng.random() < 0.3 else ()
        local = (f"l{number}",)
        self.own = (*local, *hides, *(n for n, kind in parameters if kind != "point"))
        self.given = tuple(n for n, kind in parameters if kind == "point")
        self.file = int(self.has("modules") and rng.random() < 0.6)
        handler = self._handler()
        first = tuple(Assign(n, rng.randint(0, 3)) for n in (*local, *hides))
        body = (*first, *self._body(rng.randint(2, 5), 1))
        name = f"sub{number}"
        return Routine(
            name, parameters, body, (*local, *hides), handler, self._repair(handler),
            self.file,
        )  # fmt: skip

    def _handler(self) -> tuple[str, int]:
        if not self.has("handler") or self.rng.random() < 0.4:
            return "", 0
        words = ["RETRY", "TRYNEXT", "TRYNEXT", "RETURN", "RAISE"]
        return self.rng.choice(words), self.rng.randint(0, 2)

    def _repair(self, handler: tuple[str, int]) -> Body:
        simple = handler[1] < 2 and handler[0]  # the third way is one line
        if not simple or not self.has("repair") or self.rng.random() < 0.5:
            return ()
        return (self._change(),)

    def _change(self) -> Statement:
        """Change something that other statements build on."""
        rng = self.rng
        kinds = ["number", "number", "point", *["load"] * self.can("load"), "base"]
        match rng.choice([*kinds, *["displace"] * self.can("displace")]):
            case "point":
                value = Named(f"p{rng.randint(1, 3)}")
                return SetPoint(rng.choice(self.made.variables[:2]), value)
            case "load":
                return SetLoad(rng.randint(0, LOADS))
            case "base":
                return SetBase(rng.randint(1, BASES))
            case "displace":
                return Displace(self._still_offset())
        return Assign(rng.choice(["n1", "n2", "n3"]), rng.randint(0, 3))

    # Numbers and conditions.

    def _names(self) -> list[str]:
        return list(dict.fromkeys(["n1", "n2", "n3", *self.own]))

    def _expr(self, depth: int = 0) -> Expr:
        rng = self.rng
        kind = rng.choice(["number", "number", "name", "name", "sum", "ask", "read"])
        if kind == "read" and self.inputs:
            return Read()
        if kind == "sum" and depth < 1:
            return Sum(self._expr(1), rng.randint(1, 2))
        if kind == "ask" and depth < 1 and self.can("functions"):
            return Ask(rng.choice(["plus", "choice"]), self._expr(1))
        return Var(rng.choice(self._names())) if kind == "name" else rng.randint(0, 3)

    def _cond(self, depth: int = 0) -> Cond:
        rng = self.rng
        kinds = ["less", "less", "equal", "signal", "signal", "not", "both"]
        kind = rng.choice(kinds)
        if kind == "signal" and self.inputs:
            return Signal(rng.randint(1, 3))
        if kind == "not" and depth < 1:
            return Not(self._cond(1))
        if kind == "both" and depth < 1:
            return Both(self._cond(1), self._cond(1))
        return Less(Var(rng.choice(self._names())), rng.randint(0, 3), kind == "equal")

    # Places.

    def _fixed(self) -> Named | Element:
        rng, made = self.rng, self.made
        if self.has("element") and rng.random() < 0.25:
            return Element("row", rng.randint(1, 3))
        names = [n for n, (_, file) in made.points.items() if file <= self.file]
        return Named(rng.choice([n for n in names if n[0] in "pr"]))

    def _point(self) -> Point:
        rng = self.rng
        more = ("element", "offset", "tool", "variable", "given", "made", "rows")
        kinds = ["named"] * 3 + ["fresh"] * 6 + ["inline"] * 4 * self.has("inline")
        kind = rng.choice([*kinds, *(name for name in more if self.has(name))])
        match kind:
            case "inline":
                return Inline(self._literal())
            case "element" if self.loops:
                return Element("row", Var(f"i{self.loops}"))
            case "rows":
                return Element("s", self._row_index())
            case "offset" | "tool":
                by = self._offset()
                self.shifts += 1
                return Shifted(self._fixed(), by, kind == "tool", SHIFTS + self.shifts)
            case "fresh":
                name = f"q{len(self.made.points)}"
                self.made.points[name] = (self._literal(), self.file)
                return Named(name)
            case "variable":
                return Named(rng.choice(self.made.variables[:2]))
            case "given" if self.given:
                return Named(self.given[0])
            case "made":
                return Made("above", self._expr())
        return self._fixed()

    def _value(self) -> Point:
        """Draw what a variable point is given: another one, numbers, or a shift."""
        match self.rng.choice(["point", "point", "numbers", "numbers", "shift"]):
            case "numbers":
                return Inline(self._literal())
            case "shift" if self.has("offset"):
                self.shifts += 1
                return Shifted(self._fixed(), self._offset(), mark=SHIFTS + self.shifts)
            case "point" if self.has("variable"):
                return Named(self.rng.choice(self.made.variables[:2]))
        return self._fixed()

    def _offset(self) -> tuple[Expr, Expr, Expr]:
        rng = self.rng
        z: Expr = rng.randint(-20, 20)
        if rng.random() < 0.3:
            z = Var(rng.choice(self._names()))
        return rng.randint(-10, 10), 0, z

    # Statements.

    def _opening(self) -> Body:
        first = []
        for back in OPENING:
            self.made.places.append(Place(MIDDLE - back, True, 1, 1))
            first.append(self._move("axes", Inline(len(self.made.places) - 1), 0))
        frames: list[Statement] = [SetTool(1, 1), SetBase(1, way=1), SetSpeed(200)]
        given = [SetPoint(name, self._fixed()) for name in self.made.variables[:2]]
        counts = [Assign("m1", 0)]
        if not self.can("first"):
            counts += [Assign(name, value) for name, value in self.made.numbers.items()]
        return (*frames, *given, *counts, *first, *self._fill())

    def _body(self, count: int, depth: int) -> Body:
        found: list[Statement] = []
        for _ in range(count):
            found.append(one := self._statement(depth))
            if isinstance(one, Foreign):
                found += [SetTool(1, 1), SetBase(1, way=1), SetSpeed(200)]
                found.append(self._move("axes", Inline(self._literal(True)), 0))
            elif isinstance(one, SetPoint) and self.rng.random() < 0.7:
                found += self._parts(Named(one.name), 0.3)
                found.append(self._move("line", Named(one.name), 0))
            elif isinstance(one, SetElement) and self.rng.random() < 0.7:
                to = Element(one.name, one.index)
                found += [*self._parts(to, 0.3), self._move("line", to, 0)]
            elif self.has("variable") and self.rng.random() < 0.1:
                found += self._own_variable()
        return tuple(found)

    def _own_variable(self) -> Body:
        """Give a variable that nothing else uses a value, or two, and go there."""
        name = f"w{len(self.made.variables)}"
        self.made.variables.append(name)
        found: list[Statement] = []
        for _ in range(self.rng.randint(1, 2)):
            value = Inline(self._literal())
            found += [SetPoint(name, value), *self._parts(Named(name), 0.3)]
            found.append(self._move("line", Named(name), 0))
            if parts := self._parts(Named(name), 0.3):
                found += [*parts, self._move("line", Named(name), 0)]
        return tuple(found)

    def _parts(self, point: Named | Element, share: float) -> Body:
        """Set numbers of a variable point by themselves, in some programs."""
        if not self.has("parts") or self.rng.random() > share:
            return ()
        return tuple(self._part(point) for _ in range(self.rng.randint(1, 2)))

    def _part(self, point: Named | Element) -> Statement:
        """Set one number: written there, or that of a point with something added."""
        rng = self.rng
        axis = rng.randrange(3)
        if rng.random() < 0.4:
            self.shifts += 1
            literal = Inline(self._literal())
            return SetPart(point, axis, literal, mark=SHIFTS + self.shifts)
        of = rng.choice([point, point, self._fixed()])
        computed = rng.random() < 0.3
        by = Var(rng.choice(self._names())) if computed else rng.randint(-9, 9)
        return SetPart(point, axis, of, by)

    def _row_index(self) -> Expr:
        """Draw which point of a variable array is meant."""
        if self.loops and self.rng.random() < 0.6:
            return Var(f"i{self.loops}")
        return self.rng.randint(1, ROW)

    def _fill(self) -> Body:
        """Fill a variable array in a loop, and go to its points in another."""
        if not self.has("rows"):
            return ()
        self.loops += 1
        i = Var(f"i{self.loops}")
        value: Point = self._fixed()
        if self.rng.random() < 0.5:
            value = Shifted(value, (0, self.rng.randint(-9, 9), i))
        to = Element("s", i)
        fill: Body = (SetElement("s", i, value), *self._parts(to, 0.5))
        loop = For(i.name, 1, ROW, 1, fill)
        go = For(i.name, 1, ROW, 1, (self._move("line", to, 0),))
        self.loops -= 1
        return (loop, go) if self.rng.random() < 0.5 else (loop,)

    def _statement(self, depth: int) -> Statement:
        kinds: dict[str, int] = {"motion": 12, "assign": 2, "frames": 2, "other": 2}
        if depth < DEPTH:
            kinds |= {
                "block": 5,
                "call": 3 * (bool(self.callable) and self.has("call")),
            }
        kind = self.rng.choices(list(kinds), list(kinds.values()))[0]
        if kind == "block":
            return self._block(depth)
        draw: dict[str, Callable[[], Statement]] = {
            "motion": self._motion, "assign": self._assignment, "call": self._call,
            "frames": self._frames, "other": self._other,
        }  # fmt: skip
        return draw[kind]()

    def _motion(self) -> Statement:
        rng = self.rng
        kinds = ["line"] * 6 + ["joint"] * 3 + ["axes"]
        kinds += ["arc"] * (self.has("arc") and not self.made.plain)
        kinds += ["step"] * self.has("step")
        kind = rng.choice(kinds)
        zone = rng.choice([0, 0, 0, 5, 10, -1 if self.has("zone") else 0])
        if kind == "axes":
            joints = Inline(self._literal(in_joints=True))
            named = self.file == 0 and rng.random() < 0.5
            return self._move(kind, Named("j1") if named else joints, 0)
        if kind == "step":
            return self._move(kind, Shifted(Named(""), self._still_offset()), 0)
        if kind == "arc":
            return self._move(kind, Inline(self._literal()), 0, self._via())
        return self._move(kind, self._point(), zone)

    def _via(self) -> Point:
        """Draw the point on the way of an arc: no move ends there.

        An arc that begins at its own middle point is none that a controller drives.
        """
        rng, points = self.rng, self.made.points
        own = (name for name, (_, file) in points.items() if file == self.file)
        names = [name for name in own if name.startswith("u")]
        if rng.random() < 0.5:
            return Inline(self._literal())
        if not names or rng.random() < 0.5:
            names = [f"u{len(points)}"]
            points[names[0]] = (self._literal(), self.file)
        return Named(rng.choice(names))

    def _still_offset(self) -> tuple[int, int, int]:
        rng = self.rng
        return rng.randint(-10, 10), rng.randint(-10, 10), rng.randint(-10, 10)

    def _move(self, kind: str, to: Point, zone: int, via: Point | None = None) -> Move:
        self.marks += 1
        rng = self.rng
        formed = False
        if self.can("modal"):
            named = not self.has("modal") or rng.random() < 0.7
        else:
            simple = kind in ("line", "joint") and zone >= 0
            any_move = self.can("clauses") and kind != "step"
            formed = self.has("forms") and (simple or any_move)
            named = formed = formed and rng.random() < 0.6
        tool = rng.choice([1, 1, 1, 2]) if named else 0
        base = rng.choice([1, 1, 1, 2, 3]) if named else 0
        trigger = (
            kind == "line" and not formed and self.has("trigger") and rng.random() < 0.2
        )
        speed = rng.choice([100, 200] if formed else [0, 100, 200])
        speed *= formed or self.can("speeds")
        early = kind == "joint" and self.can("early")
        early = early and (formed or rng.random() < 0.5)
        return Move(self.marks, kind, to, via, zone, tool, base, speed, trigger, early)

    def _assignment(self) -> Statement:
        rng = self.rng
        kinds = ["number", "number", *["point"] * 3 * self.has("variable")]
        kinds += ["lift"] * self.has("lift") + ["row"] * 3 * self.has("rows")
        kinds += ["part"] * 2 * self.has("parts")
        match rng.choice(kinds):
            case "row":
                return SetElement("s", self._row_index(), self._value())
            case "part" if self.has("rows") and rng.random() < 0.5:
                return self._part(Element("s", self._row_index()))
            case "part":
                return self._part(Named(rng.choice(self.made.variables[:2])))
            case "point":
                return SetPoint(rng.choice(self.made.variables[:2]), self._value())
            case "lift":
                return Lift(rng.choice(self.made.variables[:2]), rng.randint(-5, 5))
        return Assign(rng.choice(self._names()), self._expr())

    def _frames(self) -> Statement:
        rng = self.rng
        kinds = ["speed", *["tool", "base", "base"] * self.has("frames")]
        kinds += [name for name in ("shift", "load", "zone") if self.has(name)]
        kinds += ["displace"] * 2 * self.has("displace")
        match rng.choice(kinds):
            case "tool":
                return SetTool(rng.randint(1, TOOLS), rng.randint(0, 2))
            case "base":
                return SetBase(rng.randint(1, BASES), way=rng.randint(0, 2))
            case "shift":
                return SetBase(rng.randint(1, BASES), self._still_offset())
            case "load":
                return SetLoad(rng.randint(0, LOADS))
            case "zone":
                return SetZone(rng.choice([5, 10]))
            case "displace":
                return Displace(self._still_offset() if rng.random() < 0.6 else None)
        return SetSpeed(rng.choice([50, 100, 250]))

    def _other(self) -> Statement:
        rng = self.rng
        kinds = ["wait", "output", "output", *["note"] * 3 * self.has("note")]
        kinds += ["fail"] * 3 * self.has("fail") + ["foreign"] * 2 * self.has(FOREIGN)
        match rng.choice(kinds):
            case "wait":
                return Wait(rng.randint(0, 1))
            case "note":
                return Note(rng.randint(0, 4))
            case "foreign":
                return Foreign(self._literal(in_joints=True))
            case "fail":
                return MayFail(rng.random() < 0.3)
        return Output(rng.randint(1, 3), rng.random() < 0.5)

    def _call(self) -> Statement:
        """Call one of the routines; a number goes in as a copy or as itself."""
        rng = self.rng
        called = rng.choice(self.callable)
        arguments: list[Expr | Point] = []
        for _, kind in called.parameters:
            if kind == "point":
                arguments.append(self._fixed())
            elif kind == "reference":
                arguments.append(Var(rng.choice(self._names())))
            else:
                arguments.append(self._expr())
        late = self.has("late") and not arguments and rng.random() < 0.5
        return Call(called.name, tuple(arguments), late)

    def _block(self, depth: int) -> Statement:
        rng = self.rng
        kinds = ["if", "if", "switch", "for", "for", "while", "label", "skip"]
        kinds += ["loop"] * self.has("loop")
        kinds += ["poll"] * (self.inputs and self.has("poll"))
        kinds += ["return"] * (self.own != ()) + ["repeat"] * self.can("repeat")
        kind = rng.choice(kinds)
        if kind == "return":
            return Return(self._cond())
        if kind == "for":
            return self._for(depth)
        if kind in ("while", "label", "repeat"):
            self.marks += 1
            name = f"m{self.marks}"
            return Count(name, rng.randint(1, 3), self._inner(depth), kind)
        if kind == "poll":
            return Poll(rng.randint(1, 3), self._inner(depth))
        if kind == "loop":
            self.marks += 1
            name = f"m{self.marks}"  # before loops in it are drawn
            inner = self._inner(depth), self._cond(), self._inner(depth)
            return Loop(name, *inner)
        if kind == "skip":
            self.marks += 1
            return Skip(self.marks, self._cond(), self._inner(depth))
        if kind == "switch":
            cases = tuple(
                (values, self._inner(depth)) for values in ((0,), (1, 2), (3,))
            )
            return Switch(self._expr(), cases, self._inner(depth))
        branches = tuple(
            (self._cond(), self._inner(depth)) for _ in range(rng.randint(1, 2))
        )
        return If(branches, self._inner(depth) if rng.random() < 0.5 else ())

    def _for(self, depth: int) -> Statement:
        self.loops += 1
        body = self._inner(depth)
        name = f"i{self.loops}"
        self.loops -= 1
        first, last, step = self.rng.choice(
            [(1, 3, 1), (1, 2, 1), (3, 1, -1), (1, 3, 2)]
        )
        return For(name, first, last, step, body)

    def _inner(self, depth: int) -> Body:
        return self._body(self.rng.randint(1, 3), depth + 1)
