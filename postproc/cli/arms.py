"""Commands on arm files: list the shipped ones, write one of what others hold."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from postproc.cli.common import app, as_path, report_errors, say, write_text
from postproc.files import check_places

if TYPE_CHECKING:
    from postproc.robot.arm import Arm
    from postproc.robot.urdf import UrdfChain

MADE = "new"  # of --verify: the arm that is made of the URDF
ASSUMED_MM = 0.1  # repeatability, which no source of arm files states

arm = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode=None,
    help="List the shipped arms, or write an arm file.",
)
app.add_typer(arm, name="arm")


@arm.command("list")
def list_arms() -> None:
    """List the shipped arms with their reach, repeatability and closed form."""
    from postproc.report.terminal import Column, table_text
    from postproc.robot.arm import load_arm
    from postproc.robot.arm_file import list_shipped_arms

    titles = "reach [mm]", "RP [mm]", "inverse"
    columns = [Column("arm", "left"), *map(Column, titles)]
    with report_errors():
        rows = [_row(load_arm(name)) for name in list_shipped_arms()]
    typer.echo(table_text(columns, rows))


def _row(arm: Arm) -> tuple[str, ...]:
    """Tell of an arm; its reach is how far the wrist centre is from axis 1 at most."""
    from postproc.robot.pose import MM

    opw = arm.file.opw
    if opw is None:
        return arm.name, "", f"{arm.repeatability / MM:g}", "numeric"
    reach = opw.a1_mm + opw.c2_mm + math.hypot(opw.a2_mm, opw.c3_mm)
    return arm.name, f"{reach:.0f}", f"{arm.repeatability / MM:g}", "closed form"


@arm.command("from-urdf")
def from_urdf(
    urdf: Annotated[Path, typer.Argument(help="ROBOT.urdf, expanded.")],
    output: Annotated[
        str, typer.Option("-o", "--output", help="ARM.toml, - for stdout.")
    ] = "-",
    base: Annotated[
        str | None,
        typer.Option("--base", help="Link of the base frame, default base, base_link."),
    ] = None,
    tip: Annotated[
        str | None, typer.Option("--tip", help="Link of the flange, default tool0.")
    ] = None,
    verify: Annotated[
        str | None,
        typer.Option(
            "--verify",
            metavar="ARM",
            help="Compare an arm with Pinocchio's reading of the URDF, and write no "
            "file. new: compare what is made of the URDF, and write it if they agree.",
        ),
    ] = None,
) -> None:
    """Write the arm file of a URDF: six revolute joints in series."""
    from postproc.robot.ortho_parallel import arm_text
    from postproc.robot.urdf import read_chain

    with report_errors(urdf):
        check_places([as_path(output)], [urdf])
        if verify is not None:
            from postproc.verify.extra import load

            load()
        chain = read_chain(urdf, base, tip)
        for assumed in (*chain.rounded, *chain.endless):
            say(f"{urdf}: {assumed}")
        text = arm_text(chain, ASSUMED_MM) if verify in (None, MADE) else None
        if text is not None:
            _say_what_lacks(chain)
        if verify and not _verify_arm(chain, text, verify):
            raise typer.Exit(1)
        if text is not None:
            write_text(output, text)
            if output != "-":
                say(f"written {output}")


def _say_what_lacks(chain: UrdfChain) -> None:
    """Say why an arm file has no closed form, or no links."""
    from postproc.robot.ortho_parallel import find_closed_form_obstacle
    from postproc.robot.urdf_links import placeholder

    if obstacle := find_closed_form_obstacle(chain):
        say(obstacle)
    if (problem := placeholder(chain.weights)) is not None:
        say(f"{chain.path}: {problem}. [links] is not written")


def _verify_arm(chain: UrdfChain, text: str | None, arm: str) -> bool:
    """Compare the text of an arm file, or an arm, with Pinocchio's reading of a URDF.

    Raises:
        PostprocError: There is no such arm, or Pinocchio cannot be loaded.
    """
    from postproc.report.second_opinion import print_opinion
    from postproc.robot.arm import arm_of_text, load_arm
    from postproc.verify.urdf import ArmClaim, UrdfChainNames, judge_urdf

    ours = load_arm(arm) if text is None else arm_of_text(chain.path, text)
    names = tuple(joint.name for joint in chain.moving)
    stated = chain.path.read_text("utf-8", "replace")
    theirs = UrdfChainNames(stated, chain.base, chain.tip, names)
    claim = ArmClaim(ours.file, ours.flange, ours.gravity_torque)
    opinion = judge_urdf(ours.name, theirs, claim)
    print_opinion(opinion)
    return opinion.agrees


@arm.command("from-machine-dat")
def from_machine_dat(
    machine: Annotated[
        Path, typer.Argument(help="$machine.dat, in R1/Mada of a KUKA archive.")
    ],
    output: Annotated[
        str, typer.Option("-o", "--output", help="ARM.toml, - for stdout.")
    ] = "-",
) -> None:
    """Write the arm file of a KUKA arm: six axes with a spherical wrist."""
    from postproc.robot.machine_data import machine_arm_text, read_machine_data

    with report_errors(machine):
        check_places([as_path(output)], [machine])
        text = machine_arm_text(read_machine_data(machine), ASSUMED_MM)
        write_text(output, text)
        if output != "-":
            say(f"written {output}")
