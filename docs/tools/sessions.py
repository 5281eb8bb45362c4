"""Console sessions in a page: parsed, run, compared with what stands there.

A block that begins with ``console`` holds commands, each after ``$ `` (its further
lines after ``> ``), and under each
what it prints (standard output and standard error as they come); a command that does
not end with 0 adds the line ``[exit code N]``.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from difflib import unified_diff
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")])
BLOCK = re.compile(r"(?ms)^```console\n(.*?)^```$")
PROMPT, MORE = "$ ", "> "
# All that is taken to be equal: seconds, rates, ids of models, which hash the last bits
# of sums that processors round differently, dates, and where the page was run.
TIMES = re.compile(r"\b\d+(\.\d+)? ?(s|ms|/s|files/s|programs/s)(?![\w/])")
MODELS = re.compile(r"\b[0-9a-f]{16}\b")
FITTED = re.compile(r"\bfitted on \d{4}-\d\d-\d\d\b")
PROGRESS = re.compile(r"(?m)^\d+ s: .*\n")
"""Progress that a command prints when it takes long: it depends on the machine."""


@dataclass(frozen=True)
class Step:
    """One command and what it should print."""

    command: str
    output: str


def steps_of(block: str) -> list[Step]:
    r"""Take a block apart.

    >>> steps_of("$ a\n>\n> b\nx\ny\n$ c\n")
    [Step(command='a\n\nb', output='x\ny\n'), Step(command='c', output='')]
    """
    steps: list[Step] = []
    lines = block.splitlines()
    while lines:
        line = lines.pop(0)
        if not line.startswith(PROMPT):
            raise ValueError(f"a block begins with output: {line!r}")
        command = [line.removeprefix(PROMPT)]
        while lines and f"{lines[0]} ".startswith(MORE):
            command.append(lines.pop(0)[len(MORE) :])
        output = []
        while lines and not lines[0].startswith(PROMPT):
            output.append(lines.pop(0) + "\n")
        steps.append(Step("\n".join(command), "".join(output)))
    return steps


def run_page(text: str, folder: Path) -> tuple[str, list[str]]:
    """Run the commands of a page in a folder.

    Args:
        text: The page.
        folder: Where to run them.

    Returns:
        The page with what the commands really print, and the differences in words.
    """
    wrong: list[str] = []

    def rewritten(found: re.Match[str]) -> str:
        parts = []
        for step in steps_of(found.group(1)):
            printed = run_step(step.command, folder)
            if normal(printed) != normal(step.output):
                wrong.append(told_apart(step, printed))
                step = Step(step.command, printed)
            command = step.command.replace("\n", f"\n{MORE}").replace("> \n", ">\n")
            parts.append(f"{PROMPT}{command}\n{step.output}")
        return "```console\n" + "".join(parts) + "```"

    return BLOCK.sub(rewritten, text), wrong


def run_step(command: str, folder: Path) -> str:
    """Run a command as a user of bash does, and return what it prints."""
    quiet = {"NO_COLOR": "1", "COLUMNS": "200", "LC_ALL": "C.UTF-8"}
    # The tool of this environment, whether a shell has activated it or not.
    own = f"{Path(sys.executable).parent}{os.pathsep}{os.environ.get('PATH', '')}"
    done = subprocess.run(
        ["bash", "-c", command],
        cwd=folder,
        env={**os.environ, **quiet, "PATH": own},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        check=False,
    )
    text = done.stdout.decode("utf-8", "replace").replace(f"{folder}/", "")
    text = "".join(f"{line.rstrip()}\n" for line in text.splitlines())
    text = PROGRESS.sub("", text)
    return text + (f"[exit code {done.returncode}]\n" if done.returncode else "")


def normal(output: str) -> str:
    """Replace what may differ from run to run.

    >>> normal("model 135d6e7307b40c29 done in 1.25 s at 3 files/s, 5 steps")
    'model ID done in T s at T files/s, 5 steps'
    >>> normal("fitted on 2026-11-29 by postproc")
    'fitted on DATE by postproc'
    """
    timeless = TIMES.sub(lambda found: f"T {found.group(2)}", output)
    return FITTED.sub("fitted on DATE", MODELS.sub("ID", timeless))


def told_apart(step: Step, printed: str) -> str:
    """Show how the output of a command differs from what the page says."""
    lines = unified_diff(
        normal(step.output).splitlines(),
        normal(printed).splitlines(),
        "on the page",
        "printed now",
        lineterm="",
    )
    return "\n".join([f"$ {step.command}", *lines])


def commands(texts: Sequence[str]) -> Iterator[str]:
    """List the commands of pages."""
    for text in texts:
        for block in BLOCK.findall(text):
            yield from (step.command for step in steps_of(block))
