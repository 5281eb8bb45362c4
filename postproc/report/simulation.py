"""Run a program or a survey on the virtual arm, and measure it."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from postproc.arrays import Ints
from postproc.compensation.paths.write_points import points_on_ways
from postproc.compensation.program import read_program
from postproc.compensation.program_files import read_files
from postproc.files import schema
from postproc.language.languages import language_of
from postproc.language.visits import Visits
from postproc.model.statistics import ErrorStatistics
from postproc.report.json import finite
from postproc.robot.arm_file import ArmFile
from postproc.robot.cell import Cell, as_cell
from postproc.robot.pose import MM
from postproc.simulation import (
    DEFAULT,
    NJ220,
    Campaign,
    Chain,
    GearKind,
    Landing,
    Planted,
    VirtualCell,
    campaign_length,
    gravity_of,
    land_runs,
    measure_rows,
    measure_run,
    parse_effects,
    read_rows,
    run_program,
    virtual_arm,
    write_measurements,
)
from postproc.simulation.path import PathScores, score_paths
from postproc.simulation.track import VirtualTrack, record_track


@dataclass(frozen=True)
class Simulation:
    """What the virtual arm did.

    Attributes:
        name: The program or survey.
        campaign: What the tracker read.
        true_error: Where the tool landed against the wanted program, or None.
        paths: How far the tool was from the paths of the wanted program, or None.
        lines: Line of every visit of that program.
        track: Readings of a tracker that followed the tool, or None.
        left_out: Fly points that the run does not go on from, which count nowhere.
    """

    name: str
    campaign: Campaign
    true_error: ErrorStatistics | None
    paths: PathScores | None = None
    lines: tuple[int, ...] = ()
    track: VirtualTrack | None = None
    left_out: int = 0

    def write(self, path: Path) -> None:
        """Write the readings as a measurement file.

        Raises:
            OutputError: The place cannot be written to.
        """
        write_measurements(self.campaign, path)

    def to_json(self) -> str:
        """Return the true error as JSON text."""
        error = None if self.true_error is None else asdict(self.true_error)
        told: dict[str, object] = {
            **schema("simulation"),
            "program": self.name,
            "true_error": error,
        }
        told |= {"left_out": self.left_out} if self.left_out else {}
        if self.paths is not None:
            told |= {
                "path_accuracy": asdict(self.path_accuracy),
                "path_all_along": asdict(self.all_along),
                "path": self._moves(),
            }
        return json.dumps(finite(told)) + "\n"

    @property
    def all_along(self) -> ErrorStatistics:
        """Distance from the path at all places on the way, a millimetre apart."""
        sizes = np.empty(0) if self.paths is None else self.paths.across
        return ErrorStatistics.of_sizes(sizes)

    @property
    def path_accuracy(self) -> ErrorStatistics:
        """Return the statistics of AT_p over the moves."""
        sizes = np.empty(0) if self.paths is None else self.paths.largest
        return ErrorStatistics.of_sizes(sizes)

    def _moves(self) -> list[dict[str, object]]:
        """Describe how far the tool was from the path of each move."""
        paths = self.paths
        if paths is None:
            return []
        moves: list[dict[str, object]] = []
        for k, visit in enumerate(paths.visit.tolist()):
            own = slice(*paths.first[k : k + 2].tolist())
            largest = own.start + int(paths.across[own].argmax())
            moves.append(
                {
                    "line": self.lines[visit],
                    "visit": visit,
                    "max_mm": round(float(paths.across[largest]) / MM, 5),
                    "at_mm": round(float(paths.way[largest]) / MM, 3),
                    "p95_mm": round(
                        float(np.percentile(paths.across[own], 95)) / MM, 5
                    ),
                    "along_mm": round(float(np.abs(paths.along[own]).max()) / MM, 5),
                }
            )
        return moves

    def summary(self) -> str:
        """Say in one line what was measured or missed."""
        if self.true_error is None:
            followed = (
                "" if self.track is None else f", {len(self.track.time)} on the way"
            )
            return f"{self.name}: {len(self.campaign)} measurements{followed}"
        e = self.true_error
        if e.n == 0:
            return f"{self.name}: no target of it is known, so no error either"
        said = (
            f"{self.name}: true error mean {e.mean_mm:.4f} mm, std {e.std_mm:.4f}, "
            f"95 % {e.p95_mm:.4f}, max {e.max_mm:.4f} over {e.n} visits"
        )
        if self.left_out:
            why = "fly points without a score: no move continues from them"
            said += f" ({self.left_out} {why})"
        if self.paths is None:
            return said
        if not len(self.paths.visit):
            return f"{said}; no LINEAR or CIRCULAR move: no path to score"
        p = self.path_accuracy
        return (
            f"{said}; path accuracy AT_p (systematic part) mean {p.mean_mm:.4f} mm, "
            f"95 % {p.p95_mm:.4f}, max {p.max_mm:.4f} over {p.n} moves"
        )


def setup_of(cell: Cell) -> VirtualCell:
    """Tell the virtual arm about its cell in plain values."""
    probes = np.tile(np.eye(4), (len(cell.probes), 1, 1))
    probes[:, :3, 3] = cell.probes
    usual = VirtualCell()
    warm = cell.temperature
    return VirtualCell(
        chain=chain_of(cell.arm.file),
        coupling=cell.arm.coupling,
        tool=cell.tool.pose,
        base=cell.base.pose,
        uframe=cell.uframe.pose,
        tools=probes,
        home=cell.home,
        calibration=cell.calibration,
        payload=float(np.nan_to_num(cell.payload_mass)),
        payload_com=cell.payload_com,
        temperature=warm if np.isfinite(warm) else usual.temperature,
        tracker=usual.tracker if cell.tracker is None else cell.tracker,
        gravity=gravity_of(cell.file.robot.mounting, cell.base.pose),
    )


def chain_of(file: ArmFile) -> Chain:
    """Take the numbers of an arm file into the virtual arm's own chain.

    An arm whose masses or speeds are not known has those of the usual virtual arm.
    """
    dh, joints, links = file.dh, file.joints, file.links
    speed = joints.velocity_deg_s
    return Chain(
        a=np.array(dh.a_mm) * MM,
        d=np.array(dh.d_mm) * MM,
        alpha=np.deg2rad(dh.alpha_deg),
        offset=np.deg2rad(dh.offset_deg),
        sense=np.array(dh.sense, dtype=float),
        shift=np.deg2rad(dh.shift_deg),
        beta=np.zeros(6),
        mass=NJ220.mass if links is None else np.array(links.mass_kg),
        centre=NJ220.centre if links is None else np.array(links.com_mm) * MM,
        speed=NJ220.speed if speed is None else np.deg2rad(speed),
        lower=np.deg2rad(joints.lower_deg),
        upper=np.deg2rad(joints.upper_deg),
        parallelogram=dh.axis3_adds_axis2,
    )


def simulate_file(
    program: Path,
    cell: Cell | Path,
    seed: int = 1,
    effects: str | None = None,
    reference: Path | None = None,
    path: bool = False,
    rate: float = 0.0,
    gears: str = GearKind.SHARP.value,
) -> Simulation:
    """Run a program or a survey on the virtual arm.

    Args:
        program: A program (.pdl) or joint targets (.csv).
        cell: The cell, or its file.
        seed: Which virtual arm.
        effects: Effects beyond geometry, tool and backlash, comma separated.
        reference: The program that says where the tool should have landed.
        path: Score the paths between the targets as well.
        rate: Follow the tool with so many readings in a second [Hz]; 0: do not.
        gears: What the arm's gears do in their gaps.

    Raises:
        PostprocError: A file cannot be used, or an effect is not known.
    """
    cell = as_cell(cell)
    setup = setup_of(cell)
    names: list[str | Planted] = [*DEFAULT, *parse_effects(effects or "")]
    if program.suffix.lower() == ".csv":
        rows = read_rows(program)
        arm = virtual_arm(
            seed, names, chain=setup.chain, coupling=setup.coupling,
            rows=len(rows.ids), tool=setup.tool,
            gears=gears, tracker=setup.tracker, gravity=setup.gravity,
        )  # fmt: skip
        return Simulation(program.name, measure_rows(arm, setup, rows), None)
    visits, own, skipped = _read(program, cell)
    arm = virtual_arm(
        seed,
        names,
        chain=setup.chain,
        coupling=setup.coupling,
        rows=campaign_length(visits),
        tool=setup.tool,
        gears=gears,
        tracker=setup.tracker,
        gravity=setup.gravity,
    )
    run = run_program(arm, setup, visits)
    campaign = measure_run(arm, setup, run, visits)
    track = record_track(arm, setup, run, rate) if rate else None
    if reference is None and not path:
        return Simulation(program.name, campaign, None, track=track)
    original, asked = visits, run
    if reference is not None and reference.resolve() != program.resolve():
        original = visits_of(reference, cell)
        asked = run_program(arm, setup, original)
    landing = land_runs(arm, asked, run, own)
    error, left = true_error(landing, original), landing.left_out
    if not path:
        return Simulation(program.name, campaign, error, track=track, left_out=left)
    scores = score_paths(arm, setup, asked, run, own, skipped)
    lines = tuple(original.place.line.tolist())
    return Simulation(program.name, campaign, error, scores, lines, track, left)


def visits_of(program: Path, cell: Cell) -> Visits:
    """Read a program, with its pages and the variable file beside it."""
    return read_program(read_files(program), cell).visits


def _read(program: Path, cell: Cell) -> tuple[Visits, Ints, Ints]:
    """Read a program, and tell which of its visits no points on ways are.

    Told as well: which of those, counted alone, are approached anew, so that the way
    to them is no longer that of the original.
    """
    reading = read_program(read_files(program), cell)
    visits = reading.visits
    inserted, stops = np.zeros((2, len(visits)), dtype=bool)
    for file, source in enumerate(reading.sources):
        language, rows = (
            language_of(source.name),
            np.flatnonzero(visits.place.file == file),
        )
        for row in rows.tolist():
            line = source.line_text(int(visits.place.line[row])).encode("latin-1")
            inserted[row] = language.is_inserted(line)
            stops[row] = language.is_approach(line)
    new = points_on_ways(visits, reading.sources, inserted)
    own = np.flatnonzero(~new)
    return visits, own, np.searchsorted(own, np.flatnonzero(stops))


def true_error(landing: Landing, original: Visits) -> ErrorStatistics:
    """Compare where the tool landed with where the original program says."""
    targets = original.target.literal[landing.visit] >= 0
    return ErrorStatistics.of(landing.error[targets])
