"""An interpreter of generated programs.

It runs the instructions that the generator wrote beside the text; it shares nothing
with the parser or the analysis, so that both can be wrong only in the same way by
chance.
"""

from __future__ import annotations

from typing import Any

from tests.language.pdl2.executed import EVERYWHERE, PAGE, Executed, Generated, Literal
from tests.language.pdl2.poses import composed, inverted
from tests.language.pdl2.running import Running

__all__ = ["EVERYWHERE", "PAGE", "Executed", "Generated", "Interpreter"]


class Interpreter(Running):
    """Runs a generated program once, with random inputs."""

    def do_nop(self) -> None: ...

    # ---- moves ----------------------------------------------------------------------
    def do_move(self, numbers: Any) -> None:
        self.log(Literal.at(self.line, numbers))

    def do_move_to(self, name: str) -> None:
        self.log(self.hold(name))

    def do_move_table(self, index: str) -> None:
        self.log(self.hold(f"tab[{self.subscript(index)}]"))

    def do_move_shifted(self, name: str, by: Any) -> None:
        self.log(self.shifted(name, by))

    def do_near(self, name: str, short_mm: float, how: str = "NEAR") -> None:
        self.log(self.hold(name), how, short_mm)

    def do_arc(self, name: str, via: str) -> None:
        self.log(self.hold(via), "VIA")
        self.fire()
        self.log(self.hold(name))

    def do_without(self, how: str, numbers: Any) -> None:
        self.log(numbers, how)

    # ---- values ---------------------------------------------------------------------
    def do_set(self, name: str, value: Any) -> None:
        point = isinstance(value, tuple)
        held = Literal.at(self.line, value) if point else value
        self.values[self.name(name)] = held

    def do_copy(self, a: str, b: str) -> None:
        self.values[self.name(a)] = self.hold(b)

    def do_shift(self, a: str, b: str, by: Any) -> None:
        self.values[self.name(a)] = self.shifted(b, by)

    def do_compose(self, a: str, b: str, by: Any) -> None:
        held = self.hold(b)
        self.values[self.name(a)] = None if held is None else composed(held, by)

    def do_invert(self, a: str, b: str) -> None:
        held = self.hold(b)
        self.values[self.name(a)] = None if held is None else inverted(held)

    def do_component(self, name: str, at: int, number: float, add: bool) -> None:
        held = self.hold(name)
        if held is not None:
            new = held[at] + number if add else number
            self.values[self.name(name)] = (*held[:at], new, *held[at + 1 :])

    def do_input(self, name: str) -> None:
        self.values[self.name(name)] = float(self.rng.randrange(5))

    def do_add(self, name: str) -> None:
        if self.hold(name) is not None:
            self.values[self.name(name)] += 1.0

    def do_frame(self, name: str, numbers: Any) -> None:
        self.frames[name] = numbers

    def do_fill(self, index: str, numbers: Any) -> None:
        self.values[self.name(f"tab[{self.subscript(index)}]")] = Literal.at(
            self.line, numbers
        )

    def do_scramble(self, name: str) -> None:
        self.values[self.name(name)] = tuple(self.rng.random() for _ in range(6))

    def subscript(self, index: str) -> str:
        held = float(index) if index.isdigit() else self.hold(index)
        return str(held)

    def shifted(self, name: str, by: Any) -> Any:
        held = self.hold(name)
        if held is None:
            return None
        return (*(v + d for v, d in zip(held[:3], by, strict=True)), *held[3:])

    # ---- routines, functions, handlers ----------------------------------------------
    def do_call(self, name: str, argument: str) -> int:
        self.stack.append((self.line + 1, self.name(argument)))
        return self.program.routines[name]

    def do_return(self) -> int:
        return self.stack.pop()[0] if self.stack else 0

    def do_give(self, kind: str, value: Any) -> int:
        self.returned = self.hold(value) if kind == "point" else value
        return self.do_return()

    def do_evaluate(self, name: str, argument: str, then: Any) -> int | None:
        self.within(self.program.routines[name], self.name(argument))
        match then:
            case ("set", into):
                self.values[self.name(into)] = self.returned
            case ("move",):
                self.log(self.returned)
            case ("unless", value, line) if self.returned != value:
                return int(line)
        return None

    def do_enable(self, number: int) -> None:
        self.enabled.add(number)

    def do_disable(self, number: int) -> None:
        self.enabled.discard(number)

    def do_resume(self) -> int:
        return self.do_return()

    # ---- flow -----------------------------------------------------------------------
    def do_stop(self) -> int:
        return 0

    def do_cycle(self, start: int) -> int:
        return start

    def do_jump(self, line: int) -> int:
        return line

    def do_unless(self, test: Any, line: int) -> int | None:
        return None if self.test(*test) else line

    def do_select(self, name: str, cases: Any, otherwise: int) -> int:
        held = self.hold(name)
        if held is None:
            held = float(self.rng.randrange(5))
        return next((line for values, line in cases if held in values), otherwise)

    def do_for(self, name: str, first: float, last: Any, by: float, end: int) -> Any:
        self.limits[self.line] = float(self.rng.randrange(4)) if last is None else last
        self.values[self.name(name)] = first
        return None if self._inside(self.line, first, by) else end + 1

    def do_next(self, start: int, name: str, by: float) -> Any:
        value = self.hold(name) + by
        if self._inside(start, value, by):
            self.values[self.name(name)] = value
            return start + 1
        self.values.pop(self.name(name))
        return None

    def _inside(self, start: int, value: float, by: float) -> bool:
        last = self.limits[start]
        return value <= last if by > 0 else value >= last
