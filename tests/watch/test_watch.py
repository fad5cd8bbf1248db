"""A run watched from outside the dark room, while its folder grows."""

import http.client
import os
import shutil
import time
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from filelock import FileLock
from selenium.webdriver import Chrome
from selenium.webdriver.common.by import By
from selenium.webdriver.support.wait import WebDriverWait

from labrig import shipped
from labrig.cli.ending import guarded
from labrig.cli.progress import thumbnail
from labrig.errors import UsageError
from labrig.record import read_run
from labrig.report.pictures import jpeg
from labrig.watch.following import Following
from labrig.watch.glances import Glances
from labrig.watch.server import News, WatchServer
from labrig.yaml_file import read_yaml, yaml_text

SCREENSHOTS = os.environ.get("LABRIG_SCREENSHOTS")
PATIENCE_S = 20


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A processed run with two patches."""
    folder = tmp_path_factory.mktemp("finished")
    rig = read_yaml(shipped.folder("config") / "sim.yaml")
    rig["simulation"] |= {"sensor": {"width": 192, "height": 128}}
    protocol = {
        "protocol": "decay",
        "sample": {"name": "two papers"},
        "charge": "10 min",
        "for": "60 s",
        "exposure": "1 s",
        "patches": {"left": [0.1, 0.2, 0.3, 0.6], "right": [0.6, 0.2, 0.3, 0.6]},
    }
    for name, content in (("rig.yaml", rig), ("protocol.yaml", protocol)):
        (folder / name).write_text(yaml_text(content))
    asked = [str(folder / "protocol.yaml"), "--rig", str(folder / "rig.yaml")]
    assert guarded(["run", *asked, "--runs", str(folder / "runs")]) == 0
    (run,) = (folder / "runs").iterdir()
    return run


class Growing:
    """The same run over again, line by line of its journal."""

    def __init__(self, finished: Path, place: Path) -> None:
        self.path = place / finished.name
        self._finished = finished
        self._lines = (finished / "journal.jsonl").read_bytes().splitlines(keepends=True)
        self.path.mkdir(parents=True)
        for name in ("protocol.yaml", "rig.yaml"):
            shutil.copy(finished / name, self.path)
        shutil.copytree(finished / "frames", self.path / "frames")

    def grow(self, lines: int) -> None:
        with (self.path / "journal.jsonl").open("ab") as journal:
            journal.writelines(self._lines[:lines])
        del self._lines[:lines]

    def grow_until(self, text: bytes) -> None:
        """Up to the first line with `text` in it."""
        self.grow(1 + next(n for n, line in enumerate(self._lines) if text in line))

    def finish(self) -> None:
        self.grow(len(self._lines))
        shutil.copytree(self._finished / "result", self.path / "result")


@pytest.fixture
def growing(finished: Path, tmp_path: Path) -> Growing:
    return Growing(finished, tmp_path / "growing")


def test_what_is_done_and_what_comes(growing: Growing) -> None:
    following = Following(growing.path)
    assert following.look()
    assert following.state()["state"] == "unfinished"
    growing.grow_until(b'"unit": "decay-1"')
    growing.grow_until(b'"purpose": "decay"')
    with FileLock(growing.path / ".lock"):
        assert following.look()
        assert not following.look()
        state = following.state()
    assert state["state"] == "running"
    assert [unit["state"] for unit in state["units"]] == ["done", "now"]
    assert {step["what"] for step in state["steps"]} >= {"lamp on", "lamp off"}
    assert [point["patch"] for point in state["points"]] == ["left", "right"]
    assert state["frame"]["purpose"] == "decay"
    assert state["results"] == []


def test_the_points_are_the_decay(growing: Growing) -> None:
    growing.finish()
    following = Following(growing.path)
    following.look()
    state = following.state()
    assert state["state"] == "processed"
    assert [result["patch"] for result in state["results"]] == ["left", "right"]
    frames = read_run(growing.path).frames("decay")
    points = [point for point in state["points"] if point["patch"] == "left"]
    assert len(points) == len(frames)
    assert points[0]["t_s"] == pytest.approx(0.56, abs=0.05)
    greens = [point["dn_per_s"]["G"] for point in points]
    assert greens == sorted(greens, reverse=True)
    # before dark frames are subtracted, and so within a few per cent of the result
    series = (growing.path / "result" / "left" / "series.csv").read_text().splitlines()
    column = series[0].split(",").index("G")
    assert greens[0] == pytest.approx(float(series[1].split(",")[column]), rel=0.05)


def test_a_frame_that_cannot_be_read_is_passed_over(growing: Growing) -> None:
    growing.finish()
    (last,) = sorted((growing.path / "frames").iterdir())[-1:]
    last.write_bytes(b"no frame")
    following = Following(growing.path)
    following.look()
    assert following.state()["frame"]["name"] != last.name


def test_another_process_looks_at_frames_and_runs_nothing_that_lies_about(
    finished: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "numpy.py").write_text("open('was-run', 'w')\n")
    monkeypatch.chdir(tmp_path)
    glances = Glances(finished, 48)
    try:
        glances.ask("nothing.dng")
        glances.ask("000005.dng")
        deadline = time.monotonic() + PATIENCE_S
        while glances.latest is None and time.monotonic() < deadline:
            time.sleep(0.05)
        seen = glances.latest
    finally:
        glances.close()
    assert not (tmp_path / "was-run").exists()
    assert seen is not None
    assert seen.name == "000005.dng"
    assert seen.picture.shape == (32, 48, 3)
    assert seen.values["left"]["G"] > 1000
    drawn = thumbnail(seen.picture)
    assert [len(line) for line in drawn.plain.splitlines()] == [48] * 16
    colours = {str(span.style) for span in drawn.spans}
    assert len(colours) > 5


def test_what_is_no_run_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="expected a run folder"):
        Following(tmp_path)


class Watching:
    """What `labrig watch` does, look by look."""

    def __init__(self, run: Path) -> None:
        self.following, self.news = Following(run), News()
        self.server = WatchServer(self.news)

    def look(self) -> None:
        if self.following.look():
            latest = self.following.latest
            picture = None if latest is None else jpeg(latest.picture)
            self.news.tell(self.following.state(), picture)


@pytest.fixture
def watching(growing: Growing) -> Iterator[Watching]:
    made = Watching(growing.path)
    with made.server, made.server.running():
        made.look()
        yield made
        made.news.end()


def test_nobody_else_gets_to_see_it(watching: Watching) -> None:
    place = urlsplit(watching.server.url)
    assert place.hostname == "127.0.0.1"
    for path, host in (("/events", place.netloc), (f"{place.path}events", "evil.example")):
        connection = http.client.HTTPConnection("127.0.0.1", place.port or 0, timeout=10)
        connection.request("GET", path, headers={"Host": host})
        assert connection.getresponse().status == 403
        connection.close()


def dots(chromium: Chrome) -> int:
    return len(chromium.find_elements(By.CSS_SELECTOR, "#plot .marker"))


def text(chromium: Chrome, place: str) -> str:
    return chromium.find_element(By.ID, place).text


def test_the_page_follows_the_run_and_finds_back(
    growing: Growing, watching: Watching, chromium: Chrome, tmp_path: Path
) -> None:
    wait = WebDriverWait(chromium, PATIENCE_S, poll_frequency=0.02)
    growing.grow_until(b'"unit": "decay-1"')
    with FileLock(growing.path / ".lock"):
        watching.look()
        chromium.get(watching.server.url)
        wait.until(lambda _: text(chromium, "state") == "running")
        assert dots(chromium) == 0
        for frames in (1, 2, 3):
            growing.grow_until(b'"purpose": "decay"')
            began = time.monotonic()
            watching.look()
            wait.until(lambda _: dots(chromium) == 2 * frames)  # noqa: B023
            assert time.monotonic() - began < PATIENCE_S
        shown = chromium.find_element(By.ID, "picture")
        wait.until(lambda _: float(str(shown.get_property("naturalWidth"))) > 50)
        keep(chromium, "watch-running", tmp_path)
        # every stream breaks, as when the PC was asleep; the page asks again by itself
        watching.news.end()
        wait.until(lambda _: "lost" in text(chromium, "state"))
        watching.news = watching.server.news = News()
        growing.grow_until(b'"purpose": "decay"')
        watching.look()
        wait.until(lambda _: dots(chromium) == 8)
        assert text(chromium, "state") == "running"
    growing.finish()
    watching.look()
    wait.until(lambda _: text(chromium, "state") == "processed")
    assert "0.03" in text(chromium, "results")
    assert "the report is" in text(chromium, "steps")
    keep(chromium, "watch-finished", tmp_path)
    logged = chromium.get_log("browser")  # type: ignore[no-untyped-call]
    assert all("events" in entry["message"] for entry in logged), logged
    for width in (1200, 800, 400):
        chromium.set_window_size(width, 900)
        too_wide = chromium.execute_script(
            "return document.documentElement.scrollWidth - innerWidth"
        )
        assert too_wide <= 0
        keep(chromium, f"watch-{width}", tmp_path)


def keep(chromium: Chrome, name: str, tmp_path: Path) -> None:
    chromium.save_screenshot(str(Path(SCREENSHOTS or tmp_path) / f"{name}.png"))
