"""Arms as their makers' and ROS-Industrial's URDFs state them, joint by joint."""

from __future__ import annotations

import math
from dataclasses import dataclass

Vector = tuple[float, float, float]
QUARTER = math.pi / 2
NONE = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Row:
    """One joint of a URDF.

    Attributes:
        xyz, rpy: Its origin [m], [rad].
        axis: Its axis.
        moves: (axis number, multiplier, offset [rad]) of the angle: another joint's
            for one that mimics it. None where it is fixed.
    """

    xyz: Vector
    rpy: Vector
    axis: Vector = NONE
    moves: tuple[int, float, float] | None = None


def turning(number: int, xyz: Vector, axis: Vector, rpy: Vector = NONE) -> Row:
    """Return the joint of an axis, 1 to 6."""
    return Row(xyz, rpy, axis, (number, 1.0, 0.0))


X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
LEFT, DOWN = (0.0, -1.0, 0.0), (0.0, 0.0, -1.0)
BACK = (-1.0, 0.0, 0.0)
TOOL0 = Row(NONE, (0.0, QUARTER, 0.0))


def upright(c1, a1, c2, a2, c3, c4):
    """Return the joints of an IRB, whose zero is the upright arm."""
    return (
        turning(1, (0.0, 0.0, c1), Z),
        turning(2, (a1, 0.0, 0.0), Y),
        turning(3, (0.0, 0.0, c2), Y),
        turning(4, (0.0, 0.0, a2), X),
        turning(5, (c3, 0.0, 0.0), Y),
        turning(6, (c4, 0.0, 0.0), X),
        TOOL0,
    )


def stretched(c1, a1, c2, a2, c3, c4):
    """Return the joints of a KR, whose zero is the arm stretched forward."""
    return (
        turning(1, (0.0, 0.0, c1), DOWN),
        turning(2, (a1, 0.0, 0.0), Y),
        turning(3, (c2, 0.0, 0.0), Y),
        turning(4, (0.0, 0.0, a2), BACK),
        turning(5, (c3, 0.0, 0.0), Y),
        turning(6, (c4, 0.0, 0.0), BACK),
        TOOL0,
    )


URDFS: dict[str, tuple[Row, ...]] = {
    # ros-industrial/abb: irb6640_185_280_macro.xacro
    "irb6640-185-2.8": upright(0.780, 0.320, 1.075, 0.2, 1.392, 0.2),
    # ros-industrial/abb: irb6700_200_260_macro.xacro, with the upper arm and the
    # forearm of RobotComponents' IRB6700_150_320.cs
    "irb6700-150-3.2": upright(0.78, 0.32, 1.280, 0.2, 1.5925, 0.2),
    # ros-industrial/abb: irb4600_60_205_macro.xacro
    "irb4600-60-2.05": upright(0.495, 0.175, 0.9, 0.175, 0.960, 0.135),
    # ros-industrial/kuka_experimental: kr210r2700extra_macro.xacro
    "kr210-r2700-extra": stretched(0.675, 0.350, 1.150, -0.041, 1.200, 0.215),
    # ros-industrial/kuka_experimental: kr120r2500pro_macro.xacro
    "kr120-r2500-pro": stretched(0.675, 0.350, 1.150, -0.041, 1.0, 0.215),
    # ros-industrial/kuka_experimental: kr340r3330_macro.xacro
    "kr340-r3330": stretched(1.045, 0.5, 1.300, -0.055, 1.525, 0.290),
    # ukaea/CRCOpenROS2Driver: nj_130_2_6_arm.urdf.xacro. Its axis 3 is that of the
    # parallelogram: two passive joints carry the forearm; flange by Comau's driver.
    "nj130-2.6": (
        turning(1, (0.0, 0.0, 0.331), Z, (math.pi, 0.0, 0.0)),
        turning(2, (0.35, 0.0, -0.499), Z, (-QUARTER, 0.0, math.pi)),
        Row((0.0, 1.16, 0.0), (0.0, math.pi, 0.0), Z, (2, 1.0, 0.0)),
        Row(NONE, NONE, Z, (3, 1.0, QUARTER)),
        turning(4, (0.145, 0.25, 0.0), Z, (-QUARTER, 0.0, QUARTER)),
        turning(5, (0.0, 0.0, -0.96058), Z, (-QUARTER, 0.0, 0.0)),
        turning(6, (0.0, 0.165, 0.0), Z, (QUARTER, 0.0, 0.0)),
        Row(NONE, (0.0, math.pi, 0.0)),
    ),
    # Comau/COMAU-ROS2-DRIVER: racer7-14.urdf.xacro, its 1.5708 and 3.1416 written out.
    # Its ee_link points into the wrist: the flange is link_6.
    "racer7-1.4": (
        turning(1, (0.0, 0.0, 0.201), Y, (-QUARTER, 0.0, 0.0)),
        turning(2, (0.15, -0.229, -0.09), Z, (0.0, 0.0, -QUARTER)),
        turning(3, (0.59, 0.0, 0.0), Y, (-QUARTER, 0.0, -QUARTER)),
        turning(4, (0.13, -0.09, 0.0), LEFT, (QUARTER, 0.0, 0.0)),
        turning(5, (0.0, 0.684, 0.0), LEFT, (-QUARTER, 0.0, 0.0)),
        turning(6, (0.0, 0.0, 0.1), DOWN, (0.0, 0.0, math.pi)),
    ),
}
# Comau/COMAU-ROS2-DRIVER: nj130-26.urdf.xacro, its -1.57 written out. Axis 3 follows
# axis 2 here; the driver adds the controller's two angles (parallel_joint_fix).
NJ130_SERIAL = (
    turning(1, (0.0, 0.0, 0.29865), DOWN),
    turning(2, (0.35, 0.0, 0.53135), Y),
    turning(3, (0.0, 0.0, 1.16), LEFT, (0.0, -QUARTER, 0.0)),
    turning(4, (0.145, 0.0, 0.25), BACK),
    turning(5, (0.96058, 0.0, 0.0), Y),
    turning(6, (0.165, 0.0, 0.0), BACK),
    TOOL0,
)


def degrees(*values: float) -> list[float]:
    """Convert to radians what a URDF states as radians(..)."""
    return [math.radians(value) for value in values]


# (lower, upper, velocity) [rad], [rad/s] as the URDFs above state them, where they are
# those of the arm: the file of the KR 120 states a KR 16's, no URDF is of the 6700's.
LIMITS: dict[str, tuple[list[float], list[float], list[float]]] = {
    "irb6640-185-2.8": (
        [-2.967, -1.134, -3.142, -5.236, -2.094, -6.283],
        [2.967, 1.4855, 1.222, 5.236, 2.094, 6.283],
        [1.7453, 1.5707, 1.5707, 2.9671, 2.4435, 3.3161],
    ),
    "irb4600-60-2.05": (
        [-3.141, -1.570, -3.141, -6.981, -2.181, -6.981],
        [3.141, 2.617, 1.308, 6.981, 2.094, 6.981],
        [3.054, 3.054, 3.054, 4.363, 4.363, 6.283],
    ),
    "kr210-r2700-extra": (
        degrees(-185, -140, -120, -350, -125, -350),
        degrees(185, -5, 155, 350, 125, 350),
        degrees(123, 115, 112, 179, 172, 219),
    ),
    "kr340-r3330": (
        degrees(-185, -130, -100, -350, -120, -350),
        degrees(185, 20, 144, 350, 120, 350),
        degrees(90, 80, 75, 90, 83, 130),
    ),
    "nj130-2.6": (
        degrees(-180, -75, -256, -280, -120, -2700),
        degrees(180, 95, -10, 280, 120, 2700),
        degrees(110, 110, 110, 190, 190, 230),
    ),
    "racer7-1.4": (
        [-2.88, -1.484, -2.932, -3.665, -2.356, -47.124],
        [2.88, 2.705, 0.0, 3.665, 2.356, 47.124],
        [4.363, 4.363, 5.236, 10.473, 10.472, 11.345],
    ),
}


def urdf_text(rows: tuple[Row, ...], name: str = "robot", limits: str = "") -> str:
    """Write joints as a URDF, links l0 to ..., tool0 at the end."""
    lines = ['<?xml version="1.0"?>', f'<robot name="{name}">']
    limits = limits or 'lower="-3.0" upper="3.0" velocity="2.0" effort="0"'
    ends = [f"l{k}" for k in range(len(rows))] + ["tool0"]
    lines += [f'  <link name="{end}"/>' for end in ends]
    for k, row in enumerate(rows):
        kind = "fixed" if row.moves is None else "revolute"
        xyz, rpy, axis = (
            " ".join(map(repr, vector)) for vector in (row.xyz, row.rpy, row.axis)
        )
        lines += [
            f'  <joint name="j{k + 1}" type="{kind}">',
            f'    <origin xyz="{xyz}" rpy="{rpy}"/>',
            f'    <parent link="{ends[k]}"/> <child link="{ends[k + 1]}"/>',
        ]
        if kind == "revolute":
            lines += [f'    <axis xyz="{axis}"/>', f"    <limit {limits}/>"]
        lines += ["  </joint>"]
    return "\n".join([*lines, "</robot>", ""])
