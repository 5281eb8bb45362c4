"""Commands on arm files: list the shipped ones, write one of what others hold."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from postproc.cli.common import app, as_path, explained, say, write_text
from postproc.files import check_places

if TYPE_CHECKING:
    from postproc.robot.arm import Arm

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
    from postproc.robot.arm_file import shipped_arms

    titles = "reach [mm]", "RP [mm]", "inverse"
    columns = [Column("arm", "left"), *map(Column, titles)]
    with explained():
        rows = [_row(load_arm(name)) for name in shipped_arms()]
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
    name: Annotated[
        str | None, typer.Option("--name", help="Of the arm, default the robot's.")
    ] = None,
    repeatability: Annotated[
        float, typer.Option("--repeatability", min=0.001, help="RP of ISO 9283 [mm].")
    ] = 0.1,
) -> None:
    """Write the arm file of a URDF: six revolute joints in series."""
    from postproc.robot.ortho_parallel import arm_text, closed_form_obstacle
    from postproc.robot.urdf import read_chain
    from postproc.robot.urdf_links import placeholder

    with explained(urdf):
        check_places([as_path(output)], [urdf])
        chain = read_chain(urdf, base, tip)
        text = arm_text(chain, repeatability, name)
        write_text(output, text)
        for rounded in chain.rounded:
            say(f"{urdf}: {rounded}")
        if obstacle := closed_form_obstacle(chain):
            say(obstacle)
        if (problem := placeholder(chain.weights)) is not None:
            say(f"{urdf}: {problem}. [links] is not written")
        if output != "-":
            say(f"written {output}")


@arm.command("from-machine-dat")
def from_machine_dat(
    machine: Annotated[
        Path, typer.Argument(help="$machine.dat, in R1/Mada of a KUKA archive.")
    ],
    output: Annotated[
        str, typer.Option("-o", "--output", help="ARM.toml, - for stdout.")
    ] = "-",
    name: Annotated[
        str | None,
        typer.Option("--name", help="Of the arm, default the transformation's."),
    ] = None,
    repeatability: Annotated[
        float, typer.Option("--repeatability", min=0.001, help="RP of ISO 9283 [mm].")
    ] = 0.1,
) -> None:
    """Write the arm file of a KUKA arm: six axes with a spherical wrist."""
    from postproc.robot.machine_data import machine_arm_text, read_machine_data

    with explained(machine):
        check_places([as_path(output)], [machine])
        text = machine_arm_text(read_machine_data(machine), repeatability, name)
        write_text(output, text)
        if output != "-":
            say(f"written {output}")
