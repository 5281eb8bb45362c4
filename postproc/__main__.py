"""`python -m postproc` is the command `postproc`, where that is not on the PATH."""

from __future__ import annotations

from postproc.cli import main

if __name__ == "__main__":
    main()
