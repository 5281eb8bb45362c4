"""A few of the random programs of no language, and whether what is wrong is found."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from tests.any_controller import told
from tests.conftest import CELL
from tests.generated.found import AVERAGED, KNOWN, LOADED, UNSURE, Found, within
from tests.generated.neutral import alike as alike_module
from tests.generated.neutral import landing
from tests.generated.neutral.alike import alike
from tests.generated.neutral.draw import FEATURES, FOREIGN, Draw
from tests.generated.neutral.follow import follow
from tests.generated.neutral.landing import case, compensated, given_back, lands
from tests.generated.neutral.languages import LANGUAGES as WRITERS
from tests.generated.neutral.run import Run
from tests.generated.neutral.text import NUMBER
from tests.generated.neutral.traits import RAPID
from tests.generated.neutral.tree import counters

LANGUAGES = ("pdl2", "rapid", "krl")
SEEDS = range(400, 416)
ALIKE = (1, 2, 5, 6, 7)  # written in all languages; in others they are known to differ
# What stands in programs of a language that are drawn, by what it means.
WRITTEN = {
    "pdl2": (
        r"MOVE JOINT", r"MOVE LINEAR", r"MOVE CIRCULAR", r"MOVEFLY", r"VIA", r"ADVANCE",
        r"RELATIVE VEC", r"POS_SHIFT\(", r": POS\(", r"WITH \$TOOL", r"\$LIN_SPD = ",
        r"\$FLY_DIST = ", r"WITH .*CONDITION", r"\$TOOL :=", r"\$UFRAME := base",
        r"\$UFRAME := POS", r"\$LIN_SPD :=", r"\$FLY_DIST :=", r"IF .* THEN", r"ELSE",
        r"SELECT", r"ELSE:", r"FOR .* STEP", r"DOWNTO", r"WHILE \$DIN", r"REPEAT",
        r"GOTO", r"WHILE TRUE", r"\(\(n\d", r": INTEGER EXPORTED", r": POSITION\r",
        r"RETURN\(", r"CONDITION\[5\]", r"beep", r"DELAY", r"WAIT FOR", r"\$GIN",
        r"Priv", r"Xport", r"CALL part", r"CYCLE", r"\[i\d\]", r"\.X := \d",
        r"elsewhere",
    ),
    "rapid": (
        r"MoveJ", r"MoveL", r"MoveC", r"MoveAbsJ", r"TriggL", r"Offs\(", r"RelTool\(",
        r"PDispSet", r"PDispOff", r"GripLoad", r"tVar:=", r"wVar:=", r"oframe:=",
        r"vVar.v_tcp:=", r"zVar:=", r"IF .* THEN", r"ELSEIF", r"TEST", r"DEFAULT",
        r"FOR .* STEP", r"WHILE di", r"GOTO", r"INOUT num", r"VAR num \w+[,)]", r"FUNC",
        r"ERROR \(", r"IF ERRNO", r"RETRY", r"TRYNEXT", r"RETURN;", r"RAISE;",
        r"RAISE MY_ERR", r"%\"sub", r"TPWrite", r"WaitDI", r"WaitTime", r"TRAP",
        r"LOCAL CONST", r"\{i\d\}",
    ),
    "krl": (
        r"\bPTP", r"\bLIN ", r"SPTP", r"SLIN ", r"SCIRC", r"LIN_REL", r"C_DIS",
        r"C_PTP", r"C_SPL", r"BAS\(#TOOL", r"BAS\(#BASE", r"\$TOOL=TOOL_DATA",
        r"\$TOOL=\{", r"\$BASE=BASE_DATA\[\d\]:", r"\$LOAD=\{", r"\$VEL.CP", r"\$APO",
        r"IF .* THEN", r"ELSE", r"SWITCH", r"DEFAULT", r"FOR .* STEP", r"WHILE",
        r"REPEAT", r"LOOP", r"EXIT", r"GOTO", r":OUT", r":IN", r"DEFFCT INT",
        r"DEFFCT E6POS", r"TRIGGER", r"INTERRUPT", r"CONTINUE", r"WAIT SEC",
        r"WAIT FOR", r"GI_PART", r"GLOBAL E6POS", r"FDAT_ACT=",
        r"BAS\(#CP_PARAMS", r"STOOL2\(", r"SVEL_JOINT", r"DECL E6POS",
        r"\[i\d\]", r"SH:",
    ),
}  # fmt: skip


@pytest.fixture(scope="module")
def told_cell(tmp_path_factory):
    """The cell of the job folder, which says that the controller corrects nothing."""
    from postproc.robot.cell import load_cell

    path = tmp_path_factory.mktemp("told") / "cell.toml"
    path.write_text(told(CELL))
    return load_cell(path)


@pytest.fixture(scope="module", params=LANGUAGES)
def found(request, told_cell, job_model) -> Found:
    whole = Found()
    for seed in SEEDS:
        whole.add(lands(seed, request.param, told_cell, job_model))
    return whole


def test_what_runs_was_predicted_and_lands(found):
    assert found.wrong == [] and not found.refused
    errors = found.pairs(KNOWN)
    assert len(errors) > 40
    assert errors[:, 0].mean() > 1.0
    assert errors[:, 1].mean() < 0.03
    assert errors[:, 1].max() < landing.MOST_MM


def test_what_is_not_sure_lands_within_its_error(found, request):
    assert len(found.pairs(UNSURE)) > 20 and within(found.z) >= 0.95
    language = WRITERS[request.node.callspec.params["found"]]
    assert "load" in language.traits.lacks or len(found.pairs(LOADED)) > 20


def test_a_good_share_is_corrected(found):
    assert found.corrected > 0.25 * found.visits


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_construct_is_drawn(told_cell, language):
    texts = [
        data.decode("latin-1")
        for seed in range(60)
        for data in case(seed, language, told_cell).text.files.values()
    ]
    missing = [w for w in WRITTEN[language] if not any(re.search(w, t) for t in texts)]
    assert not missing
    traits = WRITERS[language].traits
    drawn = {name for seed in range(60) for name in Draw(seed, traits).features}
    assert drawn == {*FEATURES, FOREIGN} - traits.lacks


@pytest.mark.parametrize("seed", [0, 100, 5801, 5984])
@pytest.mark.parametrize("language", LANGUAGES)
def test_a_label_and_a_counter_are_those_of_one_loop(told_cell, language, seed):
    one = case(seed, language, told_cell)
    for text in one.text.files.values():
        labels = re.findall(r"(?m)^\s*(\w+)::?\s*$", text.decode("latin-1"))
        own = [name for name in labels if name not in ("DEFAULT", "ELSE")]
        assert len(own) == len(set(own))
    for routine in one.made.routines:
        found = counters(routine.body)
        assert len(found) == len(set(found))


@pytest.mark.parametrize("language", LANGUAGES)
def test_numbers_are_read_back_where_they_stand(told_cell, language):
    one = case(3, language, told_cell)
    name, first, _ = one.text.literals[0]
    text = one.text.files[name].decode("latin-1")
    at = list(NUMBER.finditer(text))[first]
    new = f"{text[: at.start()]}-77.25{text[at.end() :]}".encode()
    numbers = one.text.numbers({**one.text.files, name: new})
    assert numbers[0][0] == -77.25
    before = one.text.numbers(one.text.files)
    assert all(numbers[k] == before[k] for k in before if k)


@pytest.mark.parametrize("language", LANGUAGES)
def test_another_change_than_of_targets_is_found(told_cell, language):
    one = case(3, language, told_cell)
    name = next(iter(one.text.files))
    zones = {"rapid": b"FALSE,5", "krl": b"CDIS=5", "pdl2": b"DIST := 5"}
    zone = zones[language]
    other = zone, zone.replace(b"5", b"6")
    for old, new in ((b"END", b"ENX"), (b"m1", b"m7"), other):
        assert old in one.text.files[name]
        changed = {name: one.text.files[name].replace(old, new)}
        with pytest.raises(AssertionError):
            one.text.numbers({**one.text.files, **changed})


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_correction_that_lands_wrong_is_found(
    told_cell, job_model, language, monkeypatch
):
    def farther(files, done):
        """Move all corrected targets by 0.3 mm more."""
        own = given_back(files, done)
        places = one.text.literals
        for number, numbers in one.text.numbers(own).items():
            if numbers != one.text.numbers(files)[number]:
                name, first, _ = places[number]
                text = own[name].decode("latin-1")
                at = list(NUMBER.finditer(text))[first]
                more = f"{numbers[0] + 0.3:.5f}"
                own[name] = f"{text[: at.start()]}{more}{text[at.end() :]}".encode()
        return own

    one = case(100, language, told_cell)
    monkeypatch.setattr(landing, "given_back", farther)
    assert lands(100, language, told_cell, job_model).wrong


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_run_that_is_not_predicted_is_found(told_cell, job_model, language):
    """A base, a tool or an order that is another one."""
    one = case(100, language, told_cell)
    done = compensated(one.text.files, told_cell, job_model)
    steps = one.steps(one.text.files, 0)
    assert follow(done.visits, steps, one.text, one.language)
    with pytest.raises(AssertionError, match="otherwise"):
        follow(done.visits, steps[::-1], one.text, one.language)
    for pose in (*one.made.tools, *one.made.bases):
        pose[2, 3] += 0.01
    with pytest.raises(AssertionError, match="otherwise"):
        follow(done.visits, one.steps(one.text.files, 0), one.text, one.language)


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_run_is_the_same_for_the_same_inputs(told_cell, language):
    one = case(101, language, told_cell)
    a, b = (one.steps(one.text.files, 2) for _ in range(2))
    assert [s.move.mark for s in a] == [s.move.mark for s in b]
    assert all(np.array_equal(s.world, t.world) for s, t in zip(a, b, strict=True)
               if not s.in_joints)  # fmt: skip


def test_inputs_decide_which_way_is_run(told_cell):
    ways = set()
    for seed in range(1, 30, 2):
        made = Draw(seed, RAPID).program()
        literals = {
            k: p.q if p.in_joints else np.eye(4) for k, p in enumerate(made.places)
        }
        runs = [Run(made, literals, {}, run, RAPID).run() for run in range(3)]
        ways.add(len({tuple(s.move.mark for s in steps) for steps in runs}))
    assert max(ways) > 1


def test_shifts_make_up_for_points_with_one_correction_for_several(
    told_cell, job_model
):
    """A point is shifted, too, whose arrivals need different corrections."""
    found = lands(300185, "rapid", told_cell, job_model)
    assert found.error_mm[AVERAGED] and not found.wrong


def test_one_program_is_the_same_in_all_languages(told_cell, job_model):
    whole = Found()
    for seed in ALIKE:
        whole.add(alike(seed, told_cell, job_model))
    assert whole.wrong == []
    assert whole.visits > 200 and whole.corrected > 0.4 * whole.visits


def test_a_program_that_one_language_has_otherwise_is_found(
    told_cell, job_model, monkeypatch
):
    """A base that is another one in RAPID alone, and a move that is another one."""
    write = WRITERS["rapid"].write

    def otherwise(made, cell):
        text = write(made, cell)
        name, data = next(iter(text.files.items()))
        old = re.search(rb"wobj1:=.*?,\[\[(\d+)", data)[1]
        new = str(int(old) + 1).encode()
        files = {**text.files, name: data.replace(b"[[" + old, b"[[" + new)}
        return replace(text, files=files)

    own = replace(WRITERS["rapid"], write=otherwise)
    monkeypatch.setitem(WRITERS, "rapid", own)
    with pytest.raises(AssertionError, match="the base"):
        alike(ALIKE[0], told_cell, job_model)
    monkeypatch.setattr(alike_module, "follow", lambda *_: [])
    found = alike(ALIKE[0], told_cell, job_model).wrong
    assert any("frame is another one" in what for _, _, what in found)
