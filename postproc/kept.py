"""What is kept of a program, or of a window of it, once its targets are corrected."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from postproc.arrays import Bools, Floats, Ints
from postproc.language.source import Replacements
from postproc.language.visits import Visits
from postproc.model.model import Model
from postproc.planning import Planned
from postproc.report import Decisions
from postproc.robot.cell import Cell
from postproc.robot.pose import MM
from postproc.robot.state import States
from postproc.settling import Corrected
from postproc.strings import overruled


@dataclass(frozen=True)
class Kept:
    """A corrected program without poses, paths and plans (structure of arrays).

    Attributes:
        edited: Literals that get new numbers, (m,).
        edits: The edits of these, file by file.
        decisions: What was decided for n visits.
        corrected: Visits whose target moves, (n,).
        before, after: Size of the predicted error of the k visits that move, (k,) [m].
        position: Where the program wants the TCP, (n, 3) [m], base frame.
        away: How far the path passes it, (n,) [mm].
        overruled: The path does not follow the configuration string, and nobody said
            that it must, (n,).
        untimed: No time law was found, (n,).
    """

    edited: Ints
    edits: tuple[Replacements, ...]
    decisions: Decisions
    corrected: Bools
    before: Floats
    after: Floats
    position: Floats
    away: Floats
    overruled: Bools
    untimed: Bools


def keep(
    visits: Visits,
    planned: Planned,
    states: States,
    found: Corrected,
    cell: Cell,
    model: Model,
    seeds: int = 0,
) -> Kept:
    """Keep what a report says of corrected visits, but for the first `seeds`."""
    proposal, done, plan = found.proposal, found.reached, planned.plan
    moved = proposal.corrected
    new = states.with_(q=np.array(done.q), direction=np.array(done.side))[moved]
    wanted = plan.tcp[:, :3, 3] + planned.shift
    before = model.error(cell.arm, states[moved]) - planned.shift[moved]
    after = done.tcp[moved, :3, 3] + model.error(cell.arm, new) - wanted[moved]
    return Kept(
        edited=proposal.edited,
        edits=found.edits,
        decisions=proposal.decisions.part(slice(seeds, None)),
        corrected=moved[seeds:],
        before=np.linalg.norm(before, axis=1),
        after=np.linalg.norm(after, axis=1),
        position=(wanted - plan.aside)[seeds:],
        away=np.linalg.norm(np.nan_to_num(plan.aside), axis=1)[seeds:] / MM,
        overruled=overruled(planned.targets, plan).unchecked(visits)[seeds:],
        untimed=plan.untimed[seeds:],
    )


def joined(parts: Sequence[Kept]) -> Kept:
    """Put the windows of a program one after the other."""
    if len(parts) == 1:
        return parts[0]
    arrays = {
        f.name: np.concatenate([getattr(part, f.name) for part in parts])
        for f in fields(Kept)
        if f.name not in ("edits", "decisions")
    }
    edits = zip(*(part.edits for part in parts), strict=True)
    return Kept(
        edits=tuple(Replacements.merged(own) for own in edits),
        decisions=_one_after_another([part.decisions for part in parts]),
        **arrays,
    )


def _one_after_another(parts: Sequence[Decisions]) -> Decisions:
    """Join decisions, and their reasons."""
    arrays = {
        f.name: np.concatenate([getattr(part, f.name) for part in parts])
        for f in fields(Decisions)
        if f.name not in ("why", "reasons")
    }
    codes: dict[str, int] = {"": 0}
    why = []
    for part in parts:
        new = np.zeros(len(part.reasons), dtype=np.int64)
        for k in np.unique(part.why).tolist():
            new[k] = codes.setdefault(part.reasons[k], len(codes))
        why.append(new[part.why])
    return Decisions(why=np.concatenate(why), reasons=tuple(codes), **arrays)
