"""Expected data of a protocol: schedule, frames, noise, information of the fit."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from labrig.acquire import CameraOffers, ProtocolModel
from labrig.foundation.errors import ProtocolError, UsageError
from labrig.predict.camera import CameraFigures
from labrig.predict.frames import dark_frames, glow_frames
from labrig.predict.glow import Glow
from labrig.predict.information import Information, information
from labrig.predict.series import ExpectedSeries, expected_series, repeated
from labrig.protocols.steps.camera_settings import CameraSettings
from labrig.protocols.steps.decays import DecaySettings
from labrig.protocols.steps.exposure_metering import Schedule
from labrig.reduce import FrameMeasurement, is_clipped


def predictable(protocol: ProtocolModel) -> DecaySettings:
    """Return the protocol if its fit can be predicted.

    Raises
    ------
    UsageError
        If it records no decay.
    """
    if not isinstance(protocol, DecaySettings):
        raise UsageError(
            f"--predict: expected a protocol that records a decay, got '{protocol.protocol}', of "
            "which no rates are fitted"
        )
    return protocol


@dataclass(frozen=True, eq=False)
class Bench:
    """Camera and samples, measured or assumed before the run.

    Attributes
    ----------
    camera
        Camera at some ISO, from which other sensitivities follow.
    flicker
        Relative common-mode noise ρ of a frame.
    glows
        Glow of each predicted patch by name.
    """

    camera: CameraFigures
    flicker: float
    glows: Mapping[str, Glow]

    def at_settings(self, settings: CameraSettings) -> "Bench":
        """Return the bench at a protocol's camera settings."""
        glows = {
            patch: glow.at_settings(settings.iso, settings.f_number)
            for patch, glow in self.glows.items()
        }
        return Bench(self.camera.at_iso(settings.iso), self.flicker, glows)


@dataclass(frozen=True, eq=False)
class Expectation:
    """Expected data and information of one protocol.

    Attributes
    ----------
    exposures_s
        Exposure times of the frames of one decay in seconds.
    series
        Expected data of the fit by patch.
    found
        Information of the fit by patch.
    clipped
        Number of clipped frames of one decay, which are left out, by patch.
    states_chosen
        Whether the fit chooses the number of states.
    warnings
        Warnings of the protocol's metering and of the number of states.
    """

    exposures_s: tuple[float, ...]
    series: Mapping[str, ExpectedSeries]
    found: Mapping[str, Information]
    clipped: Mapping[str, int]
    states_chosen: bool
    warnings: tuple[str, ...]


def expect(protocol: DecaySettings, offers: CameraOffers, bench: Bench) -> Expectation:
    """Predict every patch of a bench.

    Raises
    ------
    ProtocolError
        If too few frames of a patch remain that do not clip.
    """
    bench = bench.at_settings(protocol.camera)
    warnings: list[str] = []
    schedule = expected_schedule(protocol, offers, bench, warnings.append)
    series, clipped = {}, {}
    for patch, glow in bench.glows.items():
        series[patch], clipped[patch] = _series(protocol, offers, bench, patch, schedule)
        if protocol.states not in ("auto", len(glow.rate_per_s)):
            warnings.append(
                f"{patch}: the protocol asks for {protocol.states} states, the material has "
                f"{len(glow.rate_per_s)}; predicted is a fit of {len(glow.rate_per_s)}"
            )
    return Expectation(
        exposures_s=tuple(schedule.exposures_s),
        series=series,
        found={patch: information(data) for patch, data in series.items()},
        clipped=clipped,
        states_chosen=protocol.states == "auto",
        warnings=tuple(warnings),
    )


def expected_schedule(
    protocol: DecaySettings,
    offers: CameraOffers,
    bench: Bench,
    warn: Callable[[str], None],
) -> Schedule:
    """Return the schedule that the protocol's metering chooses for the glows of a bench."""

    def expected(t_s: float, exposure_s: float) -> list[FrameMeasurement]:
        at = np.array([t_s]), np.array([exposure_s])
        return [
            glow_frames(glow, bench.camera, protocol.patches[patch], *at).measurements()[0]
            for patch, glow in bench.glows.items()
        ]

    return protocol.expected_schedule(offers, expected, warn)


def _series(
    protocol: DecaySettings,
    offers: CameraOffers,
    bench: Bench,
    patch: str,
    schedule: Schedule,
) -> tuple[ExpectedSeries, int]:
    """Return the expected data of a patch and the number of clipped frames of a decay."""
    camera, region, glow = bench.camera, protocol.patches[patch], bench.glows[patch]
    t_s, exposure_s = np.array(schedule.times_s), np.array(schedule.exposures_s)
    frames = glow_frames(glow, camera, region, t_s, exposure_s)
    darks = background = None
    if protocol.dark == "background" and protocol.background is not None:
        background = dark_frames(camera, protocol.background, frames.channels, exposure_s)
    else:
        darks_s = np.array(protocol.dark_exposures_s(offers))
        darks = dark_frames(camera, region, frames.channels, darks_s)
    decay = expected_series(glow, t_s, frames, darks, background, bench.flicker)
    usable = np.asarray(~is_clipped(frames.saturated, 1.0).any(axis=1))
    clipped = int(np.count_nonzero(~usable))
    if len(usable) - clipped < 2 * len(glow.rate_per_s):
        raise ProtocolError(
            f"{patch}: {clipped} of {len(usable)} frames will clip, so that too few are left to "
            "fit; expose for less (or exposure: auto), or lower camera.iso"
        )
    return repeated(decay, usable, protocol.repeats), clipped
