"""The webcam that only aims, on pictures instead of a stream."""

from pathlib import Path
from typing import cast

import cv2
import numpy as np
import pytest

from labrig.acquire import ROLES, LiveView
from labrig.acquire.connections import Connections
from labrig.drivers.uvc_preview import UvcPreview
from labrig.foundation.errors import DeviceError


def eye(address: str) -> UvcPreview:
    nothing = cast(Connections, None)
    return UvcPreview(address, UvcPreview.Settings(), nothing)


@pytest.fixture
def film(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """Address of a stream of two pictures, one dark and one bright."""
    for number, value in enumerate((40, 200)):
        picture = np.full((48, 64, 3), value, np.uint8)
        assert cv2.imwrite(str(tmp_path / f"frame{number:03d}.png"), picture)
    pictures, opened = str(tmp_path / "frame%03d.png"), cv2.VideoCapture
    monkeypatch.setattr(cv2, "VideoCapture", lambda stream: opened(pictures))
    return "http://camera/stream.mjpg"


def brightness(jpeg: bytes) -> float:
    picture = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)
    assert picture is not None
    assert picture.shape == (48, 64, 3)
    return float(np.mean(picture))


def test_shows_one_picture_after_the_other(film: str) -> None:
    camera = eye(film)
    assert isinstance(camera, LiveView)
    assert ROLES["viewfinder"].protocol_class is LiveView
    assert brightness(camera.preview()) == pytest.approx(40, abs=1)
    assert brightness(camera.preview()) == pytest.approx(200, abs=1)
    camera.make_safe()
    assert brightness(camera.preview()) == pytest.approx(40, abs=1), "opened anew"
    camera.disconnect()


def test_nothing_is_opened_before_somebody_looks() -> None:
    camera = eye("uvc://97")
    assert "uvc://97" in camera.identity()
    camera.make_safe()
    camera.disconnect()
    with pytest.raises(DeviceError, match="cannot open uvc://97"):
        camera.preview()


def test_the_end_of_the_pictures_is_reported(film: str) -> None:
    camera = eye(film)
    for _ in range(2):
        camera.preview()
    with pytest.raises(DeviceError, match="expected a picture"):
        camera.preview()


@pytest.mark.parametrize(
    "address", ["uvc://webcam", "uvc://²", "frame%03d.png", "/dev/zero", "filesrc ! filesink"]
)
def test_an_address_of_anything_else_is_refused(address: str) -> None:
    with pytest.raises(DeviceError, match="uvc://0 for the first"):
        eye(address)
