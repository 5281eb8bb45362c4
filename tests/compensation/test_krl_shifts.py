"""KRL: products of frames go where the same target, written in the move, would go."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from postproc.compensation.options import Options
from postproc.compensation.outcome import Status
from postproc.compensation.output.sidecar import restore
from postproc.exceptions import ProgramError
from tests.compensation.shift_jobs import (
    AGREED_MM,
    EXACT_MM,
    Shop,
    krl,
    krl_landed,
)
from tests.fuzz.case import check_bytes, records_of

P1, P2, P3 = "LIN Xp1", "LIN Xp2", "LIN Xp3"


@pytest.fixture(scope="module")
def shop(job_cell, job_model):
    return Shop.of(job_cell, job_model)


def by(x=0, y=0, z=-80, a=0, b=0, c=0):
    return f"{{X {x},Y {y},Z {z},A {a},B {b},C {c}}}"


EXACT = {
    "along the tool": [P1, f"LIN Xp1:{by()}"],
    "aside": [P1, f"LIN Xp1:{by(30, -40, -90)}"],
    "far": [P1, f"LIN Xp1:{by(150, -120, -200)}"],
    "never visited": [f"LIN Xp1:{by()}", f"LIN Xp1:{by(0, 0, -20)}"],
    "two points": [f"LIN Xp1:{by()}", P1, f"LIN Xp2:{by()}", P2],
    "frame": [P1, f"LIN {by(0, 0, 90)}:Xp1"],
    "frame, aside": [P1, f"LIN {by(50, 60, 90)}:Xp1"],
    "frame, joint move": [P1, f"PTP {by(20, 0, 60)}:Xp1"],
    "turned": [P1, f"LIN Xp1:{by(0, 5, -60, 8, 0, 0)}"],
    "turned about all": [P1, f"LIN Xp1:{by(5, 9, -60, 8, -5, 4)}"],
    "turned frame": [P1, f"LIN {by(-20, 9, 60, 4, 1, -2)}:Xp1"],
    "arc": [P1, f"CIRC Xp1:{by(30, 30, 0)},Xp1:{by(60, 0, 0)}"],
    "type said": [P1, "LIN Xp1:{FRAME: X 0,Y 5,Z -70,A 0,B 0,C 0}"],
    "spaces": [P1, "LIN Xp1 : { X 0.0 , Y -5 , Z -80.50 , A 0 , B 0 , C 0 } ; 100"],
    "order": [P1, "LIN Xp1:{Z -80,Y 0,X 5,C 0,B 0,A 0}"],
    "spline planner": [P1, f"SLIN Xp1:{by(30, -40, -90)}"],
    "exponent": [P1, "LIN Xp1:{X -0,Y 0,Z -1E2,A 0,B 0,C 0}"],
}


@pytest.mark.parametrize("kind", EXACT)
def test_products_go_where_written_targets_would(shop, kind):
    found = krl_landed(shop, EXACT[kind])
    assert set(found.status) <= {"CORRECTED", "UNCHANGED"}, found.whys
    assert found.off_mm.max() < EXACT_MM
    assert found.turned_deg.max() < 2e-4


def test_the_other_bytes_stay_and_the_source_comes_back(shop):
    files = krl(
        shop, [P1, "LIN Xp1 : { X 0.0 , Y -5 , Z -80.50 , A 0 , B 0 , C 0 } ; 1"]
    )
    done = shop.compensate(files)
    records = records_of(done.sidecar)
    check_bytes(files, {**files, **done.outputs}, records, done.visits)
    for name, record in records.items():
        assert restore(done.outputs[name], record, name) == files[name]
    text = done.outputs["job.src"]
    assert b"Z -80.50 " not in text and b", A 0 , B 0 , C 0 } ; 1" in text
    with pytest.raises(ProgramError, match="compensated already"):
        shop.compensate({**files, **done.outputs})


LEFT = {
    "computed": "LIN Xp1:{X 0,Y 0,Z -2*80,A 0,B 0,C 0}",
    "named frame": "LIN Xp1:FUP",
    "partial": "LIN Xp1:{X 0,Y 0,Z -160}",
    "twice": "LIN Xp1:{X 0,Y 0,Z -160,Z -100,A 0,B 0,C 0}",
    "by a variable": "LIN Xp1:{X 0,Y 0,Z NUP,A 0,B 0,C 0}",
    "joint move without S and T": f"PTP Xp1:{by(z=-160)}",
}


@pytest.mark.parametrize("kind", LEFT)
def test_shifts_that_are_no_plain_numbers_stay(shop, kind):
    data = "DECL FRAME FUP={X 0,Y 0,Z -160,A 0,B 0,C 0}\r\nDECL REAL NUP=-160"
    files = krl(shop, [P1, LEFT[kind]], data=data)
    done = shop.compensate(files)
    assert LEFT[kind].encode() in done.outputs.get("job.src", files["job.src"])
    assert b"FUP={X 0,Y 0,Z -160,A 0" in done.outputs.get("job.dat", files["job.dat"])


def test_a_point_that_is_read_stays_and_its_shift_makes_up_for_all(shop):
    data = "DECL REAL NUP=0"
    found = krl_landed(shop, [f"LIN Xp1:{by()}", P1, "NUP=Xp1.X"], data=data)
    assert found.status[-1] != "CORRECTED" and "CORRECTED" in found.status
    assert found.off_mm[0] < EXACT_MM


def test_a_statement_in_two_bases_keeps_its_numbers_where_they_disagree(shop):
    far = by(250, 200, -150)
    more = f"DEF at()\r\nLIN Xp1:{far}\r\nEND"
    base = "$BASE={X 420,Y 260,Z 330,A -30,B 10,C 5}"
    done = shop.compensate(krl(shop, ["at()", base, "at()"], more))
    assert f"LIN Xp1:{far}".encode() in done.outputs["job.src"]


def test_a_loop_that_comes_again_from_elsewhere_is_one_arrival_of_several(shop):
    lines = ["FOR I=1 TO 2", f"LIN Xp1:{by()}", P1, P2, "ENDFOR"]
    found = krl_landed(shop, lines, runs=[0, 1, 2, 0, 1, 2], data="DECL INT I")
    safe = np.array([s == "CORRECTED" for s in found.status])[2:]
    assert len(safe) == 6 and (found.off_mm[safe] < AGREED_MM).all()


def test_a_correction_beyond_the_limit_stays(shop):
    limits = shop.cell.limits.model_copy(update={"correction_mm": 0.5})
    small = Shop(replace(shop.cell, limits=limits), shop.model)
    done = small.compensate(krl(small, [P1, f"LIN Xp1:{by(z=-33)}"]))
    assert f"LIN Xp1:{by(z=-33)}".encode() in done.outputs["job.src"]
    assert "correction_mm" in " ".join(map(str, done.decisions.reasons))


def test_a_taught_point_leaves_its_shifts_alone(shop):
    files = krl(shop, [P1, f"LIN Xp1:{by()}"])
    data = files["job.dat"].decode().split("\r\n")
    marked = [x + " ; TAUGHT" if "Xp1=" in x else x for x in data]
    files["job.dat"] = "\r\n".join(marked).encode()
    done = shop.compensate(files)
    assert f"LIN Xp1:{by()}".encode() in done.outputs["job.src"]


def test_a_shift_that_is_taught_holds_its_point(shop):
    files = krl(shop, [P1, f"LIN Xp1:{by()} ; TAUGHT", P2])
    done = shop.compensate(files)
    status = [Status(s).name for s in done.decisions.status[2:].tolist()]
    assert status == ["CONFLICT", "UNCHANGED", "CORRECTED"]


@pytest.mark.parametrize("x", ["", "1+"])
def test_a_shift_of_points_that_are_not_all_known_stays(shop, x):
    """The shift makes up for what its points do not, as far as that is known."""
    files = krl(shop, ["FOR I=1 TO 2", f"LIN XL[I]:{by()}", "ENDFOR"])
    data = files["job.dat"].decode()
    point = re.search(r"Xp1=\{X (.*?)\}", data)[1]
    number, rest = point.split(",", 1)
    other = f"X {float(number) - 1.0 if x else number}"
    more = ["DECL INT I", "DECL E6POS XL[2]", f"XL[1]={{X {point}}}",
            f"XL[2]={{{other.replace('X ', 'X ' + x)},{rest}}}"]  # fmt: skip
    files["job.dat"] = data.replace("ENDDAT", "\r\n".join([*more, "ENDDAT"])).encode()
    done = shop.compensate(files)
    move = f"LIN XL[I]:{by()}".encode()
    assert (move in done.outputs.get("job.src", files["job.src"])) == bool(x)


def test_a_shared_point_stays_and_its_shift_makes_up_for_it(shop):
    files = krl(shop, [P1, f"LIN Xp1:{by()}"])
    files["job.dat"] = (
        files["job.dat"].replace(b"DEFDAT job", b"DEFDAT job PUBLIC")
        .replace(b"DECL E6POS Xp1", b"DECL GLOBAL E6POS Xp1")
    )  # fmt: skip
    done = shop.compensate(files)
    assert done.outputs.get("job.dat", files["job.dat"]) == files["job.dat"]
    assert f"LIN Xp1:{by()}".encode() not in done.outputs["job.src"]


def on_track(shop, lines, places):
    """Compensate a job of an arm on a track, given E1 of points."""
    aux = shop.cell.file.model_copy(update={"aux": {"1": "track"}})
    told = Shop(replace(shop.cell, file=aux, aux={1: "track"}), shop.model)
    files = krl(told, lines)
    data = files["job.dat"].decode()
    for name in ("Xp1", "Xp2", "Xp3"):
        place = f"\\1,E1 {places.get(name, 0)}}}"
        data = re.sub(rf"({name}={{[^}}]*)}}", place, data)
    return told.compensate({**files, "job.dat": data.encode()})


def test_a_frame_behind_a_point_leaves_the_track_where_it_is(shop):
    start = "PTP {A1 -29,A2 6,A3 -109,A4 16,A5 49,A6 16}"
    lines = ["LIN Xp2", start, f"LIN Xp1:{by()}"]
    found = on_track(shop, lines, {"Xp2": 500})
    assert Status(found.decisions.status[-1]) != Status.CORRECTED
    assert Status(on_track(shop, lines, {}).decisions.status[-1]) == Status.CORRECTED


@pytest.mark.parametrize(("e1", "left"), [(0, False), (500, True)])
def test_what_stands_behind_a_point_says_where_the_track_goes(shop, e1, left):
    line = f"LIN Xp1:{{E6POS: X 0,Y 5,Z -80,A 0,B 0,C 0,E1 {e1}}}"
    found = on_track(shop, [P1, line], {})
    assert (Status(found.decisions.status[-1]) != Status.CORRECTED) == left


def test_a_frame_before_a_point_leaves_the_track_to_the_point(shop):
    line = "LIN {E6POS: X 0,Y 5,Z 80,A 0,B 0,C 0,E1 500}:Xp1"
    found = on_track(shop, [P1, line], {})
    assert Status(found.decisions.status[-1]) == Status.CORRECTED


def test_with_turns_all_that_is_written_turns(job_cell, job_model):
    shop = Shop.of(job_cell, job_model, Options(orientation=True))
    lines = [
        P1,
        f"LIN Xp1:{by(150, -120, -200, 8, -5, 4)}",
        f"LIN {by(50, 60, 90)}:Xp1",
    ]
    found = krl_landed(shop, lines)
    assert set(found.status[2:]) == {"CORRECTED"}, found.whys
    assert found.off_mm.max() < EXACT_MM and found.turned_deg.max() < 5e-4
