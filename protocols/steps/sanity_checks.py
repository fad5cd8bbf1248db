"""Sanity checks of a unit's frames against lamp, relay, room and disk."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from labrig.acquire import LAMP_OFF, ExposureSettings, Session, TakeFrame, at
from labrig.foundation.errors import DeviceError
from labrig.foundation.quantity import duration_text
from labrig.foundation.region import Region
from labrig.record import FrameRecord, FrameRole

from .afterglow import (
    LOOK_AGAIN_S,
    Afterglow,
    Glow,
    classify_decay,
    classify_ladder,
    classify_repeats,
    dark_level,
    glow,
    has_gone_out,
)
from .darkness import DARK, Darkness, darkness, levels
from .exposure_metering import MeteringFrame, measure_frame

#: Time by which a lamp has gone dark; a halogen lamp takes a third of it.
LAMP_GONE_S = 1.0
#: Delay of a frame from which there is a warning; a PC's own delays are shorter.
LATE_S = 0.1


@dataclass(frozen=True)
class SanityChecks:
    """Checks of recorded frames only, so that a resumed run is judged alike.

    Attributes
    ----------
    session
        Session of the unit.
    unit
        Name of the unit.
    patches
        Regions of the samples.
    background
        Region that never glows, which takes the place of dark frames.
    role
        Role of the frames after lamp off.
    metering
        Name of the unit that metered the same glow.
    """

    session: Session
    unit: str
    patches: Sequence[Region]
    background: Region | None
    role: str = FrameRole.DECAY
    metering: str = "meter"

    def require_darkness(self, shorter: Sequence[ExposureSettings]) -> None:
        """Refuse to charge where the dark frames of this unit show that a light is on.

        Parameters
        ----------
        shorter
            Settings of shorter exposures, for a repetition in doubt.

        Raises
        ------
        DeviceError
            A light is on.
        DataError
            The sample still glows too brightly.
        """

        def decide() -> Darkness:
            frames = self._unit_frames(FrameRole.DARK)
            longest_s = max(frame.exposure_s for frame in frames)
            longest = [frame for frame in frames if frame.exposure_s == longest_s]
            measured = [
                self._measure(frame) for frame in (*_first_of_each_exposure(frames), *longest[1:])
            ]
            return darkness(measured, frames[0].iso)

        light = self.session.decide("light before charging", decide, when_planned=DARK)
        if light.is_doubtful:
            light = replace(light, fades=self._closer_look(shorter) is Afterglow.FADING)
        light.require(self.session.warn)

    def require_glow(self, shorter: Sequence[ExposureSettings]) -> None:
        """Refuse a metering after which nothing glows, or the light does not fade.

        Parameters
        ----------
        shorter
            Settings of shorter exposures, for a repetition in doubt.

        Raises
        ------
        DeviceError
            The frames show no glow; the message names what to check.
        """
        self._require(
            lambda: classify_ladder(self._glows(self._unit_frames(FrameRole.METER))), shorter
        )

    def require_decay(self, shorter: Sequence[ExposureSettings]) -> None:
        """Refuse a series of frames that is no decay.

        Parameters
        ----------
        shorter
            Settings of shorter exposures, for a repetition in doubt.

        Raises
        ------
        DeviceError
            The frames show no decay; the message names what to check.
        """

        def decide() -> Afterglow:
            frames = self._unit_frames(self.role)
            middle = len(frames) // 2
            count = min(2, middle)
            chosen = [*frames[:count], frames[middle], *frames[-count:]]
            glows = self._glows(chosen)
            return classify_decay(
                glows[:count], glows[count], glows[count + 1 :], self._reference_glows()
            )

        self._require(decide, shorter)

    def switch_off(self, under_lamp: Sequence[ExposureSettings]) -> None:
        """Switch the lamp off after photographs under it, and check that it has gone out.

        Parameters
        ----------
        under_lamp
            Settings of the photographs, by rising exposure.

        Raises
        ------
        DeviceError
            The frames are as bright as before.
        """

        def longest_open() -> ExposureSettings:
            glows = zip(under_lamp, self._glows(self._unit_frames(FrameRole.DAYLIGHT)), strict=True)
            unclipped = [settings for settings, signal in glows if not signal.clips]
            return unclipped[-1] if unclipped else under_lamp[0]

        def gone_out() -> bool:
            under_lamp_frame = self._unit_frames(FrameRole.DAYLIGHT)[under_lamp.index(compared)]
            return has_gone_out(
                *self._glows([under_lamp_frame, *self._unit_frames(FrameRole.LOOK)])
            )

        compared = self.session.decide("frame to compare with", longest_open, under_lamp[-1])
        look_again = TakeFrame(FrameRole.LOOK, compared)
        self.session.run_sequence([at(0.0, LAMP_OFF), at(LAMP_GONE_S, look_again)])
        if not self.session.decide("lamp has gone out", gone_out, when_planned=True):
            raise DeviceError(
                "it is as bright after lamp off as before: the lamp is still on although its relay "
                "reads off (pull its plug, the contact may be welded), or it did not light at all"
            )

    def report_delays(self, times_s: Sequence[float]) -> None:
        """Warn if frames of the decay began late, and whether the disk was the reason.

        Parameters
        ----------
        times_s
            Planned start of each frame in seconds after lamp off.
        """
        frames = self._unit_frames(self.role)
        if not frames:
            return  # the plan takes none
        # A busy camera releases late, though it was asked in time: the begins themselves count.
        lags_s = np.array([frame.start_time for frame in frames]) - times_s
        lamp_off_s = min(lag_s - frame.late_s for lag_s, frame in zip(lags_s, frames, strict=True))
        late_s = lags_s - lamp_off_s
        if late_s.max() <= LATE_S:
            return
        message = (
            f"{np.count_nonzero(late_s > LATE_S)} of {len(frames)} frames began late, up to "
            f"{duration_text(float(late_s.max()))}"
        )
        disk_s = max(frame.disk_s for frame in frames)
        if disk_s > LATE_S:
            message += (
                f": the disk cannot keep up, it took up to {duration_text(disk_s)} for a frame "
                "(use another disk, or leave more time between frames)"
            )
        self.session.warn(f"{message}; all are kept, with the times at which they were taken")

    def _require(
        self, decide: Callable[[], Afterglow], shorter: Sequence[ExposureSettings]
    ) -> None:
        afterglow = self.session.decide("after lamp off", decide, when_planned=Afterglow.FADING)
        if afterglow is Afterglow.CLIPPED:
            afterglow = self._closer_look(shorter)
        afterglow.require(self.session.warn)

    def _closer_look(self, shorter: Sequence[ExposureSettings]) -> Afterglow:
        """Return whether the light fades: the same frames are taken again after a while."""

        def decide() -> Afterglow:
            glows = self._glows(self._unit_frames(FrameRole.LOOK))
            return classify_repeats(glows[: len(shorter)], glows[len(shorter) :])

        self._shoot(shorter)
        self.session.wait(LOOK_AGAIN_S, "is it a lamp, or does it fade?")
        self._shoot(shorter)
        return self.session.decide("a closer look", decide, when_planned=Afterglow.FADING)

    def _shoot(self, settings: Sequence[ExposureSettings]) -> None:
        for exposure in settings:
            self.session.perform(TakeFrame(FrameRole.LOOK, exposure))

    def _unit_frames(self, role: str) -> list[FrameRecord]:
        return [frame for frame in self.session.frames(role) if frame.unit == self.unit]

    def _reference_glows(self) -> list[Glow]:
        """Return the glow of the metering, else that at the start of the first complete decay."""
        decays = self.session.frames(self.role)
        metering = [
            frame for frame in self.session.frames(FrameRole.METER) if frame.unit == self.metering
        ]
        if not metering and decays[0].unit == self.unit:
            return []
        return self._glows(metering or decays[:2])

    def _glows(self, frames: Sequence[FrameRecord]) -> list[Glow]:
        """Return the glow of frames, at times from the planned start of the first of them."""
        zero_s = frames[0].start_time - frames[0].late_s
        darks = [
            self._measure(frame)
            for frame in _first_of_each_exposure(self.session.frames(FrameRole.DARK))
        ]
        if darks and darkness(darks, frames[0].iso).light:
            darks = []  # they hold an earlier glow
        return [self._glow(frame, darks, zero_s) for frame in frames]

    def _glow(self, frame: FrameRecord, darks: Sequence[MeteringFrame], zero_s: float) -> Glow:
        measured = self._measure(frame)
        if self.background is not None:
            patches_only = MeteringFrame(
                measured.start_s, measured.exposure_s, measured.patches[:-1]
            )
            return glow(patches_only, levels(measured)[-1], zero_s)
        dark = dark_level(darks, frame.exposure_s) if darks else np.zeros(levels(measured).shape)
        return glow(measured, dark, zero_s)

    def _measure(self, frame: FrameRecord) -> MeteringFrame:
        """Return the measurement of a frame, with the background last if there is one."""
        background = [] if self.background is None else [self.background]
        return measure_frame(frame, [*self.patches, *background])


def _first_of_each_exposure(frames: Sequence[FrameRecord]) -> list[FrameRecord]:
    """Return the first frame of each shutter time."""
    return list({frame.exposure_s: frame for frame in reversed(frames)}.values())
