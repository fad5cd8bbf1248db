"""Estimates of the same sample by several methods: directly, as a mixture, as seen in colours."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np

from labrig.acquire import RigFile
from labrig.fit import fit_mixture
from labrig.fit.fluorescence import FluorescenceFit
from labrig.foundation.arrays import BoolArray, FloatArray
from labrig.foundation.errors import DataError, UsageError
from labrig.foundation.result_warning import ResultWarning, Unmeasured
from labrig.material import ReradiationMatrix, compare_colours
from labrig.optics import Spectrum, edges_from_centres, read_light
from labrig.results import (
    DirectColumns,
    DirectMeasurement,
    MeasuringMethod,
    MethodDifference,
    MixtureOfMatrix,
    ReradiatedSpectrum,
    ReradiationUnderLight,
    read_result,
)

#: Lights under which the methods' colours are compared.
COMPARED = ("D65", "A")


def reradiation_under_lights(
    joint: FluorescenceFit,
    per_led: FluorescenceFit,
    leds: Sequence[Spectrum],
    direct: DirectMeasurement | None,
) -> tuple[ReradiationUnderLight, ...]:
    """Return what a sample re-radiates under each light, by each method.

    Parameters
    ----------
    joint, per_led
        Estimates of the sample.
    leds
        Spectra of the LEDs, by rising peak.
    direct
        Direct measurement of the same sample. Its lights, as it measured them, then stand for the
        LEDs, so that all methods are asked the same.
    """
    columns = None if direct is None else direct.samples.get(joint.matrix.name)
    lights = leds
    if direct is not None and columns is not None:
        lights = [
            Spectrum(light.name, light.wavelength_nm, np.maximum(light.relative, 0.0))
            for light in direct.lights
        ]
    return tuple(
        ReradiationUnderLight(
            light=light.name,
            peak_nm=float(light.wavelength_nm[light.value.argmax()]),
            joint=_estimated(joint, light),
            per_led=_estimated(per_led, light),
            direct=None if columns is None else _read(columns, number),
        )
        for number, light in enumerate(lights)
    )


def _estimated(fit: FluorescenceFit, light: Spectrum) -> ReradiatedSpectrum:
    matrix = fit.matrix
    absorbed = light.in_bands(matrix.input_edges_nm) * matrix.input_width_nm
    absorbed /= absorbed.sum()
    sigma = None
    if fit.surfaces is not None:
        sigma = (fit.surfaces.reradiation @ absorbed).std(axis=0, ddof=1).astype(np.float64)
    return ReradiatedSpectrum(matrix.output_nm, matrix.reradiation @ absorbed, sigma)


def _read(columns: DirectColumns, number: int) -> ReradiatedSpectrum:
    width_nm = np.diff(edges_from_centres(columns.output_nm))
    is_longer = columns.output_nm > columns.input_nm[number]
    value, sigma = (
        np.where(is_longer, table[:, number] / width_nm, np.nan)
        for table in (columns.reradiated, columns.reradiated_sigma)
    )
    return ReradiatedSpectrum(columns.output_nm, value, sigma)


def method_differences(
    joint: ReradiationMatrix, per_led: ReradiationMatrix, direct: ReradiationMatrix | None
) -> tuple[MethodDifference, ...]:
    """Return the colour differences between each two methods under each light."""
    matrices: dict[MeasuringMethod, ReradiationMatrix] = {"joint": joint, "per-led": per_led}
    if direct is not None:
        matrices["direct"] = direct
    return tuple(_differences(matrices))


def _differences(
    matrices: Mapping[MeasuringMethod, ReradiationMatrix],
) -> Iterator[MethodDifference]:
    lights = [read_light(name) for name in COMPARED]
    for first, second in combinations(matrices, 2):
        reference = matrices[second]
        if second == "direct":
            reference = _completed(reference, matrices[first])
        for found in compare_colours(matrices[first], reference, lights):
            yield MethodDifference(first, second, found.light, float(found.delta_e))


def _completed(measured: ReradiationMatrix, by: ReradiationMatrix) -> ReradiationMatrix:
    """Return a matrix with the numbers of another one where it was not measured."""
    other = by.rebinned(measured.input_nm, measured.output_nm)
    return replace(
        measured,
        reflectance=_filled(measured.reflectance, other.reflectance),
        reradiation=_filled(measured.reradiation, other.reradiation),
        reflectance_sigma=None,
        reradiation_sigma=None,
        column_correlation=None,
    )


def _filled(measured: FloatArray, other: FloatArray) -> FloatArray:
    return np.where(np.isnan(measured), other, measured)


def direct_measurement(rig: RigFile) -> DirectMeasurement | None:
    """Read the direct measurement that a rig file names; None if it names none.

    Raises
    ------
    UsageError, DataError
        There is no such run, it has no result, or it is another protocol's.
    """
    named = rig.optics.direct
    if named is None:
        return None
    result = read_result(Path(named))
    direct: DirectMeasurement | None = result.provides().get("direct")
    if direct is None:
        raise UsageError(
            f"{named}: expected a run of direct_bispectral (optics: direct), got one of "
            f"{result.kind}; name another run, or leave the key out"
        )
    if len(direct.lights) < 2:
        raise UsageError(
            f"{named}: expected a direct measurement under two lights or more, got one"
        )
    return direct


def missing_samples(direct: DirectMeasurement, names: Iterable[str]) -> list[ResultWarning]:
    """Return a warning if no sample was measured directly under the name of a patch."""
    if any(name in direct.samples for name in names):
        return []
    return [
        Unmeasured(
            "sample-not-measured-directly",
            "no sample is called {asked}; it has {samples}, and nothing is compared",
            subject="optics: direct",
            asked=" or ".join(names),
            samples=tuple(direct.samples),
        )
    ]


#: Components of a mixture: with more it follows little but noise (Hua et al. 2021).
COMPONENTS = 3
#: Least part of the strongest entry that counts as re-radiation. An estimate is smooth, and errors
#: of its entries have the same sign: σ of each would leave out what belongs to the dye.
MIN_PART = 0.01


def mixture_of(matrix: ReradiationMatrix, is_extrapolated: BoolArray) -> MixtureOfMatrix | None:
    """Fit a mixture to the input bands that LEDs lit; None where they re-radiate nothing.

    Parameters
    ----------
    matrix
        The estimated matrix.
    is_extrapolated
        Input bands whose numbers are extrapolated and are left out, shape (i,).
    """
    unknown = np.broadcast_to(is_extrapolated, matrix.reradiation.shape)
    lit = replace(matrix, reradiation=np.where(unknown, np.nan, matrix.reradiation))
    per_band = lit.reradiation * lit.output_width_nm[:, np.newaxis]
    threshold = MIN_PART * float(np.nanmax(np.where(lit.is_stokes, per_band, 0.0)))
    if not threshold > 0:
        return None
    try:
        fit = fit_mixture(lit, COMPONENTS, threshold=threshold)
    except (DataError, UsageError):
        # Too few entries for as many numbers.
        return None
    edges = matrix.input_edges_nm
    bands = np.flatnonzero(~is_extrapolated)
    return MixtureOfMatrix(
        scale=fit.mixture.scale,
        weights=fit.mixture.weights,
        mean_nm=fit.mixture.mean_nm,
        covariance_nm2=fit.mixture.covariance_nm2,
        measured_nm=(float(edges[bands[0]]), float(edges[bands[-1] + 1])),
        threshold=fit.threshold,
        kept_entries=fit.kept_entries,
        entries=fit.entries,
        masked_mse=fit.masked_mse,
        band_nm=fit.band_nm,
    )
