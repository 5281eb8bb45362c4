"""What to declare first is told once, with how many targets it frees."""

from postproc.language.interface import Start
from postproc.language.krl.causes import CODE
from tests.language.krl.test_visits import job

FRAMES = ["FDAT_ACT=FP1", "LDAT_ACT=LCPDAT1", "BAS(#CP_PARAMS,2)"]


def causes(found):
    return [(d.file, d.line, d.message) for d in found.diagnostics if d.code == CODE]


def test_the_first_routine_and_what_it_frees():
    lines = [
        "LIN XP1",
        "grip( )",
        "LIN XP1",
        "LIN XP2",
        "grip( )",
        "weld(1)",
        "LIN XP1",
    ]
    ((file, line, text),) = causes(job(*lines))
    assert (file, line) == ("m.src", 4)
    assert text.startswith("grip( ) is the first of 2 routines")
    assert "2 of 3 targets that are left are freed; 3 if none of them does" in text
    assert 'grip = "still", weld = "still"' in text


def test_there_is_no_cause_where_nothing_is_freed():
    assert causes(job("LIN XP1", "LIN XP2")) == []
    assert causes(job(*FRAMES, "LIN XP1", "grip( )")) == []
    said = Start(routines={"grip": "moves"})
    assert causes(job("LIN XP1", "grip( )", "LIN XP2", start=said)) == []
