"""Make the pictures of the manual anew, in `docs/pictures`, from the pages that labrig makes.

    python docs/pictures.py RUNS

RUNS is the folder `runs` that the tutorial leaves. Needs chromium, and the development tools.
"""

import argparse
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from filelock import FileLock
from PIL import Image
from selenium.webdriver import Chrome

sys.path.insert(0, str(Path(__file__).parents[1]))
from labrig.material import write_reradiation
from tests.chromium import browser
from tests.material.reradiation.synthetic import ORANGE, YELLOW, measurement

LABRIG = (sys.executable, "-m", "labrig")
PICTURES = Path(__file__).parent / "pictures"
WIDTH = 1280
#: What a wall of the shipped box shall look like.
WISH = """\
name: sea
states: 2
albedo: 0.6
scene: {file: cornell-box, material: phosphorescent, white_cd_per_m2: 440}
pixels: {upper: [0.09, 0.35], lower: [0.09, 0.65]}
keys:
  - {at: 1 s, place: upper, colour: "#20c060", brightness: 3.0e-3}
  - {at: 20 s, place: lower, colour: "#20a0a0", brightness: 1.2e-3}
  - {at: 90 s, place: upper, colour: "#2060c0", brightness: 5.0e-4}
"""
#: Frames of the decay that the watched run has when its picture is taken.
FRAMES_WATCHED = 22
#: Time after which a live page has drawn what it is sent.
SETTLE_S = 4.0


def main() -> None:
    """Draw all pictures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("runs", type=Path)
    runs: Path = parser.parse_args().runs.resolve()
    PICTURES.mkdir(exist_ok=True)
    decay, phosphor = (min(runs.glob(f"*_{name}_*")) for name in ("decay", "phosphor"))
    with tempfile.TemporaryDirectory() as scratch, browser(Path(scratch, "profile")) as chrome:
        page(chrome, (decay / "result/report.html").as_uri(), "report_decay", 2000)
        page(chrome, (phosphor / "result/report.html").as_uri(), "report_phosphor", 1500)
        mixture(chrome, Path(scratch, "mixture"))
        front(Path(scratch, "front"))
        half = half_done(decay, Path(scratch, "runs"))
        # A run whose folder is locked is under way.
        with FileLock(half / ".lock"), served("watch", str(half), "--no-browser") as address:
            page(chrome, address, "watch", 860, SETTLE_S)
        protocol = Path(scratch, "my-decay.yaml")
        subprocess.run([*LABRIG, "protocol", "new", "decay", str(protocol)], check=True)
        with served("rig", "view", "sim", "--protocol", str(protocol), "--no-browser") as address:
            page(chrome, address, "view", 900, SETTLE_S)
        design_page(chrome, Path(scratch, "sea.yaml"))


def design_page(chrome: Chrome, wish: Path) -> None:
    """Take a picture of the page on which a material is designed, in a scene."""
    wish.write_text(WISH, encoding="utf-8")
    with served("design", "--open", str(wish), "--no-browser") as address:
        page(chrome, address, "design", 1100, 4 * SETTLE_S)


def mixture(chrome: Chrome, folder: Path) -> None:
    """Take a picture of the page of a mixture, of a made-up paper with two dyes."""
    folder.mkdir()
    paper = replace(measurement(21, YELLOW, ORANGE).measured, name="made-up paper")
    write_reradiation(folder / "paper.csv", paper)
    arguments = ("fit", "mixture", "paper.csv", "--corrected", "--out", ".")
    subprocess.run([*LABRIG, *arguments], cwd=folder, check=True)
    page(chrome, (folder / "report.html").as_uri(), "report_mixture", 1190)


def front(folder: Path) -> None:
    """Render the shipped room in the light and after it, side by side, for the front page."""
    size = ("--size", "420x420", "--paths", "128")
    subprocess.run([*LABRIG, "render", "cornell-box", *size, "--out", str(folder)], check=True)
    panels = [Image.open(path) for path in sorted(folder.glob("[0-9]*.png"))]
    width = sum(panel.width for panel in panels)
    strip = Image.new("RGB", (width, max(panel.height for panel in panels)))
    for number, panel in enumerate(panels):
        strip.paste(panel, (number * panel.width, 0))
    strip.save(PICTURES / "front.jpg", quality=88)


def page(chrome: Chrome, address: str, name: str, height: int, settle_s: float = 0.5) -> None:
    """Take a picture of the top of a page, `height` pixels high."""
    chrome.set_window_size(WIDTH, height)
    chrome.get(address)
    time.sleep(settle_s)
    chrome.execute_script("document.documentElement.style.overflow = 'hidden'")
    chrome.save_screenshot(str(PICTURES / f"{name}.png"))


def half_done(run: Path, runs: Path) -> Path:
    """Return a copy of a run as it was in the middle of its decay."""
    copy = runs / run.name
    shutil.copytree(run, copy, ignore=shutil.ignore_patterns("result*", "comparison"))
    lines = (run / "journal.jsonl").read_text(encoding="utf-8").splitlines(keepends=True)
    decay = [number for number, line in enumerate(lines) if '"role": "decay"' in line]
    kept = "".join(lines[: decay[min(FRAMES_WATCHED, len(decay) - 1)] + 1])
    (copy / "journal.jsonl").write_text(kept, encoding="utf-8")
    return copy


@contextmanager
def served(*arguments: str) -> Iterator[str]:
    """Yield the address of a page that a command of labrig serves."""
    with subprocess.Popen(
        [*LABRIG, *arguments], stdout=subprocess.PIPE, encoding="utf-8"
    ) as process:
        assert process.stdout is not None
        try:
            yield next(
                word for line in process.stdout for word in line.split() if word.startswith("http")
            )
        finally:
            process.terminate()


if __name__ == "__main__":
    main()
