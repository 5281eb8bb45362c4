"""The arm file of a chain of six joints, with a closed form where the arm has one."""

from __future__ import annotations

import json
import math
from typing import NamedTuple

import numpy as np

from postproc.arrays import Floats
from postproc.exceptions import ArmError
from postproc.robot.arm import arm_of_text, check_flanges
from postproc.robot.arm_file import compensating_share, list_text, number_text
from postproc.robot.denavit_hartenberg import PARALLEL, DhParameters, dh_parameters
from postproc.robot.pose import MM
from postproc.robot.urdf import MOVING, UrdfChain, rotate_about
from postproc.robot.urdf_links import links_text

# What the chain is: lengths and zeros of an ortho-parallel basis with a wrist.
#
# The closed form's own angles are 0 where the arm stands upright: all joints but 1, 4
# and 6, which lie along z, turn about y then.

EXACT = 1e-10  # [rad], [m] that axes may be off
BY_NUMBERS = "Its inverse kinematics is numeric"
ON_AXIS_6 = (
    "Name the flange with --tip: it stands on axis 6, its z points out of it. Where no "
    "link does, add one by a fixed joint"
)


class NoClosedFormError(ArmError):
    """The arm is not six axes with an ortho-parallel basis and a spherical wrist."""


class Shape(NamedTuple):
    """An ortho-parallel arm with a spherical wrist.

    Attributes:
        a1, a2, b, c1, c2, c3, c4: Lengths of the closed form [m].
        zero: Its angles where the joints' are 0, (6,) [rad].
        sign: Of every joint's rotation against it, (6,).
    """

    a1: float
    a2: float
    b: float
    c1: float
    c2: float
    c3: float
    c4: float
    zero: Floats
    sign: Floats


class _Geometry:
    """Axes and points of a chain where all joints are at 0, and complaints of them."""

    def __init__(self, chain: UrdfChain) -> None:
        """Walk along the chain."""
        self._chain, self.joints = chain, chain.moving
        frame, axes, points = np.linalg.inv(chain.before), [], []
        for joint in chain.joints:
            frame = frame @ joint.origin
            if joint.kind in MOVING:
                axes.append(frame[:3, :3] @ joint.axis)
                points.append(frame[:3, 3])
        self.axes, self.points = np.array(axes), np.array(points)
        self.flange: Floats = np.asarray(frame)

    def need(self, k: int, gap: float, problem: str, cure: str = "") -> None:
        """Refuse the arm where a gap is more than rounding.

        Raises:
            NoClosedFormError: Naming joint k and the gap.
            ArmError: Likewise, where a cure is given: no arm file can say that.
        """
        if abs(gap) > EXACT:
            joint = self.joints[k]
            what = f"joint {joint.name} {problem}, off by {abs(gap):.3g}"
            error, default = (
                (ArmError, cure) if cure else (NoClosedFormError, BY_NUMBERS)
            )
            raise error(self._chain.path, what, default, line=joint.line)

    def need_base(self) -> None:
        """Refuse a base whose z is not axis 1.

        Raises:
            ArmError: It is beside axis 1, or askew.
        """
        z = np.array([0.0, 0.0, 1.0])
        cure = "Name the controller's base frame with --base"
        problem = f"does not turn about z of {self._chain.base}"
        self.need(0, _sine(self.axes[0], z), problem, cure)
        beside = float(np.hypot(*self.points[0][:2]))
        self.need(0, beside, "is beside the base's z", cure)

    def need_flange(self) -> None:
        """Refuse a flange that does not stand on axis 6, with z along it.

        Raises:
            ArmError: It is beside axis 6, or askew.
        """
        last, place = self.axes[5], self.flange[:3, 3] - self.points[5]
        askew = _sine(self.flange[:3, 2], last)
        self.need(5, askew, "is not along the z of the flange", ON_AXIS_6)
        beside = _length(place - (place @ last) * last)
        self.need(5, beside, "misses the flange", ON_AXIS_6)


def shape_of(chain: UrdfChain) -> Shape:
    """Find the closed form of a chain.

    Raises:
        NoClosedFormError: It has no ortho-parallel basis, or no spherical wrist.
        ArmError: Base or flange are not on its axes.
    """
    here = _Geometry(chain)
    axes, z = here.axes, np.array([0.0, 0.0, 1.0])
    here.need_base()
    here.need(1, axes[1] @ z, "is not square to axis 1")
    here.need(2, _sine(axes[2], axes[1]), "is not parallel to axis 2")
    here.need(3, axes[3] @ axes[2], "is not square to axis 3")
    here.need(4, axes[4] @ axes[3], "is not square to axis 4")
    here.need(5, axes[5] @ axes[4], "is not square to axis 5")
    return _wrist(here, _basis(here, _wrist_centre(here)))


def _sine(a: Floats, b: Floats) -> float:
    """Return the sine of the angle between two unit vectors."""
    return float(np.linalg.norm(np.cross(a, b)))


def _wrist_centre(here: _Geometry) -> Floats:
    """Find where axes 4, 5 and 6 meet, (3,) [m].

    Raises:
        ArmError: They do not.
    """
    (p4, p5, p6), (u4, u5, u6) = here.points[3:], here.axes[3:]
    away = p4 - p5  # the foot on axis 5 of the common normal of axes 4 and 5
    centre = p5 + (away @ u5) * u5
    beside = p4 - centre
    here.need(4, _length(beside - (beside @ u4) * u4), "does not cross axis 4")
    beside = p6 - centre
    here.need(5, _length(beside - (beside @ u6) * u6), "misses the wrist centre")
    found: Floats = centre
    return found


def _length(vector: Floats) -> float:
    return float(np.linalg.norm(vector))


def _turn(axis: Floats, angle: float) -> Floats:
    """Rotate about a unit vector, (3, 3)."""
    return rotate_about(axis, np.array([angle]))[0, :3, :3]


def _basis(here: _Geometry, centre: Floats) -> Shape:
    """Find the lengths and the first three angles.

    The side of axis 1 on which axis 2 lies is ahead.

    Raises:
        ArmError: Upper arm or forearm have no length.
    """
    up = np.array([0.0, 0.0, 1.0])
    side = here.axes[1] if here.axes[1] @ [0.0, 1.0, 0.0] >= -EXACT else -here.axes[1]
    if np.cross(side, up) @ here.points[1] < -EXACT:
        side = -side
    ahead = np.cross(side, up)
    plane = np.array([ahead, up])
    shoulder, elbow, wrist = (plane @ p for p in (*here.points[1:3], centre))
    forearm = here.axes[3] * (
        1.0 if (plane @ here.axes[3]) @ (wrist - elbow) >= 0 else -1.0
    )
    along = plane @ forearm
    upper, lean = elbow - shoulder, math.atan2(*along)
    across = np.array([along[1], -along[0]])
    c2, c3 = _length(upper), float((wrist - elbow) @ along)
    for k, length, what in ((2, c2, "an upper arm"), (3, c3, "a forearm")):
        here.need(k, 0.0 if length > EXACT else 1.0, f"ends {what} of no length")
    t1, t2 = math.atan2(ahead[1], ahead[0]), math.atan2(*upper)
    sign = [here.axes[0] @ up, here.axes[1] @ side, here.axes[2] @ side]
    return Shape(
        a1=float(shoulder[0]), a2=float((wrist - elbow) @ across),
        b=float(centre @ side), c1=float(shoulder[1]), c2=c2, c3=c3, c4=0.0,
        zero=np.array([t1, t2, lean - t2, 0.0, 0.0, 0.0]),
        sign=np.array([*sign, here.axes[3] @ forearm, 0.0, 0.0]),
    )  # fmt: skip


def _wrist(here: _Geometry, basis: Shape) -> Shape:
    """Find the wrist's angles and the flange, given the basis.

    Raises:
        ArmError: The flange does not stand on axis 6, with z along it.
    """
    x, y, z = np.eye(3)
    t1, t2, t3 = basis.zero[:3]
    forearm = _turn(z, t1) @ _turn(y, t2 + t3)
    u5, u6 = here.axes[4:]
    out: Floats = np.asarray(here.flange[:3, 2])
    place = here.flange[:3, 3] - _wrist_centre(here)
    here.need_flange()
    here.need(5, min(float(place @ out), 0.0), "is behind its flange", ON_AXIS_6)
    local = forearm.T @ u5
    t4 = math.atan2(-local[0], local[1])
    if abs(t4) > math.pi / 2 + EXACT:  # the other half turn, with axis 5 the other way
        t4 -= math.copysign(math.pi, t4)
    roll = forearm @ _turn(z, t4)
    t5 = math.atan2(out @ (roll @ x), out @ (roll @ z))
    last = roll @ _turn(y, t5)
    local = last.T @ here.flange[:3, 0]
    return basis._replace(
        c4=float(place @ out),
        zero=np.array([t1, t2, t3, t4, t5, math.atan2(local[1], local[0])]),
        sign=np.array([*basis.sign[:4], u5 @ (roll @ y), u6 @ out]),
    )


# What any six axes are: Denavit-Hartenberg parameters.

NEARLY = 0.01  # [rad] between axes whose common normal is far from the arm
SINGULAR = 1e-6  # least singular value of the Jacobian [m, rad] of an arm that moves


def dh_of(chain: UrdfChain) -> DhParameters:
    """Find the D-H parameters of a chain.

    Raises:
        ArmError: Base or flange are not on its axes, or axes are nearly parallel.
    """
    here = _Geometry(chain)
    here.need_base()
    here.need_flange()
    for k in range(1, 6):
        sine = _sine(here.axes[k - 1], here.axes[k])
        near = sine if PARALLEL <= sine < NEARLY else 0.0
        cure = "Make it parallel: the common normal of such axes is far from the arm"
        here.need(k, near, f"is nearly parallel to axis {k}", cure)
    return dh_parameters(here.axes, here.points, here.flange)


# The arm file.

FULL_SPEED, FULL_ACCELERATION = 0.4, 0.1  # [s], guesses


def arm_text(chain: UrdfChain, repeatability_mm: float, name: str | None = None) -> str:
    """Write the arm file of a chain, and read it back.

    Args:
        chain: The URDF's joints.
        repeatability_mm: Pose repeatability of the arm [mm], which no URDF states.
        name: Name of the arm; default: the robot's.

    Raises:
        ArmError: The chain is no arm that an arm file can say.
    """
    obstacle = None
    try:
        parts = _write_closed_form(shape_of(chain))
    except NoClosedFormError as exc:
        obstacle, parts = exc, _numeric_parts(dh_of(chain))
    text = _fill_arm_file(chain, parts, repeatability_mm, name or chain.name)
    arm = arm_of_text(chain.path, text)
    if obstacle is not None:  # likely what is wrong with an arm that is singular
        J = arm.jacobian(Q, np.zeros(3))
        if np.linalg.svd(J, compute_uv=False)[:, -1].max() < SINGULAR:
            problem = f"{obstacle.problem}, and no joint angles move the flange freely"
            cure = "Check origins and axes of the joints"
            raise ArmError(obstacle.path, problem, cure, line=obstacle.line)
    check_flanges(arm, chain.path, Q, chain.flange(Q))
    return text + links_text(chain.weights, arm)


def find_closed_form_obstacle(chain: UrdfChain) -> str:
    """Say why the arm file of a chain has no closed form; "" where it has one.

    Raises:
        ArmError: The chain is no arm that an arm file can say.
    """
    try:
        shape_of(chain)
    except NoClosedFormError as exc:
        return str(exc)
    return ""


TEMPLATE = """\
# {robot}, from the URDF {file},
# links {base} to {tip}.
# Lengths in mm, angles in degrees. Compare limits with the data sheet.
name = {name}
repeatability_mm = {repeatability}

[dh]                          # standard Denavit-Hartenberg
a_mm = {a}
d_mm = {d}
alpha_deg = {alpha}
# D-H angle = offset + sense * q, q the controller's joint angle
offset_deg = {offset}
sense = {sense}
{parallelogram}
[joints]
lower_deg = {lower}
upper_deg = {upper}
velocity_deg_s = {velocity}
# Accelerations and jerks are guesses, full speed in 0.4 s, full acceleration in 0.1 s.
# A URDF states no gear ratios and no coupled gears.
guessed = ["acceleration", "jerk"]
acceleration_deg_s2 = {acceleration}
jerk_deg_s3 = {jerk}

{closed_form}"""
PARALLELOGRAM = """\
axis2_in_axis3 = 0.0          # a URDF does not state this: {share} where the forearm
                              # keeps its direction while joint 2 moves alone, as with
                              # a parallelogram
"""
CLOSED_FORM = """\
[opw]                         # ortho-parallel basis with spherical wrist
{lengths}
offsets_deg = {offsets}
flip_axes = {flips}
"""
NUMERIC = """\
# No [opw]: no spherical wrist on an ortho-parallel basis. The inverse is numeric.
"""
DH_ZERO = (0.0, -90.0, -90.0, 0.0, 0.0, 180.0)  # [deg] D-H angles of the upright arm


def _fill_arm_file(
    chain: UrdfChain, parts: dict[str, str], repeatability_mm: float, name: str
) -> str:
    """Fill in the arm file."""
    return TEMPLATE.format(
        robot=_quote(chain.name), file=_quote(chain.path.name),
        base=_quote(chain.base), tip=_quote(chain.tip),
        name=_quote(name), repeatability=number_text(repeatability_mm),
        **parts, **_joint_parts(chain),
    )  # fmt: skip


def _quote(text: str) -> str:
    r"""Write a basic string of TOML; what is no character becomes a question mark.

    >>> _quote('a "\x7f')
    '"a \\"\\u007f"'
    """
    valid = text.encode("utf-8", "replace").decode("utf-8")
    return json.dumps(valid, ensure_ascii=False).replace("\x7f", "\\u007f")


def _write_closed_form(shape: Shape) -> dict[str, str]:
    """Write the closed form and its standard D-H parameters."""
    a = np.array([shape.a1, shape.c2, -shape.a2, 0.0, 0.0, 0.0])
    d = np.array([shape.c1, shape.b, 0.0, shape.c3, 0.0, shape.c4])
    offset = np.rad2deg(shape.zero) + np.array(DH_ZERO)
    sense = [round(float(s)) for s in shape.sign]
    wrapped = 180.0 - (180.0 - offset) % 360.0
    return {
        "a": list_text(a / MM),
        "d": list_text(d / MM),
        "alpha": "[-90.0, 0.0, -90.0, 90.0, -90.0, 0.0]",
        "offset": list_text(wrapped),
        "sense": str(sense),
        "parallelogram": _parallelogram_text(sense, 0.0),
        "closed_form": CLOSED_FORM.format(**_opw_parts(shape)),
    }


def _numeric_parts(dh: DhParameters) -> dict[str, str]:
    """Write standard D-H parameters alone, to more digits where these are needed."""
    alpha, offset = (
        180.0 - (180.0 - _round_values(np.rad2deg(angles))) % 360.0
        for angles in (dh.alpha, dh.offset)
    )
    sense = [round(float(s)) for s in dh.sense]
    parallel = abs(np.sin(dh.alpha[1])) < NEARLY
    lists = {"a": dh.a / MM, "d": dh.d / MM, "alpha": alpha, "offset": offset}
    return {
        **{key: str((_round_values(v) + 0.0).tolist()) for key, v in lists.items()},
        "sense": str(sense),
        "parallelogram": _parallelogram_text(sense, dh.alpha[1]) if parallel else "",
        "closed_form": NUMERIC,
    }


def _parallelogram_text(sense: list[int], alpha2: float) -> str:
    """Write the key of a parallelogram, with the number that this arm would need."""
    return PARALLELOGRAM.format(share=compensating_share(sense, alpha2))


def _round_values(values: Floats) -> Floats:
    """Round to 1e-9 what is so round, and the rest to 1e-12.

    >>> _round_values(np.array([163.94100000000003, 100.0 / 3.0])).tolist()
    [163.941, 33.333333333333]
    """
    short: Floats = np.round(values, 9)
    return np.where(np.abs(values - short) < 1e-11, short, np.round(values, 12))


def _joint_parts(chain: UrdfChain) -> dict[str, str]:
    """Write the limits, stated and guessed."""
    limits = [(j.lower, j.upper, j.velocity) for j in chain.moving]
    lower, upper, velocity = np.rad2deg(limits).T
    acceleration = velocity / FULL_SPEED
    return {
        "lower": list_text(lower),
        "upper": list_text(upper),
        "velocity": list_text(velocity),
        "acceleration": list_text(acceleration),
        "jerk": list_text(acceleration / FULL_ACCELERATION),
    }


def _opw_parts(shape: Shape) -> dict[str, str]:
    """Write the closed form."""
    lengths = (
        f"{key}_mm = {number_text(getattr(shape, key) / MM)}"
        for key in ("a1", "a2", "b", "c1", "c2", "c3", "c4")
    )
    flips = ("true" if s < 0 else "false" for s in shape.sign)
    return {
        "lengths": "\n".join(lengths),
        "offsets": list_text(-np.rad2deg(shape.zero)),
        "flips": f"[{', '.join(flips)}]",
    }


Q = np.linspace(-3.0, 3.0, 90).reshape(15, 6) * [1.0, -0.7, 0.5, -0.9, 0.6, 0.8]
