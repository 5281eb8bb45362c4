"""What the user asked for."""

from __future__ import annotations

from dataclasses import dataclass

from postproc.exceptions import PostprocError


@dataclass(frozen=True)
class Options:
    """What the user asked for.

    Attributes:
        clone: Give variables whose arrivals disagree a value for each; not available.
        shared: Edit variables that other programs may read too.
        temperature: Arm temperature [deg C]; default: the cell's.

    Raises:
        PostprocError: Cloning is asked for.
    """

    clone: bool = False
    shared: bool = False
    temperature: float | None = None

    def __post_init__(self) -> None:
        """Refuse what would silently not be done."""
        if self.clone:
            raise PostprocError(
                "--clone: cloning is not available. Give each move a variable of its "
                "own, or leave --clone out: points whose arrivals disagree are listed"
            )


AS_USUAL = Options()
