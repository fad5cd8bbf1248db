"""The live view's server and its loop: what a browser gets, and what others do not."""

import http.client
import json
import os
import signal
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import cv2
import numpy as np
import pytest

from labrig.acquire import read_protocol
from labrig.foundation.clock import Interrupted, SystemClock
from labrig.foundation.errors import DeviceError, UsageError
from labrig.foundation.region import CENTRE
from labrig.local_server import KINDS
from labrig.setup.picture_stats import decode, picture_stats, sharpness
from labrig.setup.view import PAGES, EditableProtocol, LivePictures, ViewServer, serve_pictures
from tests.conftest import Ended

BLUE = {"patches": [{"name": "blue paint", "region": [0.1, 0.2, 0.3, 0.4]}]}


def jpeg(value: int = 128) -> bytes:
    return bytes(cv2.imencode(".jpg", np.full((40, 60, 3), value, np.uint8))[1])


class Eye:
    """A camera with a live view; counts how often it is looked through, and by which thread."""

    def __init__(self) -> None:
        self.threads: list[int] = []

    def identity(self) -> str:
        return "eye"

    def preview(self) -> bytes:
        self.threads.append(threading.get_ident())
        return jpeg()

    def make_safe(self) -> None:
        pass

    def disconnect(self) -> None:
        pass


@dataclass(frozen=True)
class Answer:
    status: int
    kind: str
    body: bytes
    headers: dict[str, str]

    def error(self) -> str:
        text = json.loads(self.body)["error"]
        assert "\n" not in text
        return str(text)


@dataclass(frozen=True)
class Browser:
    server: ViewServer
    eye: Eye
    protocol: Path

    def ask(
        self,
        path: str,
        body: bytes | None = None,
        token: str | None = None,
        headers: dict[str, str] | None = None,
    ) -> Answer:
        url = urlsplit(self.server.url)
        assert url.hostname == "127.0.0.1"
        line = http.client.HTTPConnection(url.hostname, url.port or 0, timeout=20)
        target = f"/{self.server.token if token is None else token}/{path}"
        default = {} if body is None else {"Content-Type": "application/json"}
        line.request("GET" if body is None else "POST", target, body, default | (headers or {}))
        answer = line.getresponse()
        data = answer.read()
        line.close()
        return Answer(
            answer.status, answer.headers.get_content_type(), data, dict(answer.headers.items())
        )

    def post(self, content: object, **headers: str) -> Answer:
        return self.ask("patches", json.dumps(content).encode(), headers=headers)


@pytest.fixture
def browser(make_protocol: Callable[..., Path]) -> Iterator[Browser]:
    pictures, eye, clock = LivePictures(), Eye(), SystemClock()
    path = make_protocol()
    server = ViewServer(pictures, EditableProtocol(path), "test rig")

    def look() -> None:
        with pytest.raises(Interrupted):
            serve_pictures(pictures, eye, clock)

    looking = threading.Thread(target=look)
    with server.running():
        looking.start()
        yield Browser(server, eye, path)
        clock.interrupt(signal.SIGINT)
        looking.join(10)
    assert not looking.is_alive()


def test_the_page_is_whole_and_asks_nobody_else(browser: Browser) -> None:
    for name, file in PAGES.items():
        answer = browser.ask(name)
        assert answer.status == 200
        assert answer.kind == KINDS[file.suffix].partition(";")[0]
        assert b"http" not in answer.body
        assert "default-src 'self'" in answer.headers["Content-Security-Policy"]
    page = browser.ask("").body.decode()
    for name in PAGES:
        assert name in page or name == "view_regions.js"


def test_pictures_are_fetched_when_asked_for_and_by_one_thread(browser: Browser) -> None:
    assert browser.eye.threads == []
    first = browser.ask("frame.jpg")
    second = browser.ask(f"frame.jpg?after={first.headers['X-Picture']}")
    assert (first.kind, second.kind) == ("image/jpeg", "image/jpeg")
    assert int(second.headers["X-Picture"]) > int(first.headers["X-Picture"])
    assert decode(first.body).shape == (40, 60, 3)
    assert len(browser.eye.threads) == 2
    assert len(set(browser.eye.threads)) == 1


def test_statistics_of_the_last_picture(browser: Browser) -> None:
    assert browser.ask("stats").status == 503
    browser.ask("frame.jpg")
    stats = json.loads(browser.ask("stats?region=0.25,0.25,0.5,0.5").body)
    assert (stats["width"], stats["height"], stats["number"]) == (60, 40, 1)
    assert stats["clipped"] == [0, 0, 0]
    assert [channel[64] for channel in stats["histogram"]] == [1, 1, 1]
    assert stats["region_focus"] == stats["focus"] == 0
    for wrong in ("1,2", "a,b,c,d", "0.9,0.9,0.5,0.5", "0,0,0,0"):
        answer = browser.ask(f"stats?region={wrong}")
        assert answer.status == 400
        assert answer.error()


def test_regions_are_written_into_the_protocol(browser: Browser) -> None:
    told = json.loads(browser.ask("patches").body)
    assert told["patches"] == [{"name": "sample", "region": list(CENTRE)}]
    assert told["rig"] == "test rig"
    assert told["protocol"] == "protocol.yaml"
    assert browser.post(BLUE).status == 200
    assert read_protocol(browser.protocol).model_dump()["patches"] == {
        "blue paint": (0.1, 0.2, 0.3, 0.4)
    }
    assert json.loads(browser.ask("patches").body)["patches"] == BLUE["patches"]


def patch(name: Any, *region: Any) -> dict[str, Any]:
    return {"name": name, "region": list(region)}


@pytest.mark.parametrize(
    "content",
    [
        [],
        {},
        {"patches": []},
        {"patches": [patch("", 0, 0, 1, 1)]},
        {"patches": [patch("a\nb", 0, 0, 1, 1)]},
        {"patches": [patch("a", 0, 0, 1)]},
        {"patches": [patch("a", 0, 0, 1, "wide")]},
        {"patches": [patch("a", 0, 0, 0, 1)]},
        {"patches": [patch("a", -0.1, 0, 0.5, 1)]},
        {"patches": [patch("a", 0.6, 0, 0.5, 1)]},
        {"patches": [patch("a", 10, 10, 64, 64)]},
        {"patches": [patch("a", 0, 0, 1, float("nan"))]},
        {"patches": [patch("a", 0, 0, 1, 1), patch("a", 0, 0, 0.5, 0.5)]},
        {"patches": [patch("a", 0, 0, 1, 1)], "more": 1},
    ],
    ids=str,
)
def test_wrong_regions_are_one_line_and_nothing_is_written(
    browser: Browser, content: object
) -> None:
    before = browser.protocol.read_bytes()
    answer = browser.post(content)
    assert answer.status == 400
    assert answer.error()
    assert browser.protocol.read_bytes() == before


@pytest.mark.parametrize("body", [b"", b"{", b"\xff\xfe", b"[" * 30_000, b"x" * 70_000])
def test_what_is_no_json_is_refused(browser: Browser, body: bytes) -> None:
    answer = browser.ask("patches", body)
    assert answer.status == 400
    assert "JSON" in answer.error()
    assert browser.ask("patches").status == 200


def test_only_this_page_is_answered(browser: Browser) -> None:
    port = browser.server.server_port
    before = browser.protocol.read_bytes()
    for path in ("", "frame.jpg", "patches", "stats"):
        assert browser.ask(path, token="guess").status == 403
        assert browser.ask(path, headers={"Host": f"evil.example:{port}"}).status == 403
        assert browser.ask(path, headers={"Host": "127.0.0.1"}).status == 403
    evil = {"Host": f"evil.example:{port}"}
    body = json.dumps(BLUE).encode()
    assert browser.ask("patches", body, headers=evil).status == 403
    assert browser.ask("patches", body, token="guess").status == 403
    # what a foreign page can send without asking: a form, or plain text
    assert browser.ask("patches", body, headers={"Content-Type": "text/plain"}).status == 400
    assert browser.ask("../view.py").status == 404
    assert browser.ask("frame.jpg", body).status == 404
    assert browser.protocol.read_bytes() == before
    assert browser.eye.threads == []
    assert browser.ask("", headers={"Host": f"localhost:{port}"}).status == 200


def test_without_a_protocol_nothing_is_written() -> None:
    server = ViewServer(LivePictures(), None, "rig")
    with server.running():
        browser = Browser(server, Eye(), Path())
        assert json.loads(browser.ask("patches").body)["protocol"] is None
        assert browser.post(BLUE).status == 404


def test_a_port_that_is_taken_is_named() -> None:
    with (
        ViewServer(LivePictures(), None, "rig") as first,
        pytest.raises(UsageError, match=f"port {first.server_port}"),
    ):
        ViewServer(LivePictures(), None, "rig", first.server_port)


def test_regions_in_pixels_are_distinguished(make_protocol: Callable[..., Path]) -> None:
    patches = {"a": [0, 0, 0.5, 1], "b": [700, 400, 64, 64]}
    protocol = EditableProtocol(make_protocol(patches=patches))
    assert [region["name"] for region in protocol.in_fractions()] == ["a"]
    assert protocol.in_pixels() == ["b"]


class TestStatistics:
    def test_clipping_by_channel_and_in_a_region(self) -> None:
        picture = np.zeros((20, 20, 3), np.uint8)
        picture[:10, :, 0] = 255
        picture[0, 0, 2] = 250
        stats = picture_stats(picture, (0, 0, 0.5, 0.5))
        assert stats.clipped == pytest.approx((0.5, 0, 1 / 400))
        assert stats.region_clipped == 1
        assert [sum(channel) for channel in stats.histogram] == pytest.approx([1, 1, 1])

    def test_focus_falls_with_blur_and_not_with_light(self) -> None:
        rng = np.random.default_rng(1)
        sharp = rng.integers(40, 80, (100, 150, 3)).astype(np.uint8)
        blurred = [cv2.GaussianBlur(sharp, (0, 0), sigma) for sigma in (0.7, 1.5, 3.0)]
        values = [sharpness(picture.astype(np.uint8)) for picture in (sharp, *blurred)]
        assert values == sorted(values, reverse=True)
        assert sharpness(sharp * np.uint8(2)) == pytest.approx(values[0], rel=0.02)
        assert sharpness(np.zeros((4, 4, 3), np.uint8)) == 0

    @pytest.mark.parametrize("data", [b"", b"no picture"])
    def test_what_is_no_jpeg(self, data: bytes) -> None:
        with pytest.raises(DeviceError, match="JPEG"):
            decode(data)


class TestCommand:
    def test_ctrl_c_ends_it_in_one_line(
        self,
        labrig: Callable[..., Ended],
        make_rig: Callable[..., Path],
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        seen = []

        def look_and_interrupt(url: str) -> None:
            parts = urlsplit(url)
            line = http.client.HTTPConnection(parts.hostname or "", parts.port or 0, timeout=20)
            line.request("GET", f"{parts.path}frame.jpg")
            seen.append(decode(line.getresponse().read()).shape)
            line.close()
            os.kill(os.getpid(), signal.SIGINT)

        def open_in_another_thread(url: str) -> None:
            threading.Thread(target=look_and_interrupt, args=(url,), daemon=True).start()

        monkeypatch.setattr("webbrowser.open", open_in_another_thread)
        ended = labrig("rig", "view", make_rig())
        assert seen == [(32, 48, 3)]
        assert ended.code == 130
        assert ended.err == "labrig: interrupted\n"

    @pytest.mark.parametrize(
        ("more", "said"),
        [
            (["--protocol", "none.yaml"], "none.yaml: no such protocol file"),
            (["--protocol", "decay"], "copy a shipped one first"),
            (["--port", "70000"], "see labrig rig view --help"),
        ],
    )
    def test_wrong_usage(self, labrig: Callable[..., Ended], more: list[str], said: str) -> None:
        ended = labrig("rig", "view", "sim", "--no-browser", *more)
        assert ended.code == 2
        assert said in ended.err
        assert len(ended.err.splitlines()) == 1
