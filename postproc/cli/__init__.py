"""The command line: arguments, a call, and what is printed.

Nothing is imported here but what ends a command: the rest takes long enough to be
interrupted on its way.
"""

from __future__ import annotations

import gc
import os
import signal
import sys
from typing import Any

from postproc import __version__
from postproc.operating_system import print_any_text
from postproc.threads import start_no_threads

__all__ = ["app", "main"]

M_TRIM_THRESHOLD, M_MMAP_THRESHOLD = -1, -3  # of mallopt(3)
LARGE = 4 << 20  # bytes
SPARE = 16 << 20  # bytes that are kept for the next arrays
YOUNG = 500_000  # objects that may hold others, before cycles among them are looked for


def __getattr__(name: str) -> Any:
    """Load the application, for who does not come through `main`."""
    if name != "app":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from postproc.cli.commands import app

    return app


def main() -> None:
    """Run the command line; a defect of ours ends with 2, like all that failed."""
    _leave_signals_to_the_system()
    if sys.argv[1:] == ["--version"]:  # what takes long to load is not needed
        print(f"postproc {__version__}")
        return
    start_no_threads()
    _give_large_arrays_back()
    print_any_text(sys.stdout, sys.stderr)
    # A command makes hardly any cycles: loading it takes a tenth less without a search.
    gc.set_threshold(YOUNG, *gc.get_threshold()[1:])
    # pydantic would read what every installed package says of itself.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "1")
    from postproc.cli.commands import application
    from postproc.cli.common import report_os_error, say

    try:
        application("".join(sys.argv[1:2]))()
    except OSError as exc:
        sys.exit(report_os_error(exc))
    except Exception as exc:
        if os.environ.get("POSTPROC_DEBUG"):
            raise
        say(
            f"postproc: internal error: {type(exc).__name__}: {exc}. Nothing more was "
            "written. Set POSTPROC_DEBUG=1 for the trace, and please report it"
        )
        sys.exit(2)


def _give_large_arrays_back() -> None:
    """Let the C library give memory back to the system where an array ends.

    It learns from the first long array to keep what is freed: a quarter of what a
    program of a million targets needs. A little is kept: to hand every small array's
    pages back and ask for them again is half of what the system does for a long
    program. Only glibc has the options.
    """
    if sys.platform != "linux":
        return
    import ctypes

    if hasattr(library := ctypes.CDLL(None), "mallopt"):
        library.mallopt(M_MMAP_THRESHOLD, LARGE)
        library.mallopt(M_TRIM_THRESHOLD, SPARE)


def _leave_signals_to_the_system() -> None:
    """Let Ctrl-C and SIGTERM end this process at once, wherever it is.

    Python would wait for the end of a long sum, and raise where nobody catches it:
    while modules are loaded, or where an exception is dropped. Who has to tidy up says
    so (`files.end_process`, `batch.run.stoppable`). A signal that is ignored stays so.
    """
    for number in (signal.SIGINT, signal.SIGTERM):
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, signal.SIG_DFL)
