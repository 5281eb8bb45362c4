"""A model is made for an arm once, and does not grow with the arms it was used on."""

from __future__ import annotations

from dataclasses import replace

from postproc.compensation.compensate import prepare_cell
from postproc.compensation.options import DEFAULT_OPTIONS
from postproc.model.cache import KEPT, ArmCache


def test_things_are_made_once_and_the_oldest_go(bench_cell) -> None:
    cache: ArmCache[int] = ArmCache()
    arms = [replace(bench_cell.arm) for _ in range(KEPT + 1)]
    made: list[int] = []

    def make(arm) -> int:
        made.append(id(arm))
        return len(made)

    assert [cache.of(arm, make) for arm in arms[:-1]] == list(range(1, KEPT + 1))
    assert cache.of(arms[0], make) == 1 and len(made) == KEPT
    cache.of(arms[-1], make)
    assert cache.of(arms[1], make) == 2 and cache.of(arms[0], make) == KEPT + 2


def test_programs_of_a_cell_share_the_evaluator(bench_cell, bench_model) -> None:
    one, two = (
        prepare_cell(bench_cell, bench_model, DEFAULT_OPTIONS).arm for _ in range(2)
    )
    assert one is two and bench_model.evaluator(one) is bench_model.evaluator(two)
