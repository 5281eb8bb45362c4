"""Which files belong to a job, and which are outputs beside it."""

from __future__ import annotations

import pytest

from postproc.compensation.pages import names_in
from postproc.compensation.sidecar import sidecar_path
from postproc.language.source import Source
from postproc.language.stamp import stamp_line

MAIN = b"MODULE main\nPROC main()\nENDPROC\nENDMODULE\n"
PART = b"MODULE part\nPROC edge()\nENDPROC\nENDMODULE\n"


@pytest.mark.parametrize("stamped", [True, False])
def test_outputs_are_no_modules_of_the_task(tmp_path, stamped):
    for name, text in (("main.mod", MAIN), ("part.mod", PART)):
        (tmp_path / name).write_bytes(text)
        output = tmp_path / name.replace(".", ".compensated.")
        stamp = stamp_line("1.0", "m", Source(name, text), "!") if stamped else b""
        first, _, rest = text.partition(b"\n")
        output.write_bytes(first + b"\n" + stamp + rest)
        sidecar_path(output).write_text("{}")
    assert set(names_in(tmp_path / "main.mod")[0]) == {"part.mod"}


def test_a_module_with_such_a_name_and_no_record_is_one(tmp_path):
    for name, text in (("main.mod", MAIN), ("part.compensated.mod", PART)):
        (tmp_path / name).write_bytes(text)
    assert set(names_in(tmp_path / "main.mod")[0]) == {"part.compensated.mod"}
