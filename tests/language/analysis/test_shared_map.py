"""A mapping whose copies share what they share, beside plain dictionaries."""

from __future__ import annotations

import random
from itertools import pairwise

from postproc.language.analysis.shared_map import SharedMap


def test_copies_change_on_their_own_as_dictionaries_do() -> None:
    rng = random.Random(3)
    pairs: list[tuple[SharedMap[int, int], dict[int, int]]] = [(SharedMap(), {})]
    for _ in range(2000):
        shared, plain = rng.choice(pairs)
        key, value = rng.randrange(700), rng.randrange(3)
        if rng.random() < 0.2:
            pairs.append((shared.copy(), plain.copy()))
        elif rng.random() < 0.3:
            del shared[key]
            plain.pop(key, None)
        else:
            shared[key] = value
            plain[key] = value
    assert len(pairs) > 100
    for shared, plain in pairs:
        assert {key: shared.get(key) for key in shared} == plain
    for (one, a), (two, b) in pairwise(pairs):
        assert (one == two) == (a == b)
        wrong = {key for key in {*a, *b} if a.get(key) != b.get(key)}
        assert wrong <= {*one.differing(two)}
