"""Full poses: --orientation corrects how the tool is turned, by default only where."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from postproc.compensation.compensate import compensate
from postproc.compensation.options import Options
from postproc.compensation.outcome import Status
from postproc.compensation.program import read_program
from postproc.compensation.solver.inverse_model import turn_std
from postproc.exceptions import ModelError
from postproc.language.visits import Visits
from postproc.report.simulation import setup_of
from postproc.robot.pose import MM, angles_near, rotation_from_zyz, rotation_vector
from postproc.robot.state import make_states
from postproc.simulation import run_program, virtual_arm
from tests.conftest import SEED
from tests.plant import program
from tests.written import FIRST, cli, entry
from tests.written import program as lines

FULL = Options(orientation=True)
TARGETS = 40
LOST = 1  # the first visit, whose side nobody knows


def errors(
    cell, asked: Visits, executed: Visits, seed: int = SEED
) -> tuple[np.ndarray, np.ndarray]:
    """Return how far every target is missed [mm] and how far it is turned [mrad]."""
    arm, setup = virtual_arm(seed), setup_of(cell)
    wanted = arm.nominal_pose(run_program(arm, setup, asked).arrivals)
    landed = arm.pose(run_program(arm, setup, executed).arrivals)
    across = landed[:, :3, :3] @ np.swapaxes(wanted[:, :3, :3], 1, 2)
    missed = np.linalg.norm(landed[:, :3, 3] - wanted[:, :3, 3], axis=1) / MM
    turned = np.linalg.norm(rotation_vector(across), axis=1) * 1e3
    return missed[LOST:], turned[LOST:]


def inline() -> dict[str, bytes]:
    return {"job.pdl": program("job", TARGETS, 3)}


def tilted() -> dict[str, bytes]:
    """Points of a variable file, and joint targets between them."""
    rng, text, moves = np.random.default_rng(5), [], []
    for k in range(12):
        x, angle = rng.uniform(0, 300), rng.uniform(-40, 40)
        point = entry(f"w{k}", x).replace("E: 175.000", f"E: {150 + k:.3f}")
        text.append(point.replace("A: 0.000", f"A: {angle:.3f}"))
        q = np.array([-10.0, 15, -100, 20, 60, 0]) + rng.uniform(-8, 8, 6)
        joints = ", ".join(f"{v:.5f}" for v in q)
        moves += [f"MOVE LINEAR TO w{k}", f"MOVE JOINT TO {{{joints}}}"]
    names = ", ".join(f"w{k}" for k in range(12))
    source = lines(FIRST, *moves, declared=f"{names} : XTNDPOS FOR ARM[1]")
    return {"job.pdl": source, "job.lsv": "".join(text).encode()}


@pytest.mark.parametrize("files", [inline(), tilted()], ids=["inline", "variables"])
def test_orientations_land_too_and_positions_no_worse(job_cell, job_model, files):
    asked = read_program(files, job_cell).visits
    missed, turned = errors(job_cell, asked, asked)
    found = {}
    for options in (Options(), FULL):
        done = compensate(
            files["job.pdl"], job_cell, job_model, name="job.pdl",
            variables=files.get("job.lsv"), options=options,
        )  # fmt: skip
        assert (done.decisions.status == Status.CORRECTED).all(), (
            done.list_uncorrected()
        )
        executed = read_program({**files, **done.outputs}, job_cell).visits
        found[options] = errors(job_cell, asked, executed)
    place, full = found[Options()], found[FULL]
    assert turned.mean() > 1.0 and missed.mean() > 0.8
    assert full[1].mean() < 0.1 * turned.mean()
    assert full[1].mean() < 0.1
    assert full[0].mean() < place[0].mean() + 0.005
    assert full[0].mean() < 0.03


def test_by_default_the_written_angles_stay(desk, job_model):
    source, out = desk.put("job.pdl", inline()["job.pdl"]), desk.folder / "out.pdl"
    assert desk.compensate(source, "-o", out).exit_code == 0
    angles = re.findall(rb"([^,]*, 180.000, [^,]*), ''", out.read_bytes())
    assert angles == [b" 0.000, 180.000, 0.000"] * TARGETS


def test_full_poses_are_written_and_given_back(desk):
    before = inline()["job.pdl"]
    source, out = desk.put("job.pdl", before), desk.folder / "out.pdl"
    report = desk.report(source, "-o", out, "--orientation")
    assert b" 180.000, " not in out.read_bytes()
    turns = np.array([row["correction_deg"] for row in report["targets"]])
    assert 0.05 < np.linalg.norm(turns, axis=1).mean() < 0.2
    assert "correction_deg" not in desk.report(source)["targets"][0]
    assert cli("restore", out).exit_code == 0
    assert out.read_bytes() == before


def test_a_batch_corrects_orientations_when_asked_to(desk):
    (desk.folder / "src").mkdir()
    source = desk.put("src/job.pdl", inline()["job.pdl"])
    out, target = desk.folder / "out.pdl", desk.folder / "dst"
    given = ("batch", source.parent, target, "--jobs", 1, "--resume",
             "--cell", desk.cell, "--model", desk.model)  # fmt: skip
    for options in ((), ("--orientation",), ("--orientation",), ()):
        assert desk.compensate(source, "-o", out, *options).exit_code == 0
        keys = ("--set", "compensation.orientation=true") if options else ()
        assert cli(*given, *keys).exit_code == 0  # redone for another option
        assert (target / "job.pdl").read_bytes() == out.read_bytes()


def test_a_model_of_one_point_does_not_know_rotations(desk, job_cell, job_model):
    single = job_model.ranges.tools[:1]
    model = replace(job_model, ranges=replace(job_model.ranges, tools=single))
    with pytest.raises(ModelError, match=r"one point of the tool.*three points.*6D"):
        compensate(inline()["job.pdl"], job_cell, model, options=FULL)
    model.save(desk.folder / "one.json")
    source = desk.put("job.pdl", inline()["job.pdl"])
    found = cli("compensate", source, "--cell", desk.cell, "--model",
                desk.folder / "one.json", "--orientation")  # fmt: skip
    assert (
        found.exit_code == 2
        and "orientation: the model was surveyed at one" in found.stderr
    )
    assert desk.names() == {"job.pdl", "one.json"}


def test_a_correction_that_turns_too_far_is_guarded(job_cell, job_model):
    limits = job_cell.limits.model_copy(update={"correction_deg": 0.001})
    cell = replace(job_cell, limits=limits)
    done = compensate(inline()["job.pdl"], cell, job_model, options=FULL)
    assert (done.decisions.status == Status.REJECTED).all()
    assert "correction_deg = 0.001" in done.list_uncorrected()[0]


def test_the_standard_error_of_the_rotation_covers_it(job_cell, job_model):
    """Hold the predicted rotation against the true one, in its standard errors."""
    rng, arm = np.random.default_rng(2), virtual_arm(SEED)
    low, high = [-40, -20, -110, -80, 25, -80], [40, 20, -80, 80, 70, 80]
    q = np.deg2rad(rng.uniform(low, high, (200, 6)))
    tool = job_cell.tool.pose
    from postproc.simulation.state import make_arrivals

    side = rng.choice([-1.0, 1.0], q.shape)
    usual = setup_of(job_cell)
    reached = make_arrivals(
        q, side, np.tile(tool, (len(q), 1, 1)), temperature=usual.temperature
    )
    truth = rotation_vector(
        arm.pose(reached)[:, :3, :3]
        @ np.swapaxes(arm.nominal_pose(reached)[:, :3, :3], 1, 2)
    )
    states = make_states(q, side, np.tile(tool[:3, 3], (len(q), 1)))
    off = truth - job_model.evaluator(job_cell.arm).turns(states)
    z = off / turn_std(job_model, job_cell.arm, states)
    assert np.sqrt((off**2).sum(axis=1).mean()) < 1e-4
    assert 0.5 < np.sqrt((z**2).mean()) < 2.0


def test_angles_next_to_the_written_ones_say_the_rotation():
    rng = np.random.default_rng(0)
    written = rng.uniform(-400, 400, (500, 3))
    written[:100, 1] = rng.choice([0.0, 180.0, -180.0, 360.0], 100)
    turned = rotation_from_zyz(written)
    np.testing.assert_array_equal(angles_near(written, turned), written)
    from scipy.spatial.transform import Rotation

    by = Rotation.from_rotvec(1e-4 * rng.standard_normal((500, 3))).as_matrix()
    found = angles_near(written, by @ turned)
    np.testing.assert_allclose(rotation_from_zyz(found), by @ turned, atol=1e-9)
    upright = np.abs(np.sin(np.deg2rad(written[:, 1]))) < 0.1
    assert np.abs(found - written)[~upright].max() < 0.3
