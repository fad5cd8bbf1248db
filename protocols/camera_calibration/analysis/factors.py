"""Actual factors of shutter, ISO and aperture relative to their nominal ones, and the flicker.

The data are brackets of a steady card: ln(light of a frame) is a linear drift of the lamp within a
unit, plus the nominal settings, plus one parameter for every setting. All units are solved
together; the reference exposure between the others separates lamp and settings.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError
from labrig.optics import Factor
from labrig.protocols.camera_calibration.protocol import CardFrames
from labrig.results import Measured

Setting = float | None

#: Least squared projection of a determined factor on the frames' row space.
DETERMINED = 1 - 1e-6
#: Iterations of the frames' weights by their flicker.
ROUNDS = 4


@dataclass(frozen=True)
class CardFrame:
    """One frame of the lit card.

    Attributes
    ----------
    unit, role
        Unit and role in the run.
    time_s
        Start of the frame in seconds, on any clock.
    exposure_s, iso, f_number
        Nominal exposure time in seconds, ISO and f-number.
    light, sigma
        Logarithm of the signal over all channels, and its standard uncertainty by noise.
    """

    unit: str
    role: str
    time_s: float
    exposure_s: float
    iso: float
    f_number: Setting
    light: float
    sigma: float


@dataclass(frozen=True)
class Factors:
    """Factors by rising setting.

    Attributes
    ----------
    shutter, iso_gain, aperture
        Actual over nominal light of each setting.
    flicker
        Relative scatter of all frames.
    repeated
        Relative scatter of frames with equal settings.
    """

    shutter: tuple[Factor, ...]
    iso_gain: tuple[Factor, ...]
    aperture: tuple[Factor, ...]
    flicker: Measured
    repeated: Measured


def fit_factors(frames: Sequence[CardFrame], iso: float, f_number: Setting) -> Factors:
    """Fit the factors of settings to frames of brackets and repeats.

    Parameters
    ----------
    frames
        Frames of the card.
    iso, f_number
        Settings at which factors are 1; the shutter's is 1 at the longest exposure time.

    Raises
    ------
    DataError
        There are too few frames.
    """
    repeats = [frame for frame in frames if frame.role == CardFrames.REPEAT]
    if len(repeats) < 4 or len(frames) < 8:
        raise DataError(
            f"expected repeats and brackets of the lit card that do not clip, got {len(frames)} "
            "frames; is the card lit, and 'card:' its region?"
        )
    times = sorted({frame.exposure_s for frame in frames})
    isos = sorted({frame.iso for frame in frames})
    stops = sorted({frame.f_number for frame in frames if frame.f_number is not None})
    columns: list[tuple[str, Setting]] = [
        *(("shutter", time_s) for time_s in times[:-1]),
        *(("iso", iso_setting) for iso_setting in isos if iso_setting != iso),
        *(("aperture", stop) for stop in stops if stop != f_number),
    ]
    design = np.hstack([_settings_design(frames, columns), _lamp_design(frames)])
    target = np.array([frame.light - _nominal_light(frame, iso, f_number) for frame in frames])
    noise = np.array([frame.sigma for frame in frames])
    values, sigma, determined, flicker = _solve(design, target, noise)

    def of(kind: str, fixed: Setting) -> tuple[Factor, ...]:
        factors = [] if fixed is None else [Factor(setting=fixed, factor=1.0, sigma=0.0)]
        for number, (name, setting) in enumerate(columns):
            if name == kind and determined[number] and setting is not None:
                factor = float(np.exp(values[number]))
                factors.append(
                    Factor(setting=setting, factor=factor, sigma=factor * float(sigma[number]))
                )
        return tuple(sorted(factors, key=lambda factor: factor.setting))

    return Factors(
        shutter=of("shutter", times[-1]),
        iso_gain=of("iso", iso),
        aperture=of("aperture", f_number),
        flicker=flicker,
        repeated=_repeat_flicker(repeats),
    )


def _settings_design(
    frames: Sequence[CardFrame], columns: Sequence[tuple[str, Setting]]
) -> FloatArray:
    design = np.zeros((len(frames), len(columns)))
    for row, frame in enumerate(frames):
        frame_settings = {
            ("shutter", frame.exposure_s),
            ("iso", frame.iso),
            ("aperture", frame.f_number),
        }
        design[row] = [column in frame_settings for column in columns]
    return design


def _lamp_design(frames: Sequence[CardFrame]) -> FloatArray:
    """Return the design of a level and a linear drift of the lamp for every unit."""
    units = list(dict.fromkeys(frame.unit for frame in frames))
    design = np.zeros((len(frames), 2 * len(units)))
    for number, unit in enumerate(units):
        rows = [row for row, frame in enumerate(frames) if frame.unit == unit]
        times_s = np.array([frames[row].time_s for row in rows])
        span_s = max(float(np.ptp(times_s)), 1.0)
        design[rows, 2 * number] = 1.0
        design[rows, 2 * number + 1] = (times_s - times_s.mean()) / span_s
    return design


def _nominal_light(frame: CardFrame, iso: float, f_number: Setting) -> float:
    """Return the logarithm of the nominal light relative to the reference's."""
    labelled = np.log(frame.exposure_s * frame.iso / iso)
    if frame.f_number is not None and f_number is not None:
        labelled += 2 * np.log(f_number / frame.f_number)
    return float(labelled)


def _solve(
    design: FloatArray, target: FloatArray, noise: FloatArray
) -> tuple[FloatArray, FloatArray, NDArray[np.bool_], Measured]:
    """Return parameters, their σ, whether they are determined, and the flicker."""
    flicker = 0.01
    for _ in range(ROUNDS):
        weight = 1 / np.hypot(noise, flicker)
        u, s, v = np.linalg.svd(design * weight[:, np.newaxis], full_matrices=False)
        kept = s > 1e-9 * s[0]
        inverse = v[kept].T / s[kept]
        values = inverse @ (u[:, kept].T @ (target * weight))
        dof = len(target) - int(kept.sum())
        if dof < 1:
            raise DataError("expected more frames than settings; raise 'cycles'")
        squares = np.square(target - design @ values) * len(target) / dof
        flicker = _common_scatter(squares, noise)
    sigma = np.sqrt(np.square(inverse).sum(axis=1))
    determined = np.square(v[kept]).sum(axis=0) > DETERMINED
    return values, sigma, determined, Measured(flicker, float(flicker / np.sqrt(2 * dof)))


def _repeat_flicker(frames: Sequence[CardFrame]) -> Measured:
    """Return the flicker of frames with equal settings about a straight line."""
    light, design = np.array([frame.light for frame in frames]), _lamp_design(frames)
    coefficients, *_ = np.linalg.lstsq(design, light)
    dof = max(len(light) - design.shape[1], 1)
    squares = np.square(light - design @ coefficients) * len(light) / dof
    flicker = _common_scatter(squares, np.array([frame.sigma for frame in frames]))
    return Measured(flicker, float(np.sqrt(squares.mean() / (2 * dof))))


def _common_scatter(squares: FloatArray, noise: FloatArray) -> float:
    """Return ρ such that the squares average to ρ² + noise², weighted by their information on ρ."""
    variance = float(squares.mean())
    for _ in range(20):
        weight = 1 / np.square(variance + np.square(noise))
        variance = max(float(weight @ (squares - np.square(noise)) / weight.sum()), 0.0)
        if variance == 0:
            break
    return float(np.sqrt(variance))
