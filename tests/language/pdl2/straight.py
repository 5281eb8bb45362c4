"""What a program executed, as a program of its own without branches."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from tests.language.pdl2.executed import PAGE, Executed, Generated

Numbers = Sequence[float]


def straight(made: Generated, trace: list[Executed]) -> bytes:
    """Write what was executed move after move; each makes one visit, arcs two."""
    lines = ["PROGRAM job EZ", "VAR", "BEGIN"]
    texts = [data.decode("latin-1").splitlines() for data in made.files.values()]
    frames: dict[str, Numbers] = {}
    via = ""
    for executed in trace:
        lines += _changed(frames, executed)
        words = texts[executed.line // PAGE][executed.line % PAGE - 1].split("--")[0]
        if executed.how == "VIA":
            via = f" VIA {_target(words, executed)}"
            continue
        lines.append(f"  {_move(words, executed)}{via}{_end(words)}")
        via = ""
    return "\n".join([*lines, "END job", ""]).encode("ascii")


def _changed(frames: dict[str, Numbers], executed: Executed) -> Iterator[str]:
    """Yield the frames that are others than before."""
    for name in ("tool", "uframe"):
        now = getattr(executed, name)
        if now != frames.get(name) and any(now):
            yield f"  ${name.upper()} := POS({_text(now)}, '')"
            frames[name] = now


def _move(words: str, executed: Executed) -> str:
    """Return a move as it was executed."""
    kinds = ("CIRCULAR", "LINEAR", "JOINT")
    how = next(kind for kind in kinds if kind in words)
    fly = "MOVEFLY" if "MOVEFLY" in words else "MOVE"
    numbers = _text(executed.values or ())
    word, _, frame = executed.how.partition("_")
    match word:
        case "NEAR":
            target = _target(words, executed)
            return f"{fly} {how} NEAR {target} BY {executed.short_mm:.7f}"
        case "FOR":
            target = _target(words, executed)
            return f"{fly} {how} FOR {executed.short_mm:.7f} TO {target}"
        case "AWAY":
            return f"{fly} {how} AWAY {numbers}"
        case "RELATIVE":
            return f"{fly} {how} RELATIVE VEC({numbers}) IN {frame}"
        case "ABOUT":
            axis, angle = numbers.rsplit(", ", 1)
            return f"{fly} {how} ABOUT VEC({axis}) BY {angle} IN {frame}"
        case "BY":
            return f"{fly} {how} BY {{{numbers}}}"
    return f"{fly} {how} TO {_target(words, executed)}"


def _target(words: str, executed: Executed) -> str:
    numbers = _text(executed.values or ())
    word = "VIA" if executed.how == "VIA" else "TO"
    name = words.partition(f" {word} ")[2].strip()
    joints = name.startswith(("{", "j1"))
    return f"{{{numbers}}}" if joints else f"POS({numbers}, '')"


def _end(words: str) -> str:
    return " ADVANCE" if "MOVEFLY" in words else ""


def _text(numbers: Numbers) -> str:
    return ", ".join(f"{n:.7f}" for n in numbers)
