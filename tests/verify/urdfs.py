"""Arm files of a public package's URDFs against Pinocchio's reading of these.

    pip install example-robot-data
    python -m tests.verify.urdfs

Ten arms become arm files and are compared; the others are refused, and it prints why.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from postproc.exceptions import ArmError
from postproc.robot.arm import arm_of_text
from postproc.robot.ortho_parallel import arm_text
from postproc.robot.urdf import UrdfChain, read_chain
from postproc.verify.opinion import Opinion
from postproc.verify.urdf import ArmClaim, UrdfChainNames, judge_urdf

PACKAGE = "example-robot-data"
FOLDER = "cmeel.prefix/share/example-robot-data/robots"
UR = "ur_description/urdf/"
Z1, KINOVA = "z1_description/urdf/z1.urdf", "kinova_description/robots/kinova.urdf"


@dataclass(frozen=True)
class Given:
    """A URDF of the package, and how it is read.

    Attributes:
        path: In the package.
        tip: Link of the flange, None where the file names it.
        flange: Link, and angles of a fixed joint, where the file has no flange: `tip`
            is then added behind that link.
    """

    path: str
    tip: str | None = None
    flange: tuple[str, str] | None = None

    @property
    def name(self) -> str:
        """Name the file."""
        return Path(self.path).stem


ARMS = (
    Given(UR + "ur3_robot.urdf"),
    Given(UR + "ur3_joint_limited_robot.urdf"),
    Given(UR + "ur3_gripper.urdf"),
    Given(UR + "ur5_robot.urdf"),
    Given(UR + "ur5_joint_limited_robot.urdf"),
    Given(UR + "ur5_gripper.urdf"),
    Given(UR + "ur10_robot.urdf"),
    Given(UR + "ur10_joint_limited_robot.urdf"),
    Given(Z1, "tool0", ("link06", "0 1.5707963267948966 0")),
    Given(KINOVA, "tool0", ("j2s6s200_link_6", "3.1415926535897931 0 0")),
    Given("panda_description/urdf/panda.urdf", "panda_link6"),
    Given("xarm_description/urdf/xarm7.urdf", "link6"),
)
REFUSED = (
    Given(Z1),
    Given(Z1, "link06"),
    Given(KINOVA),
    Given(KINOVA, "j2s6s200_link_6"),
    Given("panda_description/urdf/panda.urdf", "panda_link8"),
    Given("xarm_description/urdf/xarm7.urdf"),
    Given("so_arm_description/urdf/so100.urdf"),
    Given("talos_data/robots/talos_left_arm.urdf", "gripper_left_base_link"),
    Given("asr_twodof_description/urdf/TwoDofs.urdf"),
    Given("baxter_description/urdf/baxter.urdf"),
    Given("iris_description/robots/iris.urdf"),
    Given(UR + "ur3.urdf"),
)


def folder() -> Path | None:
    """Find the URDFs of the package, None where it is not installed."""
    try:
        found = Path(str(distribution(PACKAGE).locate_file(FOLDER)))
    except PackageNotFoundError:
        return None
    return found if found.is_dir() else None


def chain_of(given: Given, robots: Path, scratch: Path) -> UrdfChain:
    """Read the chain of a URDF, with the flange that it lacks.

    Raises:
        ArmError: It is no arm of six axes.
    """
    path = robots / given.path
    if given.flange is None:
        return read_chain(path, tip=given.tip)
    link, rpy = given.flange
    added = (
        f'<link name="{given.tip}"/><joint name="{given.tip}" type="fixed">'
        f'<origin rpy="{rpy}"/><parent link="{link}"/><child link="{given.tip}"/>'
        "</joint></robot>"
    )
    whole = scratch / path.name
    whole.write_text(path.read_text().replace("</robot>", added))
    return read_chain(whole, tip=given.tip)


def judged(given: Given, robots: Path, scratch: Path) -> Opinion:
    """Make an arm file of a URDF and compare it.

    Raises:
        ArmError: It is no arm of six axes.
    """
    chain = chain_of(given, robots, scratch)
    arm = arm_of_text(chain.path, arm_text(chain, 0.1))
    joints = tuple(joint.name for joint in chain.moving)
    names = UrdfChainNames(chain.path.read_text(), chain.base, chain.tip, joints)
    claim = ArmClaim(arm.file, arm.flange, arm.gravity_torque)
    return judge_urdf(given.name, names, claim)


def cells(opinion: Opinion) -> str:
    """Write one row of the table."""
    rows = {row.what: row for row in opinion.rows}
    order = ("flange: place", "flange: orientation", "joint limits", "link masses",
             "gravity torque")  # fmt: skip
    sizes = (f"{rows[what].largest:.1g}" if what in rows else "" for what in order)
    rounded = rows.get("flange, angles of the URDF as rounded: place")
    last = "" if rounded is None else f"{rounded.largest:.2g}"
    verdict = "agrees" if opinion.agrees else "DISAGREES"
    return f"| {opinion.program} | {' | '.join(sizes)} | {last} | {verdict} |"


def main() -> int:
    """Compare all, and print a table and who is refused."""
    robots = folder()
    if robots is None:
        print(f"nothing compared: pip install {PACKAGE}")
        return 0
    wrong = 0
    print("| URDF | place mm | orientation rad | limits rad | masses kg | "
          "gravity N m | place mm, angles as rounded | |")  # fmt: skip
    with tempfile.TemporaryDirectory() as scratch:
        for given in ARMS:
            opinion = judged(given, robots, Path(scratch))
            wrong += not opinion.agrees
            print(cells(opinion))
        for given in REFUSED:
            try:
                judged(given, robots, Path(scratch))
                print(f"{given.name}: READ")
                wrong += 1
            except ArmError as exc:
                print(f"{given.name}: {exc.problem}. {exc.cure}")
    return 1 if wrong else 0


if __name__ == "__main__":
    raise SystemExit(main())
