"""Analysis of a camera calibration, from its frames to its result."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from labrig.analyse.frame_times import timed, untimed
from labrig.analyse.frames import lens_of, part_frames, part_region
from labrig.analyse.inputs import AnalysisContext
from labrig.calibration import CameraFile, Linearity
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError
from labrig.foundation.number_format import exposure_text, plus_minus
from labrig.foundation.region import Region
from labrig.foundation.result_warning import Contradiction, Disturbance, ResultWarning, Unmeasured
from labrig.protocols.camera_calibration.analysis.factors import CardFrame, Factors, fit_factors
from labrig.protocols.camera_calibration.analysis.flat_field import fit_flat, measure_glare
from labrig.protocols.camera_calibration.analysis.linearity import (
    Bend,
    deviation,
    fit_bend,
    fit_linearity,
)
from labrig.protocols.camera_calibration.analysis.photon_transfer import (
    MeasurePair,
    Pair,
    pairs_of,
    photon_transfer,
)
from labrig.protocols.camera_calibration.protocol import LINEARITY, CardFrames
from labrig.protocols.camera_calibration.result import (
    CameraCalibrationResult,
    FittedFlat,
    PhotonTransfer,
)
from labrig.record import FrameRecord, FrameRole
from labrig.reduce import measure_region, reduce_groups, reduce_patches
from labrig.results import Series

LIT = tuple(CardFrames)
#: Deviation from linearity beyond which frames are not used for settings.
MAX_BENT = 0.02
#: χ² per degree of freedom beyond which the photon transfer is not linear.
STRAIGHT_CHI2 = 6.0
#: Deviations from linearity and of exposure times, and gradients of light, that cause a warning.
BENT, OFF, UNEVEN = 0.01, 0.05, 0.2
#: Veiling glare of a dirty lens.
MUCH_GLARE = 0.03
#: Significance of a difference in σ.
CLEAR_SIGMAS = 4.0


def analyse(context: AnalysisContext) -> CameraCalibrationResult:
    """Measure noise, linearity, factors of settings and flat fields.

    Raises
    ------
    DataError
        Some unit is missing, or its frames are unusable.
    """
    protocol, run = context.protocol, context.run
    region, iso = part_region(context, protocol.card), protocol.camera.iso
    darks = part_frames(context, FrameRole.DARK)
    lit = part_frames(context, *LIT)
    card = card_levels(lit, darks, region)
    photon = [frame for frame in lit if frame.role == CardFrames.PHOTON]
    bracket = [frame for frame in lit if frame.unit == LINEARITY]
    if not bracket:
        raise DataError("expected the brackets of 'linearity', got none; resume the run")
    range_dn, full_dn = _saturation_levels(max(bracket, key=lambda frame: frame.exposure_s), region)
    linearity = card.linearity(iso, range_dn, full_dn)
    transfers = tuple(
        _fit_transfer(noise_iso, photon, darks, region, card.bend(noise_iso, range_dn))
        for noise_iso in protocol.isos
    )
    factors = fit_factors(
        card.card_frames((CardFrames.REPEAT, CardFrames.BRACKET), linearity),
        iso,
        protocol.camera.f_number,
    )
    flats = _fit_flats(context, lit, darks)
    file = CameraFile(
        camera=run.camera_identity,
        lens=lens_of(lit),
        iso=iso,
        f_number=protocol.camera.f_number,
        channels=card.series.channels,
        noise=tuple(transfer.noise for transfer in transfers),
        linearity=linearity,
        flicker=factors.flicker.value,
        flicker_sigma=factors.flicker.sigma,
        shutter=factors.shutter,
        iso_gain=factors.iso_gain,
        aperture=factors.aperture,
        flats=tuple(fitted.flat for fitted in flats),
        source="measured with labrig, camera_calibration",
        run=run.name,
    )
    file = file.model_copy(update={"glare": measure_glare(context, file, lit, darks)})
    return CameraCalibrationResult(
        calibration=file,
        card=card.series,
        photon_transfers=transfers,
        repeat_flicker=factors.repeated,
        flats=flats,
        warnings=tuple(_warnings(file, transfers, factors, card)),
    )


@dataclass(frozen=True, eq=False)
class CardLevels:
    """Signal of the card in n frames of C channels.

    Attributes
    ----------
    frames
        Records of the frames.
    series
        Signal of each frame in DN/s, row by row.
    """

    frames: tuple[FrameRecord, ...]
    series: Series

    @property
    def level_dn(self) -> FloatArray:
        """Signal above dark in DN, shape (n, C)."""
        return self.series.values * self.series.exposure_s[:, np.newaxis]

    @property
    def sigma_dn(self) -> FloatArray:
        """Standard uncertainty of `level_dn` in DN, shape (n, C)."""
        return self.series.sigma * self.series.exposure_s[:, np.newaxis]

    @property
    def clipped(self) -> int:
        """Number of frames that clip, except brackets, which are meant to."""
        rows = zip(self.frames, self.series.usable, strict=True)
        return sum(frame.role != CardFrames.BRACKET and not usable for frame, usable in rows)

    def linearity(
        self, iso: float, range_dn: float, saturation_dn: float | None
    ) -> Linearity | None:
        """Fit the deviation from linearity to the frames at one ISO."""
        return fit_linearity(*self._at_iso(iso), range_dn, saturation_dn)

    def bend(self, iso: float, range_dn: float) -> Bend:
        """Fit the bend to the frames at one ISO."""
        return fit_bend(*self._at_iso(iso), range_dn)

    def _at_iso(self, iso: float) -> tuple[FloatArray, FloatArray, NDArray[np.intp]]:
        """Return levels and σ in DN, NaN at other ISOs, and a number for each aperture."""
        rows = self.series.usable & np.array([frame.iso == iso for frame in self.frames])
        stops = [frame.f_number for frame in self.frames]
        stop_values = list(dict.fromkeys(stops))
        group = np.array([stop_values.index(stop) for stop in stops], dtype=np.intp)
        return np.where(rows[:, np.newaxis], self.level_dn, np.nan), self.sigma_dn, group

    def card_frames(self, roles: Sequence[str], linearity: Linearity | None) -> list[CardFrame]:
        """Return the light of the card in frames of the roles, corrected for non-linearity."""
        nonlinearity = deviation(linearity, self.level_dn)
        linear_level = self.level_dn * np.exp(-nonlinearity)
        used = self.series.usable & (np.abs(nonlinearity).max(axis=1) < MAX_BENT)
        light, noise = linear_level.sum(axis=1), np.sqrt(np.square(self.sigma_dn).sum(axis=1))
        return [
            CardFrame(
                frame.unit, frame.role, frame.start_time, frame.exposure_s, frame.iso,
                frame.f_number, float(np.log(light[row])), float(noise[row] / light[row]),
            )
            for row, frame in enumerate(self.frames)
            if frame.role in roles and used[row] and light[row] > 0
        ]  # fmt: skip


def card_levels(
    lit: Sequence[FrameRecord], darks: Sequence[FrameRecord], card: Region
) -> CardLevels:
    """Reduce all lit frames in the card's region.

    Raises
    ------
    DataError
        There are no lit frames, or no dark frames at their ISO.
    """
    if not lit:
        raise DataError("expected frames of the lit card, got none; resume the run")
    frames = [
        replace(
            timed(frame, lit[0].start_time),
            unit=f"{frame.unit} ISO {frame.iso} f/{frame.f_number}",
        )
        for frame in lit
    ]
    dark = [untimed(frame) for frame in darks]
    return CardLevels(tuple(lit), reduce_patches(frames, {"card": card}, dark)["card"])


def _fit_transfer(
    iso: float,
    lit: Sequence[FrameRecord],
    darks: Sequence[FrameRecord],
    card: Region,
    bend: Bend,
) -> PhotonTransfer:
    """Fit the photon transfer at one ISO.

    Raises
    ------
    DataError
        There are too few frames.
    """
    shortest_s = min((frame.exposure_s for frame in darks if frame.iso == iso), default=0.0)
    dark = [frame for frame in darks if frame.iso == iso and frame.exposure_s == shortest_s]
    dark_dn = float(np.mean(_dark_levels(dark, card))) if dark else 0.0
    iso_frames = [frame for frame in lit if frame.iso == iso]
    return photon_transfer(
        iso,
        _measure_pairs(pairs_of(iso_frames), card, dark_dn),
        _measure_pairs(pairs_of(dark), card, dark_dn),
        bend,
    )


def _dark_levels(darks: Sequence[FrameRecord], card: Region) -> FloatArray:
    """Return the mean of each channel above black in DN, shape (channels,)."""
    levels = [
        [channel.mean for channel in measured.channels.values()]
        for measured in measure_region(darks, card)
    ]
    mean: FloatArray = np.mean(levels, axis=0)
    return mean


def _saturation_levels(brightest: FrameRecord, card: Region) -> tuple[float, float | None]:
    """Return the range from black to white and the saturation level above black, in DN.

    The saturation level is None if less than half of the card clips.
    """
    measured = measure_region([brightest], card)[0]
    clips = any(channel.saturated > channel.n / 2 for channel in measured.channels.values())
    return measured.range_dn, measured.range_dn if clips else None


def _measure_pairs(
    pairs: Sequence[tuple[FrameRecord, FrameRecord]], card: Region, dark_dn: float
) -> list[Pair]:
    measured = reduce_groups(pairs, MeasurePair(card, dark_dn))
    return [pair for one_or_none in measured for pair in one_or_none]


def _fit_flats(
    context: AnalysisContext, lit: Sequence[FrameRecord], darks: Sequence[FrameRecord]
) -> tuple[FittedFlat, ...]:
    card, reference = part_region(context, context.protocol.card), context.protocol.camera.iso
    dark_dn = _dark_levels([frame for frame in darks if frame.iso == reference], card)
    flat_frames = [frame for frame in lit if frame.role == CardFrames.FLAT]
    return tuple(
        fit_flat(
            [frame for frame in flat_frames if frame.f_number == f_number],
            card,
            dark_dn,
            f_number,
        )
        for f_number in dict.fromkeys(frame.f_number for frame in flat_frames)
    )


def _warnings(
    file: CameraFile,
    transfers: Sequence[PhotonTransfer],
    factors: Factors,
    card: CardLevels,
) -> Iterator[ResultWarning]:
    for transfer in transfers:
        if transfer.reduced_chi2 > STRAIGHT_CHI2:
            yield Contradiction(
                "noise-not-of-photons",
                "the noise at ISO {iso:g} does not rise with the light as that of photons (χ² "
                "{reduced_chi2:.1f} a degree of freedom): does the camera filter its RAW frames, "
                "or did something move?",
                iso=transfer.noise.iso,
                reduced_chi2=transfer.reduced_chi2,
            )
    evident = [transfer for transfer in transfers if transfer.neighbours_share_noise]
    if evident:
        largest = max(evident, key=lambda transfer: transfer.shared)
        yield Disturbance(
            "pixels-share-noise",
            "neighbouring pixels share noise ({shared:.0%} of a pixel's variance): the gain takes "
            "it into account",
            shared=largest.shared,
        )
    flicker, repeated = factors.flicker.value, factors.repeated.value
    if flicker - repeated > CLEAR_SIGMAS * factors.repeated.sigma:
        yield Disturbance(
            "brackets-scatter",
            "brackets scatter by {brackets_percent:.2f} %, equal frames by {repeated_percent:.2f} "
            "%: the lamp wandered, or a setting does not repeat well; factors are no better than "
            "that",
            brackets_percent=100 * flicker,
            repeated_percent=100 * repeated,
        )
    if file.linearity is not None:
        curve = zip(
            file.linearity.level_dn, file.linearity.deviation, file.linearity.sigma, strict=True
        )
        bent_levels = [level for level, d, s in curve if abs(d) > max(BENT, CLEAR_SIGMAS * s)]
        if bent_levels:
            yield Disturbance(
                "sensor-nonlinear",
                "the sensor is off a straight line by more than 1 % at {level_dn:.0f} DN above "
                "dark: keep the brightest level of a measurement well below",
                level_dn=bent_levels[0],
            )
        if file.linearity.saturation_dn is None:
            yield Unmeasured(
                "saturation-unmeasured",
                "no frame saturated; the level at which the sensor is full is not known",
            )
    shutter_errors = [
        factor
        for factor in file.shutter
        if abs(factor.factor - 1) > max(OFF, CLEAR_SIGMAS * factor.sigma)
    ][:3]
    if shutter_errors:
        yield Contradiction(
            "shutter-times-off",
            "shutter times are off by more than 5 % ({times}): longer ones are more exact",
            times=tuple(
                f"{exposure_text(factor.setting)}, × {plus_minus(factor.factor, factor.sigma)}"
                for factor in shutter_errors
            ),
        )
    gradients = [max(map(abs, row)) for flat in file.flats for row in flat.gradient]
    if gradients and max(gradients) > UNEVEN:
        yield Disturbance(
            "card-uneven",
            "the card is lit unevenly, by more than 20 %: move the lamp further away",
            gradient=max(gradients),
        )
    if file.glare is not None and file.glare.fraction > MUCH_GLARE:
        yield Disturbance(
            "glare",
            "{glare:.1%} of the frame's light lies over all of it: clean the lens and shade it, "
            "and look whether the black trap is black",
            glare=file.glare.fraction,
        )
    if clipped := card.clipped:
        yield Disturbance(
            "frames-clipped",
            "{clipped} frames of the card clip and are left out; lower camera.iso",
            clipped=clipped,
        )
