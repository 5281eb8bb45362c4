"""The predicted path accuracy is what the virtual arm does, and a slow loop says."""

from __future__ import annotations

import json
import tempfile
from dataclasses import replace
from functools import cache
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest

from postproc.compensation.findings.timing_comparison import InTime, run_in_time
from postproc.compensation.options import DEFAULT_OPTIONS, Clock, Job, no_progress
from postproc.compensation.paths.path_error import apart
from postproc.compensation.program import plan_visits, prepare_cell, read_program
from postproc.language.visits import Visits
from postproc.model.effects import BASE_EFFECTS
from postproc.model.flank_hypotheses import FlankKind
from postproc.model.model import load_model
from postproc.report.simulation import setup_of, visits_of
from postproc.robot.cell import load_cell
from postproc.robot.pose import MM
from postproc.robot.state import make_states
from postproc.robot.trajectory import Motion
from postproc.simulation import DEFAULT, run_program, virtual_arm
from postproc.simulation import path as simulated
from postproc.simulation.path import _tracks
from tests.written import cli

ROOT = Path(__file__).parents[3]
CELL = ROOT / "programs/cell.toml"
SEED = 41  # of the virtual arm
ARM = ("--set", f"simulation.seed={SEED}")
DESIGN = ("--poses", 250, "--set", "survey.seed=9")
LINES = 12
START = (
    "MOVE JOINT TO {4.0, -6.0, -84.0, 9.0, 53.0, -12.0}",
    "MOVE JOINT TO {0.0, 0.0, -90.0, 0.0, 60.0, 0.0}",
)


def pos(place: np.ndarray, turn: np.ndarray) -> str:
    return f"POS({', '.join(f'{v:.4f}' for v in (*place, *turn))}, '')"


def drawn() -> list[tuple[str, ...]]:
    """Draw moves to a place and on from there: lines of 200 to 500 mm, then arcs."""
    rng, moves = np.random.default_rng(3), []
    for k in range(60):
        begin, way = rng.uniform((-250, -300, 0), (250, 150, 300)), rng.normal(size=3)
        way *= rng.uniform(200, 500) / np.linalg.norm(way)
        turn = rng.uniform((65, 155, -50), (115, 168, 50))
        on = f"LINEAR TO {pos(begin + way, turn)}"
        if k >= 45:
            aside = np.cross(way, (0.0, 0.0, 1.0)) / 3
            via = pos(begin + way / 2 + aside, turn)
            on = f"CIRCULAR TO {pos(begin + way, turn)} VIA {via}"
        moves.append((f"  MOVE JOINT TO {pos(begin, turn)}", f"  MOVE {on}"))
    return moves


@cache
def job(lines: int = LINES) -> str:
    """Write lines and arcs with stops that the arm can reach."""
    kept: dict[str, list[str]] = {"LINEAR": [], "CIRCULAR": []}
    for moves in drawn():
        text = "\r\n".join(["PROGRAM job", "BEGIN", *START, *moves, "END job", ""])
        visits = read_program({"job.pdl": text.encode()}, load_cell(CELL)).visits
        if not plan_visits(visits, load_cell(CELL)).plan.reason.any():
            kept[moves[1].split()[1]] += moves
    moves = [*kept["LINEAR"][: 2 * lines], *kept["CIRCULAR"][:4]]
    return "\r\n".join(["PROGRAM job", "BEGIN", *START, *moves, "END job", ""])


def done(*arguments: object) -> None:
    found = cli(*arguments)
    assert found.exit_code in (0, 1), found.stderr


@cache
def fitted() -> bytes:
    """Survey the virtual arm and fit a model, once for all that test with it."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        survey, model = folder / "survey.pdl", folder / "model.json"
        done("survey", "--cell", CELL, *DESIGN, "-o", survey)
        measured = folder / "survey.csv"
        done("simulate", survey, "--cell", CELL, *ARM, "-o", measured)
        # All that this arm has: to look for effects would fit ten times.
        effects = ",".join(BASE_EFFECTS)
        done("fit", measured, "--cell", CELL, "-o", model, "--effects", effects)
        return model.read_bytes()


FINE = 1e-4  # [m] between places that are looked at


@pytest.fixture(scope="module")
def shop(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An arm surveyed, and a job compensated for it."""
    folder = tmp_path_factory.mktemp("paths")
    (folder / "job.pdl").write_text(job())
    model = folder / "model.json"
    model.write_bytes(fitted())
    done("compensate", folder / "job.pdl", "--cell", CELL, "--model", model,
         "-o", folder / "out.pdl", "--report", folder / "report.json")  # fmt: skip
    with patch.object(simulated, "STEP", FINE):  # links jump between coarse places
        for name in ("job", "out"):
            done("simulate", folder / f"{name}.pdl", "--cell", CELL, *ARM,
                 "--reference", folder / "job.pdl", "--path",
                 "--report", folder / f"{name}.json")  # fmt: skip
    return folder


@pytest.fixture(scope="module")
def ran(shop: Path) -> tuple[InTime, Job]:
    """The job in time, before and after."""
    model, given = load_model(shop / "model.json"), load_cell(CELL)
    cell = prepare_cell(given, model, DEFAULT_OPTIONS)
    readings = [
        read_program({"job.pdl": (shop / name).read_bytes()}, cell)
        for name in ("job.pdl", "out.pdl")
    ]
    setting = Job(cell, model, DEFAULT_OPTIONS, Clock(no_progress))
    position = np.full((len(readings[0].visits), 3), np.nan)
    return run_in_time(*readings, position, setting), setting


@pytest.mark.slow
def test_it_is_what_the_virtual_arm_does(shop: Path) -> None:
    report = json.loads((shop / "report.json").read_bytes())
    assert len(report["path"]) == LINES + 4  # an arc is two paths
    for key, name in (("before", "job"), ("after", "out")):
        truth = json.loads((shop / f"{name}.json").read_bytes())
        real = {move["visit"]: move for move in truth["path"]}
        pairs = [(p["max_mm"][key], real[p["visit"]]["max_mm"]) for p in report["path"]]
        told, found = np.array(pairs).T
        assert np.abs(told - found).mean() < 0.02 and np.abs(told - found).max() < 0.06
        along = [
            abs(p["along_mm"][key] - real[p["visit"]]["along_mm"])
            for p in report["path"]
        ]
        assert np.mean(along) < 0.03
        assert truth["path_accuracy"]["max_mm"] == pytest.approx(found.max(), abs=1e-5)
    before, after = (report["path_accuracy"][key] for key in ("before", "after"))
    assert after["mean_mm"] < 0.5 * before["mean_mm"]
    assert 0.05 < after["max_mm"]  # right at its ends, and not between them


# Rounded corners.

ZONE = 8.0  # [mm]
CORNERS = ((0, -200, 150), (0, 100, 150), (150, 100, 250), (150, -150, 250))


def rounded() -> str:
    """Write lines between stops at both ends, flown through with zones."""
    turn, places = np.array([100.0, 160.0, 0.0]), np.array(CORNERS, dtype=float)
    moves = [f"  MOVE LINEAR TO {pos(places[0], turn)}"]
    moves += [f"  MOVEFLY LINEAR TO {pos(p, turn)} ADVANCE" for p in places[1:-1]]
    head = ("$LIN_SPD := 0.1", "$FLY_TYPE := FLY_CART", "$FLY_TRAJ := FLY_FROM",
            f"$FLY_DIST := {ZONE:g}")  # fmt: skip
    moves.append(f"  MOVE LINEAR TO {pos(places[-1], turn)}")
    return "\r\n".join(["PROGRAM job", "BEGIN", *head, *START, *moves, "END job", ""])


def real_corners(folder: Path, name: str) -> dict[int, float]:
    """How near the virtual arm comes to every target on its ways, by visit [mm]."""
    cell = load_cell(CELL)
    setup, wanted = setup_of(cell), visits_of(folder / "round.pdl", cell)
    arm = virtual_arm(SEED, DEFAULT, coupling=setup.coupling, rows=1, tool=setup.tool)
    corner, real = (
        dict(_tracks(arm, setup, run_program(arm, setup, visits)))
        for visits in (with_stops(wanted), visits_of(folder / name, cell))
    )
    found = {}
    for v in real.keys() & corner.keys():
        way = np.vstack([real[k].real for k in (v, v + 1) if k in real])
        place = corner[v].nominal[-1]
        found[v] = float(np.linalg.norm(way - place, axis=1).min() / MM)
    return found


def with_stops(visits: Visits) -> Visits:
    """Let the arm stop at all targets, so that it goes to them."""
    return visits.with_columns(fly=np.zeros(len(visits), dtype=bool))


def test_rounded_corners_are_passed_as_the_virtual_arm_does(shop: Path) -> None:
    (shop / "round.pdl").write_text(rounded())
    done("compensate", shop / "round.pdl", "--cell", CELL, "--model",
         shop / "model.json", "-o", shop / "round.out.pdl",
         "--report", shop / "round.json", "--report", shop / "round.html")  # fmt: skip
    assert "Cornering round-off" in (shop / "round.html").read_text()
    report = json.loads((shop / "round.json").read_bytes())
    told = {p["visit"]: p["corner_mm"] for p in report["path"] if "corner_mm" in p}
    places = np.array(CORNERS, dtype=float)
    steps = np.diff(places, axis=0)
    units = steps / np.linalg.norm(steps, axis=1)[:, None]
    programmed = ZONE / 4 * np.linalg.norm(np.diff(units, axis=0), axis=1)
    assert len(told) == len(programmed) == 2  # not where the arm stops
    for key, name in (("before", "round.pdl"), ("after", "round.out.pdl")):
        real = real_corners(shop, name)
        off = [abs(sizes[key] - real[v]) for v, sizes in told.items()]
        assert max(off) < 0.03
    after = np.array([sizes["after"] for sizes in told.values()])
    assert np.abs(after - programmed).max() < 0.1  # corrected, the zones are left
    most = report["path_accuracy"]["cornering_round_off"]["after"]["max_mm"]
    assert most == pytest.approx(after.max(), abs=1e-5)


@pytest.mark.slow
def test_it_is_what_a_slow_loop_says(ran: tuple[InTime, Job]) -> None:
    found, setting = ran
    cell, model, cycle = setting.cell, setting.model, found.before
    arm, paths = cell.arm, found.paths
    half = 2 * arm.play
    edge, source = cycle.ways
    for k, visit in enumerate(paths.visit.tolist()):
        if cycle.targets.move[visit] != Motion.LINEAR:
            continue
        play = cycle.arrived.past.play
        lo, hi = (np.array(side[source[visit]]) for side in (play.lo, play.hi))
        assert (lo == hi).all()  # the job begins with joints that are told
        begin, end = cycle.path.edges.start[edge[visit] : edge[visit] + 2]
        q = np.vstack([cycle.path.q[source[visit]], cycle.path.edges.path[begin:end]])
        sizes = []
        for here in fine(q):
            drive = arm.coupling @ here
            lo = np.clip(lo, drive - half, drive + half)
            tool = cycle.targets.tool[visit, :3, 3]
            state = make_states(here[None], ((drive - lo) / half)[None], tool,
                                payload=cell.payload_mass,
                                payload_com=cell.payload_com)  # fmt: skip
            error = model.error(arm, state)[0]
            ends = arm.tcp(q[[0, -1]], np.tile(tool, (2, 1)))
            heading = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
            sizes.append(np.linalg.norm(error - (error @ heading) * heading))
        # where a drive has crossed is a kink, which samples 8 times as dense miss
        assert max(sizes) == pytest.approx(paths.before.sizes[k], abs=6e-6)


def fine(q: np.ndarray) -> np.ndarray:
    """Sample a joint path 40 times as densely, straight between its places."""
    marks = np.arange(len(q))
    inner = np.linspace(0, len(q) - 1, 40 * (len(q) - 1) + 1)
    return np.stack([np.interp(inner, marks, column) for column in q.T], axis=1)


def test_at_the_targets_the_compensated_program_is_right(ran) -> None:
    paths = ran[0].paths
    last = paths.first[1:] - 1
    assert paths.after.across[last].max() < 2e-5
    assert paths.before.across[last].min() > 1e-4
    assert (paths.way[last] > 0).all() and (np.diff(paths.way[: last[0]]) > 0).all()


def test_where_links_come_to_rest_samples_are_close(ran) -> None:
    """The largest deviation stands there: 0.3 mm farther it may be smaller."""
    paths = ran[0].paths
    moved = np.abs(np.diff(paths.side, axis=0)) > 0.02
    arrives = (moved & (np.abs(paths.side[1:]) > 0.999)).any(axis=1)
    arrives[paths.first[1:-1] - 1] = False
    assert arrives.sum() > 10
    assert np.diff(paths.way)[arrives].max() < 0.3 * MM


def test_sides_that_nobody_knows_widen_it(shop: Path, ran) -> None:
    _, setting = ran
    text = "\r\n".join(line for line in job().split("\r\n") if line not in START)
    readings = [read_program({"job.pdl": text.encode()}, setting.cell)] * 2
    nowhere = np.full((len(readings[0].visits), 3), np.nan)
    paths = run_in_time(*readings, nowhere, setting).paths
    first = paths.samples(0)
    assert paths.before.unsure[first].max() > 1e-5
    assert paths.before.unsure[paths.samples(len(paths) - 1)].max() < 1e-9
    np.testing.assert_allclose(paths.after.across, paths.before.across, atol=1e-12)


def test_the_program_as_written_is_told_at_other_samples(ran) -> None:
    paths = ran[0].paths
    same = paths.as_written(paths).before
    for name, column in vars(paths.before).items():
        np.testing.assert_array_equal(getattr(same, name), column)
    some = np.arange(len(paths) - 2, len(paths))
    every = np.concatenate([np.arange(len(paths.way))[paths.samples(k)][::-3][::-1]
                            for k in some])  # fmt: skip
    count = [-(-np.diff(paths.first)[k] // 3) for k in some]
    fewer = replace(
        paths, visit=paths.visit[some], first=np.cumsum([0, *count]),
        way=paths.way[every],
    )  # fmt: skip
    told = paths.as_written(fewer).before
    np.testing.assert_array_equal(told.sizes, paths.before.sizes[some])
    np.testing.assert_array_equal(told.shares, paths.before.shares[some])
    others = np.setdiff1d(np.arange(len(every)), told.largest)
    np.testing.assert_array_equal(told.off[others], paths.before.off[every][others])


@pytest.mark.parametrize("kind", [FlankKind.ELASTIC, FlankKind.START])
def test_a_case_is_where_the_error_is_with_a_joint_on_that_side(
    shop: Path, ran: tuple[InTime, Job], kind: FlankKind
) -> None:
    _, setting = ran
    lines = [line for line in job().split("\r\n")
             if kind is FlankKind.ELASTIC or line not in START]  # fmt: skip
    reading = read_program({"job.pdl": "\r\n".join(lines).encode()}, setting.cell)
    n = len(reading.visits)
    paths = run_in_time(
        reading, reading, np.full((n, 3), np.nan), setting, np.arange(n)
    ).paths
    cases = paths.cases
    assert cases is not None
    own = [case for case in cases.cases if case.key[1] is kind]
    assert own and all((np.diff(case.rows) > 0).all() for case in own)
    for case in own:
        joint, rows = case.key[0] - 1, case.rows
        side = np.array(cases.run.side[rows])
        sides = [s for found, _, s in cases.open_sides().of(joint)
                 if found is kind]  # fmt: skip
        far = []
        for one in sides:
            side[:, joint] = one[rows]
            moved = cases.error(cases.run, rows, side)
            usual = cases.error(cases.run, rows, cases.run.side[rows])
            off = cases.off[rows] + moved - usual
            far.append(apart(off, cases.tangent[rows])[0])
        least = min(np.abs(one - case.across).max() for one in far)
        assert least < 5e-8  # linear in the side, nearly
