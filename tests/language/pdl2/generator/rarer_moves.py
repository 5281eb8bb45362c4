"""Moves that hold no target, arcs, and moves of more than one arm."""

from __future__ import annotations

from tests.language.pdl2.generator.writer import Writer

FRAMES = ("TOOL", "BASE", "UFRAME")


class RarerMoves(Writer):
    """Writes the moves that only some programs have."""

    def rarer_moves(self) -> list[object]:
        return [self.near, self.away, self.relative, self.about, self.by,
                self.towards, self.arc, self.arc, self.together,
                self.other_arm]  # fmt: skip

    def near(self) -> None:
        name, short = self.point(), abs(self.number())
        text = f"MOVE LINEAR NEAR {name} BY {short:.4f}"
        self.emit(text, "near", name.lower(), short)

    def towards(self) -> None:
        name, far = self.point(), abs(self.number())
        text = f"MOVE LINEAR FOR {far:.4f} TO {name}"
        self.emit(text, "near", name.lower(), far, "FOR")

    def away(self) -> None:
        by = abs(self.number())
        self.emit(f"MOVE LINEAR AWAY {by:.4f}", "without", "AWAY", (by,))

    def relative(self) -> None:
        frame = self.rng.choice(FRAMES)
        by, text = self.vector()
        text = f"MOVE LINEAR RELATIVE VEC({text}) IN {frame}"
        self.emit(text, "without", f"RELATIVE_{frame}", by)

    def about(self) -> None:
        axis = self.rng.choice([(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)])
        angle = round(self.rng.uniform(-5.0, 5.0), 2)
        frame = self.rng.choice(FRAMES)
        vector = ", ".join(f"{n:g}" for n in axis)
        text = f"MOVE LINEAR ABOUT VEC({vector}) BY {angle:.2f} IN {frame}"
        self.emit(text, "without", f"ABOUT_{frame}", (*axis, angle))

    def by(self) -> None:
        by = tuple(round(self.rng.uniform(-3.0, 3.0), 3) for _ in range(6))
        numbers = ", ".join(f"{n:.3f}" for n in by)
        self.emit(f"MOVE JOINT BY {{{numbers}}}", "without", "BY", by)

    def arc(self) -> None:
        name, via = self.point(), self.point()
        text = f"MOVE CIRCULAR TO {name} VIA {via}"
        self.emit(text, "arc", name.lower(), via.lower())

    def together(self) -> None:
        """Move another arm along with ours."""
        name = self.point()
        text = f"MOVE LINEAR TO {name} SYNCMOVE ARM[2] LINEAR TO q"
        self.emit(text, "move_to", name.lower())

    def other_arm(self) -> None:
        self.emit(f"MOVE ARM[2] JOINT TO {self.point()}", "nop")
