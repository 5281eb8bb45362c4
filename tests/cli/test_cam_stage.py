"""The last stage of a CAM chain: the filter, the Makefile and the post of the guide."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from postproc.language.text.stamp import read_stamp, strip_stamp
from tests.plant import contents, pages, program

ROOT = Path(__file__).parents[2]
TOOL = [sys.executable, "-c", "from postproc.cli import main; main()"]


def stage(source, job_folder):
    """Run the filter on bytes."""
    files = ["--cell", job_folder / "cell.toml", "--model", job_folder / "model.json"]
    return subprocess.run(
        [*TOOL, "compensate", "-", *files], input=source, capture_output=True
    )


def test_the_filter_is_byte_clean(job_folder):
    source = b"-- caf\xe9 \xff\r\n" + program("job", 2, 1).replace(b"VAR\r\n", b"VAR\n")
    done = stage(source, job_folder)
    assert done.returncode == 0
    assert read_stamp(done.stdout) is not None
    numbers = re.compile(rb"-?\d+\.?\d*")
    text = strip_stamp(done.stdout)
    assert numbers.sub(b"#", text) == numbers.sub(b"#", source)
    assert b"visits" in done.stderr


def test_the_filter_lets_nothing_out_that_it_refuses(job_folder):
    done = stage(b"PROGRAM x\0", job_folder)
    assert (done.returncode, done.stdout) == (2, b"")
    assert b"binary" in done.stderr


def test_the_makefile(tmp_path, job_folder):
    nominal = tmp_path / "nominal"
    nominal.mkdir()
    (nominal / "job.pdl").write_bytes(program("job", 1, 1))
    for name in ("cell.toml", "model.json"):
        (tmp_path / name).write_bytes((job_folder / name).read_bytes())
    file = ROOT / "programs/Makefile.example"
    tool = f"POSTPROC={shlex.join(TOOL)}"

    def make(*goals):
        return subprocess.run(
            ["make", "-f", file, tool, *goals],
            cwd=tmp_path,
            capture_output=True,
            text=True,
        )

    done = make("check")
    assert done.returncode == 0, done.stderr
    assert "1 programs, 0 findings" in done.stderr
    (nominal / "far.pdl").write_bytes(b"PROGRAM x\0")
    assert make().returncode != 0
    assert not (tmp_path / "compensated/far.pdl").exists()


class BasePost:
    """What the guide's post is derived from: saves a program with its pages."""

    LOG = ""

    def ProgSave(self, folder, progname, ask_user=False, show_result=False):
        pages(Path(folder), 2, 2)
        self.PROG_FILES = sorted(str(p) for p in Path(folder).iterdir())


@pytest.fixture
def post(job_folder):
    """The post of the guide, for this job."""
    text = (ROOT / "docs/cam-stage.md").read_text()
    code = re.search(r"```python\n(.*?)```", text, re.DOTALL)[1]
    there = "    PROG_EXT = 'pdl'\n    MAX_LINES_X_PROG = 5000\n"
    code = re.sub(r"(?m)^    \.\.\. .*\n", there, code)  # what the class holds stays
    names = {"BasePost": BasePost, "__name__": "post"}
    exec(compile(code, "cam-stage.md", "exec"), names)
    names["POSTPROC"] = TOOL
    names["CELL"] = str(job_folder / "cell.toml")
    names["MODEL"] = str(job_folder / "model.json")
    made = names["RobotPost"]()
    assert (made.PROG_EXT, made.MAX_LINES_X_PROG) == ("pdl", 5000)
    return made


def test_the_post_hands_on_compensated_programs_only(tmp_path, post):
    post.ProgSave(str(tmp_path), "main")
    names = [Path(f).relative_to(tmp_path).as_posix() for f in post.PROG_FILES]
    assert names == [f"main.compensated/{n}.pdl" for n in ("main", "page1", "page2")]
    for file in post.PROG_FILES:
        assert read_stamp(Path(file).read_bytes()) is not None


def test_the_post_hands_on_nothing_after_a_failure(tmp_path, post, monkeypatch):
    def save(self, folder, progname, ask_user=False, show_result=False):
        self.PROG_FILES = str(Path(folder) / "main.pdl")
        Path(self.PROG_FILES).write_bytes(b"PROGRAM main\0")

    monkeypatch.setattr(BasePost, "ProgSave", save)
    with pytest.raises(Exception, match="nothing to send"):
        post.ProgSave(str(tmp_path), "main")
    assert post.PROG_FILES == []
    assert not contents(tmp_path / "main.compensated")
