"""Functions, whose values only the controller knows, and routines that come back."""

from __future__ import annotations

from tests.language.pdl2.generator.blocks import Blocks
from tests.language.pdl2.generator.writer import COUNTS, Writer


class Functions(Blocks, Writer):
    """Writes functions that may move the arm, and calls in expressions.

    Attributes:
        points_of, numbers_of: Those that give a point, and those that give a number.
        giving: What the function that is being written gives, and how it is written.
    """

    points_of: tuple[str, ...] = ()
    numbers_of: tuple[str, ...] = ()
    giving: tuple[str, tuple[object, ...]] | tuple[()] = ()

    def function(self, name: str, posed: bool) -> None:
        """Write one; it takes a point and gives a point, or gives a number."""
        self.parameter = "a" if posed else ""
        self.lines.append(
            f"ROUTINE {name}(a : POSITION) : POSITION" if posed
            else f"ROUTINE {name} : INTEGER"
        )  # fmt: skip
        self.lines.append("BEGIN")
        self.routines[name] = self.here
        self.giving = ("a", ("point", "a")) if posed else ("1", ("number", 1.0))
        self.block(self.rng.randrange(1, 4), 2)
        self.emit(f"RETURN({self.giving[0]})", "give", *self.giving[1])
        self.emit(f"END {name}", "return")
        self.parameter, self.giving = "", ()
        if posed:
            self.points_of = (*self.points_of, name)
        else:
            self.numbers_of = (*self.numbers_of, name)

    def use_function(self) -> None:
        """Call one in an expression."""
        kind = self.rng.randrange(4)
        if kind < 2 and self.points_of:
            name, point = self.rng.choice(self.points_of), self.point()
            call = (name, point.lower())
            if kind == 0:
                into = self.point()
                text = f"{into} := {name}({point})"
                self.emit(text, "evaluate", *call, ("set", into.lower()))
            else:
                text = f"MOVE LINEAR TO {name}({point})"
                self.emit(text, "evaluate", *call, ("move",))
        elif kind == 2 and self.numbers_of:
            name, into = self.rng.choice(self.numbers_of), self.rng.choice(COUNTS)
            self.emit(f"{into} := {name}", "evaluate", name, "", ("set", into))
        elif self.numbers_of:
            name = self.rng.choice(self.numbers_of)
            line = self.emit(f"IF {name} = 1 THEN")
            self.block(1, 3)
            test = ("unless", 1.0, self.here)
            self.patch(line, "evaluate", name, "", test)
            self.emit("ENDIF", "nop")

    def return_(self, depth: int) -> None:
        """Give a value back where the routine has one."""
        if not self.giving:
            super().return_(depth)
        elif self.rng.random() < 0.3:
            self.guarded(f"RETURN({self.giving[0]})", "give", *self.giving[1])
