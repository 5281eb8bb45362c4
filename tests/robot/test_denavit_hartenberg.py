"""Arms of other structures from URDFs, held against pinocchio's reading of these."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation

from postproc.exceptions import ArmError
from postproc.robot.arm import Arm, load_arm
from postproc.robot.ortho_parallel import arm_text, find_closed_form_obstacle
from postproc.robot.urdf import read_chain
from tests.robot import urdfs
from tests.robot.urdfs import QUARTER, Row, turning, urdf_text
from tests.written import cli

X, Y, Z = np.eye(3)
Lines = list[tuple[np.ndarray, np.ndarray]]


def lines_of(*rows: tuple[np.ndarray, tuple[float, float, float]]) -> Lines:
    """Give axes and what their points lie from the last one."""
    points = np.cumsum([shift for _, shift in rows], axis=0)
    return [(axis, point) for (axis, _), point in zip(rows, points, strict=True)]


def tilted(degrees: float, axis: str) -> np.ndarray:
    out: np.ndarray = Rotation.from_euler(axis, degrees, degrees=True).apply(Z)
    return out


def offset_wrist(draw) -> Lines:
    """As a UR: three parallel axes, then three of a wrist that do not meet."""
    return lines_of(
        (Z, (0, 0, draw(0.1, 0.3))), (Y, (0, draw(0.1, 0.2), 0)),
        (-Y, (draw(0.1, 0.2), 0, draw(0.5, 0.9))), (Y, (draw(0.3, 0.6), -0.02, 0.1)),
        (Z, (0, draw(0.08, 0.2), 0.1)), (Y, (0, 0.03, draw(0.08, 0.2))),
    )  # fmt: skip


def shifted_axis_6(draw) -> Lines:
    """As a CRX or a GoFa: axis 6 passes beside the point where 4 and 5 meet."""
    return lines_of(
        (Z, (0, 0, draw(0.2, 0.4))), (Y, (draw(0.0, 0.2), 0, 0)),
        (Y, (0, 0, draw(0.4, 0.8))), (-X, (0, 0, draw(0.05, 0.2))),
        (Y, (draw(0.4, 0.8), 0, 0)), (X, (0.1, 0, draw(0.05, 0.15))),
    )  # fmt: skip


def oblique_wrist(draw) -> Lines:
    """As a painting arm: the axes of its wrist stand oblique to one another."""
    return lines_of(
        (Z, (0, 0, draw(0.3, 0.6))), (Y, (draw(0.1, 0.3), 0, 0)),
        (Y, (0, 0, draw(0.6, 0.9))), (Z, (0.1, 0, 0.3)),
        (tilted(draw(40, 70), "x"), (0, 0, draw(0.3, 0.5))),
        (tilted(draw(-30, -10), "x"), (0, 0.05, draw(0.05, 0.1))),
    )  # fmt: skip


def two_upright_axes(draw) -> Lines:
    """As a SCARA that carries a wrist: axis 2 is parallel to axis 1."""
    return lines_of(
        (-Z, (0, 0, 0.1)), (Z, (draw(0.3, 0.5), 0.1, 0.4)),
        (Y, (draw(0.2, 0.4), 0, 0)), (X, (0.1, 0, draw(0.2, 0.4))),
        (Y, (draw(0.2, 0.4), 0.05, 0)), (X, (0.1, 0, 0.08)),
    )  # fmt: skip


def skew(draw) -> Lines:
    """Six axes of which no two meet or are parallel."""
    rows = [(Z, (0.0, 0.0, 0.2))]
    for _ in range(5):
        away = np.array([draw(-1, 1) for _ in range(3)])
        rows.append(
            (away / np.linalg.norm(away), tuple(draw(-0.4, 0.4) for _ in range(3)))
        )
    return lines_of(*rows)


STRUCTURES = [offset_wrist, shifted_axis_6, oblique_wrist, two_upright_axes, skew]


def written(lines: Lines, rng: np.random.Generator) -> str:
    """Write a URDF whose joint frames stand anyhow and anywhere on their axes."""
    parts, here = ['<robot name="drawn">', '<link name="base_link"/>'], np.eye(4)
    parent = "base_link"
    for k, (axis, point) in enumerate(lines, start=1):
        frame = np.eye(4)
        frame[:3, 3] = point + axis * rng.uniform(-0.2, 0.2)
        frame[:3, :3] = here[:3, :3] @ plain_rotation(rng)
        parts += joint(f"j{k}", parent, f"l{k}", np.linalg.inv(here) @ frame,
                       frame[:3, :3].T @ axis)  # fmt: skip
        here, parent = frame, f"l{k}"
    axis, point = lines[-1]
    flange = np.eye(4)
    turn = Rotation.align_vectors([axis], [Z])[0] * Rotation.from_euler("z", 0.4)
    flange[:3, :3], flange[:3, 3] = turn.as_matrix(), point + 0.1 * axis
    parts += joint("f", parent, "tool0", np.linalg.inv(here) @ flange, None)
    return "\n".join([*parts, "</robot>"])


def plain_rotation(rng: np.random.Generator) -> np.ndarray:
    """Draw a rotation of which no angle is nearly a quarter turn: these are rounded."""
    while True:
        rpy = rng.uniform([-3, -1.5, -3], [3, 1.5, 3])
        if (np.abs(rpy - np.round(rpy / (np.pi / 2)) * np.pi / 2) > 0.01).all():
            out: np.ndarray = Rotation.from_euler("xyz", rpy).as_matrix()
            return out


def joint(name, parent, child, place, axis) -> list[str]:
    def words(vector):
        return " ".join(repr(float(v)) for v in vector)

    rpy = Rotation.from_matrix(place[:3, :3]).as_euler("xyz")
    kind = "fixed" if axis is None else "revolute"
    inside = "" if axis is None else f'<axis xyz="{words(axis)}"/>'
    return [
        f'<link name="{child}"/>',
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/>',
        f'<child link="{child}"/>{inside}',
        f'<origin xyz="{words(place[:3, 3])}" rpy="{words(rpy)}"/>',
        '<limit lower="-2.5" upper="2.6" velocity="2" effort="1"/></joint>',
    ]


def by_pinocchio(path: Path, q: np.ndarray) -> np.ndarray:
    """Place tool0 for joint angles (n, 6) [rad], (n, 4, 4) [m]."""
    model = pin.buildModelFromUrdf(str(path))
    data, tip = model.createData(), model.getFrameId("tool0")
    out = []
    for angles in q:
        pin.framesForwardKinematics(model, data, angles)
        out.append(data.oMf[tip].homogeneous.copy())
    return np.array(out)


def made(folder: Path, structure, seed: int) -> tuple[Path, Arm]:
    rng = np.random.default_rng(seed)
    lines = structure(lambda low, high: float(rng.uniform(low, high)))
    path = folder / "robot.urdf"
    path.write_text(written(lines, rng))
    (folder / "arm.toml").write_text(arm_text(read_chain(path), 0.05))
    return path, load_arm(folder / "arm.toml")


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("structure", STRUCTURES)
def test_the_flange_is_where_pinocchio_puts_it(tmp_path, structure, seed):
    path, arm = made(tmp_path, structure, seed)
    q = np.random.default_rng(seed).uniform(-3.0, 3.0, (200, 6))
    np.testing.assert_allclose(arm.flange(q), by_pinocchio(path, q), atol=1e-9)
    assert arm.file.opw is None
    np.testing.assert_allclose(arm.lower, -2.5)
    np.testing.assert_allclose(arm.upper, 2.6)
    np.testing.assert_allclose(arm.velocity, 2.0)
    assert np.abs(np.concatenate([arm.dh.a, arm.dh.d])).max() < 10.0
    assert (np.abs(arm.file.dh.offset_deg[:5]) <= 90.0).all()


@pytest.mark.parametrize("structure", STRUCTURES)
def test_what_the_inverse_finds_leads_there(tmp_path, structure):
    _, arm = made(tmp_path, structure, 1)
    q = np.random.default_rng(5).uniform(-2.5, 2.5, (60, 6))
    wanted = arm.flange(q)
    found = arm.nearest(wanted, q)
    there = ~np.isnan(found[:, 0])
    np.testing.assert_allclose(arm.flange(found[there]), wanted[there], atol=1e-9)
    assert there.sum() > 50


@pytest.mark.parametrize("structure", STRUCTURES)
def test_a_solution_nearby_is_found(tmp_path, structure):
    """An arm may have 16 solutions, more than there are names of branches."""
    _, arm = made(tmp_path, structure, 1)
    rng = np.random.default_rng(5)
    q = rng.uniform(-2.5, 2.5, (300, 6))
    least = np.linalg.svd(arm.jacobian(q, np.zeros(3)), compute_uv=False)[:, -1]
    q = q[least > 0.02]
    wanted = q + rng.uniform(-0.005, 0.005, q.shape)
    found = arm.nearest(arm.flange(wanted), q, arm.branch(q))
    assert len(q) > 150
    np.testing.assert_allclose(found, wanted, atol=1e-8)


THREE_PARALLEL = (  # a UR's lengths, upright
    turning(1, (0.0, 0.0, 0.1273), urdfs.Z),
    turning(2, (0.0, 0.220941, 0.0), urdfs.Y, (0.0, QUARTER, 0.0)),
    turning(3, (0.0, -0.1719, 0.612), urdfs.Y),
    turning(4, (0.0, 0.0, 0.5723), urdfs.Y, (0.0, QUARTER, 0.0)),
    turning(5, (0.0, 0.1149, 0.0), urdfs.Z),
    turning(6, (0.0, 0.0, 0.1157), urdfs.Y),
    Row((0.0, 0.0922, 0.0), (-QUARTER, 0.0, 0.0)),
)


def test_three_parallel_axes_have_their_offset_in_one_length(tmp_path):
    path = tmp_path / "robot.urdf"
    path.write_text(urdf_text(THREE_PARALLEL))
    (tmp_path / "arm.toml").write_text(arm_text(read_chain(path), 0.1))
    arm = load_arm(tmp_path / "arm.toml")
    q = np.random.default_rng(7).uniform(-6.0, 6.0, (300, 6))
    np.testing.assert_allclose(arm.flange(q), by_pinocchio(path, q), atol=1e-12)
    assert arm.file.dh.a_mm == [0.0, 612.0, 572.3, 0.0, 0.0, 0.0]
    assert arm.file.dh.d_mm == [127.3, 0.0, 0.0, 163.941, 115.7, 92.2]


UR10_URDF = [  # the lengths of ROS-Industrial's ur10, upright frames
    (Z, (0.0, 0.0, 0.1273)), (-Y, (0.0, 0.0, 0.0)), (-Y, (-0.612, 0.0, 0.0)),
    (-Y, (-0.5723, 0.0, 0.0)), (-Z, (0.0, -0.163941, 0.0)), (-Y, (0.0, 0.0, -0.1157)),
]  # fmt: skip


def test_a_ur10_is_the_shipped_one(tmp_path):
    path = tmp_path / "robot.urdf"
    path.write_text(written(lines_of(*UR10_URDF), np.random.default_rng(1)))
    (tmp_path / "arm.toml").write_text(arm_text(read_chain(path), 0.1))
    found, shipped = load_arm(tmp_path / "arm.toml").file.dh, load_arm("ur10").file.dh
    for key in ("a_mm", "alpha_deg", "sense"):
        assert getattr(found, key) == getattr(shipped, key)
    assert found.d_mm[:5] == shipped.d_mm[:5]
    assert found.offset_deg[:5] == [0.0] * 5


def test_nearly_parallel_axes_are_refused(tmp_path):
    path, rng = tmp_path / "robot.urdf", np.random.default_rng(2)
    lines = offset_wrist(lambda low, high: float(rng.uniform(low, high)))
    lines[2] = (tilted(90.2, "x"), lines[2][1])
    path.write_text(written(lines, rng))
    with pytest.raises(ArmError, match=r"j3 is nearly parallel to axis 2.*0\.0034"):
        arm_text(read_chain(path), 0.1)


def test_an_arm_that_is_always_singular_is_refused(tmp_path):
    path, rng = tmp_path / "robot.urdf", np.random.default_rng(3)
    lines = offset_wrist(lambda low, high: float(rng.uniform(low, high)))
    lines[4] = (Y, lines[4][1])  # five parallel axes
    path.write_text(written(lines, rng))
    with pytest.raises(ArmError, match=r":\d+: joint j4 .*no joint angles move"):
        arm_text(read_chain(path), 0.1)


def test_it_is_fitted_predicted_and_compensated(tmp_path):
    """An arm as built, 0.4 mm and 0.2 mrad off: the URDF with its frames moved."""
    path, arm = made(tmp_path, offset_wrist, 4)
    assert find_closed_form_obstacle(read_chain(path)).endswith("kinematics is numeric")
    rng = np.random.default_rng(6)
    (tmp_path / "cell.toml").write_text('[robot]\narm = "arm.toml"\n')
    built = tmp_path / "built.urdf"
    built.write_text(
        re.sub(r'(xyz=")([^ ]+)(?= \S+ \S+" rpy)', lambda found: (
            f"{found[1]}{float(found[2]) + 4e-4 * rng.choice([-1, 1])}"
        ), path.read_text())
    )  # fmt: skip
    q = rng.uniform(-2.4, 2.4, (160, 6))
    least = np.linalg.svd(arm.jacobian(q, np.zeros(3)), compute_uv=False)[:, -1]
    q = q[np.argsort(-least)]  # the job is far from singularities
    read = by_pinocchio(built, q)[:, :3, 3] * 1e3 + rng.normal(0, 0.015, (160, 3))
    head = [f"q{j}_deg" for j in range(1, 7)] + ["x_mm", "y_mm", "z_mm"]
    rows = np.column_stack([np.rad2deg(q), read])
    for name, some in (("fit", rows[::2]), ("check", rows[1::2])):
        lines = [",".join(map(repr, row)) for row in some.tolist()]
        numbered = [f"{k},{line}" for k, line in enumerate(lines)]
        text = "\n".join([",".join(["id", *head]), *numbered])
        (tmp_path / f"{name}.csv").write_text(text)
    cell, model = ("--cell", tmp_path / "cell.toml"), tmp_path / "model.json"
    found = cli("fit", tmp_path / "fit.csv", *cell, "-o", model,
                "--effects", "geometry")  # fmt: skip
    assert found.exit_code == 0 and left(found, "error after fit") < 0.026
    found = cli("predict", tmp_path / "check.csv", *cell, "--model", model,
                "-o", tmp_path / "predicted.csv")  # fmt: skip
    assert found.exit_code == 0 and left(found, "residual") < 0.035
    job = tmp_path / "job.pdl"
    moves = [f"  MOVE JOINT TO {{{', '.join(f'{v:.3f}' for v in row)}}}"
             for row in np.rad2deg(q[:4])]  # fmt: skip
    job.write_text("\n".join(["PROGRAM job", "BEGIN", *moves, "END job", ""]))
    found = cli("compensate", job, *cell, "--model", model, "-o", tmp_path / "out.pdl")
    assert found.exit_code == 0, found.stderr
    angles = re.findall(r"TO \{(.*)\}", (tmp_path / "out.pdl").read_text())
    commands = np.deg2rad([[float(v) for v in row.split(",")] for row in angles])
    wanted = arm.flange(q[:4])[:, :3, 3]
    miss = by_pinocchio(built, commands)[:, :3, 3] - wanted
    assert np.linalg.norm(miss, axis=1).max() < 5e-5
    assert np.linalg.norm(by_pinocchio(built, q[:4])[:, :3, 3] - wanted) > 3e-4


def left(found, what: str) -> float:
    figure = re.search(rf"{what} mean ([\d.]+)", found.stdout + found.stderr)
    assert figure is not None
    return float(figure[1])
