"""RAPID: shifted moves go where the same target, written in the move, would go."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc.compensation.options import Options
from postproc.compensation.output.sidecar import restore
from postproc.compensation.scale import windowing
from postproc.compensation.scale.micro_batch import Given, compensate_batch
from postproc.exceptions import ProgramError
from tests.compensation.shift_jobs import (
    AGREED_MM,
    EXACT_MM,
    Shop,
    landed,
    rapid,
)
from tests.fuzz.case import check_bytes, records_of, rewrite

END = ",v200,fine,t\\WObj:=w;"
P1, P2, P3 = (f"MoveL {name}{END}" for name in ("p1", "p2", "p3"))
FAR = 0.03  # [mm] at least by which some point needs another correction


@pytest.fixture(scope="module")
def shop(job_cell, job_model):
    return Shop.of(job_cell, job_model)


def offs(point, x=0, y=0, z=100, word="MoveL"):
    return f"{word} Offs({point},{x},{y},{z}){END}"


EXACT = {
    "above": [offs("p1"), P1, offs("p1")],
    "far": [P1, offs("p1", 150, -120, 250)],
    "never visited": [offs("p1"), offs("p1", 0, 0, 20)],
    "two points": [offs("p1"), P1, offs("p2"), P2],
    "joint move": [offs("p1", word="MoveJ"), P1],
    "tool": [P1, f"MoveL RelTool(p1,0,0,-100){END}"],
    "tool, aside": [P1, f"MoveL RelTool(p1,30,-40,-100){END}"],
    "turned about z": [P1, f"MoveL RelTool(p1,0,0,-60\\Rz:=8){END}"],
    "turned about x and z": [P1, f"MoveL RelTool(p1,5,0,-60\\Rx:=6\\Rz:=-7){END}"],
    "turned about all": [P1, f"MoveL RelTool(p1,5,9,-60\\Rx:=6\\Ry:=4\\Rz:=-7){END}"],
    "shift of a shift": [P1, f"MoveL RelTool(Offs(p1,20,10,0),0,0,-80){END}"],
    "shift of a turned one": [
        P1,
        f"MoveL Offs(RelTool(p1,0,0,-20\\Rz:=8),0,9,80){END}",
    ],
    "arc": [P1, f"MoveC Offs(p1,30,30,0),Offs(p1,60,0,0){END}"],
    "spaces and comments": [P1, f"MoveL  Offs ( p1 , 0 ,-5.0,  +80.50 ) {END} ! 100"],
    "exponent": [P1, f"MoveL Offs(p1,-0,0,1E2){END}"],
    "lower case": [P1, f"movel offs(p1,0,0,60){END}".replace("movel", "MoveL")],
}


@pytest.mark.parametrize("kind", EXACT)
def test_shifted_moves_go_where_written_targets_would(shop, kind):
    found = landed(shop, EXACT[kind])
    assert set(found.status) <= {"CORRECTED", "UNCHANGED"}, found.whys
    assert found.off_mm.max() < EXACT_MM
    assert found.turned_deg.max() < 1e-4


def test_the_numbers_of_the_shift_are_needed_for_it(shop):
    lines = [P1, offs("p1", 150, -120, 250)]
    found = landed(shop, lines)
    assert "Offs(p1,150,-120,250)" not in found.text


def test_the_other_bytes_stay_and_the_source_comes_back(shop):
    line = f"MoveL  Offs ( p1 , 0 ,-5.0,  80.50 ) {END} ! 100"
    source = {"m.mod": rapid(shop, [P1, line])}
    done = shop.compensate(source)
    records = records_of(done.sidecar)
    check_bytes(source, {**source, **done.outputs}, records, done.visits)
    for name, record in records.items():
        assert restore(done.outputs[name], record, name) == source[name]
    assert b"80.50 )" not in done.outputs["m.mod"] and b"! 100" in done.outputs["m.mod"]
    with pytest.raises(ProgramError, match="compensated already"):
        shop.compensate(done.outputs)


LEFT = {
    "computed": f"MoveL Offs(p1,0,0,2*80){END}",
    "named": f"MoveL Offs(p1,0,0,nApp){END}",
    "turned by name": f"MoveL RelTool(p1,0,0,-160\\Rz:=nTurn){END}",
}


@pytest.mark.parametrize("kind", LEFT)
def test_shifts_that_are_no_plain_numbers_stay(shop, kind):
    more = "CONST num nApp:=160; CONST num nTurn:=5;"
    source = rapid(shop, [P1, LEFT[kind]])
    source = source.replace(b"PROC main", more.encode() + b"\nPROC main", 1)
    done = shop.compensate({"m.mod": source})
    assert LEFT[kind].encode() in done.outputs["m.mod"]


AT = f"PROC at(robtarget a)\nMoveL Offs(a,0,0,100){END}\nMoveL a{END}\nENDPROC\n"


def test_a_routine_that_is_called_with_near_points_shares_its_shift(shop):
    found = landed(
        shop, ["at p1;", "at p1;"], AT, [(0, {"a": "p1"}), (1, {"a": "p1"})] * 2
    )
    assert found.status.count("CORRECTED") >= 2, found.whys
    safe = np.array([s == "CORRECTED" for s in found.status])[2:]
    assert (found.off_mm[safe] < AGREED_MM).all()


def test_a_routine_that_is_called_with_points_that_differ_shares_none(shop):
    calls = [(k, {"a": name}) for name in ("p1", "p2", "p3") for k in (0, 1)]
    far = AT.replace("0,0,100", "200,150,250")
    found = landed(shop, ["at p1;", "at p2;", "at p3;"], far, calls)
    assert "shifts (such as Offs) that differ" in found.whys
    assert "Offs(a,200,150,250)" in found.text


def test_one_shift_in_two_work_objects_is_one_only_where_they_agree(shop):
    frame = "[[420,260,330],[0.9,0,0,0.43589]],[[0,0,0],[1,0,0,0]]"
    data = f'PERS wobjdata w2:=[FALSE,TRUE,"",{frame}];'
    move = "MoveL Offs(p1,0,0,100),v200,fine,t\\WObj:=o;"
    more = f"PROC at(PERS wobjdata o)\n{move}\nENDPROC\n"
    done = shop.compensate({"m.mod": rapid(shop, ["at w;", "at w2;"], more, data)})
    assert b"Offs(p1,0,0,100)" in done.outputs["m.mod"]


def test_a_loop_over_points_compares_its_rounds(shop):
    lines = ["FOR i FROM 1 TO 3 DO", f"MoveL Offs(row{{i}},200,150,250){END}", "ENDFOR"]
    source = rapid(shop, lines)
    points = [shop_point(source, name) for name in ("p1", "p2", "p3")]
    data = f"CONST robtarget row{{3}}:=[{','.join(points)}];"
    source = source.replace(b"PROC main", data.encode() + b"\nPROC main", 1)
    done = shop.compensate({"m.mod": source})
    assert b"Offs(row{i},200,150,250)" in done.outputs["m.mod"]
    d = done.decisions
    assert any("(such as Offs)" in d.reasons[k].text for k in d.why.tolist())


def shop_point(source, name):
    line = next(x for x in source.decode().splitlines() if f"robtarget {name}:=" in x)
    return line.split(":=")[1].rstrip(";")


def test_a_shift_that_is_given_to_a_routine_stays(shop):
    more = f"PROC go(robtarget a)\nMoveL a{END}\nx:=a.trans.x;\nENDPROC\n"
    source = rapid(shop, [P1, "go Offs(p1,0,0,150);"], more)
    source = source.replace(b"PROC main", b"VAR num x;\nPROC main", 1)
    assert b"Offs(p1,0,0,150)" in shop.compensate({"m.mod": source}).outputs["m.mod"]


def test_a_point_that_is_read_stays_and_its_shift_makes_up_for_all(shop):
    found = landed(shop, [offs("p1"), P1, 'TPWrite ""\\Num:=p1.trans.x;'])
    assert found.status[-1] != "CORRECTED" and "CORRECTED" in found.status
    assert found.off_mm[0] < EXACT_MM


def test_a_taught_point_leaves_its_shifts_alone(shop):
    source = rapid(shop, [P1, offs("p1")]).decode().splitlines()
    marked = [x + " ! TAUGHT" if "robtarget p1:=" in x else x for x in source]
    done = shop.compensate({"m.mod": "\n".join(marked).encode() + b"\n"})
    assert b"Offs(p1,0,0,100)" in done.outputs["m.mod"]


def test_a_shift_that_is_taught_holds_its_point(shop):
    found = landed(shop, [P1, f"{offs('p1')} ! TAUGHT", P2])
    assert found.status[2:] == ["CONFLICT", "UNCHANGED", "CORRECTED"]
    source = rapid(shop, [])
    assert shop_point(source, "p1") == shop_point(found.text.encode(), "p1")


def test_a_function_of_the_program_by_that_name_is_no_shift(shop):
    own = "FUNC robtarget Offs(robtarget a,num x,num y,num z)\nRETURN a;\nENDFUNC\n"
    done = shop.compensate({"m.mod": rapid(shop, [P2, offs("p1")], own)})
    assert b"Offs(p1,0,0,100)" in done.outputs["m.mod"]


def test_displacements_that_hold_are_made_up_for(shop):
    lines = ["PDispSet d;", P1, offs("p1", 50, 60, 150), "PDispOff;"]
    data = "CONST pose d:=[[10,20,5],[0.9848,0,0,0.17365]];"
    found = landed(shop, lines, data=data)
    assert "Offs(p1,50,60,150)" not in found.text and "p1,0,0" not in found.text
    assert found.off_mm.max() < EXACT_MM


def test_a_displacement_that_holds_at_times_only_is_another_frame(shop):
    lines = ["at;", "PDispSet d;", "at;", "PDispOff;"]
    more = f"PROC at()\n{offs('p1', 300, 300, 0)}\nENDPROC\n"
    data = "CONST pose d:=[[200,-300,200],[0.9848,0,0,0.17365]];"
    done = shop.compensate({"m.mod": rapid(shop, lines, more, data)})
    assert b"Offs(p1,300,300,0)" in done.outputs["m.mod"]


MOVES = {
    "TriggL": "TriggL Offs(p1,0,0,90),v200,e,fine,t\\WObj:=w;",
    "ArcL": "ArcL Offs(p1,0,0,90),v200,s1,wd\\Weave:=wv,fine,t\\WObj:=w;",
    "zone": "MoveL Offs(p1,0,0,90),v200,z10,t\\WObj:=w;",
}


@pytest.mark.parametrize("kind", ["TriggL", "zone"])
def test_other_instructions_take_shifts_too(shop, kind):
    data = "VAR triggdata e;"
    found = landed(shop, [offs("p2"), MOVES[kind], P1], data=data)
    assert found.status[3] == "CORRECTED", found.whys
    assert found.off_mm.max() < EXACT_MM


def test_a_shift_behind_a_condition_is_made_up_for(shop):
    lines = ["IF di1=1 THEN", offs("p1", 9, 8, 120), "ENDIF", P1, offs("p1")]
    found = landed(shop, lines)
    safe = np.array([s == "CORRECTED" for s in found.status])[2:]
    assert safe[0] and (found.off_mm[safe] < EXACT_MM).all()


@pytest.mark.parametrize("name", ["Offs", "RelTool"])
def test_a_correction_beyond_the_limit_stays(shop, name):
    limits = shop.cell.limits.model_copy(update={"correction_mm": 0.5})
    small = Shop(replace(shop.cell, limits=limits), shop.model)
    line = f"MoveL {name}(p1,0,0,33){END}"
    done = small.compensate({"m.mod": rapid(small, [P1, line])})
    assert line.encode() in done.outputs["m.mod"]
    assert "correction_mm" in " ".join(map(str, done.decisions.reasons))


def test_the_point_may_stand_in_another_module(shop):
    source = rapid(shop, [P1, offs("p1"), offs("p2", 5, 6, 7)]).decode().splitlines()
    points = [x for x in source if "robtarget" in x]
    main = [x for x in source if x not in points]
    data = "\n".join(["MODULE d", *points, "ENDMODULE", ""]).encode()
    files = {"m.mod": "\n".join([*main, ""]).encode(), "d.mod": data}
    done, whole = (
        shop.compensate(files),
        landed(shop, [P1, offs("p1"), offs("p2", 5, 6, 7)]),
    )
    assert whole.off_mm.max() < EXACT_MM
    moves = [x for x in done.outputs["m.mod"].decode().splitlines() if "Offs" in x]
    assert moves == [x for x in whole.text.splitlines() if "Offs" in x]


@pytest.mark.parametrize("name", ["s.sys", "s.mod", "SYSMOD/s.mod"])
def test_points_and_shifts_of_system_modules_stay(shop, name):
    main = rapid(shop, ["up;", P1, offs("p1")]).decode().splitlines()
    points = [one for one in main if "robtarget p" in one]
    written = [P1.replace("p1", one.split(":=")[1].rstrip(";")) for one in points[:1]]
    up = ["PROC up()", offs("p2"), *written, "ENDPROC"]
    kind = "" if "/" in name else "(SYSMODULE)"
    system = "\n".join([f"MODULE s{kind}", *points, *up, "ENDMODULE", ""]).encode()
    body = "\n".join([one for one in main if one not in points] + [""]).encode()
    done = shop.compensate({"m.mod": body, name: system})
    assert done.outputs.get(name, system) == system
    assert b"Offs(p1,0,0,100)" not in done.outputs["m.mod"]
    assert "system module" in " ".join(map(str, done.decisions.reasons))


def test_every_line_end_is_kept(shop):
    source = rapid(shop, [P1, offs("p1")]).replace(b"\n", b"\r\n")
    text = shop.compensate({"m.mod": source}).outputs["m.mod"]
    assert text.count(b"\r\n") == text.count(b"\n") and b"Offs(p1,0,0,100)" not in text


def test_points_that_are_cloned_leave_shifts_where_they_go(job_cell, job_model):
    shop = Shop.of(job_cell, job_model, Options(shared_points="clone"))
    lines = [offs("p1"), P1, P2, P1, offs("p1"), P3, offs("p1", 0, 0, 50), P1]
    found = landed(shop, lines)
    assert set(found.status[2:]) <= {"CORRECTED"}, found.whys
    assert found.off_mm.max() < AGREED_MM


def test_with_turns_a_tool_shift_is_turned_and_an_offs_only_where_it_agrees(
    job_cell, job_model
):
    shop = Shop.of(job_cell, job_model, Options(orientation=True))
    lines = [P1, f"MoveL RelTool(p1,5,9,-60\\Rx:=6\\Ry:=4\\Rz:=-7){END}", offs("p1")]
    found = landed(shop, lines)
    assert found.off_mm[1] < EXACT_MM and found.turned_deg[1] < 1e-4
    kept = found.status[-1] != "CORRECTED"
    assert kept or np.deg2rad(found.turned_deg[2]) * 100.0 < AGREED_MM


def test_programs_side_by_side_come_out_as_each_alone(shop):
    jobs = [[P1, offs("p1")], [offs("p2"), P2, offs("p1", 9, 8, 7)], [P3]]
    texts = [rapid(shop, lines) for lines in jobs]
    given = [Given("m.mod", text, None, {}) for text in texts]
    found = compensate_batch(given, shop.cell, shop.model, shop.options)
    for one, text in zip(found, texts, strict=True):
        assert one.outputs == shop.compensate({"m.mod": text}).outputs


def test_a_long_program_in_windows_comes_out_as_one(shop, monkeypatch):
    lines = [offs(p, 3 * k, 0, 60 + k) for k in range(40) for p in ("p1", "p2")]
    text = rapid(shop, lines)
    whole = shop.compensate({"m.mod": text}).outputs
    for name, value in (("LEAST", 20), ("HALO", 8), ("BAND", 4), ("RUN_UP", 20)):
        monkeypatch.setattr(windowing, name, value)
    assert shop.compensate({"m.mod": text}).outputs == whole


def test_a_shift_of_a_point_beyond_all_reach_is_read_as_it_was_written(shop):
    move = f"MoveL RelTool(p4,0,0,-20){END}"
    far = shop_point(rapid(shop, []), "p1")
    far = far.replace(far.split(",")[2], "1591e9]", 1)
    source = rapid(shop, [move], "", f"CONST robtarget p4:={far};")
    assert b"1591e9" in source
    assert rewrite({"m.mod": source}, shop.cell) == "rewritten"
