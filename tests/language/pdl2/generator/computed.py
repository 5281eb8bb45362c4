"""Points computed from others."""

from __future__ import annotations

from tests.language.pdl2.generator.writer import Writer


class Computed(Writer):
    """Writes frames composed and inverted."""

    def compose(self) -> None:
        a, b = self.point(), self.point()
        by, text = self.record("step")
        self.emit(f"{a} := {b} : POS({text}, '')", "compose", a.lower(), b.lower(), by)

    def invert(self) -> None:
        a, b = self.point(), self.point()
        self.emit(f"{a} := POS_INV({b})", "invert", a.lower(), b.lower())
