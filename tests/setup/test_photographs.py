"""What a rig check's photographs tell, of every kind of sensor. Oracle: the frame that was made."""

from collections.abc import Sequence

import cv2
import numpy as np
import pytest

from labrig.acquire import CameraCapabilities, ExerciseContext, Exercised, ExposureSettings, Frame
from labrig.acquire.roles.camera import exercise_camera
from labrig.foundation.clock import VirtualClock
from labrig.foundation.errors import FrameError
from labrig.reduce import read_raw
from labrig.setup.check import Photographs
from labrig.setup.picture_stats import decode, picture_stats
from tests.reduce.conftest import _dng as write_dng

X_TRANS = "GGRGGBGGBGGRBRGRBGGGBGGRGGRGGBRBGBRG"
CHANNELS = {"RGGB": "RGB", X_TRANS: "RGB", "RRGGRRGGGGBBGGBB": "RGB", "L": "L"}
BLACK = 1000
TURNED = (274, "H", 1, 6)
every_sensor = pytest.mark.parametrize("cfa", CHANNELS, ids=["Bayer", "X-Trans", "quad", "mono"])


def dark_frame(
    cfa: str, above_dn: float = 0.0, tags: Sequence[tuple[int, str, int, int]] = ()
) -> bytes:
    pixels = np.random.default_rng(1).normal(BLACK + above_dn, 5.0, (96, 144))
    return write_dng(np.rint(pixels), cfa, (BLACK,) * (1 if cfa == "L" else 4), tags=tags)


class StillCamera:
    """Takes 60 ms to open its shutter and 270 ms to deliver; always the same frame."""

    def __init__(self, clock: VirtualClock, data: bytes) -> None:
        self._clock = clock
        self._data = data
        self._settings = ExposureSettings(1.0, 100)

    def identity(self) -> str:
        return "still camera"

    def capabilities(self) -> CameraCapabilities:
        return CameraCapabilities((1 / 64, 0.5, 2.0), (100, 400, 1600))

    def configure(self, settings: ExposureSettings) -> ExposureSettings:
        self._settings = settings
        return settings

    def arm(self) -> None:
        pass

    def shoot(self) -> Frame:
        start_s = self._clock.now() + 0.06
        end_s = start_s + self._settings.exposure_s
        self._clock.sleep_until(end_s + 0.27)
        return Frame(self._data, ".dng", start_s, end_s, self._settings)

    def make_safe(self) -> None:
        pass

    def disconnect(self) -> None:
        pass


def exercised(data: bytes) -> Exercised:
    clock = VirtualClock()
    return exercise_camera(StillCamera(clock, data), ExerciseContext(clock, Photographs()))


@every_sensor
def test_noise_of_every_channel_is_reported(cfa: str) -> None:
    report = exercised(dark_frame(cfa))
    told = {entry.what: entry.value for entry in report.measured if "dark frame" in entry.what}
    assert list(told) == [f"dark frame 2 s ISO 400, {name}" for name in CHANNELS[cfa]]
    for value in told.values():
        mean, std = (float(value.split(word)[1].split()[0]) for word in ("mean", "std"))
        assert mean == pytest.approx(0.0, abs=0.3)
        assert std == pytest.approx(5.0, rel=0.05)
    assert {finding.severity for finding in report.findings} == {"fine"}
    suggested = {entry.key: entry.value for entry in report.suggestions}
    raw = read_raw(dark_frame(cfa), "frame")
    assert suggested["frame_time"] == "300 ms"
    assert suggested["frame_pixels"] == f"[{raw.width}, {raw.height}]"
    assert suggested["frame_size"].endswith(" kB")


@every_sensor
def test_a_frame_that_is_not_dark_is_reported(cfa: str) -> None:
    (warned,) = [f for f in exercised(dark_frame(cfa, 200.0)).findings if f.severity == "warn"]
    assert "not dark (200 DN above black)" in warned.what


@every_sensor
def test_a_frame_that_is_marked_as_turned_is_refused(cfa: str) -> None:
    turned = dark_frame(cfa, tags=[TURNED])
    (refused,) = [f for f in exercised(turned).findings if f.severity == "refuse"]
    assert "auto rotate" in refused.what
    assert "Auto rotate → Off" in refused.remedy


def test_a_frame_that_cannot_be_reduced() -> None:
    with pytest.raises(FrameError, match="the dark frame"):
        exercised(b"no photograph")


@pytest.mark.parametrize("colours", [1, 3], ids=["mono", "colour"])
def test_a_live_picture_of_any_camera(colours: int) -> None:
    """A monochrome camera's JPEG may have one channel."""
    pixels = np.full((40, 60, colours), 90, np.uint8)
    pixels[:, 30:] = 255
    _, jpeg = cv2.imencode(".jpg", pixels)
    stats = picture_stats(decode(jpeg.tobytes()), region=(30, 0, 30, 40))
    assert (stats.width, stats.height) == (60, 40)
    assert stats.clipped == pytest.approx((0.5,) * 3, abs=0.02)
    assert stats.region_clipped == pytest.approx(1.0, abs=0.02)
    assert len(set(stats.histogram)) == 1
