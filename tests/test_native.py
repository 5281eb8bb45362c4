"""The native kernels do what numpy does: on random numbers, and on whole programs."""

from __future__ import annotations

import sys
from dataclasses import fields
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from postproc import kernels
from postproc.compensation.compensate import compensate
from postproc.model.combination import Combination
from postproc.model.effects.backlash import Backlash
from postproc.model.effects.backlash_profile import BacklashProfile
from postproc.model.effects.compliance import Compliance
from postproc.model.effects.geometry import Geometry
from postproc.model.kinematics import Batch
from postproc.model.model import parameter_variance
from postproc.motion import blending
from postproc.motion import path as cartesian
from postproc.motion.path import BlendCoupling
from postproc.robot import direction, play, pose
from postproc.robot.arm import DH
from postproc.robot.inverse import ClosedForm
from postproc.robot.play import NOTHING, Clamps, Edges, chains_of, passing, prefix
from postproc.robot.pose import rotation_from_vector
from postproc.robot.state import make_states

ROOT = Path(__file__).parent.parent
PROGRAMS = ROOT / "programs"
CLOSE = {"rtol": 0, "atol": 1e-12, "equal_nan": True}

native = pytest.mark.skipif(
    kernels.native is None,
    reason="the native kernels are not there, or not wanted: native/README.md",
)


@pytest.fixture
def by_numpy(monkeypatch):
    """Call something with the kernels left alone."""

    def call(function, *args):
        with monkeypatch.context() as patch:
            for name, module in list(sys.modules.items()):
                ours = name.startswith("postproc.") and name != kernels.__name__
                if ours and getattr(module, "native", None) is not None:
                    patch.setattr(module, "native", None)
            return function(*args)

    return call


@pytest.fixture
def random():
    return np.random.default_rng(20)


@pytest.fixture
def chain(random):
    a, d, alpha, offset = random.normal(size=(4, 6))
    mix = np.eye(6) + 0.1 * random.normal(size=(6, 6))
    return DH(a, d, alpha, offset, np.array([1.0, -1, 1, 1, -1, 1]), mix)


def hash_of_sources() -> str:
    """As native/build.rs does it."""
    found = 0xCBF29CE484222325
    for path in sorted((ROOT / "native" / "src").iterdir()):
        for byte in path.read_bytes():
            found = (found ^ byte) * 0x100000001B3 % 2**64
    return f"{found:016x}"


def test_the_package_asks_for_kernels_of_its_own_sources():
    assert hash_of_sources() == kernels.SOURCES, (
        "put the first into postproc/kernels.py"
    )


@pytest.mark.parametrize(
    ("switch", "more", "used"),
    [
        ("", {"SOURCES": kernels.SOURCES}, True),
        ("", {"SOURCES": "of others"}, False),
        ("", {}, False),
        ("numpy", {"SOURCES": kernels.SOURCES}, False),
    ],
)
def test_which_kernels_are_used(monkeypatch, switch, more, used):
    monkeypatch.setenv(kernels.SWITCH, switch)
    found = SimpleNamespace(placed=lambda: 7, **more)
    monkeypatch.setitem(sys.modules, "postproc_kernels", found)
    native = kernels._native()
    assert (native is not None) == used
    assert native is None or native.placed() == 7


def test_a_panic_is_an_exception_and_an_interruption_is_none():
    class PanicException(BaseException):
        pass

    def fail(exc):
        raise exc

    with pytest.raises(RuntimeError, match="fail: out of bounds"):
        kernels._guarded(fail)(PanicException("out of bounds"))
    for exc in (KeyboardInterrupt, ValueError):
        with pytest.raises(exc):
            kernels._guarded(fail)(exc())


def test_without_kernels_numpy_works(monkeypatch):
    monkeypatch.setitem(sys.modules, "postproc_kernels", None)
    assert kernels._native() is None


@native
def test_the_chain(chain, random, by_numpy):
    q, points = random.uniform(-7, 7, (300, 6)), random.normal(size=(300, 3))
    beta = np.array([0, 0.1, 0, 0, -0.2, 0])
    q[7, 2] = np.nan
    for given in ((q, points), (q, points[0]), (q, points, beta), (q[:0], points[0])):
        assert np.allclose(
            chain.placed(*given), by_numpy(chain.placed, *given), **CLOSE
        )
    assert np.allclose(chain.flange(q), by_numpy(chain.flange, q), **CLOSE)


@native
def test_one_branch(bench_cell, random, by_numpy):
    closed = ClosedForm(bench_cell.arm.file.opw)
    reached = bench_cell.arm.flange(random.uniform(-3, 3, (400, 6)))
    reached[::7, :3, 3] *= 3.0  # out of reach
    slot = random.integers(0, 8, 400)
    assert np.isnan(closed.branch(reached, slot)).any()
    assert np.allclose(
        closed.branch(reached, slot), by_numpy(closed.branch, reached, slot), **CLOSE
    )
    all_of_them = closed.branches(reached)
    assert np.allclose(all_of_them, by_numpy(closed.branches, reached), **CLOSE)
    one = all_of_them[np.arange(len(slot)), slot]
    assert np.array_equal(one, closed.branch(reached, slot), equal_nan=True)


@native
def test_play(random, by_numpy):
    q = np.cumsum(random.normal(size=(500, 6)), axis=0)
    q[123], begins = np.nan, random.random(500) < 0.02
    begins[124] = True
    steps = Clamps(q - 0.7, q + 0.7)
    for how in (None, begins):
        found, meant = prefix(steps, how), by_numpy(prefix, steps, how)
        assert np.array_equal(found.lo, meant.lo, equal_nan=True)
        assert np.array_equal(found.hi, meant.hi, equal_nan=True)


@native
def test_walks_with_turning_values(random, by_numpy):
    count = random.integers(0, 7, 60)
    source = np.where(random.random(60) < 0.2, -1, random.integers(0, 20, 60))
    count[source >= 0] += 1  # none is empty but from an unknown place
    start = np.append(0, np.cumsum(count))
    values = np.cumsum(random.normal(size=(start[-1], 6)), axis=0)
    uneven = np.flatnonzero(random.random(len(values)) < 0.1)
    edges = Edges(np.empty(0), source, values, start, uneven)
    given = random.normal(size=(20, 6)), source, values, edges
    found, meant = play._refined(*given), by_numpy(play._refined, *given)
    assert np.array_equal(found.start, meant.start)
    assert len(found.values) > len(values)  # some joint did turn
    assert np.allclose(found.values, meant.values, **CLOSE)
    half = random.uniform(0.1, 1.0, 6)
    passed, wanted = found.clamps(half), by_numpy(found.clamps, half)
    assert np.array_equal(passed.lo, wanted.lo) and np.array_equal(passed.hi, wanted.hi)


@native
@pytest.mark.parametrize("given", [NOTHING.play, passing(np.zeros((1, 6)), np.ones(6))])
def test_states_in_a_graph(given, random, by_numpy):
    # Loops, jumps, unknown places and visits with several ways to them.
    n = 200
    count = np.where(random.random(n) < 0.2, random.integers(0, 4, n), 1)
    first = np.append(0, np.cumsum(count))
    source = np.repeat(np.arange(n), count) - 1
    odd = random.random(len(source)) < 0.15
    source[odd] = random.integers(-1, n, odd.sum())
    q = np.cumsum(random.normal(size=(n, 6)), axis=0)
    q[random.random(n) < 0.03] = np.nan
    chains, half = chains_of(q, np.eye(6), first, source), np.full(6, 0.8)
    steps = passing(chains.angles[np.repeat(np.arange(n), count)], half)
    asked = chains, steps, half, given
    found, meant = direction._states(*asked), by_numpy(direction._states, *asked)
    assert np.array_equal(found.lo, meant.lo, equal_nan=True)
    assert np.array_equal(found.hi, meant.hi, equal_nan=True)
    sides = chains.angles, found, half
    placed, wanted = direction._side(*sides), by_numpy(direction._side, *sides)
    assert np.array_equal(placed, wanted)
    assert {-1.0, 0.0, 1.0} < set(placed.flat)


@pytest.mark.parametrize("alone", [False, pytest.param(True, marks=native)])
def test_states_that_are_no_numbers_end(alone, by_numpy):
    # Two visits that lead to each other, one of them from an unknown place.
    first, source = np.array([0, 1, 3]), np.array([1, 0, -1])
    chains = chains_of(np.zeros((2, 6)), np.eye(6), first, source)
    steps = Clamps(np.full((3, 6), np.nan), np.full((3, 6), np.nan))
    asked = direction._states, chains, steps, np.ones(6), NOTHING.play
    found = asked[0](*asked[1:]) if alone else by_numpy(*asked)
    assert len(found.lo) == 2


@native
def test_places_on_edges(random, by_numpy):
    count = random.integers(1, 6, 40)
    start = np.append(0, np.cumsum(count))
    edges = SimpleNamespace(
        path=random.normal(size=(start[-1], 6)), start=start,
        source=random.integers(0, 20, 40),
    )  # fmt: skip
    traced = SimpleNamespace(edges=edges, q=random.normal(size=(20, 6)))
    edge, u = random.integers(0, 40, 500), random.uniform(0, 1, 500)
    u[:2] = 0.0, 1.0
    meant = by_numpy(blending.along, traced, edge, u)
    assert np.allclose(blending.along(traced, edge, u), meant, **CLOSE)
    u[::9] = np.nan
    found = blending.along(traced, edge, u)
    assert np.isnan(found).all(axis=1).tolist() == np.isnan(u).tolist()
    traced.q = np.asfortranarray(traced.q)
    with pytest.raises(ValueError, match="behind the other"):
        blending.along(traced, edge, u)
    traced.q = np.ascontiguousarray(traced.q)
    edges.source[:] = -1
    with pytest.raises(IndexError, match="nowhere"):
        blending.along(traced, edge, u)


@native
def test_straight_ways(bench_cell, random, by_numpy):
    flange = bench_cell.arm.flange(random.uniform(-3, 3, (300, 6)))
    flange[100:200, :3, :3] = flange[99, :3, :3]  # no turn at all
    flange[200:, :3, :3] = flange[200, :3, :3] @ rotation_from_vector(
        random.normal(size=(100, 3)) * np.logspace(-9, 0, 100)[:, None]
    )
    tool = np.repeat(bench_cell.arm.flange(np.ones((1, 6))), 300, axis=0)
    targets = SimpleNamespace(tool=tool)
    asked = targets, flange, np.arange(299), np.arange(1, 300)
    found, meant = cartesian._lines(*asked), by_numpy(cartesian._lines, *asked)
    for field in fields(found):
        one, other = (getattr(s, field.name) for s in (found, meant))
        assert np.allclose(one, other, **CLOSE), field.name
    assert np.allclose(
        blending._chords(*asked), by_numpy(blending._chords, *asked), **CLOSE
    )
    with pytest.raises(IndexError, match="not there"):
        blending._chords(targets, flange, np.array([-1]), np.array([0]))


@native
def test_poses(random, by_numpy):
    record = random.uniform(-400, 400, (200, 6))
    record[3], record[4, 4:] = np.nan, 0.0
    poses = pose.pose_from_record(record)
    assert np.allclose(poses, by_numpy(pose.pose_from_record, record), **CLOSE)
    for given in (poses, poses[::2], poses[:0]):
        assert np.allclose(pose.inverse(given), by_numpy(pose.inverse, given), **CLOSE)
        both = given, given[::-1]
        assert np.allclose(pose.times(*both), by_numpy(pose.times, *both), **CLOSE)
    with pytest.raises(ValueError, match="columns"):
        pose.times(poses, poses[:3])


@native
def test_rotation_vectors(random, by_numpy):
    vectors = random.normal(size=(300, 3))
    vectors *= np.pi / np.linalg.norm(vectors, axis=1)[:, None]
    vectors[::3] *= random.uniform(0, 1, (100, 1))
    vectors[1::3] *= 1e-5
    turned = rotation_from_vector(vectors)
    turned[7], turned[8] = np.nan, np.eye(3)
    found, meant = pose.rotation_vector(turned), by_numpy(pose.rotation_vector, turned)
    assert np.allclose(found, meant, **CLOSE)


@native
def test_corners_that_pull(random, by_numpy):
    visit = np.setdiff1d(np.arange(1, 299), random.integers(0, 299, 60))
    shares = random.uniform(0, 0.125, (2, len(visit)))
    pull = BlendCoupling(visit, visit - 1, visit + 1, *shares)
    wanted = random.normal(size=(300, 3))
    assert np.array_equal(pull.to_move(wanted), by_numpy(pull.to_move, wanted))
    with pytest.raises(ValueError, match="none"):
        pull.to_move(wanted[:250])


@native
@pytest.mark.parametrize(
    "effect",
    [
        BacklashProfile(lower=(-0.5,) * 6, upper=(0.6, 4, 0.6, 0.6, 0.6, 9)),
        BacklashProfile((2, 5), (4, 1), True, (-1.0,) * 6, (1.0,) * 6),
    ],
)
def test_backlash_along_the_gear(effect, bench_cell, random, by_numpy):
    q, sizes = random.uniform(-7, 7, (300, 6)), random.normal(size=36)
    q[5, 1], q[::2] = np.nan, q[::2] / 10.0
    batch = Batch(bench_cell.arm, make_states(q, random.uniform(-1, 1, (300, 6))))
    given = batch, sizes[: len(effect.parameters())]
    found, meant = effect.angles(*given), by_numpy(effect.angles, *given)
    assert np.allclose(found, meant, **CLOSE)


@native
@pytest.mark.parametrize("base", [True, False])
@pytest.mark.parametrize(
    "more", [(), (Backlash(), BacklashProfile(joints=(5, 2, 3)), Compliance())]
)
def test_uncertain_parameters(base, more, bench_cell, random, by_numpy):
    effects = Combination((*more[:1], Geometry((2, 6), base), *more[1:]))
    values = effects.scales * random.normal(size=len(effects.scales))
    root = effects.scales[:, None] * random.normal(size=(len(values), len(values)))
    q, direction = random.uniform(-3, 3, (43, 6)), random.uniform(-1, 1, (43, 6))
    q[5, 1] = np.nan
    states = make_states(q, direction, random.uniform(-0.3, 0.3, (43, 3)))
    at = effects.at(Batch(bench_cell.arm, states), values)
    given = effects, at, root @ root.T
    found, meant = parameter_variance(*given), by_numpy(parameter_variance, *given)
    assert np.allclose(found, meant, rtol=1e-9, atol=0, equal_nan=True)
    assert np.isnan(meant).any(axis=1).tolist() == np.isnan(q).any(axis=1).tolist()


@native
def test_corners_of_a_program(bench_cell, bench_model, by_numpy, monkeypatch):
    seen = []

    def compared(module, name, close):
        function = getattr(module, name)

        def both(*args):
            found, meant = function(*args), by_numpy(function, *args)
            seen.append(name)
            close(found, meant)
            return found

        monkeypatch.setattr(module, name, both)

    def same_corners(found, meant):
        assert np.array_equal(found.zones.visit, meant.zones.visit)
        for name in ("before", "behind"):
            pair = getattr(found.zones, name), getattr(meant.zones, name)
            assert np.allclose(*pair, **CLOSE)
        for name in ("q", "aside", "bend"):
            assert np.allclose(getattr(found, name), getattr(meant, name), atol=1e-9)

    def same(found, meant):
        for one, other in zip(found, meant, strict=True):
            assert np.allclose(one, other, **CLOSE)

    compared(blending, "_passed", same_corners)
    compared(blending, "_samples", same)
    source = (PROGRAMS / "milling.pdl").read_bytes()
    compensate(source, bench_cell, bench_model)
    assert {"_passed", "_samples"} <= set(seen)


@native
@pytest.mark.parametrize("name", ["milling", "drilling", "spot", "handling"])
def test_the_same_bytes(name, bench_cell, bench_model, by_numpy):
    path = PROGRAMS / f"{name}.pdl"
    values = path.with_suffix(".lsv")
    more = {"variables": values.read_bytes()} if values.exists() else {}

    def run():
        return compensate(path.read_bytes(), bench_cell, bench_model, **more)

    found, meant = run(), by_numpy(run)
    assert found.outputs == meant.outputs
