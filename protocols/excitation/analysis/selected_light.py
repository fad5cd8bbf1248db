"""Light of filters, a monochromator or LEDs as each band's excitation sees it, and its errors.

A narrow light charges by the rate at its own wavelengths, which differs from the mean over its
band where excitation changes within. Light counts by how much it excites: every narrow cell of it
has the weight of the smooth course of excitation through the bands' rates, which is 1 on average
over a band. So the rates of the bands stay their means, whatever lights they were measured by.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from labrig.calibration import IrradianceFile
from labrig.fit.excitation import ExcitationCourse, excitation_course
from labrig.foundation.arrays import FloatArray, IntArray
from labrig.foundation.result_warning import Extrapolated, ResultWarning
from labrig.protocols.excitation.analysis.lamp_light import KNOWN, WORST
from labrig.protocols.excitation.result import PatchCharging
from labrig.results import FittedExcitation

#: Light that a filter or monochromator lets through far from its own band, over that in its middle:
#: 10⁻⁴ to 10⁻⁵ in data sheets, so that it is known to a factor of some e. A narrow band passes
#: little light, of which the same blocking leaves a larger part.
STRAY, STRAY_SIGMA = 5e-5, 1.5
#: Part of a light's strongest band below which its share of another one is taken for exact.
MIN_SHARE = 0.01
#: σ of rates by a smooth course as a part of their difference to those by even bands: excitation
#: may have steps.
EVENNESS = 0.5
#: Change of a band's light by the course within it that causes a warning,
NOTABLE = 0.2
#: in bands whose rate is at least so large, as a fraction of the largest.
LARGE = 0.02


@dataclass(frozen=True, eq=False)
class SelectedLight:
    """Light on the sample by each of L lights and by the lamp itself, as B bands see it.

    Attributes
    ----------
    irradiance
        Irradiance of the lights with stray light, shape (L, B).
    modes
        Error modes of its logarithm, of known size, shape (M, L, B).
    direct
        Irradiance by the lamp itself, shape (B,).
    """

    irradiance: FloatArray
    modes: FloatArray
    direct: FloatArray


def selected_light(
    file: IrradianceFile, *, by_leds: bool, course: ExcitationCourse | None = None
) -> SelectedLight:
    """Return the light of selected lights, with what filters and gratings let through beside.

    Its errors are the lights' levels and wavelengths, stray light, and the course of excitation.

    Parameters
    ----------
    file
        Irradiance on the sample.
    by_leds
        Whether the lights are LEDs, which have no stray light.
    course
        Course of excitation within the bands; None: it is even.
    """
    band = _band_of_cells(file)
    of_band = (band[:, np.newaxis] == np.arange(len(file.direct))).astype(np.float64)
    relative_rate = np.ones(len(band)) if course is None else np.exp(course.log_rate)
    cells = np.array(file.through_cells)
    through, direct = (cells * relative_rate) @ of_band, file.direct_cells * relative_rate @ of_band
    moved = (_shifted(file) * relative_rate) @ of_band - through
    passed = 0.0 if by_leds else STRAY * (cells / np.array(file.direct_cells)).max(axis=1)
    stray = np.multiply.outer(passed * np.ones(len(cells)), direct)
    light = through + stray
    # A band of which a light has hardly anything gets another part of nothing.
    even = cells @ of_band
    has_light = even > MIN_SHARE * even.max(axis=1, keepdims=True)
    own = np.eye(len(through))[..., np.newaxis]
    by_wavelength = np.where(has_light, moved / np.where(has_light, light, 1.0), 0.0)
    modes = [
        own * _level_sigma(file)[:, np.newaxis] * np.ones(through.shape[1]),
        own * np.clip(by_wavelength, -WORST, WORST),
    ]
    if not by_leds:
        modes.append(own * STRAY_SIGMA * stray / light)
    if course is not None:
        share = cells * relative_rate / np.where(has_light, light, 1.0)[:, band]
        share = np.where(has_light[:, band], share, 0.0)
        modes.append((course.modes[:, np.newaxis] * share) @ of_band - _of_means(file, course))
        modes[-1] = np.where(has_light, modes[-1], 0.0)
    return SelectedLight(light, np.concatenate(modes), direct)


def within_bands(
    charging: PatchCharging, file: IrradianceFile, fit: FittedExcitation, *, by_leds: bool
) -> PatchCharging:
    """Return a patch's charging with its light weighted by the course of excitation of a fit.

    Parameters
    ----------
    charging
        Charging of a patch by selected lights.
    file
        Irradiance on the sample.
    fit
        Fit of it.
    by_leds
        Whether the lights are LEDs.
    """
    light = selected_light(file, by_leds=by_leds, course=course_of(fit, file))
    through = replace(
        charging.through,
        irradiance=light.irradiance,
        site_modes=light.modes,
        mode_kind=np.full(len(light.modes), KNOWN),
    )
    direct = replace(charging.direct, irradiance=light.direct[np.newaxis])
    if direct.earlier is not None:
        earlier = replace(direct.earlier, irradiance=light.irradiance)
        direct = replace(direct, earlier=earlier)
    return replace(charging, through=through, direct=direct)


def with_doubt(fit: FittedExcitation, even: FittedExcitation) -> FittedExcitation:
    """Return a fit by a smooth course with σ for what it changes.

    Parameters
    ----------
    fit
        Fit by the smooth course of excitation within the bands.
    even
        Fit by the same model with excitation the same all over each band.
    """
    apart = EVENNESS * (_parameters(fit) - _parameters(even))
    covariance = fit.covariance + np.outer(apart, apart)
    sigma = np.sqrt(np.diag(covariance))
    number, bands = fit.k_e().shape
    k_e_sigma = sigma[2 * number : 2 * number + number * bands].reshape(number, bands)
    states = tuple(
        replace(
            state,
            k_r_per_s_sigma=float(sigma[index]),
            amplitude_sigma=float(sigma[number + index]),
            k_e_per_s_sigma=k_e_sigma[index],
        )
        for index, state in enumerate(fit.states)
    )
    before = np.sqrt(np.diag(fit.covariance))
    # A parameter that is held has no σ, and no interval.
    ratio = np.divide(
        sigma, before, out=np.ones_like(sigma), where=(before > 0) & np.isfinite(before)
    )
    widening = dict(zip(fit.covariance_parameters, ratio, strict=True))
    intervals = {name: each.scaled(float(widening[name])) for name, each in fit.intervals.items()}
    return replace(fit, states=states, covariance=covariance, intervals=intervals)


def _parameters(fit: FittedExcitation) -> FloatArray:
    """Return the parameters of `FittedExcitation.covariance`: k_r, A, k_e and fitted orders."""
    k_r, amplitude, order = np.array(
        [(state.k_r_per_s, state.amplitude, state.kinetic_order) for state in fit.states]
    ).T
    orders = order if fit.are_orders_fitted else np.empty(0)
    return np.concatenate([k_r, amplitude, fit.k_e().ravel(), orders])


def course_of(fit: FittedExcitation, file: IrradianceFile) -> ExcitationCourse:
    """Return the course of excitation within the bands, of the glow that all states add to."""
    amplitude = np.array([state.amplitude for state in fit.states])
    sigma = np.array([state.k_e_per_s_sigma for state in fit.states])
    growth = amplitude @ fit.k_e()
    growth_sigma = np.sqrt(amplitude**2 @ np.nan_to_num(sigma, posinf=growth.max()) ** 2)
    return excitation_course(np.array(file.cells_nm), np.array(file.bands_nm), growth, growth_sigma)


def course_warnings(fit: FittedExcitation, file: IrradianceFile) -> Iterator[ResultWarning]:
    """Yield a warning if the course of excitation within the bands changes rates much.

    Parameters
    ----------
    fit
        Fit by selected lights.
    file
        Irradiance on the sample.
    """
    even = selected_light(file, by_leds=True)
    seen = selected_light(file, by_leds=True, course=course_of(fit, file))
    rate = fit.k_e().max(axis=0)
    bands = []
    for number, (low, high) in enumerate(pairwise(file.bands_nm)):
        light = int(np.argmax(even.irradiance[:, number]))
        change = float(seen.irradiance[light, number] / even.irradiance[light, number] - 1)
        if rate[number] > LARGE * rate.max() and abs(change) > NOTABLE:
            bands.append(f"{low:g}-{high:g} nm by {-100 * change / (1 + change):+.0f} %")
    if bands:
        yield Extrapolated(
            "excitation-uneven",
            "excitation changes so much from band to band that rates by narrow lights were taken "
            "for another part of the band than its mean ({bands}), and σ has the doubt in it: "
            "select more lights, and give irradiance bands_nm as narrow as their distance",
            bands=tuple(bands),
        )


def _band_of_cells(file: IrradianceFile) -> IntArray:
    """Return the number of the band to which each cell belongs, shape (F,)."""
    edges: Sequence[float] = file.cells_nm[:-1]
    return np.searchsorted(file.bands_nm, edges, side="right") - 1


def _shifted(file: IrradianceFile) -> FloatArray:
    """Return the irradiance of the cells with the wavelengths of each light moved by one σ."""
    edges = np.array(file.cells_nm)
    middle_nm, width_nm = (edges[1:] + edges[:-1]) / 2, np.diff(edges)
    return np.array(
        [
            width_nm * np.interp(middle_nm - sigma_nm, middle_nm, cells / width_nm)
            for cells, sigma_nm in zip(file.through_cells, file.wavelength_sigma_nm, strict=True)
        ]
    )


def _level_sigma(file: IrradianceFile) -> FloatArray:
    """Return the relative σ of the level of every light, without that by its wavelengths, (L,)."""
    through, sigma = np.array(file.through), np.array(file.through_sigma)
    edges = np.searchsorted(file.cells_nm, file.bands_nm[:-1])
    moved = np.add.reduceat(_shifted(file) - file.through_cells, edges, axis=1)
    variance = ((sigma**2 - moved**2) * through).sum(axis=1) / (through**3).sum(axis=1)
    return np.asarray(np.sqrt(np.clip(variance, 0.0, WORST**2)))


def _of_means(file: IrradianceFile, course: ExcitationCourse) -> FloatArray:
    """Return what the modes of the course change of the bands' means, shape (M, 1, B)."""
    band, width_nm = _band_of_cells(file), np.diff(file.cells_nm)
    weight = (band[:, np.newaxis] == np.arange(len(file.direct))) * width_nm[:, np.newaxis]
    weight = weight * np.exp(course.log_rate)[:, np.newaxis]
    change: FloatArray = course.modes @ weight / weight.sum(axis=0)
    return change[:, np.newaxis]
