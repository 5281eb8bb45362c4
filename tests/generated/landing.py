"""Compensated programs, executed by the interpreter on the virtual arm."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from postproc.compensation.compensate import compensate
from postproc.compensation.findings.findings import SURE
from postproc.compensation.options import Options
from postproc.compensation.outcome import Outcome, Status
from postproc.model.model import Model
from postproc.robot.cell import Cell
from postproc.robot.pose import MM
from tests.fuzz.case import check_bytes, records_of
from tests.generated.execution import Ran, executed
from tests.generated.found import (
    ALONG,
    AVERAGED,
    CLONED,
    FIRST,
    KNOWN,
    ROUNDED,
    UNSURE,
    Found,
    is_averaged,
)
from tests.generated.once import count_once
from tests.language.pdl2.executed import PAGE, Generated
from tests.language.pdl2.reachable import OPENING, reachable
from tests.language.pdl2.reread import CLONE
from tests.language.pdl2.test_flow_random import follow

WORSE = "is farther off than without a correction"
MOST_MM = 0.05  # by more: then it is
STUCK = "the arm can make this move as it was written, but not as it was corrected"
COMPUTED = re.compile(r"\((?:NEAR|FOR|POS_SHIFT)\)|is computed, not written")


def lands(seed: int, cell: Cell, model: Model) -> Found:
    """Compensate a program and run it before and after, on the arm of the model.

    Every other program has several files, every other two of them clones.

    Raises:
        AssertionError: A byte outside of the targets changed, or other moves are made.
    """
    made, options = program(seed)
    files = made.files
    main, pages = files["job.pdl"], {n: d for n, d in files.items() if n != "job.pdl"}
    done = compensate(main, cell, model, name="job.pdl", pages=pages, options=options)
    if "cloned" not in {d.code for d in done.diagnostics}:
        check_bytes(files, {**files, **done.outputs}, records_of(done.sidecar),
                    done.visits)  # fmt: skip
    run = executed(made, done, cell)
    found = Found(wrong=[(seed, run.lost, STUCK)] if run.lost else [])
    if len(run.asked) > len(OPENING):
        rows = follow(done.visits, run.asked, made)
        count_errors(found, seed, run, done, rows)
        count_once(found, seed, run.whole, run.ran, done, rows, run.flanks)
    return found


def program(seed: int) -> tuple[Generated, Options]:
    """Write a program, and say whether its points are cloned."""
    cloned = seed % 8 < 4
    shares = 0.4 if cloned else 0.0
    made = reachable(seed, seed % 2 == 0, pages=seed % 4 < 2, shares=shares)
    return made, Options(shared_points="clone" if cloned else "mean")


def count_errors(
    found: Found, seed: int, run: Ran, done: Outcome, rows: Sequence[set[int]]
) -> None:
    """Sort the true errors of moves whose numbers changed by what the report says."""
    ran, d, visits = run.ran, done.decisions, done.visits
    for k, step in enumerate(run.asked):
        if ran[k].values == step.values:
            continue
        mine, pair = sorted(rows[k]), (run.before[k], run.now[k])
        if not mine or (d.status[mine] != Status.CORRECTED).any():
            found.error_mm[ALONG].append(pair)
            why = {d.reasons[d.why[row]].text for row in mine}
            if not all(COMPUTED.search(one) for one in why):
                text = "is listed as not known, but went to new numbers"
                found.wrong.append((seed, step.line, f"{text}: {' / '.join(why)}"))
        elif (visits.motion.fly & ~visits.motion.via)[mine].any():
            found.error_mm[ROUNDED].append(pair)
        elif is_averaged(d, mine):
            found.error_mm[AVERAGED].append(pair)
            if (np.abs(d.side[mine]) >= SURE).all() and pair[1] > pair[0] + MOST_MM:
                found.wrong.append((seed, step.line, WORSE))
        else:
            unsure = bool((np.abs(d.side[mine]) < SURE).any())
            found.error_mm[UNSURE if unsure else KNOWN].append(pair)
            size = np.linalg.norm(d.std_error[mine], axis=1).max() / MM
            found.z += [run.now[k] / size] if unsure else []
            if unsure and k == 0:
                found.error_mm[FIRST].append(pair)
            at_clone = CLONE.search(line_of(run.after.files, ran[k].line))
            if at_clone and not unsure:
                found.error_mm[CLONED].append(pair)


def line_of(files: dict[str, bytes], line: int) -> str:
    """Return a line of a job, without its comment."""
    text = list(files.values())[line // PAGE].decode("latin-1")
    return text.splitlines()[line % PAGE - 1].split("--")[0]
