"""What variables, frames and counters hold."""

from __future__ import annotations

from tests.language.pdl2.generator.writer import COUNTS, TABLE, Writer


class Assignments(Writer):
    """Writes assignments, and statements that change variables in other ways."""

    def assign_point(self, name: str) -> None:
        numbers, text = self.record()
        self.emit(f"{name} := POS({text}, '')", "set", name.lower(), numbers)

    def assign_any(self) -> None:
        self.assign_point(self.point())

    def assign_joints(self) -> None:
        numbers, text = self.record("joints")
        self.emit(f"j1 := {{{text}}}", "set", "j1", numbers)

    def assign_component(self) -> None:
        name, at = self.point(), self.rng.randrange(3)
        number = abs(self.number())
        if self.rng.random() < 0.5:
            op = ("component", name.lower(), at, number, False)
            self.emit(f"{name}.{'XYZ'[at]} := {number:.4f}", *op)
        else:
            op = ("component", name.lower(), at, number, True)
            text = f"{name}.{'XYZ'[at]} := {name}.{'XYZ'[at]} + {number:.4f}"
            self.emit(text, *op)

    def assign_count(self) -> None:
        name = self.rng.choice(COUNTS)
        value = self.rng.randrange(4)
        if not self.exact and self.rng.random() < 0.3:
            self.emit(f"{name} := $FMI[{value + 1}]", "input", name)
        elif self.rng.random() < 0.3:
            text = self.rng.choice([f"{name} := {name} + 1", f"{name} += 1"])
            self.emit(text, "add", name)
        else:
            self.emit(f"{name} := {value}", "set", name, float(value))

    def copy(self) -> None:
        a, b = self.point(), self.point()
        self.emit(f"{a} := {b}", "copy", a.lower(), b.lower())

    def shift(self) -> None:
        a, b = self.point(), self.point()
        by, text = self.vector()
        text = f"{a} := POS_SHIFT({b}, VEC({text}))"
        self.emit(text, "shift", a.lower(), b.lower(), by)

    def extended(self) -> None:
        numbers, text = self.record()
        self.emit(f"xt.POS := POS({text}, '')", "set", "xt", numbers)
        self.emit(f"xt.AUX[1] := {self.rng.randrange(90)}", "nop")

    def frame(self) -> None:
        name = self.rng.choice(["TOOL", "UFRAME"])
        numbers, text = self.record(name.lower())
        self.emit(f"${name} := POS({text}, '')", "frame", name.lower(), numbers)

    def fill(self) -> None:
        numbers, text = self.record()
        index = self.index()
        self.emit(f"{TABLE}[{index}] := POS({text}, '')", "fill", index, numbers)

    def read(self, depth: int) -> None:
        name = self.point()
        if self.rng.random() < 0.5:
            self.emit(f"ext({name})", "scramble", name.lower())
        else:
            self.emit(f"READ lun ({name})", "scramble", name.lower())
