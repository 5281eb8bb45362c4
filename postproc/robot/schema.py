"""Reading TOML files with messages that name the place."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Annotated, TypeVar

import pydantic
from pydantic import BaseModel, ConfigDict, Field

from postproc.exceptions import FileError

MAX_BYTES = 1_000_000  # no arm or cell file is longer; a longer one is a mistake

Triple = Annotated[list[float], Field(min_length=3, max_length=3)]
Sextuple = Annotated[list[float], Field(min_length=6, max_length=6)]


class Strict(BaseModel):
    """A section of a file: unknown keys and non-finite numbers are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


Schema = TypeVar("Schema", bound=BaseModel)


def read_toml(path: Path, schema: type[Schema], error: type[FileError]) -> Schema:
    """Read and validate a TOML file.

    Raises:
        FileError: Of the given type, naming the file and the first wrong place.
    """
    try:
        raw = path.read_bytes()
    except OSError as exc:
        raise error(
            path, f"cannot be read ({exc.strerror})", "Check the path"
        ) from None
    if len(raw) > MAX_BYTES:
        raise error(path, f"is longer than {MAX_BYTES} bytes", "Check the path")
    try:
        data = tomllib.loads(raw.decode("utf-8-sig"))
    except UnicodeDecodeError:
        raise error(path, "is not UTF-8 text", "Save it as UTF-8") from None
    except tomllib.TOMLDecodeError as exc:
        raise _syntax(path, str(exc), error) from None
    try:
        return schema.model_validate(data)
    except pydantic.ValidationError as exc:
        raise _explain(path, exc, schema, error) from None


def _syntax(path: Path, message: str, error: type[FileError]) -> FileError:
    """Take the place out of the message of the TOML reader."""
    text, _, place = message.partition(" (at line ")
    numbers = [int(n) for n in re.findall(r"\d+", place)]
    line, column = numbers if len(numbers) == 2 else (None, None)
    problem, cure = f"is not valid TOML: {text}", "Mend the syntax"
    return error(path, problem, cure, line=line, column=column)


def _explain(
    path: Path,
    exc: pydantic.ValidationError,
    schema: type[Schema],
    error: type[FileError],
) -> FileError:
    """Turn the first validation error into a message with place and cure."""
    found = exc.errors()
    # A key with another unit is unknown, and the right one missing: tell the former.
    unknown = [e for e in found if e["type"] == "extra_forbidden"]
    first = (unknown or found)[0]
    place = "$" + "".join(
        f"[{k + 1}]" if isinstance(k, int) else f".{k}" for k in first["loc"]
    )
    if first["type"] == "extra_forbidden":
        allowed = ", ".join(_siblings(schema, first["loc"][:-1]))
        return error(path, "unknown key", f"Known here: {allowed}", place=place)
    if first["type"] == "missing":
        return error(path, "required key is missing", "Add it", place=place)
    message = first["msg"].removeprefix("Value error, ")
    return error(path, message, "Correct the value", place=place)


def _siblings(schema: type[BaseModel], place: tuple[int | str, ...]) -> list[str]:
    """List the keys that the schema knows at a place."""
    here: type[BaseModel] = schema
    for key in place:
        field = here.model_fields.get(str(key))
        nested = field.annotation if field else None
        options = getattr(nested, "__args__", (nested,))
        for option in options:
            if isinstance(option, type) and issubclass(option, BaseModel):
                here = option
    return list(here.model_fields)
