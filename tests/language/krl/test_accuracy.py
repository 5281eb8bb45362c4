"""The controller's own accuracy model: switched off is agreement, on is refused."""

import pytest

from postproc.diagnostics import Code
from postproc.exceptions import ProgramError
from tests.language.krl.test_visits import CONFIG, codes, job, reasons

OFF = ["$ABS_ACCUR=#NONE", "$ABS_ACCUR=FALSE", "$ABS_CONVERT=FALSE",
       "$DEACTIVATE_ABS_ACCUR = TRUE", "$SUPPRESS_ABS_ACCUR=TRUE"]  # fmt: skip
ON = ["$ABS_ACCUR=#ACTIVE", "$ABS_ACCUR=TRUE", "$ABS_ACCUR=x", "$ABS_CONVERT=TRUE",
      "$DEACTIVATE_ABS_ACCUR=FALSE", "$DEACTIVATE_ABS_ACCUR=x",
      "$SUPPRESS_ABS_ACCUR=FALSE",
      "TRIGGER WHEN DISTANCE=0 DELAY=0 DO $DEACTIVATE_ABS_ACCUR=FALSE",
      "INTERRUPT DECL 5 WHEN $IN[1] DO $ABS_ACCUR=TRUE"]  # fmt: skip


@pytest.mark.parametrize("line", OFF)
def test_switched_off_is_what_the_cell_says(line):
    found = job(line, "LIN XP1")
    assert reasons(found) == [""] and codes(found) == set()


@pytest.mark.parametrize("line", ON)
def test_switched_on_is_refused(line):
    with pytest.raises(ProgramError, match=r"m\.src:3: .*compensates on its own"):
        job(line, "LIN XP1")


def test_what_a_list_switches_on_is_refused_too():
    config = CONFIG.replace("ENDDAT", "$DEACTIVATE_ABS_ACCUR=FALSE\nENDDAT")
    with pytest.raises(ProgramError, match=r"\$config\.dat:\d+: .*on its own"):
        job("LIN XP1", config=config)


def test_a_point_of_the_model_has_a_cure_of_its_own():
    found = job("LIN {X 1,Y 2,Z 3,A 0,B 0,C 0,S 18,T 2}").visits
    assert found.reasons[found.reason[0]].code is Code.ACCURATE_POINT
