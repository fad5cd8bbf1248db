"""Check that a bench is still as it was calibrated: one picture of the card through the filter."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Literal, Self

from pydantic import Field

from labrig.acquire import CalibrationRules, RigFile, Session
from labrig.calibration import REFERENCE_KIND, CardPicture, ReferenceFile
from labrig.fit.lvf import compare_card_pictures, place_means
from labrig.foundation.errors import DataError, UsageError
from labrig.foundation.named_files import FilePath
from labrig.foundation.quantity import Count, DurationS
from labrig.foundation.result_warning import Disturbance, ResultWarning
from labrig.protocols.steps.bench_configuration import (
    BenchConfiguration,
    ConfiguredProtocol,
    ConfiguredUnit,
)
from labrig.protocols.steps.bracketing import Bracketing, SceneUnit
from labrig.protocols.steps.camera_settings import CameraSettings
from labrig.record import FrameRecord
from labrig.reduce import find_strip, read_hdr_frame, strip_profile
from labrig.results import Measured, PictureChange

#: Significance in σ below which nothing counts as changed.
CLEAR = 3.0
ANEW = "calibrate anew (labrig run calibration), or undo the change"


class CheckFrames(StrEnum):
    """Role of the frames of the card through the filter."""

    CARD = "check-card"


class CalibrationCheck(ConfiguredProtocol):
    """Settings of a calibration's check; `calibration_check.yaml` is the commented example.

    Attributes
    ----------
    reference
        File `reference.yaml` of the calibration. Default: that of the rig file, or the newest one
        that is kept beside the runs.
    rules
        Limits within which the calibration still holds. Default: those of the rig file.
    camera
        Sensitivity and aperture of the camera. Default: those of the calibration.
    longest
        Longest exposure, for example `8 s`.
    repeats
        Number of photographs at each of two exposures.
    """

    protocol: Literal["calibration_check"] = "calibration_check"
    reference: FilePath | None = None
    rules: CalibrationRules | None = None
    camera: CameraSettings = CameraSettings(iso=100)
    longest: DurationS = Field(8.0, gt=0)
    repeats: Count = Field(2, ge=1)

    def resolved_for(self, rig: RigFile) -> Self:
        """Return the protocol with the rig file's reference and rules.

        Raises
        ------
        UsageError
            There is no calibration to check, or it has no picture of the card.
        """
        named = self.reference or rig.optics.named(REFERENCE_KIND)
        if named is None:
            raise UsageError(
                f"{rig.name}: expected a calibration to check, found none for this rig beside the "
                "runs; make one: labrig run calibration"
            )
        picture = picture_of(REFERENCE_KIND.read(Path(named)), named)
        return self.model_copy(
            update={
                "reference": named,
                "rules": self.rules or rig.calibrations,
                "camera": CameraSettings(iso=round(picture.iso), f_number=picture.f_number),
            }
        )

    def configured_units(self) -> Sequence[ConfiguredUnit]:
        """Return the card through the filter before the camera."""
        bracketing = Bracketing(self.camera, self.longest, self.repeats)
        unit = CheckUnit(bracketing, "card", CheckFrames.CARD, protocol=self)
        why = "whether lamp, card and filter are still as they were calibrated"
        return [ConfiguredUnit(unit, BenchConfiguration("grey card", "before camera"), why)]


@dataclass(frozen=True)
class CheckUnit(SceneUnit):
    """The card through the filter, compared with the calibration's picture."""

    protocol: CalibrationCheck = field(default_factory=CalibrationCheck)

    def check(self, session: Session) -> None:
        """Refuse a bench that is no longer as it was calibrated.

        Raises
        ------
        DataError
            A rule of the rig file is broken.
        """
        none: tuple[tuple[str, str], ...] = ()
        broken = session.decide("broken rules", lambda: self._broken(session), when_planned=none)
        rules = self.protocol.rules or CalibrationRules()
        for rule, text in broken:
            if rule in rules.only_warn:
                session.warn(text)
        if refused := [text for rule, text in broken if rule not in rules.only_warn]:
            raise DataError(f"{'; '.join(refused)}; {ANEW}")

    def _broken(self, session: Session) -> tuple[tuple[str, str], ...]:
        assert self.protocol.reference is not None, "a plan knows the reference"
        frames = self.own(session)
        reference = REFERENCE_KIND.read(Path(self.protocol.reference))
        rules = self.protocol.rules or CalibrationRules()
        change = picture_change(frames, picture_of(reference, self.protocol.reference))
        return tuple((rule, str(warning)) for rule, warning in broken_rules(change, rules))


def picture_of(reference: ReferenceFile, path: str) -> CardPicture:
    """Return the picture of a reference.

    Raises
    ------
    UsageError
        It has none.
    """
    if reference.picture is None:
        raise UsageError(
            f"{path}: expected a picture of the card through the filter, found none: "
            "lvf_calibration was no part of that calibration; make one with it"
        )
    return reference.picture


def picture_change(frames: Sequence[FrameRecord], before: CardPicture) -> PictureChange:
    """Compare frames of the card through the filter with the picture of a calibration.

    Raises
    ------
    DataError
        There is no strip, or it clips.
    """
    frame = read_hdr_frame(frames)
    now = find_strip(frame).strip(before.strip.rising)
    rates = place_means(strip_profile(frame, before.strip), len(before.wavelength_nm))
    strips = before.strip, now
    return compare_card_pictures(
        before.wavelength_nm, before.rate_dn_per_s, rates, strips, before.width
    )


def broken_rules(
    change: PictureChange, rules: CalibrationRules
) -> Iterator[tuple[str, ResultWarning]]:
    """Yield the name of each rule that the change breaks, and its warning.

    A filter that has moved changes all the rest, which then says nothing.
    """
    if _is_beyond(change.shift_nm, 0.0, rules.shift_nm):
        yield (
            "shift_nm",
            Disturbance(
                "filter-moved",
                "the variable filter is {shift_nm:+.1f} nm from its place before the camera, or "
                "the camera was moved",
                shift_nm=change.shift_nm.value,
            ),
        )
        return
    if _is_beyond(change.brightness, 1.0, rules.brightness):
        yield (
            "brightness",
            Disturbance(
                "card-brightness-changed",
                "the card through the filter is {ratio:.2f} times as bright as when it was "
                "calibrated: the lamp aged or was moved, or this is another card",
                ratio=change.brightness.value,
            ),
        )
    if _is_beyond(change.colour, 1.0, rules.colour):
        yield (
            "colour",
            Disturbance(
                "lamp-colour-changed",
                "the lamp is {colour} than when it was calibrated, by {change_percent:.1f} % "
                "between 420 nm and 680 nm: it aged, or its voltage changed",
                colour="redder" if change.colour.value < 1 else "bluer",
                change_percent=100 * abs(change.colour.value - 1),
            ),
        )
    worst, worst_nm = change.worst
    if abs(worst) > rules.unevenness:
        yield (
            "unevenness",
            Disturbance(
                "card-spectrum-changed",
                "the card through the filter is off by {deviation_percent:+.1f} % at "
                "{wavelength_nm:.0f} nm against other wavelengths: this is another card or another "
                "filter, or there is dirt on it",
                deviation_percent=100 * worst,
                wavelength_nm=worst_nm,
            ),
        )


def _is_beyond(measured: Measured, expected: float, limit: float) -> bool:
    away = abs(measured.value - expected)
    return away > limit and away > CLEAR * measured.sigma
