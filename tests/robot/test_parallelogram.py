"""A parallelogram keeps the forearm's direction, whatever the senses of the axes are.

The arm is placed by its geometry alone: the upper arm leans by joint 2, the forearm
pitches by joint 3, and neither carries the other.
"""

from __future__ import annotations

import cmath
import math
import re
from typing import NamedTuple

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from postproc.exceptions import ArmError
from postproc.robot.arm import load_arm
from postproc.robot.arm_file import list_shipped_arms
from postproc.robot.direction import arrivals_of_rows
from postproc.robot.inverse import wrap
from postproc.robot.pose import pose_from_record, record_from_pose
from postproc.simulation.kinematics import (
    Chain,
    LinkMasses,
    branch_of,
    link_torque,
    nearest_turns,
    solve_branch,
)
from tests.written import cli

LOW = np.deg2rad([-170.0, -60, -50, -170, -110, -170])
HIGH = np.deg2rad([170.0, 70, 50, 170, 110, 170])
OLD_KEY = "axis3_adds_axis2 = true"
SENSES = [(1, 1), (1, -1), (-1, 1), (-1, -1)]
# Senses of axes 2 and 3, whether D-H axis 3 points against axis 2, a closed form.
CASES = [(*s, False, closed) for s in SENSES for closed in (True, False)]
CASES += [(1, 1, True, False), (1, -1, True, False)]


class Rod:
    """A drawn arm with a rod.

    Attributes:
        a1, a2, c1, c2, c3, c4: Lengths [m].
        sense: Of every joint about z, y, y, x, y, x of the arm as it stands, (6,).
    """

    def __init__(self, seed: int, sense2: int, sense3: int) -> None:
        self.rng = np.random.default_rng(seed)
        low, high = [0.1, -0.2, 0.4, 0.6, 0.6, 0.08], [0.4, 0.3, 0.9, 1.2, 1.2, 0.25]
        lengths = np.round(self.rng.uniform(low, high), 3)
        self.a1, self.a2, self.c1, self.c2, self.c3, self.c4 = map(float, lengths)
        self.sense = self.rng.choice([-1, 1], 6)
        self.sense[1:3] = sense2, sense3

    def flange(self, q: np.ndarray) -> np.ndarray:
        """Place the flange for joint angles (n, 6) [rad], (n, 4, 4)."""
        turns = [
            Rotation.from_euler(axis, angle[:, None])
            for axis, angle in zip("zyyxyx", (self.sense * q).T, strict=True)
        ]
        hand = turns[3] * turns[4]
        forearm = turns[2].apply(
            np.add(hand.apply([self.c4, 0, 0]), (self.c3, 0, self.a2))
        )
        upper = turns[1].apply([0, 0, self.c2])
        out = np.tile(np.eye(4), (len(q), 1, 1))
        out[:, :3, 3] = turns[0].apply(upper + forearm + (self.a1, 0, self.c1))
        out[:, :3, :3] = (
            turns[0] * turns[2] * hand * turns[5] * Rotation.from_euler("y", np.pi / 2)
        ).as_matrix()
        return out

    def text(self, facing_away: bool, closed: bool, key: str = OLD_KEY) -> str:
        """Write the arm file."""
        sense = self.sense.copy()
        alpha = [-90.0, 0.0, -90.0, 90.0, -90.0, 0.0]
        if facing_away:
            alpha[1:3], sense[2] = [180.0, 90.0], -sense[2]
        a1, a2, c1, c2, c3, c4 = (
            round(1e3 * v, 6)
            for v in (self.a1, self.a2, self.c1, self.c2, self.c3, self.c4)
        )
        text = f"""name = "rod"
repeatability_mm = 0.06
[dh]
a_mm = {[a1, c2, a2, 0.0, 0.0, 0.0]}
d_mm = {[c1, 0.0, 0.0, c3, 0.0, c4]}
alpha_deg = {alpha}
offset_deg = [0.0, -90.0, 0.0, 0.0, 0.0, 180.0]
sense = {sense.tolist()}
{key}
[joints]
lower_deg = [-180.0, -75.0, -75.0, -180.0, -120.0, -180.0]
upper_deg = [180.0, 95.0, 75.0, 180.0, 120.0, 180.0]
velocity_deg_s = [150.0, 150.0, 150.0, 360.0, 360.0, 450.0]
"""
        flips = str([bool(s < 0) for s in self.sense]).lower()
        return (
            text
            + closed
            * f"""[opw]
a1_mm = {a1}
a2_mm = {-a2}
b_mm = 0.0
c1_mm = {c1}
c2_mm = {c2}
c3_mm = {c3}
c4_mm = {c4}
offsets_deg = [0.0, 0.0, -90.0, 0.0, 0.0, 0.0]
flip_axes = {flips}
"""
        )

    def chain(self, facing_away: bool) -> Chain:
        """Return the same arm as the simulator has it."""
        sense, alpha = self.sense.astype(float), np.array([-90.0, 0, -90, 90, -90, 0])
        if facing_away:
            alpha[1:3], sense[2] = [180.0, 90.0], -sense[2]
        return Chain(
            a=np.array([self.a1, self.c2, self.a2, 0, 0, 0]),
            d=np.array([self.c1, 0, 0, self.c3, 0, self.c4]),
            alpha=np.deg2rad(alpha),
            offset=np.deg2rad([0.0, -90, 0, 0, 0, 180]),
            sense=sense, shift=np.zeros(6), beta=np.zeros(6),
            mass=self.rng.uniform(5, 100, 6),
            centre=self.rng.uniform(-0.3, 0.3, (6, 3)),
            speed=np.ones(6), lower=LOW, upper=HIGH, parallelogram=True,
        )  # fmt: skip


def drawn(rod: Rod, n: int = 40) -> np.ndarray:
    q: np.ndarray = rod.rng.uniform(LOW, HIGH, (n, 6))
    return q


@pytest.fixture(params=list(enumerate(CASES)), ids=str)
def case(request, tmp_path):
    seed, (sense2, sense3, away, closed) = request.param
    rod = Rod(seed, sense2, sense3)
    path = tmp_path / "arm.toml"
    path.write_text(rod.text(away, closed))
    return rod, load_arm(path), away


def test_the_flange_is_where_the_rod_puts_it(case):
    rod, arm, _ = case
    q = drawn(rod)
    np.testing.assert_allclose(arm.flange(q), rod.flange(q), atol=1e-12)


def test_axis_2_alone_keeps_the_forearms_direction(case):
    rod, arm, _ = case
    q = drawn(rod)
    moved = q + np.array([0.0, 0.3, 0.0, 0.0, 0.0, 0.0])
    turned = [arm.flange(angles)[:, :3, :3] for angles in (q, moved)]
    np.testing.assert_allclose(*turned, atol=1e-12)


def test_the_inverse_leads_back(case):
    rod, arm, _ = case
    q = drawn(rod)
    wanted = rod.flange(q)
    own = arm.on_branch(wanted, arm.branch(q))
    np.testing.assert_allclose(wrap(own - q), 0.0, atol=1e-6)
    np.testing.assert_allclose(arm.nearest(wanted, q), q, atol=1e-6)
    solved = arm.inverse(wanted).q
    found = ~np.isnan(solved[..., 0])
    again = arm.flange(np.nan_to_num(solved).reshape(-1, 6)).reshape(-1, 8, 4, 4)
    assert np.abs(again - wanted[:, None])[found].max() < 1e-9
    slots = arm.branch(np.nan_to_num(solved).reshape(-1, 6)).reshape(-1, 8)
    assert (slots == np.arange(8))[found].all()


def test_jacobian_and_torques_are_derivatives(case):
    """Of the flange by the controller's angles, and of the height of the weights."""
    rod, arm, _ = case
    q, step = drawn(rod, 10), 1e-6
    J = arm.jacobian(q, np.zeros(3))
    torque = arm.gravity_torque(q, 10.0, np.zeros(3))
    for j in range(6):
        ahead, behind = (rod.flange(q + d * step * np.eye(6)[j]) for d in (1, -1))
        rate = (ahead - behind)[:, :3, 3] / (2 * step)
        np.testing.assert_allclose(J[:, :3, j], rate, atol=1e-8)
        np.testing.assert_allclose(torque[:, j], -98.0665 * rate[:, 2], atol=1e-6)


def test_the_simulator_has_the_same_arm(case):
    rod, _, away = case
    chain, q, step = rod.chain(away), drawn(rod), 1e-6
    wanted = rod.flange(q)
    np.testing.assert_allclose(chain.flange(q), wanted, atol=1e-12)
    np.testing.assert_allclose(chain.controller_angles(chain.dh_angles(q)), q)
    if not away:
        for b in range(8):
            rows = branch_of(chain, q) == b
            back = solve_branch(chain, wanted[rows], b)
            np.testing.assert_allclose(nearest_turns(back, q[rows]), q[rows], atol=1e-7)
    torque = link_torque(LinkMasses(chain, chain.mass, chain.centre), q)

    def potential(angles: np.ndarray) -> np.ndarray:
        frames = chain.frames(angles)[:, 1:]
        height = np.einsum("nib,ib->ni", frames[..., 2, :3], chain.centre)
        energy: np.ndarray = 9.80665 * (height + frames[..., 2, 3]) @ chain.mass
        return energy

    for j in range(6):
        ahead, behind = (potential(q + d * step * np.eye(6)[j]) for d in (1, -1))
        np.testing.assert_allclose(
            torque[:, j], -(ahead - behind) / (2 * step), atol=1e-4
        )


@pytest.mark.parametrize(("seed", "senses"), list(enumerate(SENSES)))
def test_a_fit_leaves_the_noise_and_a_program_is_compensated(tmp_path, seed, senses):
    """Rows of an arm as built: its lengths are 0.4 mm off the file's."""
    rod = Rod(100 + seed, *senses)
    (tmp_path / "arm.toml").write_text(rod.text(False, seed % 2 == 0))
    (tmp_path / "cell.toml").write_text(
        '[robot]\narm = "arm.toml"\n[payload]\nmass_kg = 5.0\n'
    )
    q = drawn(rod, 150)
    corners = np.array([0.2, 0.3, -0.2, 0.4, 0.9, 0.3]) + rod.rng.uniform(
        -0.1, 0.1, (6, 6)
    )
    wanted = rod.flange(corners)
    for length in ("a1", "a2", "c1", "c2", "c3", "c4"):
        setattr(rod, length, getattr(rod, length) + 4e-4 * rod.rng.choice([-1, 1]))
    read = rod.flange(q)[:, :3, 3] * 1e3 + rod.rng.normal(0.0, 0.015, (150, 3))
    head = [f"q{j}_deg" for j in range(1, 7)] + [f"lambda{j}" for j in range(1, 7)]
    rows = np.column_stack([np.rad2deg(q), rod.rng.choice([-1, 1], (150, 6)), read])
    lines = [",".join(["id", *head, "x_mm", "y_mm", "z_mm"])]
    lines += [",".join(map(repr, [k, *row])) for k, row in enumerate(rows.tolist())]
    measured = tmp_path / "measured.csv"
    measured.write_text("\n".join(lines))
    found = cli("fit", measured, "--cell", tmp_path / "cell.toml", "-o",
                tmp_path / "m.json", "--effects", "geometry")  # fmt: skip
    assert found.exit_code == 0
    left = re.search(r"error after fit mean ([\d.]+)", found.stdout + found.stderr)
    assert left is not None and float(left[1]) < 0.026
    records = record_from_pose(wanted).round(4).tolist()
    moves = [f"  MOVE LINEAR TO POS({str(record)[1:-1]}, '')" for record in records]
    start = ", ".join(map(str, np.rad2deg(corners[0]).round(3).tolist()))
    job = tmp_path / "job.pdl"
    lines = [
        "PROGRAM job",
        "BEGIN",
        f"  MOVE JOINT TO {{{start}}}",
        *moves,
        "END job",
        "",
    ]
    job.write_text("\n".join(lines))
    found = cli("compensate", job, "--cell", tmp_path / "cell.toml", "--model",
                tmp_path / "m.json", "-o", tmp_path / "out.pdl")  # fmt: skip
    assert found.exit_code == 0, found.stderr
    numbers = re.findall(r"POS\((.*), ''\)", (tmp_path / "out.pdl").read_text())
    commands = np.array([[float(v) for v in row.split(",")] for row in numbers])
    # The controller solves for the lengths of the file; the arm as built goes there.
    arm = load_arm(tmp_path / "arm.toml")
    q = arm.nearest(pose_from_record(commands), corners)
    miss = (rod.flange(q) - wanted)[:, :3, 3]
    before = (rod.flange(corners) - wanted)[:, :3, 3]
    assert np.linalg.norm(miss, axis=1).max() < 3e-5
    assert np.linalg.norm(before, axis=1).min() > 2e-4


@pytest.mark.parametrize("key", [OLD_KEY, "axis2_in_axis3 = -1.0"])
def test_a_parallelogram_needs_parallel_axes(tmp_path, key):
    text = Rod(0, 1, 1).text(False, False, key)
    (tmp_path / "arm.toml").write_text(text.replace("[-90.0, 0.0, -90", "[-90, 9, -90"))
    with pytest.raises(ArmError, match=r"axis\w+ needs axes 2 and 3 parallel"):
        load_arm(tmp_path / "arm.toml")


@pytest.mark.parametrize("away", [False, True])
@pytest.mark.parametrize("senses", SENSES)
def test_a_number_states_the_coupling_and_a_wrong_sign_is_refused(
    tmp_path, senses, away
):
    """Models know the arm again whichever key its file has."""
    rod, path = Rod(3, *senses), tmp_path / "arm.toml"
    path.write_text(rod.text(away, False))
    old, right = load_arm(path), -1.0 if senses[0] == senses[1] else 1.0
    path.write_text(rod.text(away, False, f"axis2_in_axis3 = {right}"))
    arm, q = load_arm(path), drawn(rod)
    np.testing.assert_allclose(arm.flange(q), rod.flange(q), atol=1e-12)
    assert arm.id == old.id
    assert arm.file.model_dump() == old.file.model_dump()
    path.write_text(rod.text(away, False, f"axis2_in_axis3 = {-right}"))
    with pytest.raises(ArmError, match=f"these senses and angles it is {right:g}, or"):
        load_arm(path)
    path.write_text(rod.text(away, False, f"{OLD_KEY}\naxis2_in_axis3 = {right}"))
    with pytest.raises(ArmError, match="replaces axis3_adds_axis2"):
        load_arm(path)
    path.write_text(rod.text(away, False, "axis2_in_axis3 = 0.0"))
    assert load_arm(path).id != arm.id


def test_drives_are_coupled_apart_from_the_pose(tmp_path):
    """With a rod motor 3 rests while joint 2 moves alone; in series it turns back."""
    path, rod = tmp_path / "arm.toml", Rod(4, 1, 1)
    text = rod.text(False, False, "axis2_in_axis3 = -1.0")
    series = np.eye(6)
    series[2, 1] = -1.0
    q = np.deg2rad([[0.0, 0, 0, 0, 0, 0], [0, 20, 0, 0, 0, 0]])
    found = []
    for coupling in ("", f"drive_coupling = {series.tolist()}\n"):
        path.write_text(text.replace("[joints]\n", f"[joints]\n{coupling}"))
        arm = load_arm(path)
        np.testing.assert_allclose(arm.flange(q), rod.flange(q), atol=1e-12)
        found.append(arrivals_of_rows(arm, q).direction[1].tolist())
    assert found == [[0, 1, 0, 0, 0, 0], [0, 1, -1, 0, 0, 0]]


class FourBar(NamedTuple):
    """A linkage as published: lengths [mm], and how the controller counts.

    Attributes:
        base_up, base_out: Axis 2 above the floor and in front of axis 1.
        upper: Axis 2 to the elbow, as long as the rod beside it.
        up, ahead: Axis 3 to the wrist, across and along a level forearm.
        flange: Wrist to flange.
        sense: Of the joints about z, y, y, x, y, x of the stretched-out arm.
        level: Joint angle 3 of the level forearm [deg].
        turned: About axis 6, where joint 6 is 0 [deg].
    """

    base_up: float
    base_out: float
    upper: float
    up: float
    ahead: float
    flange: float
    sense: tuple[int, ...]
    level: float
    turned: float

    def place(self, q: list[float]) -> np.ndarray:
        """Close the loop of the four bars, then go on to the flange, (4, 4) [m]."""
        a = [s * angle for s, angle in zip(self.sense, q, strict=True)]
        lean, pitch = a[1], a[2] - self.sense[2] * math.radians(self.level)
        elbow = self.upper * cmath.exp(1j * (math.pi / 2 - lean))
        crank = 300.0 * cmath.exp(1j * (math.pi - pitch))  # motor 3 turns this bar
        tail = meet(crank, self.upper, elbow, 300.0)  # rod and forearm meet there
        along = (elbow - tail) / 300.0
        wrist = elbow + along * complex(self.ahead, self.up)
        plane = [self.base_out + wrist.real, 0.0, self.base_up + wrist.imag]
        out = np.eye(4)
        fore = np.array(
            [[along.real, 0, -along.imag], [0, 1, 0], [along.imag, 0, along.real]]
        )
        hand = fore @ about(0, a[3]) @ about(1, a[4]) @ about(0, a[5])
        first = about(2, a[0])
        out[:3, 3] = first @ (plane + hand @ [self.flange, 0, 0]) / 1e3
        out[:3, :3] = first @ hand @ about(0, math.radians(self.turned))
        out[:3, :3] = out[:3, :3] @ about(1, math.pi / 2)
        return out


def meet(a: complex, to_a: float, b: complex, to_b: float) -> complex:
    """Find the corner that makes a parallelogram of 0, a, b: two circles meet there.

    The other place where they meet makes the two bars cross.
    """
    gap = abs(b - a)
    foot = (to_a**2 - to_b**2 + gap**2) / (2 * gap)
    high = math.sqrt(max(to_a**2 - foot**2, 0.0))
    both = [a + (b - a) / gap * complex(foot, side * high) for side in (1, -1)]
    return max(both, key=abs)


def about(axis: int, angle: float) -> np.ndarray:
    """Turn about x, y or z, (3, 3)."""
    c, s, out = math.cos(angle), math.sin(angle), np.eye(3)
    j, k = (axis + 1) % 3, (axis + 2) % 3
    out[j, j], out[j, k], out[k, j], out[k, k] = c, -s, s, c
    return out


# Every shipped arm with such a linkage; lengths of its file's sources.
LINKAGES = {
    "nj130-2.6": FourBar(
        830.0, 350.0, 1160.0, 250.0, 145.0 + 960.58, 165.0,
        (-1, 1, -1, -1, 1, -1), -90.0, 0.0,
    ),
}  # fmt: skip


def test_every_shipped_arm_with_a_linkage_has_one_to_be_held_against():
    shares = {n: load_arm(n).file.dh.axis2_share for n in list_shipped_arms()}
    assert {name for name, share in shares.items() if share} == set(LINKAGES)


@pytest.mark.parametrize("name", LINKAGES)
def test_the_flange_is_where_the_four_bars_place_it(name):
    arm, linkage = load_arm(name), LINKAGES[name]
    low, high = np.maximum(arm.lower, -np.pi), np.minimum(arm.upper, np.pi)
    q = np.random.default_rng(8).uniform(low, high, (200, 6))
    np.testing.assert_allclose(
        arm.flange(q), [linkage.place(row) for row in q.tolist()], atol=1e-10
    )
