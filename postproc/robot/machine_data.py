"""The arm of a KUKA controller: ``$machine.dat`` of its archive becomes an arm file."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np

from postproc.arrays import Floats
from postproc.exceptions import ArmError
from postproc.robot.arm import arm_of_text, check_flanges
from postproc.robot.arm_file import list_text, number_text
from postproc.robot.pose import MM

MAX_BYTES = 5_000_000  # no machine data are longer
FULL_SPEED, FULL_ACCELERATION = 0.4, 0.1  # [s], guesses
CURE = "Only six axes with a spherical wrist can be written"
AXES = range(1, 7)
_LINE = re.compile(
    r"^[ \t]*(?:DECL[ \t]+)?(?:\w+[ \t]+)?(?P<name>\$\w+)[ \t]*"
    r"(?:\[(?P<index>[ \t\d,]*)\])?[ \t]*=[ \t]*"
    r"(?P<value>\{[^}]*\}|\"[^\"]*\"|[^;\r\n]*)",
    re.MULTILINE,
)
_FIELD = re.compile(r"(\w+)[ \t]+([-+.\w#]+)")
Key = tuple[str, tuple[int, ...]]

# What the file says.


@dataclass(frozen=True)
class MachineData:
    """The values of a ``$machine.dat``.

    Attributes:
        path: The file.
        values: Texts by name (in upper case, without its sign) and index.
    """

    path: Path
    values: Mapping[Key, str]

    def text(self, name: str, *index: int) -> str:
        """Return a value as it is written.

        Raises:
            ArmError: It is not there.
        """
        found = self.values.get((name, index))
        if found is None:
            raise ArmError(self.path, f"holds no ${name}", "Give $machine.dat of R1")
        return found

    def number(self, name: str, *index: int) -> float:
        """Return a number.

        Raises:
            ArmError: It is none.
        """
        return self._number(f"${name}", self.text(name, *index))

    def fields(self, name: str, *index: int) -> dict[str, float]:
        """Return the numbers of an aggregate ``{X 1.0, ..}``.

        Raises:
            ArmError: One of them is none.
        """
        pairs = _FIELD.findall(self.text(name, *index))
        return {
            key.upper(): self._number(f"${name}.{key}", value) for key, value in pairs
        }

    def six(self, name: str) -> Floats:
        """Return the numbers of axes 1 to 6, (6,)."""
        return np.array([self.number(name, axis) for axis in AXES])

    def _number(self, name: str, text: str) -> float:
        try:
            return float(text)
        except ValueError:
            raise ArmError(self.path, f"{name} = {text} is no number", CURE) from None

    def need(self, name: str, found: Sequence[float], wanted: Sequence[float]) -> None:
        """Refuse an arm of another build.

        Raises:
            ArmError: Numbers are others than those of an ortho-parallel arm.
        """
        if not np.allclose(found, wanted, rtol=0.0, atol=1e-9):
            said = ", ".join(f"{v:g}" for v in found)
            meant = ", ".join(f"{v:g}" for v in wanted)
            raise ArmError(self.path, f"${name} is {said}, not {meant}", CURE)


def read_machine_data(path: Path) -> MachineData:
    """Read a ``$machine.dat``.

    Raises:
        ArmError: It cannot be read.
    """
    try:
        with path.open("rb") as file:
            raw = file.read(MAX_BYTES + 1)
    except OSError as exc:
        raise ArmError(
            path, f"cannot be read ({exc.strerror})", "Check the path"
        ) from None
    if len(raw) > MAX_BYTES:
        raise ArmError(path, f"is longer than {MAX_BYTES} bytes", "Check the path")
    values: dict[Key, str] = {}
    for found in _LINE.finditer(raw.decode("latin-1")):
        index = tuple(int(k) for k in re.findall(r"\d+", found["index"] or ""))
        values[found["name"][1:].upper(), index] = found["value"].strip()
    return MachineData(path, values)


# The arm.


@dataclass(frozen=True)
class KukaShape:
    """Lengths [mm] and senses of an arm, as its machine data have them.

    Attributes:
        height: Of axis 2 over the base.
        ahead: From axis 1 to axis 2.
        upper: From axis 2 to axis 3.
        forearm, lift: From axis 3 to the wrist centre, along the forearm and square
            to it.
        flange: From the wrist centre.
        alpha4, alpha5: Turns between the axes of the wrist [deg].
        sense: Of every axis, (6,).
    """

    height: float
    ahead: float
    upper: float
    forearm: float
    lift: float
    flange: float
    alpha4: float
    alpha5: float
    sense: Floats

    def place(self, q: Floats) -> Floats:
        """Place the flange joint by joint, for angles (6,) [rad]: (4, 4) [m]."""
        a = self.sense * q
        chain = [
            _shift(0.0, self.height), _about(2, a[0]), _shift(self.ahead, 0.0),
            _about(1, a[1]), _shift(self.upper, 0.0), _about(1, a[2]),
            _shift(self.forearm, self.lift), _about(1, np.pi / 2), _about(2, a[3]),
            _about(0, np.deg2rad(self.alpha4)), _about(2, a[4]),
            _about(0, np.deg2rad(self.alpha5)), _about(2, a[5]),
            _shift(0.0, self.flange),
        ]  # fmt: skip
        out = np.eye(4)
        for one in chain:
            out = out @ one
        return out


def _shift(x: float, z: float) -> Floats:
    """Shift along x and z [mm], (4, 4) [m]."""
    T = np.eye(4)
    T[0, 3], T[2, 3] = x * MM, z * MM
    return T


def _about(axis: int, angle: float) -> Floats:
    """Turn about an axis of the frame, (4, 4)."""
    T, (i, j) = np.eye(4), ((axis + 1) % 3, (axis + 2) % 3)
    T[i, i] = T[j, j] = np.cos(angle)
    T[j, i] = np.sin(angle)
    T[i, j] = -T[j, i]
    return T


def shape_of_machine(data: MachineData) -> KukaShape:
    """Read lengths and senses, and refuse what no ortho-parallel arm has.

    Raises:
        ArmError: A value is missing, or the arm is of another build.
    """
    data.need("NUM_AX", [data.number("NUM_AX")], [6])
    for name, wanted in (("MAIN_AXIS", "#NR"), ("WRIST_AXIS", "#ZEH")):
        if data.text(name).upper() != wanted:
            raise ArmError(data.path, f"${name} is {data.text(name)}", CURE)
    data.need("A4PAR", [data.number("A4PAR")], [0])
    data.need("AXIS_SEQ", data.six("AXIS_SEQ").tolist(), list(AXES))
    root, wrist, flange = (data.fields(n) for n in ("TIRORO", "TX3P3", "TFLWP"))
    _need_frame(data, "TIRORO", root, z=root.get("Z", 0.0))
    _need_frame(data, "TFLWP", flange, z=flange.get("Z", 0.0))
    x, z = wrist.get("X", 0.0), wrist.get("Z", 0.0)
    _need_frame(data, "TX3P3", wrist, x=x, z=z, b=90.0)
    alphas = [_alpha(data, name) for name in ("DH_4", "DH_5")]
    data.need("DH_4 + $DH_5", [sum(alphas)], [0])
    sense = data.six("AXIS_DIR")
    data.need("AXIS_DIR", np.abs(sense).tolist(), [1] * 6)
    return KukaShape(
        root["Z"], data.number("LENGTH_A"), data.number("LENGTH_B"), x, z,
        flange["Z"], alphas[0], alphas[1], sense,
    )  # fmt: skip


def _need_frame(
    data: MachineData,
    name: str,
    found: Mapping[str, float],
    x: float = 0.0,
    z: float = 0.0,
    b: float = 0.0,
) -> None:
    """Refuse a frame with other components than those that may differ."""
    given = [found.get(key, np.nan) for key in "XYZABC"]
    data.need(name, given, [x, 0.0, z, 0.0, b, 0.0])


def _alpha(data: MachineData, name: str) -> float:
    """Return the turn from an axis of the wrist to the next [deg]."""
    fields = data.fields(name)
    given = [fields.get(key, np.nan) for key in ("DHART_A", "DHART_D", "DHART_ALPHA")]
    data.need(name, [given[0], given[1], abs(given[2])], [0.0, 0.0, 90.0])
    return given[2]


# The arm file.

TEMPLATE = """\
# {trafo}, from the machine data {file}. Lengths in mm, angles in degrees.
name = {name}
controller = "kuka"
repeatability_mm = {repeatability}

[dh]                          # standard Denavit-Hartenberg
a_mm = {a}
d_mm = {d}
alpha_deg = [-90.0, 0.0, -90.0, 90.0, -90.0, 0.0]
# D-H angle = offset + sense * q, q the controller's joint angle
offset_deg = [0.0, 0.0, -90.0, 0.0, 0.0, 180.0]
sense = {sense}

[joints]
lower_deg = {lower}
upper_deg = {upper}
velocity_deg_s = {velocity}   # rated speed of the motors over the gear ratios
# Accelerations and jerks are guesses, full speed in 0.4 s, full acceleration in 0.1 s.
guessed = ["acceleration", "jerk"]
acceleration_deg_s2 = {acceleration}
jerk_deg_s3 = {jerk}
gear_ratio = {ratio}
{coupling}
[opw]                         # ortho-parallel basis with spherical wrist
a1_mm = {a1}
a2_mm = {a2}
b_mm = 0.0
c1_mm = {c1}
c2_mm = {c2}
c3_mm = {c3}
c4_mm = {c4}
offsets_deg = [0.0, -90.0, 0.0, 0.0, 0.0, 0.0]
flip_axes = {flips}
"""


def machine_arm_text(
    data: MachineData, repeatability_mm: float, name: str | None = None
) -> str:
    """Write the arm file of machine data, and read it back.

    Args:
        data: The values of ``$machine.dat``.
        repeatability_mm: Pose repeatability of the arm [mm], which they do not hold.
        name: Name of the arm; default: that of the transformation.

    Raises:
        ArmError: They are of no arm that an arm file can say.
    """
    shape = shape_of_machine(data)
    trafo = data.values.get(("TRAFONAME", ()), '""').strip('" #')
    text = TEMPLATE.format(
        trafo=trafo or "a KUKA arm",
        file=data.path.name,
        name=json.dumps(name or trafo.lower().replace(" ", "-") or "kuka"),
        repeatability=number_text(repeatability_mm),
        **_lengths(shape),
        **_limits(data),
        coupling=_coupling(data),
    )
    q = np.linspace(-2.0, 2.0, 60).reshape(10, 6) * [1.0, -0.7, 0.5, -0.9, 0.6, 0.8]
    flanges = np.array([shape.place(angles) for angles in q])
    check_flanges(arm_of_text(data.path, text), data.path, q, flanges)
    return text


def _lengths(shape: KukaShape) -> dict[str, str]:
    """Write lengths and senses: axis 5 of the closed form turns against its sense."""
    closed = shape.sense * np.where(np.arange(6) == 4, -np.sign(shape.alpha4), 1.0)
    s = shape
    flips = ("true" if sign < 0 else "false" for sign in closed.tolist())
    return {
        "a": list_text([s.ahead, s.upper, s.lift, 0.0, 0.0, 0.0]),
        "d": list_text([s.height, 0.0, 0.0, s.forearm, 0.0, s.flange]),
        "sense": str([int(sign) for sign in closed]),
        "a1": number_text(s.ahead), "a2": number_text(-s.lift),
        "c1": number_text(s.height), "c2": number_text(s.upper),
        "c3": number_text(s.forearm), "c4": number_text(s.flange),
        "flips": f"[{', '.join(flips)}]",
    }  # fmt: skip


def _limits(data: MachineData) -> dict[str, str]:
    """Write ranges, speeds and gear ratios.

    Raises:
        ArmError: A ratio or a speed is none.
    """
    ratios = [data.fields("RAT_MOT_AX", axis) for axis in AXES]
    turns = [(r.get("N", 0.0), r.get("D", 0.0)) for r in ratios]
    if not all(n and d for n, d in turns):
        raise ArmError(data.path, "$RAT_MOT_AX holds no gear ratio", CURE)
    ratio = np.array([n / d for n, d in turns])
    speed = 6.0 * data.six("VEL_AXIS_MA") / np.abs(ratio)  # [deg/s] of [1/min]
    acceleration = speed / FULL_SPEED
    return {
        "lower": list_text(data.six("SOFTN_END")),
        "upper": list_text(data.six("SOFTP_END")),
        "velocity": list_text(np.round(speed, 1)),
        "acceleration": list_text(np.round(acceleration, 1)),
        "jerk": list_text(np.round(acceleration / FULL_ACCELERATION)),
        "ratio": list_text(np.round(ratio, 5)),
    }


def _coupling(data: MachineData) -> str:
    """Write how the drives of the wrist are coupled.

    ``$COUP_COMP[m,n]`` is by how much axis n turns where axis m is turned by 1 and the
    drive of n stands still (KUKA, KR C2 Machine Data, 2.1.5). So the drive of n turns
    by the angle of its axis less that.

    Raises:
        ArmError: A coupling is no ratio.
    """
    found, matrix = [], np.eye(len(AXES))
    for axis, other in product(AXES, AXES):
        if axis == other or ("COUP_COMP", (axis, other)) not in data.values:
            continue
        fields = data.fields("COUP_COMP", axis, other)
        n, d = fields.get("N", 0.0), fields.get("D", 1.0)
        if d == 0.0:
            raise ArmError(data.path, f"$COUP_COMP[{axis},{other}] is no ratio", CURE)
        if n:
            found.append(f"axis {axis} on {other} {n:.0f}/{d:.0f}")
            matrix[other - 1, axis - 1] = -n / d
    if not found:
        return "# $COUP_COMP couples no axes.\n"
    rows = "".join(f"    {list_text(row)},\n" for row in matrix)
    return (
        f"# $COUP_COMP: {', '.join(found)}: what an axis turns by with its own drive\n"
        "# at rest. drive-side angle = drive_coupling . joint angle\n"
        f"drive_coupling = [\n{rows}]\n"
    )
