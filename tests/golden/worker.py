"""Run postproc commands one by one, each in a fork of a process that has it loaded.

A script of its own, away from the package `tests`: the package under test is the one
that PYTHONPATH names. Orders come line by line on stdin, answers go to stdout.
"""

from __future__ import annotations

import atexit
import json
import os
import sys
import traceback
from typing import Any, TextIO

Order = dict[str, Any]


def main() -> None:
    """Load the package, tell where it lies, then do what is ordered."""
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    import postproc
    from postproc.cli import main as command_line

    tell(answers, {"file": postproc.__file__, "version": postproc.__version__})
    for line in sys.stdin:
        order = json.loads(line)
        if order["here"]:
            tell(answers, {"exit": loaded(command_line, order)})
        else:
            tell(answers, forked(command_line, order))


def tell(answers: TextIO, answer: Order) -> None:
    """Write an answer."""
    answers.write(json.dumps(answer) + "\n")
    answers.flush()


def forked(command_line: Any, order: Order) -> Order:
    """Run a command in a process of its own; return its exit code and its cost."""
    child = os.fork()
    if child:
        _, status, used = os.wait4(child, 0)
        return {
            "exit": os.waitstatus_to_exitcode(status),
            "seconds": used.ru_utime + used.ru_stime,
            "megabytes": used.ru_maxrss / 1024,
        }
    code = 99
    try:
        redirect(order)
        code = called(command_line, order["command"])
        atexit._run_exitfuncs()
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def loaded(command_line: Any, order: Order) -> int:
    """Run a command in this process, so that its modules are loaded from now on."""
    kept = [os.dup(fd) for fd in range(3)]
    place, stdin = os.getcwd(), sys.stdin
    redirect(order)
    try:
        return called(command_line, order["command"])
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        for fd in range(3):
            os.dup2(kept[fd], fd)
            os.close(kept[fd])
        os.chdir(place)
        sys.stdin = stdin


def redirect(order: Order) -> None:
    """Go to the folder of a command; take stdin from a file, and write files."""
    os.chdir(order["folder"])
    create = os.O_WRONLY | os.O_CREAT | os.O_TRUNC
    opened = (
        os.open(order["stdin"] or os.devnull, os.O_RDONLY),
        os.open(order["stdout"], create, 0o644),
        os.open(order["stderr"], create, 0o644),
    )
    for fd, new in enumerate(opened):
        os.dup2(new, fd)
        os.close(new)
    sys.stdin = open(0, encoding="utf-8", closefd=False)


def called(command_line: Any, command: list[str]) -> int:
    """Call the command line; return its exit code."""
    sys.argv = ["postproc", *command]
    try:
        command_line()
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else int(end.code is not None)
    return 0


if __name__ == "__main__":
    main()
