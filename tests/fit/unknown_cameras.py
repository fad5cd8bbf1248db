"""Photographs of a chart by cameras that the family lacks, with charts and lamps of their own."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from labrig.fit.camera_curves import (
    GRID_NM,
    CameraCurvesFit,
    ChartReadings,
    FilterReadings,
    fit_camera_curves,
)
from labrig.foundation import resources
from labrig.foundation.arrays import FloatArray
from labrig.optics import (
    CameraResponse,
    Lvf,
    Spectrum,
    Transmittance,
    WavelengthMap,
    nominal_lvf,
    read_camera,
    read_colour_chart,
    read_spectrum,
    shipped_cameras,
)

#: Where curves are compared, in nm.
SEEN_NM = (400.0, 700.0)
NOISE, FLOOR = 0.003, 2e-4
CARD = Transmittance("grey card", np.array([380.0, 780.0]), np.full(2, 0.18))
PLACE = np.array([((n % 6 - 2.5) / 2.5, (n // 6 - 1.5) / 1.5) for n in range(24)])


def lamp() -> Spectrum:
    """The lamp as its file says."""
    return read_spectrum(resources.curve_path("halogen_3000k"))


def chart() -> FloatArray:
    """The chart as its file says."""
    return np.array([patch.at(GRID_NM) for patch in read_colour_chart("colorchecker")])


def smooth(rng: np.random.Generator, count: int, distance_nm: float) -> FloatArray:
    """Random courses of unit variance over the grid, as sums of bells."""
    centres = np.arange(GRID_NM[0] - 200, GRID_NM[-1] + 200, distance_nm / 4)
    bells = np.exp(-(((GRID_NM - centres[:, np.newaxis]) / distance_nm) ** 2))
    courses = rng.standard_normal((count, len(centres))) @ bells
    return np.asarray(courses / np.sqrt(np.square(bells).sum(axis=0)))


def own_chart(rng: np.random.Generator) -> FloatArray:
    """One's own chart: some per cent from the mean of charts, as charts are."""
    level = 1 + 0.02 * rng.standard_normal((24, 1))
    course = 0.015 * smooth(rng, 24, 60.0)
    return np.asarray(chart() * (level + course) + 0.002 * smooth(rng, 24, 60.0))


def own_lamp(rng: np.random.Generator) -> Spectrum:
    """A lamp that is 1 % from its file."""
    known = lamp()
    return Spectrum("own", GRID_NM, known.at(GRID_NM) * (1 + 0.01 * smooth(rng, 1, 60.0)[0]))


def photographed(
    camera: CameraResponse, rng: np.random.Generator, patches: FloatArray, light: Spectrum
) -> ChartReadings:
    """The chart, lit unevenly."""
    seen = 5.0 * light.at(GRID_NM)[:, np.newaxis] * camera.at(GRID_NM)
    uneven = 1 + PLACE @ (0.05 * rng.standard_normal(2))
    value = patches @ seen * uneven[:, np.newaxis]
    sigma = np.hypot(NOISE * value, FLOOR * value.max(axis=0))
    noisy = value + sigma * rng.standard_normal(value.shape)
    return ChartReadings(noisy, sigma, chart(), PLACE, unevenness=0.05)


def through_filter(
    camera: CameraResponse, rng: np.random.Generator, light: Spectrum
) -> FilterReadings:
    """A grey card through a filter whose calibration rests on other curves: 10 % off, smoothly."""
    wavelengths = WavelengthMap(np.array([550.0, 165.0]), (0.0, 1.0))
    centre_nm = np.linspace(396.0, 704.0, 31)
    known = nominal_lvf(wavelengths, centre_nm, leakage=0.0005)
    shifted = nominal_lvf(
        WavelengthMap(np.array([550.3, 165.0]), (0.0, 1.0)), centre_nm, leakage=0.0005
    )
    gain = 1 + 0.1 * np.interp(centre_nm, GRID_NM, smooth(rng, 1, 60.0)[0])
    passed = shifted.transmission(GRID_NM) * (gain * (1 + 0.01 * rng.standard_normal(31)))[:, None]
    seen = 5.0 * light.at(GRID_NM)[:, np.newaxis] * camera.at(GRID_NM)
    value = rng.uniform(0.5, 2.0) * passed * CARD.at(GRID_NM) @ seen
    sigma = np.hypot(0.005 * value, 5e-4 * value.max(axis=0))
    half = np.full(31, 0.3)
    lvf = Lvf(
        known.position,
        known.bands,
        type(known.bands)(half, 0 * half, 0 * half, 0 * half, 0 * half),
    )
    return FilterReadings(value + sigma * rng.standard_normal(value.shape), sigma, lvf, CARD)


@dataclass(frozen=True, eq=False)
class Estimate:
    """A fit of one camera, and how far it is from the truth.

    `rms` is over 400 to 700 nm and all channels, of the difference relative to each channel's true
    peak, after one factor common to all channels that makes it least. `pulls` are the differences
    over their σ at the same wavelengths.
    """

    name: str
    fit: CameraCurvesFit
    rms: float
    family_rms: float
    pulls: FloatArray


def compared(name: str, fit: CameraCurvesFit, camera: CameraResponse) -> Estimate:
    """An estimate beside the truth."""
    sigma = fit.camera.sigma
    assert sigma is not None
    inside = (SEEN_NM[0] <= GRID_NM) & (SEEN_NM[1] >= GRID_NM)
    truth = camera.at(GRID_NM)
    rms, pulls = _difference(fit.camera.sensitivity, truth, inside, sigma)
    return Estimate(name, fit, rms, _difference(fit.family_mean, truth, inside, sigma)[0], pulls)


def rms_of_curves(curves: CameraResponse, truth: CameraResponse) -> float:
    """`Estimate.rms` of curves beside the truth."""
    inside = (SEEN_NM[0] <= GRID_NM) & (SEEN_NM[1] >= GRID_NM)
    one = np.ones((len(GRID_NM), len(curves.channels)))
    return _difference(curves.at(GRID_NM), truth.at(GRID_NM), inside, one)[0]


def _difference(
    curves: FloatArray, truth: FloatArray, inside: np.ndarray, sigma: FloatArray
) -> tuple[float, FloatArray]:
    peak = truth.max(axis=0)
    ours, true = (curves / peak)[inside], (truth / peak)[inside]
    factor = float((ours * true).sum() / (ours * ours).sum())
    off = factor * ours - true
    return float(np.sqrt(np.mean(off**2))), off / (factor * (sigma / peak)[inside])


def left_out(
    names: Sequence[str], *, with_filter: bool = False, patches: FloatArray | None = None
) -> list[Estimate]:
    """Estimates of shipped cameras, each by all of the others."""
    family = {camera.name: read_camera(camera.path) for camera in shipped_cameras()}
    estimates = []
    for name in names:
        rng = np.random.default_rng(list(family).index(name))
        light, camera = own_lamp(rng), family[name]
        readings = photographed(camera, rng, own_chart(rng) if patches is None else patches, light)
        through = through_filter(camera, rng, light) if with_filter else None
        others = [other for key, other in family.items() if key != name]
        fit = fit_camera_curves(readings, lamp(), others, through)
        estimates.append(compared(name, fit, camera))
    return estimates
