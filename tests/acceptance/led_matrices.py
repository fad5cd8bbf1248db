"""Colours of matrices estimated from photographs under LEDs, over the measured ones.

    python -m tests.acceptance.led_matrices [CASE ...] [--dark] [--seed 0] [--library WHICH]

Every measured matrix that re-radiates is photographed by a simulation that shares nothing with the
fit: integrals in steps of 1 nm, the matrix interpolated between its bands, measured spectra of
LEDs, a DSLR's shot and read noise in a bracket of three exposures. The fit gets the values, their
variances, and spectra and curves that may be wrong. Printed are ΔE2000 under D65 and A against the
matrix, errors of L*, a*, b* over their σ, and the time a surface takes. Also: surfaces without
fluorescence, and in how many of them some is found. With --library the fit also has a library of
emissions: of all these surfaces but the one that is photographed (`others`), of that one, too
(`own`), or emissions that no surface has, two narrow lines each (`wrong`).

The truth is the measured matrix as corrected, on its Stokes side, noise and all.
"""

import argparse
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.interpolate import RegularGridInterpolator

from labrig.fit.fluorescence import (
    Exposure,
    FluorescenceFit,
    FluorescenceSystem,
    JointEstimator,
    fit_per_led,
    fluorescence_system,
    predicted_colour,
)
from labrig.fit.spectrum import CurveError
from labrig.foundation.arrays import FloatArray
from labrig.material import (
    ReradiationMatrix,
    appearance,
    compare_colours,
    corrected,
    emission_spectrum,
    matrix_files,
    read_reradiation,
)
from labrig.optics import CameraResponse, Spectrum, read_camera, read_light, read_spectrum
from tests.real_data import SHARED

LED_FILE = SHARED / "light_sources/photobiology/leds.csv"
CAMERA = "canon_eos_5d_mark_ii"
OTHER_CURVES = SHARED / "camera_sensitivity/ssf_data/jiang2013_Canon_5DMarkII.csv"
LIGHTS = ("D65", "A")
#: Fraction of the light of some wavelength from which a surface counts as re-radiating here.
MIN_FRACTION = 0.1
NINE = (
    "LedEngin_LZ1_10UB00_00U8_405nm",
    "Epileds_3W_430nm",
    "LedEngin_LZ1_10DB00_460nm",
    "Agilent_HLMB_CD31",
    "LedEngin_LZ7_N4M100_ch_G_Cyan",
    "Weili_3W.nominal.525nm",
    "Weili_3W.nominal.550nm",
    "Osram_LY5436",
    "LedEngin_LZ7_N4M100_ch_B_Red",
)
TWELVE = ("LedEngin_LZ1_10UV00_365nm", "LedEngin_LZ1_10UB00_00U4_385nm", *NINE,
          "LedEngin_LZ4_40R208_660nm")  # fmt: skip
#: The simulation's wavelengths in nm.
NM = np.arange(300.0, 781.0)
FULL_ELECTRONS, READ_ELECTRONS, METERED, PIXELS = 12_000.0, 6.0, 0.7, 100
#: Exposures of the bracket, relative to the metered one.
BRACKET = (1.0, 4.0, 16.0)
WHITE_REFLECTANCE = 0.98
#: Relative error of the white's values: its flatness, the lamp's drift.
WHITE_ERROR = 1e-3


@dataclass(frozen=True)
class Case:
    """Things that are used, and what is wrong with them."""

    leds: tuple[str, ...] = NINE
    calibrated: bool = True
    curves_error: float = 0.0
    shift_nm: float = 0.0
    told_shift_nm: float = 0.0
    noise: float = 1.0
    dim: tuple[float, ...] = field(default=())
    other_curves: bool = False
    method: str = "joint"


CASES = {
    "exact": Case(calibrated=False),
    "per-led": Case(calibrated=False, method="per-led"),
    "reflecting": Case(calibrated=False, method="none"),
    "calibrated": Case(curves_error=0.03, shift_nm=1.0, told_shift_nm=1.0),
    "noise-4": Case(calibrated=False, noise=4.0),
    "dim-led": Case(calibrated=False, dim=(1.0, 1.0, 1.0, 1.0, 0.01)),
    "off-3nm": Case(curves_error=0.03, shift_nm=3.0, told_shift_nm=3.0),
    "off-3nm-untold": Case(curves_error=0.03, shift_nm=3.0, told_shift_nm=1.0),
    "other-curves": Case(other_curves=True, shift_nm=1.0, told_shift_nm=1.0),
    "twelve": Case(leds=TWELVE, calibrated=False),
    "twelve-calibrated": Case(leds=TWELVE, curves_error=0.03, shift_nm=1.0, told_shift_nm=1.0),
}


class Photographs:
    """The simulated bench: its real LEDs, camera and brightnesses."""

    def __init__(self, case: Case, rng: np.random.Generator) -> None:
        self._noise, self._rng = case.noise, rng
        camera = read_camera(OTHER_CURVES) if case.other_curves else read_camera(CAMERA)
        errors = 1 + case.curves_error * smooth_errors(rng, 3)
        self._curves = camera.at(NM) * errors.T
        self._lights = []
        for name in case.leds:
            led = read_spectrum(LED_FILE, name)
            shift = case.shift_nm * rng.standard_normal()
            power = replace(led, wavelength_nm=led.wavelength_nm + shift).resampled(NM).value
            self._lights.append(power / power.sum())
        count = len(case.leds)
        self.brightness = np.exp(0.5 * rng.standard_normal(count)) if case.calibrated else 1.0
        dim = (*case.dim, *np.ones(count))[:count]
        self._electrons = np.array(dim)[:, np.newaxis]

    def of(self, matrix: ReradiationMatrix) -> tuple[FloatArray, FloatArray]:
        """Return values and variances, shape (m, 3)."""
        interpolated = RegularGridInterpolator(
            (matrix.output_nm, matrix.input_nm), matrix.reradiation,
            bounds_error=False, fill_value=0.0,
        )  # fmt: skip
        outputs, inputs = np.meshgrid(NM, NM, indexing="ij")
        reradiation = interpolated((outputs, inputs)) * (outputs > inputs)
        reflectance = np.interp(NM, matrix.output_nm, matrix.reflectance)
        seen = np.array([reflectance * light + reradiation @ light for light in self._lights])
        exact = seen @ self._curves * np.reshape(self.brightness, (-1, 1))
        return self._exposed(exact)

    def _exposed(self, exact: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the values that a bracket gives, weighted by variance."""
        gain = METERED * FULL_ELECTRONS / exact.max(axis=1, keepdims=True) * self._electrons
        weight = np.zeros_like(exact)
        for factor in BRACKET:
            electrons = exact * gain * factor
            variance = (np.maximum(electrons, 0.0) + READ_ELECTRONS**2) / PIXELS
            is_used = (electrons < FULL_ELECTRONS) | (factor == BRACKET[0])
            weight += np.where(is_used, (gain * factor) ** 2 / variance, 0.0)
        variance = self._noise**2 / weight
        return exact + np.sqrt(variance) * self._rng.standard_normal(exact.shape), variance


def smooth_errors(rng: np.random.Generator, count: int, distance_nm: float = 40.0) -> FloatArray:
    """Return smooth random curves of unit variance on `NM`, shape (count, n)."""
    correlation = np.exp(-(((NM[:, np.newaxis] - NM) / distance_nm) ** 2) / 2)
    root = np.linalg.cholesky(correlation + 1e-8 * np.eye(len(NM)))
    return rng.standard_normal((count, len(NM))) @ root.T


def told_system(case: Case, camera: CameraResponse, photographs: Photographs) -> FluorescenceSystem:
    """Return what is known of the bench: nominal spectra and curves, and a white's photographs."""
    leds = [read_spectrum(LED_FILE, name) for name in case.leds]
    if not case.calibrated:
        return fluorescence_system([Exposure(led) for led in leds], camera)
    exposures = [Exposure(led, 1.0, math.inf, case.told_shift_nm) for led in leds]
    error = CurveError() if case.other_curves else CurveError(case.curves_error, 0.002, 40.0)
    nm = np.array([300.0, 780.0])
    white = ReradiationMatrix("white", nm, nm, np.full(2, WHITE_REFLECTANCE), np.zeros((2, 2)))
    value, variance = photographs.of(white)
    system = fluorescence_system(exposures, camera, error)
    return system.informed_by_white(value / WHITE_REFLECTANCE,
                                    (variance + (WHITE_ERROR * value) ** 2))  # fmt: skip


def reradiating() -> list[ReradiationMatrix]:
    """Return the measured matrices that re-radiate, as corrected, on their Stokes side."""
    found = []
    for path in matrix_files(SHARED / "bispectral/rit_bfc450"):
        measured = read_reradiation(path)
        if measured.reradiated_fraction.max() > MIN_FRACTION:
            found.append(on_stokes_side(corrected(measured)))
    return found


def not_reradiating() -> list[ReradiationMatrix]:
    """Return the other measured surfaces, their reflectance alone."""
    found = []
    for path in matrix_files(SHARED / "bispectral/rit_bfc450"):
        measured = read_reradiation(path)
        if measured.reradiated_fraction.max() <= MIN_FRACTION:
            zero = np.zeros_like(measured.reradiation)
            found.append(replace(measured, reradiation=zero, reradiation_sigma=None))
    return found


def on_stokes_side(matrix: ReradiationMatrix) -> ReradiationMatrix:
    """Return a matrix without re-radiation at shorter wavelengths."""
    reradiation = np.where(matrix.is_stokes, np.nan_to_num(matrix.reradiation), 0.0)
    return ReradiationMatrix(
        matrix.name, matrix.input_nm, matrix.output_nm, matrix.reflectance, reradiation
    )


def library(which: str, surfaces: Sequence[ReradiationMatrix], name: str) -> list[Spectrum]:
    """Return a library of emissions for the surface of that name."""
    if which == "wrong":
        nm = surfaces[0].output_nm
        return [
            Spectrum(f"{peak:g} nm", nm, _lines(nm, peak)) for peak in np.arange(420.0, 681, 10)
        ]
    return [
        emission_spectrum(surface) for surface in surfaces if which == "own" or surface.name != name
    ]


def _lines(nm: FloatArray, peak: float) -> FloatArray:
    away = np.array([[-35.0], [35.0]])
    return np.asarray(np.exp(-(((nm - peak - away) / 8) ** 2) / 2).sum(axis=0))


def with_library(
    system: FluorescenceSystem, which: str, surfaces: Sequence[ReradiationMatrix]
) -> Callable[..., FluorescenceFit]:
    """Return the fit of one surface with a library."""
    common = {
        name: library(which, surfaces, name)
        for name in ({surface.name for surface in surfaces} if which == "others" else {""})
    }
    estimators: dict[str, JointEstimator] = {}

    def fit(name: str, value: FloatArray, variance: FloatArray) -> FluorescenceFit:
        key = name if which == "others" else ""
        if key not in estimators:
            estimators.clear()
            estimators[key] = JointEstimator(system, common[key])
        return estimators[key].fit(name, value, variance)

    return fit


def estimator(case: Case, system: FluorescenceSystem) -> Callable[..., FluorescenceFit]:
    """Return the fit of one surface."""
    if case.method == "per-led":
        return lambda name, value, variance: fit_per_led(name, value, variance, system)
    if case.method == "none":
        return lambda name, value, variance: without_fluorescence(name, value, variance, system)
    return JointEstimator(system).fit


def without_fluorescence(
    name: str, value: FloatArray, variance: FloatArray, system: FluorescenceSystem
) -> FluorescenceFit:
    """Return the smooth reflectance that comes closest to the values."""
    design = system.response.reflected.reshape(value.size, -1)
    rough = 0.1 * np.diff(np.eye(design.shape[1]), n=2, axis=0) * float(design.max())
    seen = (value / system.brightness[:, np.newaxis]).ravel()
    target = np.append(seen, np.zeros(len(rough)))
    found = np.linalg.lstsq(np.vstack([design, rough]), target)[0]
    like = fit_per_led(name, value, variance, system)
    zero = np.zeros_like(like.matrix.reradiation)
    matrix = replace(like.matrix, reflectance=np.maximum(found, 0.0), reradiation=zero)
    return replace(like, matrix=matrix, fluorophores=())


def run(name: str, surfaces: Sequence[ReradiationMatrix], seed: int, which: str) -> None:
    """Print one case."""
    case, rng = CASES[name], np.random.default_rng(seed)
    photographs = Photographs(case, rng)
    lights = [read_light(light) for light in LIGHTS]
    system = told_system(case, read_camera(CAMERA), photographs)
    fit = with_library(system, which, surfaces) if which else estimator(case, system)
    differences, pulls, misfits, dyes, sigmas, shapes = [], [], [], [], [], []
    taken_s = 0.0
    for surface in surfaces:
        value, variance = photographs.of(surface)
        start_s = time.perf_counter()
        found = fit(surface.name, value, variance)
        taken_s += time.perf_counter() - start_s
        misfits.append(found.reduced_chi2)
        dyes.append(len(found.fluorophores))
        differences.append([one.delta_e for one in compare_colours(found.matrix, surface, lights)])
        if found.surfaces is not None:
            colours = [predicted_colour(found, light) for light in lights]
            sigmas.append([np.linalg.norm(colour.lab_sigma) for colour in colours])
            shapes.append(emission_error(found.matrix, surface))
            pulls.append([
                (colour.lab - appearance(surface, light).lab) / colour.lab_sigma
                for colour, light in zip(colours, lights, strict=True)
            ])  # fmt: skip
    table = np.array(differences)
    textiles = table[[surface.name.upper().startswith("TEXT") for surface in surfaces]]
    quantiles = [np.quantile(table, fraction, axis=0) for fraction in (0.5, 0.9, 1.0)]
    told = "   ".join(f"{d65:5.2f} {a:5.2f}" for d65, a in quantiles)
    textile = np.median(textiles, axis=0) if len(textiles) else np.full(2, np.nan)
    rms = np.sqrt(np.square(pulls).mean(axis=(0, 2))) if pulls else np.full(2, np.nan)
    print(
        f"{name:18} {told}   {textile[0]:5.2f} {textile[1]:5.2f}   {rms[0]:4.2f} {rms[1]:4.2f}   "
        f"{np.median(misfits):4.1f}  {np.bincount(dyes, minlength=4).tolist()}  "
        f"{1000 * taken_s / len(surfaces):4.0f} ms",
        flush=True,
    )
    if sigmas:
        d65, a = np.median(sigmas, axis=0)
        print(f"{'':18} median σ of L*a*b* {d65:.2f} {a:.2f}; of emissions, median share of the "
              f"light at a wrong wavelength {np.median(shapes):.3f}")  # fmt: skip


def emission_error(found: ReradiationMatrix, true: ReradiationMatrix) -> float:
    """Return the part of an emission that lies at another wavelength than in the other matrix."""
    first, second = (emission_spectrum(matrix).value for matrix in (found, true))
    return float(np.abs(first / max(first.sum(), 1e-300) - second / second.sum()).sum() / 2)


def main() -> None:
    """Print a line for each case."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cases", nargs="*", choices=[[], *CASES], default=[])
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--dark", action="store_true", help="surfaces that do not re-radiate")
    parser.add_argument("--library", choices=("others", "own", "wrong"), default="")
    asked = parser.parse_args()
    surfaces = not_reradiating() if asked.dark else reradiating()
    print(f"{len(surfaces)} surfaces: ΔE2000 D65 A, median, 90 %, largest; of textiles; errors of "
          f"L*a*b* over σ; χ²; number with 0 to 3 dyes; time")  # fmt: skip
    for name in asked.cases or CASES:
        run(name, surfaces, asked.seed, asked.library)


if __name__ == "__main__":
    main()
