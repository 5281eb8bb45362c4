"""Every target of a trap gets the numbers of the plain program, or is listed."""

import pytest

from tests.traps.pairs import judge, read_traps, run

LANGUAGES = ("rapid", "krl", "pdl2")
TRAPS = {
    f"{language}-{trap.title}": (language, trap)
    for language in LANGUAGES
    for trap in read_traps(language)
}


@pytest.fixture(scope="module")
def run_once(bench_cell, bench_model):
    """Compensate a program that several traps have in common once."""
    runs = {}

    def compensated(files, language):
        key = tuple(sorted(files.items()))
        if key not in runs:
            runs[key] = run(files, bench_cell, bench_model, language)
        return runs[key]

    return compensated


@pytest.mark.parametrize("title", TRAPS)
def test_targets_are_corrected_as_in_the_plain_program_or_listed(title, run_once):
    language, trap = TRAPS[title]
    plain = [run_once(files, language) for files in trap.plain]
    found = judge(run_once(trap.files, language), plain)
    assert found.word in ("right", "middle", trap.known), found


@pytest.mark.parametrize("language", LANGUAGES)
def test_there_are_a_hundred(language):
    titles = [trap.title for trap in read_traps(language)]
    assert len(set(titles)) == len(titles) >= 100
