"""What the methods say of the same sample: re-radiation under each light, and colours."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from labrig.fit.fluorescence import FluorescenceFit
from labrig.foundation.arrays import FloatArray
from labrig.material import ReradiationMatrix, compare_colours
from labrig.optics import Spectrum, edges_from_centres, read_light
from labrig.results import (
    DirectColumns,
    DirectMeasurement,
    MeasuringMethod,
    MethodDifference,
    ReradiatedSpectrum,
    ReradiationUnderLight,
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
