"""What the languages of drawn programs cannot say, and how they run."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Traits:
    """What differs between languages where a program is drawn and run.

    Attributes:
        name: Of the language; "all": what is drawn has words in all of them.
        lacks: Features of programs that it has no words for.
        stops: Parts of runs in which the arm stops at a fly point for a statement
            behind it: wait, output or input.
        zone_stays: The zone of a move holds for the moves behind it.
        grips: The arm carries its tool and what it grips.
        parts_move: The rest of a target whose number is set by itself may be corrected.
    """

    name: str
    lacks: frozenset[str]
    stops: tuple[tuple[str, float], ...] = ()
    zone_stays: bool = False
    grips: bool = False
    parts_move: bool = False

    def stops_for(self, kind: str) -> float:
        """Return in which part of runs the arm stops for a kind of statement."""
        return dict(self.stops).get(kind, 0.0)


# Beside the features of `draw`: "again", a program that begins again; "clauses", any
# move may name its frames; "early", corners blended by joints; "first", numbers that
# have a value before the program sets one; "functions" and "made", what a function of
# the program returns; "plain forms", frames of a move that hold behind it; "repeat", a
# loop with its test at the end; "speeds", any move may have its own; "splines".
RAPID = Traits(
    "rapid", frozenset({"clauses", "forms", "repeat", "splines", "step"}), grips=True
)
KRL = Traits(
    "krl",
    frozenset({"again", "clauses", "displace", "fail", "handler", "late", "modal",
               "repair", "speeds"}),
    stops=(("wait", 1.0), ("output", 1.0), ("input", 1.0)), zone_stays=True,
)  # fmt: skip
PDL2 = Traits(
    "pdl2",
    frozenset({"displace", "early", "fail", "handler", "late", "load", "modal",
               "plain forms", "repair", "splines"}),
    stops=(("wait", 0.5),), parts_move=True,  # a wait may take long or not
)  # fmt: skip
# Left out, as one language follows it and another one does not: points that are shifted
# in their own frame ("tool": in KRL they have no S and T), values that other programs
# may change ("modules", "shared": PDL2), or that stand in a program before it sets them
# ("first": PDL2 decides by them), what an interrupt changes ("meddle": KRL leaves all),
# and what is behind a routine that no file holds.
ALL = Traits(
    "all",
    frozenset({"first", "foreign", "meddle", "modules", "plain forms", "shared",
               "tool"})
    | (RAPID.lacks | KRL.lacks | PDL2.lacks) - {"early", "forms", "splines"},
)  # fmt: skip
