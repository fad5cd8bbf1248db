"""A camera calibration, from its run to camera.yaml."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from labrig.analyse.camera_calibration.card_frames import (
    CardLevels,
    card_levels,
    dark_levels,
    saturation,
    transfer,
)
from labrig.analyse.camera_calibration.factors import Factors, fit_factors
from labrig.analyse.camera_calibration.flat_fit import FittedFlat, fit_flat
from labrig.analyse.camera_calibration.photon_transfer import PhotonTransfer
from labrig.analyse.camera_calibration.pictures import sections
from labrig.analyse.part import Part, StageResult
from labrig.analyse.part_frames import part_frames, part_region
from labrig.analyse.this_camera import camera_identity, lens_of
from labrig.calibration import CameraFile, Factor, write_camera_file
from labrig.errors import DataError
from labrig.record import FrameRecord
from labrig.reduce import read_raw
from labrig.written_numbers import exposure_text, plus_minus

LIT = ("photon", "repeat", "bracket", "flat")
#: χ² per degree of freedom beyond which the photon-transfer line is none.
STRAIGHT_CHI2 = 6.0
#: Deviations from linear, shutter times and gradients of light that are worth a warning.
BENT, OFF, UNEVEN = 0.01, 0.05, 0.2
#: Numbers of σ from which a difference is one.
CLEAR_SIGMAS = 4.0


def process(part: Part) -> StageResult:
    """Write camera.yaml; what later stages know is put right with it.

    Raises
    ------
    DataError
        Some unit is missing, or its frames are of no use.
    """
    protocol, run = part.protocol, part.run
    card, iso = part_region(part, protocol.card), protocol.camera.iso
    darks = part_frames(part, "dark")
    lit = part_frames(part, *LIT)
    levels = card_levels(lit, darks, card)
    transfers = [
        transfer(one, [frame for frame in lit if frame.purpose == "photon"], darks, card)
        for one in protocol.isos
    ]
    bracket = [frame for frame in lit if frame.unit == "linearity"]
    if not bracket:
        raise DataError("expected the brackets of 'linearity', got none; resume the run")
    range_dn, full_dn = saturation(max(bracket, key=lambda frame: frame.exposure_s), card)
    linearity = levels.linearity(iso, range_dn, full_dn)
    factors = fit_factors(
        levels.card_frames(("repeat", "bracket"), linearity), iso, protocol.camera.f_number
    )
    flats = _flats(part, lit, darks)
    file = CameraFile(
        camera=camera_identity(run),
        lens=lens_of(lit),
        iso=iso,
        f_number=protocol.camera.f_number,
        channels=levels.channels,
        noise=tuple(one.noise for one in transfers),
        linearity=linearity,
        flicker=factors.flicker[0],
        flicker_sigma=factors.flicker[1],
        shutter=factors.shutter,
        iso_gain=factors.iso_gain,
        aperture=factors.aperture,
        flats=tuple(one.flat for one in flats),
        source="measured with labrig, camera_calibration",
        run=run.folder.resolve().name,
    )
    write_camera_file(part.folder / "camera.yaml", file)
    return StageResult(
        known=replace(part.inputs, camera=file),
        sections=sections(file, transfers, factors, flats),
        lines=tuple(_lines(file)),
        warnings=tuple(_warnings(file, transfers, factors, levels)),
    )


def _flats(
    part: Part, lit: Sequence[FrameRecord], darks: Sequence[FrameRecord]
) -> list[FittedFlat]:
    card, reference = part_region(part, part.protocol.card), part.protocol.camera.iso
    dark_dn = dark_levels([frame for frame in darks if frame.iso == reference], card)
    of_flats = [frame for frame in lit if frame.purpose == "flat"]
    return [
        fit_flat(
            [read_raw(frame.path) for frame in of_flats if frame.f_number == f_number],
            card,
            dark_dn,
            f_number,
        )
        for f_number in dict.fromkeys(frame.f_number for frame in of_flats)
    ]


def _lines(file: CameraFile) -> Iterator[str]:
    for noise in file.noise:
        yield (
            f"ISO {noise.iso:g}: gain {plus_minus(noise.gain_e_per_dn, noise.gain_e_per_dn_sigma)} "
            f"e/DN, read noise {plus_minus(noise.read_noise_e, noise.read_noise_e_sigma)} e"
        )
    yield f"flicker {plus_minus(100 * file.flicker, 100 * file.flicker_sigma)} %"
    for name, factors in (("shutter", file.shutter), ("aperture", file.aperture)):
        if len(factors) > 1:
            most = max(factors, key=lambda one: abs(one.factor - 1))
            yield f"{name}: furthest from its label {_told(name, most)}"
    corners = [float(np.min(flat.at(1.0))) for flat in file.flats]
    stops = ["" if flat.f_number is None else f" at f/{flat.f_number:g}" for flat in file.flats]
    falling = (f"{100 * left:.1f} %{at}" for left, at in zip(corners, stops, strict=True))
    yield f"light left in the corners: {', '.join(falling)}"


def _told(name: str, one: Factor) -> str:
    setting = exposure_text(one.setting) if name == "shutter" else f"f/{one.setting:g}"
    return f"{setting}, × {plus_minus(one.factor, one.sigma)}"


def _warnings(
    file: CameraFile,
    transfers: Sequence[PhotonTransfer],
    factors: Factors,
    levels: CardLevels,
) -> Iterator[str]:
    for one in transfers:
        if one.reduced_chi2 > STRAIGHT_CHI2:
            yield (
                f"the noise at ISO {one.noise.iso:g} does not rise evenly with the light (χ² "
                f"{one.reduced_chi2:.1f} a degree of freedom): does the camera filter its RAW "
                "frames, or did something move?"
            )
    evident = [one for one in transfers if one.shares]
    if evident:
        most = max(evident, key=lambda one: one.shared)
        yield (
            f"neighbouring pixels share noise ({100 * most.shared:.0f} % of a pixel's variance): "
            "the gain takes it into account"
        )
    (flicker, _), (repeated, sigma) = factors.flicker, factors.repeated
    if flicker - repeated > CLEAR_SIGMAS * sigma:
        yield (
            f"brackets scatter by {100 * flicker:.2f} %, equal frames by {100 * repeated:.2f} %: "
            "the lamp wandered, or a setting does not repeat well; factors are no better than that"
        )
    if file.linearity is not None:
        curve = zip(
            file.linearity.level_dn, file.linearity.deviation, file.linearity.sigma, strict=True
        )
        bent = [level for level, d, s in curve if abs(d) > max(BENT, CLEAR_SIGMAS * s)]
        if bent:
            yield (
                f"the sensor is off a straight line by more than 1 % at {bent[0]:.0f} DN above "
                "dark: keep the brightest level of a measurement well below"
            )
        if file.linearity.saturation_dn is None:
            yield "no frame saturated; the level at which the sensor is full is not known"
    off = [o for o in file.shutter if abs(o.factor - 1) > max(OFF, CLEAR_SIGMAS * o.sigma)]
    if off:
        named = ", ".join(_told("shutter", one) for one in off[:3])
        yield f"shutter times are off by more than 5 % ({named}): longer ones are more exact"
    if any(max(map(abs, row)) > UNEVEN for flat in file.flats for row in flat.gradient):
        yield "the card is lit unevenly, by more than 20 %: move the lamp further away"
    clipped = np.count_nonzero(~levels.usable & np.array(
        [frame.purpose != "bracket" for frame in levels.frames]))  # fmt: skip
    if clipped:
        yield f"{clipped} frames of the card clip and are left out; lower camera.iso"
