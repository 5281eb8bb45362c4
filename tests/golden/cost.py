"""Processor time and memory beside those of a commit, in turn on one machine.

One program of each language and one fit run alternately on both packages, one process
at a time. The least of several runs counts: what else runs on the machine only adds.
"""

from __future__ import annotations

import tempfile
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from tests.golden.against import package_of
from tests.golden.case import ROOT, Case
from tests.golden.cases import all_cases
from tests.golden.running import Worker
from tests.golden.translation import Translation

ROUNDS = 5
MOST = 1.10  # times the base
NAMES = ("large/windows", "rapid/large", "krl/large", "fit/geometry,windup,lag,scale")


@dataclass(frozen=True)
class Cost:
    """What the commands of a case used.

    Attributes:
        seconds: Processor time.
        megabytes: Largest resident memory.
    """

    seconds: float
    megabytes: float

    @classmethod
    def of(cls, worker: Worker, case: Case) -> Cost:
        """Run a case.

        Raises:
            RuntimeError: A command of it failed.
        """
        worker.answers.clear()
        worker.run(case)
        if any(answer["exit"] for answer in worker.answers):
            raise RuntimeError(f"{case.name}: exit {worker.answers}")
        return cls(
            sum(answer["seconds"] for answer in worker.answers),
            max(answer["megabytes"] for answer in worker.answers),
        )


def least(costs: Sequence[Cost]) -> Cost:
    """Return the least of several runs."""
    return Cost(min(c.seconds for c in costs), min(c.megabytes for c in costs))


def compare_costs(commit: str) -> dict[str, list[str]]:
    """Print what each case costs on both; return what costs over a tenth more.

    Raises:
        KeyError: There is no case of one of these names.
    """
    by_name = {case.name: case for case in all_cases()}
    cases = [by_name[name] for name in NAMES]
    words = Translation.read()
    found: dict[str, list[str]] = {}
    with package_of(commit) as root, tempfile.TemporaryDirectory() as scratch:
        base, here = (Worker(where, Path(scratch)) for where in (root, ROOT))
        with base, here:
            for case in cases:
                pair = run_in_turn(base, here, words.case(case), case)
                print(f"{case.name}: {describe(*pair)}")
                if lines := list(excesses(*pair)):
                    found[f"cost of {case.name}"] = lines
    return found


def run_in_turn(
    base: Worker, here: Worker, in_its_words: Case, case: Case
) -> tuple[Cost, Cost]:
    """Run a case on both, one after the other, and return the least cost of each."""
    costs = defaultdict(list)
    for _ in range(ROUNDS):
        costs["base"].append(Cost.of(base, in_its_words))
        costs["here"].append(Cost.of(here, case))
    return least(costs["base"]), least(costs["here"])


def describe(base: Cost, here: Cost) -> str:
    """Write both costs."""
    return (
        f"{base.seconds:.2f} s -> {here.seconds:.2f} s, "
        f"{base.megabytes:.0f} MB -> {here.megabytes:.0f} MB"
    )


def excesses(base: Cost, here: Cost) -> Iterator[str]:
    """Say what is over a tenth more than on the base.

    >>> list(excesses(Cost(1.0, 100.0), Cost(1.09, 109.0)))
    []
    >>> list(excesses(Cost(1.0, 100.0), Cost(1.2, 105.0)))
    ['1.20 times the processor time']
    """
    for what, ratio in (
        ("processor time", here.seconds / base.seconds),
        ("memory", here.megabytes / base.megabytes),
    ):
        if ratio > MOST:
            yield f"{ratio:.2f} times the {what}"
