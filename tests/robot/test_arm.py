"""The NJ 220-2.7 against its published numbers, and derivatives by differences."""

import pickle

import numpy as np
import pinocchio as pin
import pytest

from postproc.exceptions import ArmError
from postproc.robot.arm import GRAVITY, build_arm, load_arm
from postproc.robot.pose import record_from_pose

TOOL = np.array([0.08, -0.04, 0.15])


@pytest.fixture(scope="module")
def arm():
    return load_arm("nj220-2.7")


@pytest.fixture(scope="module")
def q(arm):
    rng = np.random.default_rng(1)
    low = np.maximum(arm.lower, -np.pi) + 0.05
    high = np.minimum(arm.upper, np.pi) - 0.05
    low[2] = np.deg2rad(-250)
    return rng.uniform(low, high, (500, 6))


@pytest.mark.parametrize(
    ("joints", "xyz", "zyz"),
    [
        ((0, 0, -90, 0, 0, 0), (1755.3, 0, 2255), None),
        ((0, 0, -90, 0, 90, 0), (1525.3, 0, 2025), (0, 180, 0)),
        (
            (20, 10, -100, 40, 50, -60),
            (1690.056, -735.651, 1659.802),
            (-70.680, 140.469, -11.619),
        ),
    ],
)
def test_published_poses(arm, joints, xyz, zyz):
    record = record_from_pose(arm.flange(np.deg2rad([joints])))[0]
    np.testing.assert_allclose(record[:3], xyz, atol=6e-4)
    if zyz is not None:
        np.testing.assert_allclose(record[3:], zyz, atol=6e-4)


def test_points_along_x_at_zero(arm):
    flange = arm.flange(np.deg2rad([[0, 0, -90, 0, 0, 0]]))[0]
    np.testing.assert_allclose(flange[:3, 2], [1, 0, 0], atol=1e-12)


def test_link_frames_are_the_dh_product(arm, q):
    dh, theta = arm.dh, arm.dh.angles(q[:20])
    T = np.tile(np.eye(4), (20, 1, 1))
    frames = arm.link_frames(q[:20])
    for i in range(6):
        c, s = np.cos(theta[:, i]), np.sin(theta[:, i])
        ca, sa = np.cos(dh.alpha[i]), np.sin(dh.alpha[i])
        A = np.zeros((20, 4, 4))
        A[:, 0] = np.stack([c, -s * ca, s * sa, dh.a[i] * c], 1)
        A[:, 1] = np.stack([s, c * ca, -c * sa, dh.a[i] * s], 1)
        A[:, 2] = [0, sa, ca, dh.d[i]]
        A[:, 3, 3] = 1
        T = T @ A
        np.testing.assert_allclose(frames[:, i + 1], T, atol=1e-12)
    np.testing.assert_allclose(arm.flange(q[:20]), T, atol=1e-12)
    tool = np.linspace(-0.3, 0.4, 60).reshape(20, 3)
    tcp = np.einsum("nij,nj->ni", T[:, :3, :3], tool) + T[:, :3, 3]
    np.testing.assert_allclose(arm.tcp(q[:20], tool), tcp, atol=1e-12)


def test_jacobian_is_the_derivative(arm, q):
    q = q[:50]
    J = arm.jacobian(q, TOOL)
    step = 1e-6
    for j in range(6):
        dq = np.zeros(6)
        dq[j] = step
        ahead, behind = arm.flange(q + dq), arm.flange(q - dq)
        point = ((ahead - behind) @ [*TOOL, 1.0])[:, :3] / (2 * step)
        np.testing.assert_allclose(J[:, :3, j], point, atol=1e-8)
        spin = (ahead - behind)[:, :3, :3] / (2 * step)
        spin = spin @ np.swapaxes(arm.flange(q)[:, :3, :3], 1, 2)
        omega = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], 1)
        np.testing.assert_allclose(J[:, 3:, j], omega, atol=1e-8)


def _potential_energy(arm, q, payload, com):
    up = np.append(-GRAVITY * arm.weight, 0.0)
    frames = arm.link_frames(q)
    energy = payload * (frames[:, 6] @ [*com, 1.0]) @ up
    links = arm.file.links
    for i in range(6):
        centre = frames[:, i + 1] @ [*(np.array(links.com_mm[i]) * 1e-3), 1.0]
        energy += links.mass_kg[i] * (centre @ up)
    return energy


WEIGHTS = pytest.mark.parametrize(
    "weight", [(0, 0, -1), (0, 0, 1), (1, 0, 0), (0.3, -2.0, 0.4)]
)


@WEIGHTS
def test_gravity_torque_is_the_energy_gradient(arm, q, weight):
    arm = arm.mount(np.array(weight, dtype=float))
    q, com = q[:30], np.array([0.1, 0.0, 0.2])
    torque = arm.gravity_torque(q, 60.0, com)
    step = 1e-5
    for j in range(6):
        dq = np.zeros(6)
        dq[j] = step
        ahead = _potential_energy(arm, q + dq, 60.0, com)
        behind = _potential_energy(arm, q - dq, 60.0, com)
        slope = (ahead - behind) / (2 * step)
        np.testing.assert_allclose(torque[:, j], -slope, atol=1e-5)


@WEIGHTS
def test_gravity_basis_spans_the_torque(arm, q, weight):
    arm = arm.mount(np.array(weight, dtype=float))
    links = arm.file.links
    lumped = [
        value
        for mass, com in zip(links.mass_kg, links.com_mm, strict=True)
        for value in (mass, *(mass * np.array(com) * 1e-3))
    ]
    torque = arm.gravity_basis(q[:50]) @ lumped
    np.testing.assert_allclose(torque, arm.gravity_torque(q[:50]), atol=1e-9)


@WEIGHTS
def test_a_parallelogram_takes_part_of_the_torque(arm, q, weight):
    """Axis 3 follows axis 2: the controller's joint 2 turns both."""
    dh = arm.file.dh.model_copy(update={"axis3_adds_axis2": True})
    rod = build_arm(arm.file.model_copy(update={"dh": dh, "opw": None}))
    test_gravity_basis_spans_the_torque(rod, q, weight)
    test_gravity_torque_is_the_energy_gradient(rod, q, weight)


@WEIGHTS
def test_moments_about_the_joints_are_the_torque(arm, q, weight):
    arm = arm.mount(np.array(weight, dtype=float))
    q, com = q[:20], np.tile([0.1, 0.0, 0.2], (20, 1))
    axes, load = np.swapaxes(arm.jacobian(q, TOOL)[:, 3:], 1, 2), np.full(20, 30.0)
    for moment, torque in zip(
        arm.moments(q, load, com), arm.torques(q, load, com), strict=True
    ):
        about = np.einsum("njc,njc->nj", axes, moment)
        np.testing.assert_allclose(about, torque, atol=1e-9)


def test_a_rotated_base_turns_moments_and_leaves_torques(arm, q):
    """An arm on a wall: the world's weight, written in the base of the arm."""
    wall = arm.mount(np.array([2.0, 0.0, 0.0]))
    assert not wall.stands and np.array_equal(wall.weight, [1.0, 0.0, 0.0])
    moment = wall.tilting_moment(q[:20], 0.0, 0.0)
    np.testing.assert_allclose(moment[:, 0], 0.0, atol=1e-9)
    whole = wall.moments(q[:20], 0.0, np.zeros((20, 3)))[0][:, 0]
    np.testing.assert_allclose(moment, whole, atol=1e-9)  # joint 1 stands on the base


def test_bending_moments_are_those_of_the_first_moments(arm, q):
    links, wall = arm.file.links, arm.mount(np.array([0.0, 1.0, 1.0]))
    mass, centre = np.array(links.mass_kg), np.array(links.com_mm) * 1e-3
    frames = wall.link_frames(q[:10])
    # All weight behind a link hangs at its origin too: D-H origins are fixed to links.
    first = mass[:, None] * centre
    behind = np.append(np.cumsum(mass[::-1])[::-1], 0.0)
    for i in range(6):
        before, after = frames[0, i], frames[0, i + 1]
        first[i] += behind[i] * after[:3, :3].T @ (after[:3, 3] - before[:3, 3])
    across = np.einsum("njaib,ib->nja", wall.bending_basis(q[:10]), first)
    wanted = wall.bending_moments(q[:10], 0.0, np.full((10, 3), np.nan))
    np.testing.assert_allclose(across, wanted, atol=1e-8)


def test_an_arm_keeps_its_mounting_between_processes(arm):
    wall = pickle.loads(pickle.dumps(arm.mount(np.array([1.0, 0.0, 0.0]))))
    assert np.array_equal(wall.weight, [1.0, 0.0, 0.0]) and wall.id == arm.id


def test_every_branch_leads_back(arm, q):
    flange = arm.flange(q)
    branches = arm.inverse(flange).q
    exists = ~np.isnan(branches).any(-1)
    assert exists.any(1).all()
    again = arm.flange(branches[exists])
    wanted = np.repeat(flange[:, None], 8, 1)[exists]
    np.testing.assert_allclose(again, wanted, atol=1e-9)


def test_branch_flags(arm):
    q = np.deg2rad([[10, 5, -90, 20, 40, 30], [10, 5, -90, 20, -40, 30]])
    np.testing.assert_array_equal(arm.branch(q), [0, 4])
    over = np.deg2rad([[0, -60, 0, 20, 40, 30]])
    assert arm.branch(over)[0] & 1  # elbow: axis 3 outside (-192.53, -12.53) deg


def test_nearest_keeps_branch_and_turn(arm, q):
    turned = q + np.deg2rad([0, 0, 0, 360, 0, -720])
    found = arm.nearest(arm.flange(q), turned + 1e-3, arm.branch(q))
    np.testing.assert_allclose(found, turned, atol=1e-8)


def test_axis_3_comes_back_in_range(arm):
    q = np.deg2rad([[0.0, 0, -200, 10, 50, 0]])
    slots = arm.inverse(arm.flange(q)).q[0]
    assert np.abs(slots - q).max(1)[~np.isnan(slots).any(1)].min() < 1e-9


def _write_arm(tmp_path, arm, old, new):
    from postproc.robot.arm_file import ARMS

    text = (ARMS / "nj220-2.7.toml").read_text()
    assert old in text
    path = tmp_path / "arm.toml"
    path.write_text(text.replace(old, new))
    return path


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("lower_deg = [-180.0", "lower_deg = [190.0", r"lower_deg\[1\] must be less"),
        ("sense = [-1", "sense = [-2", "sense must be"),
        ("c2_mm = 1175.0", "c2_mm = 1200.0", r"\$\.opw"),
        ("a_mm =", "a_m =", "unknown key|required key"),
        ("repeatability_mm = 0.075", "repeatability_mm = nan", "repeatability_mm"),
        ("[links]", f"drive_coupling = {[[0.0] * 6] * 6}\n[links]", "invertible"),
        ("[links]", f"gear_ratio = {[121.0, -0.01] * 3}\n[links]", "turns of the"),
    ],
)
def test_wrong_arm_file_names_the_place(tmp_path, arm, old, new, said):
    with pytest.raises(ArmError, match=said):
        load_arm(_write_arm(tmp_path, arm, old, new))


def test_an_arm_whose_elbow_has_no_offset_is_read(tmp_path):
    """Such as an IRB 140: with joint 3 at -90 deg its elbow is stretched."""
    from postproc.robot.arm_file import ARMS

    text = (ARMS / "irb6640-185-2.8.toml").read_text()
    for old, new in (
        ("a2_mm = -200.0", "a2_mm = 0.0"),
        ("1075.0, 200.0", "1075.0, 0.0"),
    ):
        assert old in text
        text = text.replace(old, new)
    path = tmp_path / "arm.toml"
    path.write_text(text)
    straight = load_arm(path)
    q = np.deg2rad([[10.0, 20.0, -60.0, 30.0, 40.0, 50.0]])
    found = straight.nearest(straight.flange(q), q)
    np.testing.assert_allclose(found, q, atol=1e-9)
    path.write_text(text.replace("c3_mm = 1392.0", "c3_mm = 1392.1"))
    with pytest.raises(ArmError, match=r"\$\.opw"):
        load_arm(path)


def test_a_gear_ratio_of_0_is_not_known(tmp_path, arm):
    ratio = "gear_ratio = [121.0, -80.5, 0.0, 0.0, 0.0, 0.0]\n[links]"
    read = load_arm(_write_arm(tmp_path, arm, "[links]", ratio))
    np.testing.assert_array_equal(read.gear_ratio, [121.0, -80.5, *[np.nan] * 4])


def test_unknown_arm_lists_the_shipped_ones():
    with pytest.raises(ArmError, match=r"nj220-2\.7"):
        load_arm("kr-1000")


def test_axis_3_measured_from_axis_2(tmp_path, arm):
    linked = load_arm(
        _write_arm(tmp_path, arm, "axis2_in_axis3 = 0.0", "axis2_in_axis3 = 1.0")
    )
    q = np.deg2rad([[10, 20, -100, 30, 40, 50]])
    same = q - np.deg2rad([[0, 0, 20, 0, 0, 0]])
    np.testing.assert_allclose(linked.flange(same), arm.flange(q), atol=1e-12)
    found = linked.nearest(linked.flange(same), same)
    np.testing.assert_allclose(found, same, atol=1e-9)


def _pinocchio(arm):
    """Build the arm anew: joint i turns about z of D-H frame i - 1."""
    model, parent, placement = pin.Model(), 0, pin.SE3.Identity()
    model.gravity.linear = np.array([0.0, 0.0, -GRAVITY])
    dh, links = arm.dh, arm.file.links
    for i in range(6):
        parent = model.addJoint(parent, pin.JointModelRZ(), placement, f"joint {i}")
        tilt, shift = float(dh.alpha[i]), np.array([dh.a[i], 0.0, dh.d[i]])
        placement = pin.SE3(pin.utils.rotate("x", tilt), shift)
        com = placement.act(np.array(links.com_mm[i]) * 1e-3)
        inertia = pin.Inertia(links.mass_kg[i], com, np.eye(3))
        model.appendBodyToJoint(parent, inertia, pin.SE3.Identity())
    return model


def test_kinematics_are_those_of_pinocchio(arm, q):
    model, theta = _pinocchio(arm), arm.dh.angles(q)
    data, none = model.createData(), np.zeros(6)
    frames, columns = arm.link_frames(q), arm.jacobian(q, np.zeros(3))
    torque = arm.gravity_torque(q)
    for k in range(len(q)):
        J = np.array(pin.computeJointJacobians(model, data, theta[k]))
        # Pinocchio's is of the point that lies in the base origin.
        J[:3] += np.cross(J[3:], frames[k, 6, :3, 3], axisa=0).T
        np.testing.assert_allclose(
            columns[k], (J * arm.dh.sense) @ arm.dh.mix, atol=1e-12
        )
        holding = pin.rnea(model, data, theta[k], none, none)
        given = -(holding * arm.dh.sense) @ arm.dh.mix
        np.testing.assert_allclose(torque[k], given, rtol=1e-12, atol=1e-9)
        for i in range(1, 6):  # pinocchio's joint frame i turns about D-H axis i
            axis = data.oMi[i + 1].rotation[:, 2]
            np.testing.assert_allclose(frames[k, i, :3, 2], axis, atol=1e-12)
    np.testing.assert_array_equal(arm.flange(q), frames[:, 6])


BARE = """name = "bare"
repeatability_mm = 0.1
[dh]
a_mm = [0.0, -425.0, -392.25, 0.0, 0.0, 0.0]
d_mm = [89.159, 0.0, 0.0, 109.15, 94.65, 82.3]
alpha_deg = [90.0, 0.0, 0.0, 90.0, -90.0, 0.0]
[joints]
lower_deg = [-360.0, -360.0, -360.0, -360.0, -360.0, -360.0]
upper_deg = [360.0, 360.0, 360.0, 360.0, 360.0, 360.0]
"""


def test_an_arm_file_needs_only_what_is_used(tmp_path):
    path = tmp_path / "bare.toml"
    path.write_text(BARE)
    bare = load_arm(str(path))
    assert bare.flange(np.zeros((1, 6))).shape == (1, 4, 4)
    for limit in ("velocity", "acceleration", "jerk"):
        with pytest.raises(ArmError, match="velocity_deg_s"):
            getattr(bare, limit)
    path.write_text(BARE + "velocity_deg_s = [40.0, 80.0, 80.0, 80.0, 80.0, 80.0]\n")
    paced = load_arm(str(path))
    np.testing.assert_allclose(np.rad2deg(paced.acceleration), [100.0] + [200.0] * 5)
    np.testing.assert_allclose(np.rad2deg(paced.jerk), [1000.0] + [2000.0] * 5)
