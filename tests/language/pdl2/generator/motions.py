"""Moves to targets."""

from __future__ import annotations

from tests.language.pdl2.generator.writer import JOINTS, TABLE, Writer


class Motions(Writer):
    """Writes the moves that every program has."""

    def move_literal(self) -> None:
        posed = self.rng.random() < 0.5
        numbers, text = self.record("pose" if posed else "joints")
        word = self.rng.choice(["MOVE", "MOVEFLY"])
        how = self.rng.choice(["JOINT", "LINEAR"])
        end = " ADVANCE" if word == "MOVEFLY" else ""
        if posed:
            self.emit(f"{word} {how} TO POS({text}, ''){end}", "move", numbers)
        else:
            self.emit(f"{word} {how} TO {{{text}}}{end}", "move", numbers)

    def move_variable(self) -> None:
        name = self.rng.choice([self.point(), *JOINTS])
        self.emit(f"MOVE JOINT TO {name}", "move_to", name.lower())

    def move_shifted(self) -> None:
        name = self.point()
        by, text = self.vector()
        how = self.rng.choice(["JOINT", "LINEAR"])
        text = f"MOVE {how} TO POS_SHIFT({name}, VEC({text}))"
        self.emit(text, "move_shifted", name.lower(), by)

    def move_extended(self) -> None:
        self.emit("MOVE LINEAR TO xt", "move_to", "xt")

    def move_table(self) -> None:
        index = self.index()
        self.emit(f"MOVE LINEAR TO {TABLE}[{index}]", "move_table", index)
