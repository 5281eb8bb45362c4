"""What the commands write is what they wrote when manifest.json was."""

from tests.golden.case import ROOT, Case
from tests.golden.cases import all_cases
from tests.golden.manifest import changed
from tests.golden.record import differences, digest, digests_differ
from tests.golden.translation import Translation


def test_names_are_unique() -> None:
    names = [case.name for case in all_cases()]
    assert len(names) == len(set(names))


def test_a_changed_byte_is_seen() -> None:
    old = {"out/job.pdl": "MOVE LINEAR TO POS(1.250, 2.0, 3.0)"}
    new = {"out/job.pdl": "MOVE LINEAR TO POS(1.251, 2.0, 3.0)"}
    assert differences(old, new, fitted=False)
    assert digests_differ(digest(old, False), digest(new, False))


def test_a_rename_is_no_difference_and_a_changed_byte_is_one() -> None:
    words = Translation(
        arguments={"--new": "--old"},
        keys={"why": "reason"},
        words={"safe": "corrected", "side-not-sure": "direction-uncertain"},
        messages={"see --old": "see --new"},
        added={'"code": "[^"]*", ': ""},
    )
    old = {
        "r.json": '{"why": "see --old", "status": "safe", "x": 1.0}',
        "1 stdout": "safe        side-not-sure",
        "job.pdl": "-- safe",
    }
    new = {
        "r.json": '{"code": "a", "reason": "see --new", "status": "corrected", '
        '"x": 1.0}',
        "1 stdout": "corrected   direction-uncertain",
        "job.pdl": "-- safe",
    }
    found = differences(words.base(old), words.here(new), False)
    assert not found
    other = words.here({**new, "job.pdl": "-- corrected"})
    assert differences(words.base(old), other, False)
    case = Case("c", ("compensate a --new b",))
    assert words.case(case).commands == ("compensate a --old b",)


def test_numbers_of_reports_are_compared_as_numbers() -> None:
    old, new = ({"r.json": f'{{"x": [{x}, 2.0]}}'} for x in (1.0, 1.0 + 1e-13))
    far = {"r.json": '{"x": [1.0, 2.0001]}'}
    assert not differences(old, new, False)
    assert not digests_differ(digest(old, False), digest(new, False))
    assert differences(old, far, False)
    assert digests_differ(digest(old, False), digest(far, False))


def test_the_quick_set_is_as_in_the_manifest() -> None:
    found = changed([c for c in all_cases() if c.quick], ROOT, workers=1)
    assert not found, (
        f"{len(found)} cases differ from manifest.json: make golden BASE=<commit> "
        f"shows where, python -m tests.golden update keeps it: {found}"
    )
