"""Masses and centres of a URDF become the links of the arm file, or are left out."""

import numpy as np
import pytest

from postproc.model.effects.compliance import moments
from postproc.robot.arm import build_arm, load_arm
from postproc.robot.ortho_parallel import arm_text
from postproc.robot.urdf import read_chain, rotate_about
from postproc.robot.urdf_links import placeholder
from tests.robot.test_urdf import OBLIQUE
from tests.robot.urdfs import URDFS, urdf_text

MASSES = (300.0, 250.0, 160.0, 70.0, 30.0, 8.0)
CENTRE = (0.05, -0.02, 0.11)


def weighed(rows, masses, centre=CENTRE):
    """Give the link behind every moving joint a mass, and a cover to the second."""
    text = urdf_text(rows)
    moving = [k + 1 for k, row in enumerate(rows) if row.moves is not None]
    xyz = " ".join(map(str, centre))
    for k, mass in zip(moving, masses, strict=True):
        link = f'<link name="l{k}"'
        inertial = f'<inertial><mass value="{mass}"/><origin xyz="{xyz}"/></inertial>'
        text = text.replace(f"{link}/>", f"{link}>{inertial}</link>")
    return text


def chain_of(folder, text, base=None):
    path = folder / "robot.urdf"
    path.write_text(text)
    return read_chain(path, base)


def height(chain, q):
    """Sum mass times height of all links, straight from the URDF, (n,) [kg m]."""
    place, total = np.tile(np.linalg.inv(chain.before), (len(q), 1, 1)), 0.0
    angles, masses = iter(q.T), iter(MASSES)
    for joint in chain.joints:
        place = place @ joint.origin
        if joint.kind == "revolute":
            place = place @ rotate_about(joint.axis, next(angles))
            total = total + next(masses) * (place @ [*CENTRE, 1.0])[:, 2]
    return total


@pytest.mark.parametrize(
    ("rows", "base"), [(URDFS["kr120-r2500-pro"], None), (OBLIQUE, "l1")]
)
def test_torques_of_the_arm_file_are_those_of_the_urdf(tmp_path, rows, base):
    chain = chain_of(tmp_path, weighed(rows, MASSES), base)
    assert placeholder(chain.weights) is None
    (tmp_path / "arm.toml").write_text(arm_text(chain, 0.1, "mine"))
    arm = load_arm(tmp_path / "arm.toml")
    q = np.random.default_rng(0).uniform(-1.5, 1.5, (20, 6))
    torque = arm.gravity_torque(q)
    for j in range(6):
        step = 1e-5 * np.eye(6)[j]
        slope = (height(chain, q + step) - height(chain, q - step)) / 2e-5
        np.testing.assert_allclose(torque[:, j], -9.80665 * slope, atol=0.02)
    known = moments(build_arm(arm.file.model_copy(update={
        "links": arm.file.links.model_copy(update={"spread": 0.1})})), 2)  # fmt: skip
    assert arm.file.links.spread == 0.5
    wide = moments(arm, 2)
    assert all(w[1] > 4 * k[1] for w, k in zip(wide, known, strict=True))


@pytest.mark.parametrize(
    ("masses", "why"),
    [
        ((1.0,) * 6, "1 kg for every link"),
        ((5.5,) * 6, "5.5 kg for every link"),
        ((0.001, 0.002, 0.001, 0.001, 0.001, 0.001), "none is above"),
        ((300.0, 0.0, 160.0, 0.0, 30.0, 8.0), "no mass behind joint 2, 4"),
        ((0.0,) * 6, "states no masses"),
    ],
)
def test_placeholders_are_no_masses(tmp_path, masses, why):
    chain = chain_of(tmp_path, weighed(URDFS["kr120-r2500-pro"], masses))
    assert why in placeholder(chain.weights)
    assert "[links]" not in arm_text(chain, 0.1)


def test_a_cover_hangs_on_the_joint_before_it(tmp_path):
    text = weighed(URDFS["kr120-r2500-pro"], MASSES)
    cover = (
        '<link name="cover"><inertial><mass value="12.5"/></inertial></link>'
        '<joint name="screws" type="fixed"><parent link="l3"/><child link="cover"/>'
        '<origin xyz="0.1 0 0"/></joint></robot>'
    )
    chain = chain_of(tmp_path, text.replace("</robot>", cover))
    (tmp_path / "arm.toml").write_text(arm_text(chain, 0.1))
    assert load_arm(tmp_path / "arm.toml").file.links.mass_kg[2] == 160.0 + 12.5
