"""The native core: what is done to every row of a long program, in Rust.

Every function takes C-contiguous arrays and refuses others (ValueError), lets other
threads run and hears signals while it works. `native/src` has one file for each group,
which says what the arguments are; the callers say it with shapes and units too.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Protocol, overload

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Bools, Bytes, Cells, Floats, Indices, Ints

SOURCES: str
"""Hash of the sources that it was built from."""
STRAIGHT: float
"""At axis 5, below this the two branches of the wrist are one [rad]."""
TOGETHER: int
"""Numbers whose places are told from that of the first of them."""

Narrow = NDArray[np.unsignedinteger[Any]]
SpanColumns = tuple[Indices, Narrow, Narrow]

class _Clamps(Protocol):
    @property
    def lo(self) -> Floats: ...
    @property
    def hi(self) -> Floats: ...

class _Reversals(Protocol):
    @property
    def side(self) -> Floats: ...
    @property
    def angle(self) -> Floats: ...
    @property
    def z(self) -> Floats: ...

class _Edges(Protocol):
    @property
    def path(self) -> Floats: ...
    @property
    def start(self) -> Ints: ...
    @property
    def source(self) -> Ints: ...

class _Zones(Protocol):
    @property
    def visit(self) -> Ints: ...
    @property
    def into(self) -> Ints: ...
    @property
    def out(self) -> Ints: ...
    @property
    def before(self) -> Floats: ...
    @property
    def behind(self) -> Floats: ...

class _Corners(Protocol):
    @property
    def zones(self) -> _Zones: ...
    @property
    def nearest(self) -> Floats: ...
    @property
    def q(self) -> Floats: ...
    @property
    def bend(self) -> Floats: ...

class _Moves(Protocol):
    @property
    def move(self) -> Ints: ...
    @property
    def fly(self) -> Bools: ...
    @property
    def via(self) -> Bools: ...
    @property
    def rounding(self) -> Ints: ...
    @property
    def fly_distance(self) -> Floats: ...
    @property
    def overlap(self) -> Floats: ...
    @property
    def linear_speed(self) -> Floats: ...
    @property
    def tool(self) -> Floats: ...
    @property
    def pred_start(self) -> Ints: ...
    @property
    def pred(self) -> Ints: ...

class _Chains(Protocol):
    @property
    def angles(self) -> Floats: ...
    @property
    def first(self) -> Ints: ...
    @property
    def source(self) -> Ints: ...
    @property
    def heads(self) -> Ints: ...
    @property
    def ends(self) -> Ints: ...
    @property
    def chain_of(self) -> Ints: ...

# chain.rs: the Denavit-Hartenberg chain (`postproc.robot.arm`)
def flange(parameters: Floats, q: Floats) -> Floats: ...
def frames(parameters: Floats, q: Floats) -> Floats: ...
def landmarks(parameters: Floats, q: Floats, point: Floats) -> Floats: ...
def jacobian(parameters: Floats, q: Floats, point: Floats) -> Floats: ...
def placed(parameters: Floats, q: Floats, point: Floats) -> Floats: ...
def torque(
    parameters: Floats, q: Floats, links: Floats, load: Floats
) -> tuple[Floats, Floats]: ...

# deviation.rs: how far the arm is led from where it was (`postproc.motion.deviation`)
def departure(
    parameters: Floats,
    solver: Solver,
    angles: tuple[Floats, Floats],
    point: Floats,
    offset: Floats,
) -> tuple[Floats, Floats, Bools]: ...
def departure_along(
    parameters: Floats,
    solver: Solver,
    ways: tuple[tuple[_Edges, Floats], tuple[_Edges, Floats]],
    first: Ints,
    parts: Ints,
    branched: Bools,
    point: Floats,
    offset: Floats,
) -> tuple[Floats, Floats, Bools]: ...

# shares.rs: what shares of ways stay within (`compensation.paths.plan_outcomes`)
def stays_within(
    share: float, values: Floats, weight: Floats, first: Ints, ways: Ints
) -> Floats: ...

# inverse.rs: the closed-form inverse kinematics (`postproc.robot.inverse`)
def branch(parameters: Floats, flange: Floats, slot: Ints) -> Floats: ...
def branches(parameters: Floats, flange: Floats) -> Floats: ...

# stretches.rs: paths followed on one branch (`postproc.motion.joint_path`)
class _Stretches(Protocol):
    @property
    def targets(self) -> Floats: ...
    @property
    def between(self) -> Floats: ...
    @property
    def place(self) -> Ints: ...
    @property
    def start(self) -> Ints: ...
    @property
    def edge(self) -> Ints: ...
    @property
    def count(self) -> Ints: ...
    @property
    def near(self) -> Floats: ...
    @property
    def slot(self) -> Ints: ...

def along_stretches(
    solver: Solver,
    stretches: _Stretches,
    limits: tuple[Floats, Floats],
    steps: tuple[float, float],
) -> tuple[Floats, Ints]: ...

# turns.rs: angles on whole turns (`postproc.motion.branches`, `postproc.robot.inverse`)
def into_range(q: Floats, lower: Floats, upper: Floats) -> Floats: ...
def on_turns(q: Floats, turns: Floats) -> Floats: ...
def on_other_turns(q: Floats, turns: Floats) -> Bools: ...

# numeric.rs: the inverse kinematics of any chain (`postproc.robot.inverse`)
def numeric_branches(parameters: Floats, flange: Floats) -> Floats: ...

# pose.rs: rigid transforms (`postproc.robot.pose`)
def inverse(given: Floats) -> Floats: ...
def pose_from_record(record: Floats) -> Floats: ...
def rotation_from_vector(vectors: Floats) -> Floats: ...
def rotation_vector(given: Floats) -> Floats: ...
def times(left: Floats, right: Floats) -> Floats: ...

# play.rs, walks.rs: the play operator (`postproc.robot.backlash_operator`)
def reversals(
    values: Floats, at: Ints, before: _Reversals, half: Floats
) -> tuple[Floats, Floats, Floats]: ...
def sides_along(
    angles: Floats, half: Floats, begins: Bools, state: _Clamps
) -> tuple[Floats, Floats]: ...
def clamps(values: Floats, start: Ints, half: Floats) -> tuple[Floats, Floats]: ...
def refined(
    angles: Floats, source: Ints, values: Floats, start: Ints, uneven: Ints
) -> tuple[Floats, Ints]: ...

# direction.rs: from which side joints arrive (`postproc.robot.direction`)
def states(
    chains: _Chains, own: _Clamps, half: Floats, before: _Clamps
) -> tuple[Floats, Floats]: ...
def side(angles: Floats, z: _Clamps, half: Floats) -> Floats: ...

# lines.rs, segments.rs, pull.rs: paths, how corners pull (`postproc.motion.path`)
def lines(
    flange: Floats, tool: Floats, begin: Ints, end: Ints
) -> tuple[Floats, Floats, Floats, Floats]: ...
def poses_along(
    segments: Floats, path: Ints, share: Floats, tools: Floats, tool: Ints
) -> Floats: ...
def to_move(
    wanted: Floats,
    corners: tuple[Ints, Ints, Ints],
    shares: tuple[Floats, Floats],
    along: Floats,
    rounds: int,
) -> Floats: ...

# aims.rs: which sides to correct for (`postproc.compensation.solver.aims`)
def next_aims(
    core: Core,
    solver: Solver,
    commands: Floats,
    tool: Floats,
    states: _States,
    ways: _Ways,
    coupling: Floats,
    free: Bools,
    off: Bools,
    passes: Bools,
    missed: Floats,
    lead: Floats,
    watched: tuple[int, int],
) -> tuple[Floats, Floats, Floats, Floats]: ...

# commands.rs: what to command (`postproc.compensation.solver.inverse_model`)
def commands(
    core: Core,
    solver: Solver,
    wanted: Floats,
    tool: Floats,
    states: _States,
    turns: bool,
) -> tuple[Floats, Floats, Floats]: ...

# corner.rs, rounding.rs, zones.rs: rounded fly points (`postproc.motion.blending`)
def passed(
    parameters: Floats,
    edges: _Edges,
    q: Floats,
    zones: _Zones,
    tool: Floats,
    point: Floats,
    within: Floats,
) -> tuple[Floats, Floats, Floats, Floats, Floats, Floats, Floats]: ...
def rounded(
    edges: _Edges,
    share: Floats,
    q: Floats,
    corners: _Corners,
    coupling: Floats | None,
    most: int,
) -> tuple[Floats, Floats, Ints, Ints]: ...
def zones(
    targets: _Moves,
    source: Ints,
    q: Floats,
    flange: Floats,
    length: Floats,
    limits: tuple[Floats, Floats],
) -> tuple[Ints, Ints, Ints, Floats, Floats]: ...

# spline.rs: splines through the waypoints of runs (`postproc.motion.topp`)
def splines(s: Floats, q: Floats, begins: Bools) -> tuple[Floats, Floats]: ...

# time_law.rs: the fastest ds/dt along paths (`postproc.motion.topp`)
def fastest(
    paths: tuple[Floats, Floats],
    step: Floats,
    bound: Floats,
    begins: Bools,
    acceleration: Floats,
) -> Floats: ...

# terms.rs: laws of effects (`postproc.model.terms`)
def turned(terms: Sequence[Any], q: Floats, side: Floats) -> Floats: ...

# design.rs: sums over the rows of a fit (`postproc.calibration.design_matrix`)
def gram(
    moving: tuple[Floats, Floats],
    turning: tuple[Floats, Sequence[int]],
    splines: tuple[Ints, Floats, Sequence[int], int],
) -> tuple[Floats, Floats]: ...
def uncertainty(
    moving: tuple[Floats, Floats],
    turning: tuple[Floats, Sequence[int]],
    splines: tuple[Ints, Floats, Sequence[int], int],
    form: tuple[Floats, Floats],
) -> Floats: ...

# evidence.rs: normal equations (`postproc.calibration.evidence`)
def scaled(gram: Floats, scale: Floats, out: Floats) -> None: ...
def by_groups(lower: Floats, z: Floats, group: Ints, count: int) -> Floats: ...
def of_blocks(gain: Floats, share: Floats, signals: Floats, rows: float) -> Floats: ...

# names.rs: names by the million (`postproc.language.symbol_column`)
class _Ways(Protocol):
    @property
    def angles(self) -> Floats: ...
    @property
    def first(self) -> Ints: ...
    @property
    def source(self) -> Ints: ...
    @property
    def clamps(self) -> _Clamps: ...
    @property
    def play(self) -> _Clamps: ...
    @property
    def half(self) -> Floats: ...
    @property
    def side(self) -> Floats: ...

class _States(Protocol):
    @property
    def q(self) -> Floats: ...
    @property
    def side(self) -> Floats: ...
    @property
    def tool(self) -> Floats: ...
    @property
    def load(self) -> Floats: ...
    @property
    def given(self) -> Floats: ...

class Core:
    def __init__(
        self,
        chains: tuple[Floats, Floats],
        base: Floats,
        tool: tuple[float, ...],
        given: int,
        terms: tuple[list[Any], list[float]],
        fields: tuple[list[Any], list[Any]],
        spread: tuple[Any, ...] | None,
        scatter: tuple[Any, ...],
    ) -> None: ...
    def errors(self, states: _States) -> Floats: ...
    def turns(self, states: _States) -> Floats: ...
    def predict(self, states: _States) -> tuple[Floats, Floats, Floats]: ...

class Solver:
    @staticmethod
    def of_chain(chain: Floats) -> Solver: ...
    @staticmethod
    def of_closed_form(closed: Floats, mixes: tuple[Floats, Floats]) -> Solver: ...
    def nearest(self, flange: Floats, near: Floats, slot: Ints) -> Floats: ...
    def slots(self, q: Floats) -> Ints: ...

class NameColumn(Sequence[str]):
    def __init__(self, names: Iterable[str] = ...) -> None: ...
    def extend(self, names: Iterable[str]) -> None: ...
    def of(self, names: Iterable[str]) -> Indices: ...
    def find(self, names: Iterable[str]) -> Indices: ...
    def number(self, name: str) -> int: ...
    def take(self, numbers: Ints) -> NameColumn: ...
    def lower(self) -> NameColumn: ...
    def hold(self, letters: str) -> bool: ...
    def settle(self) -> None: ...
    @overload
    def __getitem__(self, number: int) -> str: ...
    @overload
    def __getitem__(self, number: slice) -> Sequence[str]: ...
    def __len__(self) -> int: ...

# text.rs: lines of a file, but for numbers and names (`postproc.language.lexer`)
def line_starts(data: bytes) -> Indices: ...
def number_in_order(
    values: NDArray[np.int64], ends: tuple[NDArray[np.int64], NDArray[np.int64]] | None
) -> tuple[NDArray[np.int64], NDArray[np.int64]]: ...
def scan_logical_lines(
    data: bytes, starts: Indices
) -> tuple[
    list[bytes],
    tuple[Indices, Indices, Indices, Indices],
    tuple[SpanColumns, Floats],
    tuple[NameColumn, Indices],
    list[int],
]: ...
def scan_lines(
    data: bytes, starts: Indices
) -> tuple[
    list[bytes],
    tuple[Indices, Indices, Indices, Indices],
    tuple[SpanColumns, Floats],
    tuple[NameColumn, Indices],
    list[int],
]: ...

# statements.rs: statements as texts and numbers (`postproc.language.statement_table`)
def scan_statements(
    data: bytes,
) -> tuple[
    list[bytes],
    tuple[Indices, Indices, Indices, Indices, Indices],
    tuple[SpanColumns, Floats],
    tuple[NameColumn, Indices],
    list[int],
]: ...
def scan_krl(
    data: bytes,
) -> tuple[
    list[bytes],
    tuple[Indices, Indices, Indices, Indices, Indices],
    tuple[SpanColumns, Floats],
    tuple[NameColumn, Indices],
    list[int],
]: ...

# number.rs: numbers, read and written (`postproc.language.number_edits`)
def count_decimals(data: bytes, start: Ints, end: Ints) -> Ints: ...
def rewrite_numbers(
    data: bytes, start: Ints, end: Ints, values: Floats, least: Ints
) -> tuple[Ints, Bytes]: ...

# table.rs: rows of reports and records as text (`postproc.arrays`)
def table(n: int, columns: Sequence[Cells], given: Mapping[int, bytes]) -> bytes: ...

# rows.rs: how many cores work on rows (`postproc.threads`)
def use_cores(most: int) -> None: ...

# heap.rs: memory that is not used any more (`postproc.arrays`)
def give_back() -> None: ...

# aligned.rs: tables whose columns stand below each other (`postproc.report.terminal`)
def aligned(
    n: int,
    most: int,
    columns: Sequence[Cells],
    left: Sequence[bool],
    gap: bytes,
    widths: Sequence[int],
    given: Mapping[int, Sequence[tuple[bytes, int]]],
) -> tuple[bytes, list[int]]: ...

# compare.rs: two texts line by line (`postproc.report.diff`)
def compare_lines(
    before: bytes,
    before_first: Indices,
    after: bytes,
    after_first: Indices,
    named: bool = False,
) -> tuple[tuple[Ints, Ints, Ints, Bools, Bools], tuple[Floats, Floats]]: ...

# weave.rs: edits of texts (`postproc.language.source`)
def weave(data: bytes, start: Indices, end: Indices, new: Bytes) -> bytes: ...
def is_woven(
    data: bytes,
    start: Indices,
    end: Indices,
    new: Bytes,
    found: bytes,
    stamp: tuple[int, int],
) -> bool: ...
def cut(data: bytes, start: Indices, end: Indices) -> Bytes: ...

# words.rs: words of a text (`batch.tree`, `language.comment_directives`)
def holds(data: bytes, word: bytes) -> bool: ...
def lines_beginning(data: bytes, words: Sequence[bytes]) -> list[tuple[int, bytes]]: ...
