"""Draw what every effect does, from the effects themselves, into docs/pictures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from numpy.typing import NDArray

from postproc.model.effects.backlash import Backlash
from postproc.model.effects.backlash_profile import BacklashProfile
from postproc.model.effects.compliance import Compliance
from postproc.model.effects.counterbalance import Counterbalance
from postproc.model.effects.coupling import Coupling
from postproc.model.effects.effect import Effect, JointEffect
from postproc.model.effects.geometry import Geometry
from postproc.model.effects.joint_map import JointMap
from postproc.model.effects.lag import Lag
from postproc.model.effects.load_backlash import LoadBacklash
from postproc.model.effects.scale import Scale
from postproc.model.effects.thermal import Thermal
from postproc.model.effects.tool_shift import ToolShift
from postproc.model.effects.transmission import Transmission
from postproc.model.effects.windup import Windup
from postproc.model.kinematics import ArmStates
from postproc.robot.arm import Arm, load_arm
from postproc.robot.state import States, make_states

Array = NDArray[np.float64]

PICTURES = Path(__file__).parents[1] / "pictures"
ARM: Arm = load_arm("nj220-2.7")
HOME = np.deg2rad([0.0, 0.0, -90.0, 0.0, 60.0, 0.0])
TOOL = np.array([0.0, 0.0, 0.25])  # [m]
BLUE, RED, GREY = "#0072b2", "#d55e00", "#767676"
MM, MRAD = 1e-3, 1e-3
Curve = tuple[str, Array, Array]  # label, abscissa, ordinate


def states(n: int, q: Array | None = None, **covariates: Array | float) -> States:
    """Make n states, at home unless they are elsewhere."""
    angles = np.tile(HOME, (n, 1)) if q is None else q
    return make_states(angles, tool=TOOL, **covariates)


def swept(joint: int, low: float, high: float, n: int = 181) -> tuple[Array, Array]:
    """Turn one joint (1 to 6) from low to high [deg]: its angles, and all joints'."""
    angle = np.linspace(low, high, n)
    q = np.tile(HOME, (n, 1))
    q[:, joint - 1] = np.deg2rad(angle)
    return angle, q


def turned(effect: JointEffect, at: States, joint: int, **p: float) -> Array:
    """Return the error of a joint [mrad] for parameters by name."""
    return effect.angles(ArmStates(ARM, at), vector(effect, p))[:, joint - 1] / MRAD


def moved(effect: Effect, at: States, **p: float) -> Array:
    """Return how far the TCP is moved [mm] for parameters by name."""
    return effect.displacement(ArmStates(ARM, at), vector(effect, p)) / MM


def vector(effect: Effect, given: dict[str, float]) -> Array:
    """Put parameters by name into their order; the others are 0."""
    names = [p.name for p in effect.parameters()]
    missing = set(given) - set(names)
    if missing:
        raise KeyError(f"{effect.name} has no {missing}: {names}")
    return np.array([given.get(name, 0.0) for name in names])


def size(error: Array) -> Array:
    """Return lengths of errors, (n,)."""
    return np.asarray(np.linalg.norm(error, axis=1))


def draw(name: str, x: str, y: str, curves: Sequence[Curve]) -> None:
    """Draw curves; colours, dashes and labels tell them apart."""
    figure = Figure(figsize=(5.6, 2.5), layout="constrained")
    axes = figure.subplots()
    styles = ((BLUE, "-"), (RED, "--"), (GREY, ":"), ("black", "-."))
    for (label, a, b), (colour, dash) in zip(curves, styles, strict=False):
        axes.plot(a, b, dash, color=colour, label=label or None)
    axes.axhline(0.0, color="#bbbbbb", linewidth=0.8, zorder=0)
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    if any(label for label, *_ in curves):
        axes.legend(frameon=False, fontsize=8)
    with rc_context({"svg.hashsalt": name, "svg.fonttype": "none"}):
        figure.savefig(PICTURES / f"{name}.svg", metadata={"Date": None})


def geometry() -> None:
    """One length and two angles that are wrong, over the reach of the arm."""
    effect = Geometry.propose(ARM, states(1))
    angle, q = swept(3, -180, 0)
    cases = (("a2 0.5 mm too long", {"a2": 0.5 * MM}),
             ("theta2 off by 0.3 mrad", {"theta2": 0.3 * MRAD}),
             ("alpha3 off by 0.3 mrad", {"alpha3": 0.3 * MRAD}))  # fmt: skip
    curves = [(told, angle, size(moved(effect, states(len(q), q=q), **p)))
              for told, p in cases]  # fmt: skip
    draw("geometry", "joint 3 [deg]", "error of the TCP [mm]", curves)


def backlash() -> None:
    """The same angles, reached from both sides."""
    angle, q = swept(1, -40, 40)
    wide = (9.0,) * 6
    profile = BacklashProfile((1,), (2,), True, tuple(-w for w in wide), wide)
    curves, shaped = [], []
    for told, side in (("coming up (λ = +1)", 1.0), ("coming down (λ = −1)", -1.0)):
        at = states(len(q), q=q, direction=np.full((len(q), 6), side))
        curves.append((told, angle, turned(Backlash(), at, 1, b1=0.1 * MRAD)))
        b = {"b1_0": 0.1, "b1_sin2": 0.03, "b1_cos2": 0.02}
        wave = turned(profile, at, 1, **{k: v * MRAD for k, v in b.items()})
        shaped.append((told, angle, wave))
    draw("backlash", "joint 1 [deg]", "error of joint 1 [mrad]", curves)
    draw("backlash_profile", "joint 1 [deg]", "error of joint 1 [mrad]", shaped)


def load_backlash() -> None:
    """Three ways in which a load acts on the gap, as joint 2 swings through."""
    angle, q = swept(2, -60, 80)
    at = states(len(q), q=q, direction=np.full((len(q), 6), -1.0))
    curves = []
    for form in ("load", "signed", "gravity_side"):
        effect = LoadBacklash(joints=(2,), form=form, t0=1500.0)
        size_of = {f"b2_{form}": 0.1 * MRAD}
        curves.append((form, angle, turned(effect, at, 2, **size_of)))
    draw("load_backlash", "joint 2 [deg], λ = −1", "error of joint 2 [mrad]", curves)


def waves() -> None:
    """Transmission, scale, coupling and a worn spot, each over a joint's angle."""
    angle, q = swept(3, -180, 0)
    at = states(len(q), q=q)
    wave = Transmission(waves=((3, 2.0), (3, 7.0)))
    curves = [("order 2", angle, turned(wave, at, 3, sin3_2=0.1 * MRAD)),
              ("order 7", angle, turned(wave, at, 3, cos3_7=0.05 * MRAD))]  # fmt: skip
    draw("transmission", "joint 3 [deg]", "error of joint 3 [mrad]", curves)
    worn = JointMap(bumps=((3, np.deg2rad(-70.0)),), width=np.deg2rad(8.0))
    height = {p.name: 0.15 * MRAD for p in worn.parameters()}
    spot = turned(worn, at, 3, **height)
    draw("joint_map", "joint 3 [deg]", "error of joint 3 [mrad]", [("", angle, spot)])
    angle, q = swept(5, -100, 100)
    at = states(len(q), q=q)
    gain = turned(Scale(joints=(5,)), at, 5, gain5=1e-4)
    pulled = turned(Coupling(pairs=((6, 5),)), at, 6, c6_5=2e-4)
    curves = [
        ("scale: joint 5, gain 1e-4", angle, gain),
        ("coupling: joint 6 dragged by joint 5, c = 2e-4", angle, pulled),
    ]
    draw("scale_coupling", "joint 5 [deg]", "joint error [mrad]", curves)  # fmt: skip


def loads() -> None:
    """What weight and the balancing spring do to joint 2."""
    angle, q = swept(2, -60, 80)
    curves = []
    for mass in (0.0, 200.0):
        at = states(len(q), q=q, payload=mass)
        effect = Compliance(joints=(2,), moments=((),), payload=False)
        soft = turned(effect, at, 2, k2=1e-7)
        curves.append((f"compliance, payload {mass:g} kg", angle, soft))
    spring = Counterbalance()
    pulled = turned(spring, states(len(q), q=q), 2, c2=0.2 * MRAD)
    curves.append(("counterbalance spring", angle, pulled))
    draw("compliance", "joint 2 [deg]", "error of joint 2 [mrad]", curves)


def motion() -> None:
    """Wind-up over the way since a reversal, lag over speed."""
    way = np.linspace(0.0, 15.0, 151)
    travel = np.deg2rad(np.tile(way[:, None], 6))
    curves = []
    for told, side in (("λ = +1", 1.0), ("λ = −1", -1.0)):
        at = states(len(way), travel=travel, direction=np.full((len(way), 6), side))
        curves.append((told, way, turned(Windup(joints=(1,)), at, 1, w1=0.05 * MRAD)))
    draw("windup", "way of joint 1 since it turned [deg]",
         "error of joint 1 [mrad]", curves)  # fmt: skip
    speed = np.linspace(0.0, 0.5, 51)
    curves = []
    for told, side in (("λ = +1", 1.0), ("λ = −1", -1.0)):
        at = states(len(speed), speed=speed, direction=np.full((len(speed), 6), side))
        curves.append((told, speed, turned(Lag(joints=(1,)), at, 1, k1=0.3 * MRAD)))
    draw("lag", "speed of the TCP on arrival [m/s]", "error of joint 1 [mrad]", curves)


def slowly() -> None:
    """Growth with the temperature and in time, and a tool that slips."""
    hours = np.linspace(0.0, 4.0, 101)
    warm = Thermal(lengths=("a2", "d4"), form="time", time_constant=3600.0)
    grown = size(moved(warm, states(len(hours), time=3600 * hours), growth=3e-4))
    draw("thermal", "time since the arm was cold [h]", "error of the TCP [mm]",
         [("warm-up: nothing is left when warm", hours, grown)])  # fmt: skip
    order = np.arange(200.0)
    slip = ToolShift(row=120)
    x = size(moved(slip, states(len(order), order=order), x_row120=0.3 * MM))
    draw("tool_shift", "visit order", "error of the TCP [mm]",
         [("a step at row 120, told backwards", order, x)])  # fmt: skip


def real_arms() -> None:
    """Mean errors of tested rows, from the first table of the study of real arms."""
    text = (PICTURES.parent / "studies" / "real-arms.md").read_text("utf-8")
    table = text.split("\n## In short")[1].split("\n\n")[1].splitlines()
    rows = [[c.strip() for c in line.strip("|").split("|")] for line in table]
    values = {row[0]: [float(cell) for cell in row[1:]] for row in rows[2:]}
    figure = Figure(figsize=(7.0, 4.6), layout="constrained")
    axes = figure.subplots()
    shown = (("registered only", GREY, "s"), ("geometry alone", "black", "^"),
             ("kriging", RED, "D"), ("fit", BLUE, "o"))  # fmt: skip
    for name, colour, mark in shown:
        column = rows[0].index(name) - 1
        x = [row[column] for row in values.values()]
        axes.plot(x, range(len(x)), mark, color=colour, label=name, markersize=5)
    axes.set_xscale("log")
    axes.set_yticks(range(len(values)), list(values), fontsize=8)
    axes.invert_yaxis()
    ticks = [0.05, 0.1, 0.2, 0.5, 1.0]
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.minorticks_off()
    axes.grid(axis="x", color="#dddddd", linewidth=0.6)
    axes.set_xlabel("mean error of the tested rows [mm]")
    axes.legend(frameon=False, fontsize=8, ncols=4, loc="lower center",
                bbox_to_anchor=(0.4, 1.0))  # fmt: skip
    with rc_context({"svg.hashsalt": "real_arms", "svg.fonttype": "none"}):
        figure.savefig(PICTURES / "real_arms.svg", metadata={"Date": None})


PARTS: tuple[Callable[[], None], ...] = (
    geometry, backlash, load_backlash, waves, loads, motion, slowly, real_arms,
)  # fmt: skip


def main() -> None:
    """Draw all pictures."""
    PICTURES.mkdir(exist_ok=True)
    for part in PARTS:
        part()


if __name__ == "__main__":
    main()
