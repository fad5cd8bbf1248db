"""The camera's part of a rig check: three short frames for their timing, a longer one for noise."""

import io
import logging
import math
from dataclasses import replace
from typing import Any

from labrig.acquire import Camera, CameraOffers, ExposureSettings, Finding, Frame
from labrig.clock import Clock
from labrig.errors import DeviceError
from labrig.quantity import duration_text
from labrig.reduce import FrameMeasurement, measure, read_raw
from labrig.setup.report import DeviceReport, Measured, Suggestion, spread_ms

SHORT_FRAMES = 3
SHORT_S, LONG_S = 1 / 60, 2.0
#: From a half press until the camera is certainly ready: in a run it has that time, too.
SETTLING_S = 0.5
#: A sensitivity at which read noise and dark current both show.
ISO = 400
#: Mean above black, as a part of the range, from which on a frame is not dark.
LIGHT = 0.005
#: Suggested times are rounded up to this, so that the plan is kept.
STEP_S = 0.1
#: EXIF orientation of a picture that was not turned.
UPRIGHT = 1


def exercise_camera(report: DeviceReport, camera: Camera, clock: Clock) -> DeviceReport:
    """`report` with what photographing taught.

    Raises
    ------
    LabrigError
        The camera failed, or its frame cannot be reduced.
    """
    offers = camera.offers()
    measured, suggestions = _timing(camera, offers, clock)
    frame = _shoot(camera, _settings(offers, LONG_S), clock)[0]
    reduced = measure(read_raw(frame.data, "the dark frame"))
    return replace(
        report,
        findings=(*report.findings, _darkness(reduced), _orientation(frame.data)),
        measured=(*report.measured, _offered(offers), *measured, *_noise(reduced, frame)),
        suggestions=(*report.suggestions, *suggestions),
    )


def _timing(
    camera: Camera, offers: CameraOffers, clock: Clock
) -> tuple[list[Measured], list[Suggestion]]:
    settings = _settings(offers, SHORT_S)
    lags_s, cycles_s = [], []
    for _ in range(SHORT_FRAMES):
        frame, asked_s = _shoot(camera, settings, clock)
        camera.arm()  # only now can the next exposure begin
        lags_s.append(frame.start_s - asked_s)
        cycles_s.append(clock.now() - frame.end_s)
    frame_time_s = math.ceil(max(cycles_s) / STEP_S) * STEP_S
    return [
        Measured(
            "release asked to exposure begun, with the rig file's shutter_lag", spread_ms(lags_s)
        ),
        Measured("exposure over to ready for the next", spread_ms(cycles_s)),
    ], [Suggestion("frame_time", duration_text(frame_time_s))]


def _shoot(camera: Camera, settings: ExposureSettings, clock: Clock) -> tuple[Frame, float]:
    """The frame, and when it was asked for."""
    camera.configure(settings)
    camera.arm()
    clock.sleep(SETTLING_S)
    asked_s = clock.now()
    frame = camera.shoot()
    if not frame.data:
        raise DeviceError("the camera delivered an empty frame; try again")
    return frame, asked_s


def _settings(offers: CameraOffers, exposure_s: float) -> ExposureSettings:
    return ExposureSettings(
        offers.exposure_at_most(exposure_s),
        min(offers.isos, key=lambda iso: abs(iso - ISO)),
        max(offers.f_numbers, default=None),
    )


def _offered(offers: CameraOffers) -> Measured:
    return Measured(
        "it offers",
        f"{duration_text(offers.exposures_s[0])} to {duration_text(offers.exposures_s[-1])}, "
        f"ISO {', '.join(map(str, offers.isos))}, "
        + (
            f"f/{offers.f_numbers[0]:g} to f/{offers.f_numbers[-1]:g}"
            if offers.f_numbers
            else "no aperture"
        ),
    )


def _noise(reduced: FrameMeasurement, frame: Frame) -> list[Measured]:
    return [
        Measured(
            f"dark frame {frame.settings}, {name}",
            f"mean {stats.mean:.2f} ± {stats.sigma:.3f} DN above black, std {stats.std:.2f} DN, "
            f"{stats.hot} hot, {stats.saturated} clipped of {stats.n}",
        )
        for name, stats in reduced.channels.items()
    ]


def _darkness(reduced: FrameMeasurement) -> Finding:
    limit_dn = LIGHT * (reduced.white - min(reduced.black))
    brightest_dn = max(stats.mean for stats in reduced.channels.values())
    if brightest_dn > limit_dn:
        return Finding(
            "warn",
            f"with the lamp off a frame is not dark ({brightest_dn:.0f} DN above black)",
            "darken the room, cover displays, and let the samples fade",
        )
    return Finding("fine", "with the lamp off a frame is dark")


def _orientation(content: bytes) -> Finding:
    """Auto rotate: no known property tells it, a turned frame does."""
    import exifread

    # it warns through logging of every odd tag
    logging.getLogger("exifread").setLevel(logging.CRITICAL)
    try:
        tags: dict[str, Any] = exifread.process_file(io.BytesIO(content), details=False)
    except Exception:  # damaged EXIF fails in any way
        return Finding(
            "warn",
            "the frame's EXIF cannot be read, and so not whether it is turned",
            "see that auto rotate is off",
        )
    tag = tags.get("Image Orientation")
    if tag is None or list(tag.values) == [UPRIGHT]:
        return Finding("fine", "frames are not marked as turned")
    return Finding(
        "refuse",
        "auto rotate is on: it marks frames as turned, some this way and some that",
        "Set-up 1 (yellow) → Auto rotate → Off",
    )
