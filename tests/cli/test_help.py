"""Help: every command has examples, the examples fit the command, shells complete."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
import typer

from postproc import __version__
from postproc.cli import reports
from postproc.cli.commands import app, application
from postproc.cli.common import EXAMPLES
from postproc.cli.reports import PLOTS, Reports
from postproc.exceptions import PostprocError
from tests.cli.test_cli import COMMANDS
from tests.written import cli

COMMAND = typer.main.get_command(app)


def commands_in(line: str) -> list[list[str]]:
    """Return the calls of postproc in a shell line."""
    words = shlex.split(line.partition(">")[0], comments=True)
    calls: list[list[str]] = []
    for word in words:
        if word == "postproc":
            calls.append([])
        elif word == "|":
            calls.append(["|"])
        elif calls:
            calls[-1].append(word)
    return [call for call in calls if call and command_of(call) in EXAMPLES]


def command_of(call: list[str]) -> str:
    """Return the name of the command that a call begins with."""
    return " ".join(call[:2] if call[0] in ("arm", "robot") else call[:1])


def test_every_command_has_examples():
    assert set(EXAMPLES) == set(COMMANDS)


@pytest.mark.parametrize("name", EXAMPLES)
def test_examples_are_shown_and_fit_the_command(name):
    words = name.split()
    told = cli(*words, "--help").stdout
    for example in EXAMPLES[name]:
        assert example in told
        (call,) = commands_in(example)
        assert command_of(call) == name
        command = COMMAND
        for word in words:
            command = command.get_command(typer.Context(command), word)
        command.make_context(name, call[len(words) :])  # refuses what it does not know


def postproc(*arguments, **environment):
    """Run the command as a shell does."""
    code = "import sys; from postproc.cli import main; sys.argv[0] = 'postproc'; main()"
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments],
        capture_output=True, text=True, check=False, env={**os.environ, **environment},
    )  # fmt: skip
    return done.stdout


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_shells_get_a_script(shell):
    told = {"_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION": "1"}
    script = postproc("--show-completion", shell, **told)
    assert "_POSTPROC_COMPLETE" in script and f"complete_{shell}" in script


@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        ("postproc com", {"compensate", "compare"}),
        ("postproc fit --method el", {"elm"}),
        ("postproc diff --rep", {"--report"}),
    ],
)
def test_what_is_typed_is_completed(typed, offered):
    told = {"COMP_WORDS": typed, "COMP_CWORD": str(len(typed.split()) - 1)}
    found = postproc(_POSTPROC_COMPLETE="complete_bash", **told)
    assert set(found.split()) == offered


def test_help_loads_nothing_heavy():
    code = (
        "import sys; from postproc.cli import app\n"
        "try: app(['--help'])\n"
        "except SystemExit: pass\n"
        "heavy = {'numpy', 'scipy', 'pinocchio', 'lark', 'rich', 'plotly', 'pandas'}\n"
        "print(sorted(heavy & set(sys.modules)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert done.stdout.splitlines()[-1] == "[]"


def test_compensating_loads_nothing_that_it_may_not_need():
    code = (
        "import sys, postproc.cli.job_files, postproc.cli.common\n"
        "import postproc.language.pdl2.language\n"
        "ours = ('batch.plan', 'compensation.timing_comparison', 'motion.timing',\n"
        "    'compensation.paths.insertion_loop', 'language.pdl2.clones',\n"
        "    'model.effects.elm')\n"
        "never = {'matplotlib', 'pinocchio', 'rich', 'ruckig', 'scipy'}\n"
        "never |= {f'postproc.{name}' for name in ours}\n"
        "print(sorted(never & set(sys.modules)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert done.stdout == "[]\n"


def test_a_command_is_prepared_alone_and_all_where_none_is_named():
    alone = application("compensate")
    assert [c.callback.__name__ for c in alone.registered_commands] == ["compensate"]
    assert not alone.registered_groups
    for first in ("", "arm", "--help", "compensat"):
        assert application(first) is app
    assert len(app.registered_commands) > 10 and app.registered_groups


def test_pictures_need_an_extra_and_that_is_reported_before_any_work(monkeypatch):
    monkeypatch.setattr(reports, "find_spec", lambda name: None)
    with pytest.raises(PostprocError, match=r"a\.svg: pictures need matplotlib.*plots"):
        Reports.of([Path("a.svg")], *PLOTS)
    assert Reports.of([Path("a.json")], *PLOTS).json == (Path("a.json"),)


def test_the_package_is_the_command():
    command = [sys.executable, "-m", "postproc", "--version"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, f"postproc {__version__}\n")


def test_the_version_is_printed_without_loading_the_command_line():
    code = (
        "import sys; sys.argv = ['postproc', '--version']\n"
        "from postproc.cli import main; main()\n"
        "slow = {'typer', 'numpy', 'pydantic', 'multiprocessing', 'ctypes'}\n"
        "print(sorted(slow & set(sys.modules)))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.splitlines() == [f"postproc {__version__}", "[]"], done.stderr
