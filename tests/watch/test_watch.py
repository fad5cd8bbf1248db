"""A run watched from outside the dark room, while its folder grows."""

import http.client
import json
import os
import re
import shutil
import signal
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from threading import Timer
from urllib.parse import urlsplit

import pytest
from filelock import FileLock
from selenium.webdriver import Chrome
from selenium.webdriver.common.by import By
from selenium.webdriver.support.wait import WebDriverWait

from labrig.acquire import read_protocol
from labrig.bench import resume_run
from labrig.cli.exit_codes import guarded
from labrig.cli.progress import thumbnail
from labrig.foundation import resources
from labrig.foundation.clock import Interrupted, SystemClock
from labrig.foundation.errors import UsageError
from labrig.foundation.yaml_file import read_yaml, yaml_text
from labrig.record import (
    UNDONE,
    ActionRecord,
    RunFolder,
    read_journal,
    read_run,
    sealed_line,
)
from labrig.watch.previews import Previews
from labrig.watch.run_follower import RunFollower, State
from labrig.watch.server import UpdateFeed, WatchServer, watch_run
from tests.analyse.recorded import quietly
from tests.recordings import runs as recordings

SCREENSHOTS = os.environ.get("LABRIG_SCREENSHOTS")
PATIENCE_S = 20
#: A chain of three parts.
CHAIN_RUN = recordings.HERE / "chain" / recordings.RUN


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A processed run with two patches."""
    folder = tmp_path_factory.mktemp("finished")
    rig = read_yaml(resources.folder("config") / "sim.yaml")
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
        if (self._finished / "result").is_dir():
            shutil.copytree(self._finished / "result", self.path / "result")


@pytest.fixture
def growing(finished: Path, tmp_path: Path) -> Growing:
    return Growing(finished, tmp_path / "growing")


def settled(following: RunFollower) -> State:
    """What there is to tell once all frames were looked at."""
    while following.look():
        pass
    return following.state()


def unit_states(state: State) -> list[str]:
    return [unit["state"] for unit in state["units"].values()]


def test_what_is_done_and_what_comes(growing: Growing) -> None:
    following = RunFollower(growing.path)
    assert settled(following)["run"]["status"] == "interrupted"
    growing.grow_until(b'"unit": "decay-1"')
    growing.grow_until(b'"role": "decay"')
    with FileLock(growing.path / ".lock"):
        assert following.look()
        state = settled(following)
        assert not following.look()
    assert state["run"]["status"] == "running"
    assert unit_states(state) == ["done", "now"]
    now = state["run"]["now"]
    assert [step["what"].split(",")[0] for step in now["done"]] == ["lamp off", "decay frame"]
    assert {step["what"].split(",")[0] for step in now["next"]} == {"decay frame"}
    # the plan begins before the lamp was on, the frames come after it was off
    assert 900 < now["at_s"] < now["next"][0]["at_s"] <= now["until_s"] < 1000
    assert [point["patch"] for (points) in state["points"].values() for point in points] == [
        "left",
        "right",
    ]
    assert state["frame"]["role"] == "decay"
    assert state["results"] == {}


def test_the_points_are_the_decay(growing: Growing) -> None:
    growing.finish()
    state = settled(RunFollower(growing.path))
    assert state["run"]["status"] == "processed"
    assert sorted(state["results"]) == ["left", "right"]
    frames = read_run(growing.path).frames("decay")
    left = [
        point
        for frame in frames
        for point in state["points"][frame.path.name]
        if point["patch"] == "left"
    ]
    assert len(left) == len(frames) == len(state["points"])
    assert left[0]["t_s"] == pytest.approx(0.56, abs=0.05)
    greens = [point["dn_per_s"]["G"] for point in left]
    assert greens == sorted(greens, reverse=True)
    # before dark frames are subtracted, and so within a few per cent of the result
    series = (growing.path / "result" / "left" / "series.csv").read_text().splitlines()
    column = series[0].split(",").index("G (DN/s)")
    assert greens[0] == pytest.approx(float(series[1].split(",")[column]), rel=0.05)


def test_a_frame_that_cannot_be_read_is_passed_over(growing: Growing) -> None:
    growing.finish()
    *_, before, last = sorted((growing.path / "frames").iterdir())
    last.write_bytes(b"no frame")
    assert settled(RunFollower(growing.path))["frame"]["name"] == before.name


def test_a_chain_is_reported_by_its_parts(tmp_path: Path) -> None:
    growing = Growing(CHAIN_RUN, tmp_path)
    growing.finish()
    state = settled(RunFollower(growing.path))
    names = [unit["name"] for unit in state["units"].values()]
    assert names[:2] == ["emission_spectrum/dark", "emission_spectrum/meter-halogen"]
    assert set(unit_states(state)) == {"done"}
    # the patches are those of the part
    frames = read_run(growing.path).frames("decay")
    told = [(point["unit"], point["patch"]) for p in state["points"].values() for point in p]
    assert told == [("decay/decay-1", "sample")] * len(frames)


def test_what_takes_longer_than_planned_is_still_to_come(tmp_path: Path) -> None:
    growing = Growing(CHAIN_RUN, tmp_path)
    growing.grow_until(b'"unit": "emission_spectrum/dark"')
    with FileLock(growing.path / ".lock"):
        now = settled(RunFollower(growing.path))["run"]["now"]
        # nobody knows how long a person takes: the plan waits there
        assert now["next"][0]["what"].startswith("by hand: put the variable filter")
        assert now["until_s"] == now["next"][0]["at_s"]
        assert now["done"] == []
        growing.grow_until(b'"device": "person"')
        now = settled(RunFollower(growing.path))["run"]["now"]
    assert [step["what"] for step in now["done"]] == [
        "by hand: put the variable filter before the camera"
    ]
    assert not any("by hand" in step["what"] for step in now["next"])


def test_what_was_cut_off_counts_no_more_until_it_is_done_again(
    finished: Path, tmp_path: Path
) -> None:
    run = Path(shutil.copytree(finished, tmp_path / finished.name))
    shutil.rmtree(run / "result")
    lines = (run / "journal.jsonl").read_bytes().splitlines(keepends=True)
    cut_at = 3 + next(n for n, line in enumerate(lines) if b'"role": "decay"' in line)
    (run / "journal.jsonl").write_bytes(b"".join(lines[:cut_at]))
    for path in (run / "frames").iterdir():
        if path.name.encode() not in b"".join(lines[:cut_at]):
            path.unlink()
    following = RunFollower(run)
    with FileLock(run / ".lock"):
        assert len(settled(following)["points"]) == 3
    state = settled(following)
    assert (state["run"]["status"], state["run"]["now"]) == ("interrupted", None)
    assert unit_states(state) == ["done", "again"]
    assert state["points"] == {}
    assert state["run"]["discarded_frames"] == 3
    (trouble,) = state["troubles"].values()
    assert trouble == {"unit": "decay-1", "reason": "labrig was cut off", "mended": False}
    resume_run(run, quietly)
    state = settled(following)
    assert (state["run"]["status"], unit_states(state)) == ("recorded", ["done", "done"])
    assert state["units"]["1"]["tries"] == 2
    assert [trouble["mended"] for trouble in state["troubles"].values()] == [True]
    assert state["run"]["discarded_frames"] == 3
    assert len(state["points"]) == len(read_run(run).frames("decay"))


def test_what_is_taken_back_is_to_be_done_again(tmp_path: Path) -> None:
    growing = Growing(CHAIN_RUN, tmp_path)
    growing.grow_until(b'"unit": "emission_spectrum/spectrum-halogen"')
    growing.grow_until(b'"name": "stop"')
    wrong = "emission_spectrum/meter-halogen"
    with RunFolder(growing.path) as folder:
        following = RunFollower(growing.path)
        before = settled(following)
        last_time = before["run"]["last_time"]
        assert unit_states(before)[:3] == ["done"] * 3
        unit = "emission_spectrum/put-back"
        writer = folder.attempt(unit, lambda: last_time, {})
        writer.action(ActionRecord(unit, UNDONE, wrong, last_time, last_time, 0.0))
        writer.stop("abort", f"taken back: 'put it there'; {wrong} is done again")
        state = settled(following)
    assert unit_states(state)[:5] == ["done", "again", "done", "again", "to do"]
    assert [trouble["unit"] for trouble in state["troubles"].values()] == [unit]
    assert state["run"]["frames"] + state["run"]["discarded_frames"] == before["run"]["frames"]
    assert state["run"]["discarded_frames"] > 0


def test_another_process_looks_at_frames_and_runs_nothing_that_lies_about(
    finished: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "numpy.py").write_text("open('was-run', 'w')\n")
    monkeypatch.chdir(tmp_path)
    glances = Previews(finished, 48)
    try:
        glances.ask("nothing.dng", "dark")
        glances.ask("000005.dng", "dark")
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
        RunFollower(tmp_path)


class Watching:
    """What `labrig watch` does, look by look."""

    def __init__(self, run: Path) -> None:
        self.following = RunFollower(run)
        self.news = UpdateFeed(settled(self.following), self.following.picture)
        self.server = WatchServer(run, self.news)

    def look(self) -> None:
        self.news.tell(settled(self.following), self.following.picture)


@contextmanager
def watched(run: Path) -> Iterator[Watching]:
    made = Watching(run)
    with made.server, made.server.running():
        yield made
        made.news.end()


@pytest.fixture
def watching(growing: Growing) -> Iterator[Watching]:
    with watched(growing.path) as made:
        yield made


def test_the_run_is_there_as_soon_as_the_address_is_reported(growing: Growing) -> None:
    growing.finish()
    clock, seen = SystemClock(), []

    def tell(url: str) -> None:
        seen.append(first_news(url))
        clock.interrupt(signal.SIGINT)

    with pytest.raises(Interrupted):
        watch_run(growing.path, 0, clock, tell)
    assert unit_states(seen[0]) == ["done", "done"]
    assert seen[0]["frame"]["name"] == "000016.dng"


@pytest.mark.skipif(os.name == "nt", reason="Windows sends no signal to this process")
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_ctrl_c_ends_it_whatever_python_is_doing(growing: Growing) -> None:
    """Python drops an exception that is raised while it deletes an object."""
    growing.finish()
    clock = SystemClock()

    class Deleted:
        def __del__(self) -> None:
            os.kill(os.getpid(), signal.SIGINT)

    def tell(_: str) -> None:
        Deleted()

    late = Timer(10.0, clock.interrupt, [signal.SIGTERM])
    late.start()
    with pytest.raises(Interrupted) as caught:
        watch_run(growing.path, 0, clock, tell)
    late.cancel()
    assert caught.value.signum == signal.SIGINT


def test_nobody_else_gets_to_see_it(watching: Watching) -> None:
    place = urlsplit(watching.server.url)
    assert place.hostname == "127.0.0.1"
    for path, host in (("/events", place.netloc), (f"{place.path}events", "evil.example")):
        connection = http.client.HTTPConnection("127.0.0.1", place.port or 0, timeout=10)
        connection.request("GET", path, headers={"Host": host})
        assert connection.getresponse().status == 403
        connection.close()


def test_the_report_and_its_figures_are_served_and_nothing_else(watching: Watching) -> None:
    result = watching.following.run / "result"
    assert answered(watching, "result/report.html")[0] == 400
    (result / "figures").mkdir(parents=True)
    for name in ("report.html", "figures/1-laws.svg", "fit.json"):
        (result / name).write_text(name)
    assert answered(watching, "result/report.html") == (200, b"report.html")
    assert answered(watching, "result/figures/1-laws.svg") == (200, b"figures/1-laws.svg")
    for name in ("fit.json", "figures/../../journal.jsonl", "figures/..%2f1-laws.svg"):
        assert answered(watching, f"result/{name}")[0] == 404
    (result / "figures" / "2-laws.svg").symlink_to(watching.following.run / "journal.jsonl")
    assert answered(watching, "result/figures/2-laws.svg")[0] == 400


def answered(watching: Watching, path: str) -> tuple[int, bytes]:
    """The status and the content of the answer to a path."""
    place = urlsplit(watching.server.url)
    connection = http.client.HTTPConnection("127.0.0.1", place.port or 0, timeout=PATIENCE_S)
    connection.request("GET", f"{place.path}{path}")
    answer = connection.getresponse()
    content = answer.read()
    connection.close()
    return answer.status, content


@dataclass(frozen=True)
class Message:
    size_bytes: int
    number: int
    things: State


@contextmanager
def connected(url: str, headers: dict[str, str] | None = None) -> Iterator[Callable[[], Message]]:
    """The stream of news; gives the next message and its size in bytes."""
    place = urlsplit(url)
    connection = http.client.HTTPConnection("127.0.0.1", place.port or 0, timeout=PATIENCE_S)
    connection.request("GET", f"{place.path}events", headers=headers or {})
    stream = connection.getresponse()

    def message() -> Message:
        lines = b""
        while not lines.endswith(b"\n\n") or b"data: " not in lines:
            line = stream.readline()
            assert line, "the stream has ended"
            lines += line
        data = lines.partition(b"data: ")[2]
        return Message(len(lines), **json.loads(data))

    yield message
    stream.close()
    connection.close()


def first_news(url: str) -> State:
    """What stands in the page itself."""
    place = urlsplit(url)
    connection = http.client.HTTPConnection("127.0.0.1", place.port or 0, timeout=PATIENCE_S)
    connection.request("GET", place.path)
    page = connection.getresponse().read().decode()
    connection.close()
    (news,) = re.findall(r'<script id="first" type="application/json">(.*?)</script>', page)
    things: State = json.loads(news)["things"]
    return things


#: As names may be.
LONG = "strontium_aluminate_powder_in_clear_varnish_thick"


class Written:
    """A chain of many decays, written frame by frame; all are the same picture."""

    FRAMES_EACH = 50

    def __init__(self, place: Path, finished: Path, name: str) -> None:
        self.path = place / "run"
        (self.path / "frames").mkdir(parents=True)
        self._frame = next((finished / "frames").iterdir())
        shutil.copy(finished / "rig.yaml", self.path)
        part = {
            "protocol": "decay", "charge": "10 s", "exposure": "1 s", "for": "300 s", "repeats": 12,
            "dark": "background", "background": [0.0, 0.0, 0.1, 0.1],
            "patches": {LONG: [0.1, 0.2, 0.3, 0.6], f"{LONG}2": [0.6, 0.2, 0.3, 0.6]},
        }  # fmt: skip
        parts = [part | {"part": f"decay of {LONG} {n}"} for n in range(5)]
        protocol = {"protocol": "phosphor", "sample": {"name": name}, "parts": parts}
        (self.path / "protocol.yaml").write_text(yaml_text(protocol))
        self._names = [unit.name for unit in read_protocol(self.path / "protocol.yaml").units()]
        self._units = iter(self._names)
        self._time = 1.8e9
        self.frames = self.of_decays = 0
        self._in_unit = self.FRAMES_EACH
        self._unit = self._seal = ""
        self._events = Counter[str]()
        self._descriptors = {
            doc["name"]: {key: value for key, value in doc.items() if key != "time"}
            for kind, doc in read_journal(finished / "journal.jsonl").documents
            if kind == "descriptor"
        }

    def _append(self, kind: str, /, **doc: object) -> None:
        self._time += 1.0
        line = sealed_line(kind, {"time": self._time} | doc, self._seal)
        with (self.path / "journal.jsonl").open("ab") as journal:
            journal.write(line)
        self._seal = sha256(line[:-1]).hexdigest()

    def _event(self, stream: str, **data: object) -> None:
        self._events[stream] += 1
        stamps = dict.fromkeys(data, self._time + 1.0)
        number, descriptor = self._events[stream], f"{self._unit} {stream}"
        self._append(
            "event", descriptor=descriptor, data=data, timestamps=stamps, seq_num=number, filled={}
        )

    def _happens(self) -> dict[str, float]:
        return {"start_time": self._time, "end_time": self._time, "late_s": 0.0}

    def _next_unit(self) -> None:
        if self._unit:
            self._append(
                "stop", uid="", run_start=self._unit, exit_status="success", num_events=self._events
            )
        self._unit, self._in_unit = next(self._units), 0
        self._append("start", uid=self._unit, unit=self._unit)
        self._events = Counter[str]()
        for stream in ("actions", "frames"):
            mine = {"uid": f"{self._unit} {stream}", "run_start": self._unit}
            self._append("descriptor", **self._descriptors[stream] | mine)
        self._event("actions", device="lamp", action="off", task="", **self._happens())

    def shoot(self, role: str = "decay") -> None:
        """One frame more."""
        if self._in_unit == self.FRAMES_EACH:
            self._next_unit()
        self.frames, self._in_unit = self.frames + 1, self._in_unit + 1
        self.of_decays += role == "decay"
        name = f"frames/{self.frames:06d}.dng"
        (self.path / name).hardlink_to(self._frame)
        settings = {"exposure_s": 1.0, "iso": 100, "f_number": 4.0, "role": role}
        kept = {"frame": name, "sha256": "", "size_bytes": 1, "disk_s": 0.0}
        self._event("frames", **kept, **settings, **self._happens())


@pytest.mark.campaign
def test_what_is_sent_for_a_frame_does_not_grow_with_the_run(
    finished: Path, tmp_path: Path
) -> None:
    written = Written(tmp_path, finished, "<b>paint</b> </script>")
    sizes = {}
    with FileLock(written.path / ".lock"):
        for _ in range(9):
            written.shoot()
        with watched(written.path) as watching:
            assert first_news(watching.server.url)["run"]["sample"] == "<b>paint</b> </script>"
            with connected(watching.server.url) as message:
                assert len(message().things["points"]) == 9
                for count in (10, 11, 1010, 1011):
                    while written.frames < count - 1:  # one of a decay takes 20 ms to look at
                        written.shoot("decay" if written.frames % 5 == 0 else "dark")
                    if count == 1010:
                        watching.look()
                        message()
                    written.shoot()
                    watching.look()
                    told = message()
                    assert list(told.things["points"]) == [f"{count:06d}.dng"]
                    assert told.things["run"]["frames"] == count
                    assert "units" not in told.things
                    sizes[count] = told.size_bytes
            # who comes late is told all of it, once; who comes back, what was missed
            with connected(watching.server.url) as message:
                everything = message()
                assert len(everything.things["points"]) == written.of_decays > 200
                assert len(everything.things["units"]) == 60
                written.shoot()
                watching.look()
                assert len(message().things["points"]) == 1
            known = {"Last-Event-ID": str(everything.number)}
            with connected(watching.server.url, known) as message:
                assert list(message().things["points"]) == ["001012.dng"]
            assert first_news(watching.server.url)["run"]["frames"] == written.frames
    print(sizes, everything.size_bytes)
    assert sizes[10] < 2000
    # a digit more here and there, and no more
    assert sizes[1010] < sizes[10] + 100
    assert sizes[1011] < sizes[11] + 60
    assert everything.size_bytes > 50 * sizes[10]


#: Pairs of texts of which one lies over the other, and texts that stick out of the window.
COVERED = """
const list = document.getElementById("units");
list.style.maxHeight = "none";
for (const part of list.querySelectorAll("details")) part.open = true;
const texts = [];
const walker = document.createTreeWalker(document.getElementById("page"), NodeFilter.SHOW_TEXT);
while (walker.nextNode()) {
  const node = walker.currentNode, range = document.createRange();
  range.selectNodeContents(node);
  if (!node.data.trim() || !node.parentElement.checkVisibility()) continue;
  for (const { left, right, top, bottom } of range.getClientRects())
    texts.push({ text: node.data.trim(), node, left, right, top: top + 2, bottom: bottom - 2 });
}
const found = texts.filter((a) => a.left < 0 || a.right > innerWidth).map((a) => a.text);
for (const a of texts) for (const b of texts)
  if (a.node !== b.node && a.left < b.right - 1 && b.left < a.right - 1 && a.top < b.bottom
      && b.top < a.bottom) found.push(`${a.text} | ${b.text}`);
return found;
"""


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
            growing.grow_until(b'"role": "decay"')
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
        growing.grow_until(b'"role": "decay"')
        watching.news = watching.server.news = UpdateFeed(
            settled(watching.following), watching.following.picture
        )
        wait.until(lambda _: dots(chromium) == 8)
        assert text(chromium, "state") == "running"
    growing.finish()
    watching.look()
    wait.until(lambda _: text(chromium, "state") == "processed")
    assert "0.03" in text(chromium, "results")
    keep(chromium, "watch-finished", tmp_path)
    chromium.find_element(By.LINK_TEXT, "Open the report").click()
    wait.until(lambda _: chromium.title.startswith("two papers"))
    chromium.back()
    wait.until(lambda _: text(chromium, "state") == "processed")
    logged = chromium.get_log("browser")  # type: ignore[no-untyped-call]
    assert all("events" in entry["message"] for entry in logged), logged
    for width in (1200, 800, 400):
        chromium.set_window_size(width, 900)
        too_wide = chromium.execute_script(
            "return document.documentElement.scrollWidth - innerWidth"
        )
        assert too_wide <= 0
        keep(chromium, f"watch-{width}", tmp_path)


@pytest.fixture
def long_chain(finished: Path, tmp_path: Path) -> Iterator[Watching]:
    """A chain under way in its second part, of units and patches with long names."""
    written = Written(tmp_path, finished, " ".join([LONG] * 3))
    with FileLock(written.path / ".lock"):
        for _ in range(Written.FRAMES_EACH * 20):
            written.shoot("dark")
        written.shoot()
        with watched(written.path) as watching:
            yield watching


def test_the_page_shows_a_chain_by_its_parts(long_chain: Watching, chromium: Chrome) -> None:
    # nothing comes but the page itself: the run stands in it
    chromium.execute_cdp_cmd("Network.enable", {})
    chromium.execute_cdp_cmd("Network.setBlockedURLs", {"urls": ["*events*"]})
    chromium.set_window_size(420, 800)
    chromium.get(long_chain.server.url)
    wait = WebDriverWait(chromium, PATIENCE_S, poll_frequency=0.02)
    parts = wait.until(lambda page: page.find_elements(By.CSS_SELECTOR, "#units details"))
    assert [part.get_property("open") for part in parts] == [False, True, False, False, False]
    heads = [part.find_element(By.TAG_NAME, "summary").text for part in parts]
    assert [said.split("\n")[1].split(",")[0] for said in heads] == [
        "12 done", "8 of 12 done", "0 of 12 done", "0 of 12 done", "0 of 12 done",
    ]  # fmt: skip
    assert text(chromium, "unit") == f"decay of {LONG} 1/decay-9"
    assert "1001 of at most" in text(chromium, "frames")
    within = chromium.execute_script("""
        const list = document.getElementById("units").getBoundingClientRect();
        const now = document.querySelector("#units li.now").getBoundingClientRect();
        const head = document.querySelector("details[open] summary").getBoundingClientRect();
        return [list.top <= head.top, head.bottom <= now.top, now.bottom <= list.bottom];
    """)
    assert within == [True, True, True]
    # what a person unfolds stays unfolded
    parts[0].find_element(By.TAG_NAME, "summary").click()
    time.sleep(1.2)
    assert parts[0].get_property("open")


@pytest.mark.campaign
@pytest.mark.parametrize("width", [320, 400, 800, 1280])
def test_no_label_covers_another(
    long_chain: Watching, chromium: Chrome, width: int, tmp_path: Path
) -> None:
    chromium.set_window_size(width, 900)
    # the window itself cannot be so narrow
    metrics = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": False}
    chromium.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    chromium.get(long_chain.server.url)
    WebDriverWait(chromium, PATIENCE_S).until(lambda _: dots(chromium) == 2)
    keep(chromium, f"watch-long-{width}", tmp_path)
    assert chromium.execute_script(COVERED) == []


def keep(chromium: Chrome, name: str, tmp_path: Path) -> None:
    chromium.save_screenshot(str(Path(SCREENSHOTS or tmp_path) / f"{name}.png"))
