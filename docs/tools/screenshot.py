"""Show what a report looks like: docs/pictures/report.png, from a real browser.

    PYTHONPATH=. python docs/tools/screenshot.py

The drilling job is surveyed, fitted and compensated first, as the tutorial does it.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from io import BytesIO
from pathlib import Path
from typing import Any

from PIL import Image
from selenium.webdriver.support.ui import Select

from tests.report.html.browser import open_browser

ROOT = Path(__file__).parents[2]
PICTURE = ROOT / "docs/pictures/report.png"
SIZE = {"width": 1280, "height": 860, "deviceScaleFactor": 1, "mobile": False}
COMMANDS = """
survey --poses 200 -o survey.pdl
simulate survey.pdl -o survey.csv
fit survey.csv -o model.json
compensate drilling.pdl --model model.json -o out.pdl --report drilling.html
"""
ROW = 5  # of the table: its source line and joints are shown beside the view


def main() -> None:
    """Make the report, open it, choose a target, keep a picture of it."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        make_report(folder)
        with open_browser(folder / "profile") as browser:
            browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", SIZE)
            browser.get((folder / "drilling.html").as_uri())
            wait_for(browser, "return document.body.dataset.ready === 'yes'")
            Select(browser.find_element("id", "mode")).select_by_value("size")
            browser.find_elements("css selector", "tbody tr")[ROW - 1].click()
            time.sleep(2.0)  # the view is drawn again
            save(browser.get_screenshot_as_png())
    print(f"{PICTURE.relative_to(ROOT)}: {PICTURE.stat().st_size // 1024} kB")


def save(png: bytes) -> None:
    """Keep a picture in 128 colours, which is a third of its size."""
    shown = Image.open(BytesIO(png)).convert("RGB")
    shown.quantize(128, dither=Image.Dither.NONE).save(PICTURE, optimize=True)


def make_report(folder: Path) -> None:
    """Compensate the drilling job with a model of a virtual arm."""
    job, cell = folder / "drilling.pdl", ROOT / "programs/cell.toml"
    job.write_bytes((ROOT / "programs" / job.name).read_bytes())
    tool = Path(sys.executable).parent / "postproc"
    for command in COMMANDS.strip().splitlines():
        line = [str(tool), *command.split(), "--cell", str(cell)]
        subprocess.run(line, cwd=folder, check=True, capture_output=True)


def wait_for(browser: Any, script: str, seconds: float = 60.0) -> None:
    """Wait until a script returns something true."""
    end = time.monotonic() + seconds
    while not browser.execute_script(script):
        if time.monotonic() > end:
            raise TimeoutError(script)
        time.sleep(0.1)


if __name__ == "__main__":
    main()
