"""A URDF: the chain of six joints between two of its links."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from xml.parsers import expat

import numpy as np

from postproc.arrays import Floats
from postproc.exceptions import ArmError
from postproc.robot.urdf_links import Weight, body_of

# The file: elements that know their line.

MAX_BYTES = 20_000_000  # no URDF is longer; meshes are files of their own
EXPAND = "Expand it first: xacro FILE.xacro > FILE.urdf"


@dataclass(frozen=True)
class Element:
    """One element of an XML file.

    Attributes:
        tag: Its name.
        attributes: Its attributes.
        line: 1-based line that it begins on.
        children: The elements in it.
    """

    tag: str
    attributes: Mapping[str, str]
    line: int
    children: list[Element] = field(default_factory=list)


def read_elements(path: Path) -> Element:
    """Read an XML file.

    Raises:
        ArmError: It cannot be read, is no XML, or is a xacro that is not expanded.
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
    reading = _Elements(path)
    reading.read(raw)
    return reading.top.children[0]


class _Elements:
    """What an XML file holds, put together as it is parsed."""

    def __init__(self, path: Path) -> None:
        self.top = Element("", {}, 1)
        self._path, self._open = path, [self.top]
        self._parser = expat.ParserCreate()
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._parser.StartDoctypeDeclHandler = self._refuse

    def read(self, raw: bytes) -> None:
        """Parse a whole file.

        Raises:
            ArmError: It is no XML, or a xacro that is not expanded.
        """
        try:
            self._parser.Parse(raw, True)
        except expat.ExpatError as exc:
            problem = f"is not XML: {expat.ErrorString(exc.code)}"
            line = exc.lineno
            raise ArmError(self._path, problem, "Give a URDF", line=line) from None

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        line = self._parser.CurrentLineNumber
        if tag.startswith("xacro:"):
            problem = f"<{tag}> is not expanded"
            raise ArmError(self._path, problem, EXPAND, line=line)
        element = Element(tag, attributes, line)
        self._open[-1].children.append(element)
        self._open.append(element)

    def _end(self, tag: str) -> None:
        self._open.pop()

    def _refuse(self, *_: object) -> None:
        """Refuse a document type: its entities could grow without end."""
        line = self._parser.CurrentLineNumber
        problem = "declares a document type, which no URDF needs"
        raise ArmError(self._path, problem, "Remove the declaration", line=line)


# Joints, and the chain of them from base to tip.

LARGEST = 1e9  # number that a URDF can mean
SQUARE = 1e-3  # [rad] that a rounded quarter turn (1.57, 3.1416) may be off
MOVING = ("revolute", "continuous")


@dataclass(frozen=True)
class UrdfJoint:
    """A joint of a URDF.

    Attributes:
        name, kind: As the file says.
        parent, child: Its links.
        origin: The joint's frame in the parent link's, (4, 4) [m].
        axis: Unit vector in the joint's frame, (3,).
        lower, upper: Limits [rad], NaN where none are stated.
        velocity: Limit [rad/s], NaN where none is stated.
        mimics: The joint that it follows, or "".
        line: Where it stands.
        rounded: What was taken as a quarter turn though it is off, in words.
    """

    name: str
    kind: str
    parent: str
    child: str
    origin: Floats
    axis: Floats
    lower: float
    upper: float
    velocity: float
    mimics: str
    line: int
    rounded: tuple[str, ...]


@dataclass(frozen=True)
class UrdfChain:
    """The way from base to tip.

    Attributes:
        path: The URDF.
        name: Name of the robot.
        base, tip: The links at its ends.
        before: The base link in the frame that the first joint hangs on, (4, 4) [m].
        joints: All joints on the way, fixed ones too.
        weights: Masses and centres of the links behind the first joint, as stated.
    """

    path: Path
    name: str
    base: str
    tip: str
    before: Floats
    joints: tuple[UrdfJoint, ...]
    weights: tuple[Weight, ...] = ()

    @property
    def moving(self) -> tuple[UrdfJoint, ...]:
        """The joints that move."""
        return tuple(joint for joint in self.joints if joint.kind in MOVING)

    @property
    def endless(self) -> tuple[str, ...]:
        """Which joints turn without end, and what range is taken, in words."""
        return tuple(
            f"joint {joint.name} is continuous: the given range is used, "
            f"{math.degrees(joint.lower):g} to {math.degrees(joint.upper):g} deg"
            for joint in self.moving
            if joint.kind == "continuous"
        )

    @property
    def rounded(self) -> tuple[str, ...]:
        """Which angles were taken as quarter turns, in words."""
        return tuple(text for joint in self.joints for text in joint.rounded)

    def flange(self, q: Floats) -> Floats:
        """Place the tip in the base frame, joint by joint.

        Args:
            q: Angles of the moving joints, (n, 6) [rad].

        Returns:
            (n, 4, 4) [m].
        """
        out = np.tile(np.linalg.inv(self.before), (len(q), 1, 1))
        angles = iter(q.T)
        for joint in self.joints:
            out = out @ joint.origin
            if joint.kind in MOVING:
                out = out @ rotate_about(joint.axis, next(angles))
        return out


def read_chain(
    path: Path, base: str | None = None, tip: str | None = None
) -> UrdfChain:
    """Read the six joints between two links of a URDF.

    Args:
        path: The file.
        base: Link of the controller's base frame; default: base, else base_link, else
            the link on which all others hang.
        tip: Link of the flange; default: tool0, else flange, else the last link.

    Raises:
        ArmError: The file cannot be read, or there are not six revolute joints of
            their own between the links.
    """
    robot = read_elements(path)
    if robot.tag != "robot":
        problem = f"is no URDF: it begins with <{robot.tag}>"
        raise ArmError(path, problem, "Give a URDF", line=robot.line)
    joints = _joints(path, robot)
    links = [c.attributes.get("name", "") for c in robot.children if c.tag == "link"]
    if not links:
        raise ArmError(path, "has no links", "Give a URDF of an arm", line=robot.line)
    roots = [name for name in links if name not in joints]
    base = _end(path, links, base, ("base", "base_link"), roots)
    tip = _end(path, links, tip, ("tool0", "flange"), _last(links, joints))
    up, down = _way(path, joints, base), _way(path, joints, tip)
    while up and down and up[-1] is down[-1]:
        up, down = up[:-1], down[:-1]
    before = _before(path, base, up)
    name = robot.attributes.get("name") or path.stem
    chain = UrdfChain(path, name, base, tip, before, tuple(reversed(down)))
    _check_joints(chain)
    return replace(chain, weights=tuple(_weights(chain, robot, joints)))


def _weights(
    chain: UrdfChain, robot: Element, joints: dict[str, UrdfJoint]
) -> Iterator[Weight]:
    """Read <inertial> of all links that hang on the chain's joints.

    Raises:
        ArmError: A number is none.
    """
    above = {child: (joint.name, joint.parent) for child, joint in joints.items()}
    moving = [joint.name for joint in chain.moving]
    base = np.linalg.inv(_place(chain.path, joints, chain.base))
    for link in (c for c in robot.children if c.tag == "link"):
        name = link.attributes.get("name", "")
        stated = next((c for c in link.children if c.tag == "inertial"), None)
        body = body_of(name, above, moving)
        if stated is None or body is None:
            continue
        parts = {child.tag: child for child in stated.children}
        none = Element("", {}, stated.line)
        mass = _numbers(chain.path, parts.get("mass", none), "value", (0.0,))[0]
        xyz = _numbers(chain.path, parts.get("origin", none), "xyz", (0.0, 0.0, 0.0))
        place = base @ _place(chain.path, joints, name) @ [*xyz, 1.0]
        yield Weight(name, body, mass, place[:3])


def _place(path: Path, joints: Mapping[str, UrdfJoint], link: str) -> Floats:
    """Place a link in the root's frame where all joints are at 0, (4, 4) [m]."""
    place = np.eye(4)
    for joint in _way(path, joints, link):
        place = joint.origin @ place
    return place


def _before(path: Path, base: str, up: Sequence[UrdfJoint]) -> Floats:
    """Place the base link in the frame that the chain begins in, (4, 4) [m].

    Raises:
        ArmError: A joint moves it there.
    """
    before = np.eye(4)
    for joint in reversed(up):
        if joint.kind != "fixed":
            problem = f"joint {joint.name} moves {base} against the chain"
            raise ArmError(path, problem, "Name another --base", line=joint.line)
        before = before @ joint.origin
    return before


def _joints(path: Path, robot: Element) -> dict[str, UrdfJoint]:
    """Read all joints, by the links that hang on them.

    Raises:
        ArmError: A number is none, or two joints carry one link.
    """
    found: dict[str, UrdfJoint] = {}
    for element in robot.children:
        if element.tag == "joint":
            joint = _joint(path, element)
            if joint.child in found:
                problem = f"two joints carry link {joint.child}"
                raise ArmError(path, problem, "Remove one", line=joint.line)
            found[joint.child] = joint
    return found


def _joint(path: Path, element: Element) -> UrdfJoint:
    """Read one joint.

    Raises:
        ArmError: A number is none, or the axis has no direction.
    """
    name, kind = (element.attributes.get(key, "") for key in ("name", "type"))
    parts: dict[str, Element] = defaultdict(lambda: Element("", {}, element.line))
    parts.update((child.tag, child) for child in reversed(element.children))
    axis: Floats = np.array(_numbers(path, parts["axis"], "xyz", (1.0, 0.0, 0.0)))
    length = float(np.linalg.norm(axis))
    if kind in MOVING and length == 0.0:
        problem = f"joint {name} has an axis of no direction"
        raise ArmError(path, problem, "Give it one", line=element.line)
    origin, rounded = _origin(path, name, parts["origin"])
    limits = {
        key: _numbers(path, parts["limit"], key, (math.nan,))[0]
        for key in ("lower", "upper", "velocity")
    }
    return UrdfJoint(
        name=name, kind=kind, line=element.line, **limits,
        parent=parts["parent"].attributes.get("link", ""),
        child=parts["child"].attributes.get("link", ""),
        origin=origin, rounded=rounded, axis=axis / (length or 1.0),
        mimics=parts["mimic"].attributes.get("joint", ""),
    )  # fmt: skip


def _origin(path: Path, name: str, element: Element) -> tuple[Floats, tuple[str, ...]]:
    """Read where a joint stands, and say which angles were taken as quarter turns.

    Returns:
        (4, 4) [m], messages.
    """
    rpy = _numbers(path, element, "rpy", (0.0, 0.0, 0.0))
    quarters = [round(angle / (math.pi / 2)) * (math.pi / 2) for angle in rpy]
    square = [q if abs(angle - q) < SQUARE else angle
              for q, angle in zip(quarters, rpy, strict=True)]  # fmt: skip
    pose = np.eye(4)
    for axis in (2, 1, 0):  # Rot_z(yaw) Rot_y(pitch) Rot_x(roll)
        pose = pose @ rotate_about(np.eye(3)[axis], np.array([square[axis]]))[0]
    pose[:3, 3] = _numbers(path, element, "xyz", (0.0, 0.0, 0.0))
    rounded = (
        f"joint {name}: {given:g} rad read as {math.degrees(taken):g} deg"
        for given, taken in zip(rpy, square, strict=True)
        if abs(given - taken) > 1e-12
    )
    return pose, tuple(rounded)


def _numbers(
    path: Path, element: Element, key: str, default: Sequence[float]
) -> Sequence[float]:
    """Read the numbers of an attribute.

    Raises:
        ArmError: They are not so many sound numbers as the default has.
    """
    text = element.attributes.get(key)
    if text is None:
        return default
    try:
        found = [float(word) for word in text.split()]
    except ValueError:
        found = []
    sound = all(abs(number) <= LARGEST for number in found)  # nan is not
    if len(found) != len(default) or not sound:
        wanted = f"{len(default)} numbers" if len(default) > 1 else "a number"
        wanted += f" below {LARGEST:g}" if len(found) == len(default) else ""
        problem = f"<{element.tag} {key}> is not {wanted}: {text}"
        cure = EXPAND if "$" in text else "Correct it"
        raise ArmError(path, problem, cure, line=element.line)
    return found


def rotate_about(axis: Floats, angle: Floats) -> Floats:
    """Rotate about a unit vector by angles (n,) [rad], (n, 4, 4) (Rodrigues)."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    s, c = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    out = np.tile(np.eye(4), (len(angle), 1, 1))
    out[:, :3, :3] += s * cross + (1 - c) * (cross @ cross)
    return out


def _end(
    path: Path,
    links: Sequence[str],
    given: str | None,
    usual: Sequence[str],
    left: Sequence[str],
) -> str:
    """Say which link is an end of the chain.

    Raises:
        ArmError: The given one is not there, or none offers itself.
    """
    if given is not None:
        if given not in links:
            known = ", ".join(links[:30])
            raise ArmError(path, f"has no link {given}", f"Links: {known}")
        return given
    found = [name for name in usual if name in links] or list(left)
    if len(found) == 0 or (found[0] not in usual and len(found) > 1):
        option = "--tip" if "tool0" in usual else "--base"
        several = ", ".join(found[:30]) or "none"
        problem = f"does not say which link is the end of the chain ({several})"
        raise ArmError(path, problem, f"Name it with {option}")
    return found[0]


def _last(links: Sequence[str], joints: Mapping[str, UrdfJoint]) -> list[str]:
    """List the links that carry none."""
    carrying = {joint.parent for joint in joints.values()}
    return [name for name in links if name not in carrying]


def _way(path: Path, joints: Mapping[str, UrdfJoint], link: str) -> list[UrdfJoint]:
    """List the joints from a link up to the root.

    Raises:
        ArmError: It comes back to where it was.
    """
    way: list[UrdfJoint] = []
    while (joint := joints.get(link)) is not None:
        if len(way) > len(joints):
            problem = f"joint {joint.name} closes a ring"
            raise ArmError(path, problem, "Give a tree of links", line=joint.line)
        way.append(joint)
        link = joint.parent
    return way


def _check_joints(chain: UrdfChain) -> None:
    """Refuse a chain that is not one of six revolute joints with limits."""
    _refuse_joints(chain, _other_kind)
    if len(chain.moving) != 6:
        names = ", ".join(joint.name for joint in chain.moving) or "none"
        problem = (
            f"has {len(chain.moving)} revolute joints between {chain.base} and "
            f"{chain.tip}, not 6 ({names})"
        )
        raise ArmError(chain.path, problem, "Name the ends with --base and --tip")
    _refuse_joints(chain, _complaints)


def _refuse_joints(
    chain: UrdfChain, complaints: Callable[[UrdfJoint], Iterator[tuple[str, str]]]
) -> None:
    """Refuse a chain for the first complaint about one of its joints."""
    for joint in chain.joints:
        for problem, cure in complaints(joint):
            problem = f"joint {joint.name} {problem}"
            raise ArmError(chain.path, problem, cure, line=joint.line)


def _other_kind(joint: UrdfJoint) -> Iterator[tuple[str, str]]:
    """Say that a joint neither turns nor stands still, with the cure."""
    if joint.kind not in (*MOVING, "fixed"):
        yield f"is {joint.kind or 'of no type'}", "Give an arm of revolute joints"


def _complaints(joint: UrdfJoint) -> Iterator[tuple[str, str]]:
    """Say what keeps a joint from being one of an arm file, with the cure."""
    if joint.kind not in MOVING:
        return
    if joint.mimics:
        cure = "Write the chain as six joints of their own"
        yield f"follows {joint.mimics}", cure
    if not joint.lower < joint.upper:
        cure = "Give it one: <limit lower upper velocity>"
        yield "has no range", cure
    if not joint.velocity > 0.0:
        yield "has no velocity", "Give it one: <limit velocity>"
