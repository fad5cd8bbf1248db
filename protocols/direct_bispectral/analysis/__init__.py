"""Columns of a matrix, from readings of white and samples under narrow-band lights.

A pixel's own scatter over a few repetitions says little, but the noise of all pixels of all
readings of a run follows one law: read noise, dark current, and shot noise of the light. What all
pixels of a repetition share is the noise of the dark pixels, which are subtracted.
"""

from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from labrig.acquire import LEDS, RigFile, bank_lights
from labrig.analyse.frames import require_intact
from labrig.analyse.hyperspectral import direct_columns
from labrig.analyse.inputs import AnalysisContext
from labrig.bench_optics import card_reflectance, filter_transmittances
from labrig.fit.bispectral import (
    BispectralColumns as BispectralColumns,
    IlluminatedSpectrum,
    band_weights_nm,
    bispectral_columns,
    light_window_nm,
    separate_columns as separate_columns,
)
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError
from labrig.foundation.nonnegative import nonnegative_least_squares
from labrig.foundation.number_format import plus_minus as plus_minus
from labrig.foundation.result_warning import (
    Contradiction,
    Disturbance,
    ResultWarning,
    Undetermined,
    Unmeasured,
)
from labrig.optics import SpectrometerReading, Spectrum, Transmittance, read_spectrometer_reading
from labrig.protocols.direct_bispectral.analysis.checks import (
    ambient_light,
    disorder,
    left_light,
    light_beyond,
    other_light,
    part_beyond,
    second_peak,
    stray_in_column,
)
from labrig.protocols.direct_bispectral.protocol import WHITE, DirectSpectra
from labrig.protocols.direct_bispectral.result import DirectBispectralResult
from labrig.results import DirectColumns, LightSpectrum, Measured

#: Groups of pixels with similar light in a reading, whose variances are averaged.
GROUPS = 24
ITERATIONS = 3
#: Part of the pixels of a reading with the least light, whose mean shows the common noise.
DIM_PART = 0.25


@dataclass(frozen=True)
class ReadingNoise:
    """Variances of one repetition, in counts².

    Attributes
    ----------
    read
        Variance of a pixel without light.
    dark_per_s
        What dark current adds in a second.
    gain
        Variance per count of light.
    common
        Variance of the offset that all pixels share.
    """

    read: float
    dark_per_s: float
    gain: float
    common: float

    def variance(self, counts: FloatArray, integration_s: float) -> FloatArray:
        """Return the variance of pixels with these counts of light."""
        return self.read + self.dark_per_s * integration_s + self.gain * np.maximum(counts, 0.0)


def repetitions(reading: SpectrometerReading) -> FloatArray:
    """Return the linear counts of each repetition, shape (repetitions, pixels)."""
    return np.array(
        [
            replace(reading, raw_counts=counts[np.newaxis]).corrected().counts
            for counts in reading.raw_counts
        ]
    )


def reading_noise(readings: Sequence[SpectrometerReading]) -> ReadingNoise:
    """Return the noise of an instrument by all readings of a run, two repetitions or more each."""
    rows, variances, common, weights = [], [], [], []
    for reading in readings:
        linear = repetitions(reading)
        usable = ~reading.saturated
        usable[list(reading.dark_pixels)] = False
        counts, scatter = linear.mean(axis=0)[usable], linear.var(axis=0, ddof=1)[usable]
        order = np.argsort(counts)
        for group in np.array_split(order, GROUPS):
            rows.append((1.0, reading.integration_s, max(float(counts[group].mean()), 0.0)))
            variances.append(float(scatter[group].mean()))
        dim = order[: max(int(DIM_PART * len(order)), 1)]
        together = linear[:, usable][:, dim].mean(axis=1).var(ddof=1)
        common.append(together - scatter[dim].mean() / len(dim))
        weights.append(len(linear) - 1)
    design, target = np.array(rows), np.array(variances)
    law = np.array([float(np.median(target)), 0.0, 0.0])
    for _ in range(ITERATIONS):
        # The scatter of a variance is proportional to it.
        sigma = np.maximum(design @ law, 1e-12)
        law = nonnegative_least_squares(design / sigma[:, np.newaxis], target / sigma)
    shared = float(np.average(common, weights=weights))
    read, dark_per_s, gain = law.tolist()
    return ReadingNoise(read, dark_per_s, gain, max(shared, 0.0))


#: Significance in σ of a drift, and of light from a sample.
SIGNIFICANT = 5.0
#: Relative drift that is told, and part of a light that it has no more when it has gone out.
TOLD_DRIFT, GONE = 0.01, 0.02
#: Least distance in nm of two lights.
APART_NM = 1.0
#: Part of the white reference's light of which less is none.
NOTHING = 0.005
#: Part of a filter's largest transmittance at the ends of its pass band.
PASSED = 0.05


@dataclass(frozen=True, eq=False)
class _Lit:
    """Result of one light: the spectrum, and the integration time in seconds.

    Of the white reference also the range in nm within which the light's power is counted.
    """

    spectrum: IlluminatedSpectrum
    integration_s: float
    window_nm: tuple[float, float] = (0.0, 0.0)


def analyse(context: AnalysisContext) -> DirectBispectralResult:
    """Divide the light from every sample by that of the white reference, light by light.

    Raises
    ------
    DataError
        The spectrometer has no scale, the white reference was read under no light, or readings are
        damaged.
    UsageError
        The rig file does not name the white reference's reflectance.
    """
    run, protocol = context.run, context.protocol
    require_intact(
        run, [DirectSpectra.DARK, DirectSpectra.LIT, DirectSpectra.OFF], context.overrides
    )
    readings = _Readings(context)
    if not readings.lit:
        raise DataError(
            "expected readings of the white reference under some light, got none; go on with "
            "labrig resume"
        )
    whole = [reading for reading in readings.lit.values() if not reading.saturated.any()]
    noise = reading_noise([*whole, *readings.dark.values()])
    card = card_reflectance(context.rig)
    spectra, warnings = _spectra(readings, noise, card)
    whites = {light: spectra.pop((WHITE, light, False)) for light in protocol.lights
              if (WHITE, light, False) in spectra}  # fmt: skip
    whites, of_whites = _usable_whites(
        protocol.lights,
        whites,
        {light for stage, light, again in readings.lit if stage == WHITE and not again},
        context.rig,
        are_filters=protocol.filters is not None,
    )
    warnings = [*ambient_light(list(readings.dark.values())), *warnings, *of_whites]
    if not whites:
        raise DataError(
            f"no light can be used: {_joined(warnings) or 'no reading is complete'}; go on with "
            "labrig resume, or measure again"
        )
    first = protocol.shuffled()[0]
    white_drift = _drift(whites.get(first), spectra.get((WHITE, first, True)))
    warnings += _drift_warnings("the white reference", first, white_drift)
    scale = readings.scale
    output_nm = np.arange(
        protocol.first_band, protocol.last_band + protocol.band_width / 2, protocol.band_width
    )
    samples = {}
    for name in protocol.samples:
        lit = {light: spectra[name, light, False] for light in whites
               if (name, light, False) in spectra}  # fmt: skip
        before = lit.get(first) if _came_back(lit.get(first), whites.get(first)) else None
        drift = _drift(before, spectra.get((name, first, True)))
        warnings += _drift_warnings(name, first, drift)
        unread = [light for light in whites if (name, light, False) not in readings.lit]
        warnings += [
            Unmeasured("not-read", "was not read under {light}", subject=name, light=light)
            for light in unread
        ]
        scale_sigma = np.interp(output_nm, *scale)
        columns, of_columns = _columns(name, whites, lit, output_nm, scale_sigma, card,
                                       (white_drift, drift))  # fmt: skip
        warnings += of_columns
        if columns is not None:
            samples[name] = columns
    if not samples:
        raise DataError(
            f"no sample was read under a light that can be used: {_joined(warnings)}; go on with "
            "labrig resume"
        )
    lights = [_light_spectrum(name, white, context.rig) for name, white in whites.items()]
    return DirectBispectralResult(
        lights=tuple(sorted(lights, key=lambda light: light.mean_nm)),
        samples=samples,
        reference_sigma=_typical_sigma(card),
        scale_sigma=_typical_sigma(readings.calibration),
        warnings=tuple(warnings),
    )


class _Readings:
    """Readings of a run.

    Lit ones, and those just after, by stage, light and whether again; dark ones by stage and time.
    """

    def __init__(self, context: AnalysisContext) -> None:
        protocol, self.lit, self.off, self.dark = context.protocol, {}, {}, {}
        lit_units = {
            protocol.unit_name(stage, light, again): (stage, light, again)
            for stage in protocol.stages
            for light in protocol.lights
            for again in (False, True)
        }
        for role, readings in ((DirectSpectra.LIT, self.lit), (DirectSpectra.OFF, self.off)):
            for record in context.run.spectra(role):
                if not context.overrides.excludes(record) and record.unit in lit_units:
                    readings[lit_units[record.unit]] = read_spectrometer_reading(record.path)
        stages = {f"{stage}: dark": stage for stage in protocol.stages}
        for record in context.run.spectra(DirectSpectra.DARK):
            if not context.overrides.excludes(record):
                key = stages[record.unit], round(record.integration_s, 9)
                self.dark[key] = read_spectrometer_reading(record.path)

    lit: dict[tuple[str, str, bool], SpectrometerReading]
    off: dict[tuple[str, str, bool], SpectrometerReading]
    dark: dict[tuple[str, float], SpectrometerReading]

    @property
    def calibration(self) -> Spectrum:
        """Scale of the spectrometer, the same for all readings."""
        calibration = next(iter(self.lit.values())).calibration
        assert calibration is not None
        return calibration

    @property
    def scale(self) -> tuple[FloatArray, FloatArray]:
        """Wavelengths in nm and relative σ of the spectrometer's scale."""
        calibration = self.calibration
        sigma = np.zeros_like(calibration.value) if calibration.sigma is None else calibration.sigma
        return calibration.wavelength_nm, sigma / calibration.value


def _spectra(
    readings: _Readings, noise: ReadingNoise, card: Transmittance
) -> tuple[dict[tuple[str, str, bool], _Lit], list[ResultWarning]]:
    """Return what came of all lights, of the white reference over its reflectance."""
    spectra: dict[tuple[str, str, bool], _Lit] = {}
    warnings: list[ResultWarning] = []
    left: dict[str, dict[str, float]] = {}
    for (stage, light, again), reading in readings.lit.items():
        dark = readings.dark.get((stage, round(reading.integration_s, 9)))
        where = f"{stage} under {light}"
        if dark is None:
            warnings.append(
                Unmeasured(
                    "no-dark-reading",
                    "there is no dark reading of the same time; it is left out",
                    subject=where,
                )
            )
            continue
        if reading.saturated.any():
            warnings.append(
                Disturbance(
                    "spectrometer-saturated",
                    "pixels are saturated; it is left out: dim the light or set 'longest' shorter",
                    subject=where,
                )
            )
            continue
        off = readings.off.get((stage, light, again))
        if off is not None and (part := left_light(reading, off, dark)):
            left.setdefault(stage, {})[light] = part
            dark = off
        spectrum = _lit_spectrum(reading, dark, noise)
        if stage == WHITE:
            spectrum = spectrum.divided_by(card.at(spectrum.wavelength_nm))
        spectra[stage, light, again] = _Lit(spectrum, reading.integration_s)
    return spectra, [*warnings, *(_left_warning(stage, parts) for stage, parts in left.items())]


def _left_warning(stage: str, parts: Mapping[str, float]) -> ResultWarning:
    return Disturbance(
        "light-left",
        "with all LEDs off the light was another than in the dark before, after {lights} (by up to "
        "{most:.1%} of that with the LED); it was subtracted as if it had been steady: an LED "
        "stays lit, or another light is on; check the LEDs' relays, darken the room",
        subject=stage,
        lights=tuple(parts),
        most=max(parts.values()),
    )


def _joined(warnings: Iterable[ResultWarning]) -> str:
    return "; ".join(map(str, warnings))


def _lit_spectrum(
    reading: SpectrometerReading, dark: SpectrometerReading, noise: ReadingNoise
) -> IlluminatedSpectrum:
    """Return a reading above the dark in the scale of the spectrometer, with its σ."""
    if reading.calibration is None:
        raise DataError(
            "expected a spectrometer with a scale, since a sample gives back light of other "
            "wavelengths than it gets, got relative counts; read a standard lamp, make the scale "
            "with labrig.optics.lamp_calibration, and name its file (calibration:) in the rig file"
        )
    measured = reading.corrected(dark)
    time_s, number, dark_number = (
        measured.integration_s,
        len(reading.raw_counts),
        len(dark.raw_counts),
    )
    variance = noise.variance(measured.counts, time_s) / number
    variance += noise.variance(np.zeros_like(measured.counts), time_s) / dark_number
    common = np.sqrt(noise.common * (1 / number + 1 / dark_number))
    calibration = reading.calibration
    known = (measured.wavelength_nm >= calibration.wavelength_nm[0]) & (
        measured.wavelength_nm <= calibration.wavelength_nm[-1]
    )
    known[list(reading.dark_pixels)] = False
    wavelength_nm = measured.wavelength_nm[known]
    factor = calibration.at(wavelength_nm) / time_s
    return IlluminatedSpectrum(
        wavelength_nm,
        factor * measured.counts[known],
        factor * np.sqrt(variance[known]),
        factor * common,
    )


def _usable_whites(
    lights: Sequence[str],
    whites: Mapping[str, _Lit],
    read: Container[str],
    rig: RigFile,
    *,
    are_filters: bool,
) -> tuple[dict[str, _Lit], list[ResultWarning]]:
    """Return the lights that lit the white reference alone, and what is wrong with the others.

    Of those that were read and are not among `whites` it has been said.
    """
    warnings: list[ResultWarning] = []
    lit: dict[str, _Lit] = {}
    for name in lights:
        if name not in whites:
            if name not in read:
                warnings.append(
                    Unmeasured(
                        "not-read",
                        "the white reference was not read under it; left out",
                        subject=name,
                    )
                )
            continue
        try:
            window_nm = light_window_nm(whites[name].spectrum)
        except DataError:
            warnings.append(
                Unmeasured(
                    "light-unlit",
                    "gave no light on the white reference; its column is left out: does it light, "
                    "and is it plugged in?",
                    subject=name,
                )
            )
            continue
        filter_nm = _filter_window_nm(rig, name) if are_filters else None
        lit[name] = replace(whites[name], window_nm=filter_nm or window_nm)
    windows_nm = {name: white.window_nm for name, white in lit.items()}
    spectra = {name: white.spectrum for name, white in lit.items()}
    usable: dict[str, _Lit] = {}
    for name, white in lit.items():
        # Behind a filter there is one lamp.
        if not are_filters and (
            other := second_peak(name, white.spectrum, white.window_nm)
            or other_light(name, spectra, windows_nm)
        ):
            warnings.append(other)
        elif too_near := [kept for kept in usable if _distance_nm(usable[kept], white) < APART_NM]:
            warnings.append(
                Contradiction(
                    "light-is-another",
                    "has the same spectrum as {other}; left out: is it connected to another output "
                    "than the rig file says?",
                    subject=name,
                    other=too_near[0],
                )
            )
        else:
            usable[name] = white
    for name, white in usable.items():
        warnings += light_beyond(name, white.spectrum, white.window_nm, is_filter=are_filters)
        warnings += disorder(name, white.spectrum, white.window_nm, named_peak_nm(rig, name))
    return usable, warnings


def _distance_nm(first: _Lit, second: _Lit) -> float:
    return abs(_mean_nm(first) - _mean_nm(second))


def _mean_nm(white: _Lit) -> float:
    light = white.spectrum
    (weights_nm,) = band_weights_nm(light.wavelength_nm, np.array(white.window_nm))
    return float(np.average(light.wavelength_nm, weights=weights_nm * light.value))


def _filter_window_nm(rig: RigFile, name: str) -> tuple[float, float]:
    """Return the ends of the pass band of a filter in nm.

    Most filters leak in the deep red, where an incandescent lamp is brightest.
    """
    (curve,) = filter_transmittances(rig, [name])
    peak = int(curve.value.argmax())
    stops = np.flatnonzero(curve.value < PASSED * curve.value[peak])
    low = max(stops[stops < peak], default=0)
    high = min(stops[stops > peak], default=len(curve.value) - 1)
    return float(curve.wavelength_nm[low]), float(curve.wavelength_nm[high])


def named_peak_nm(rig: RigFile, name: str) -> float:
    """Return the peak in nm that the rig file says of an LED; NaN where it says nothing."""
    led = bank_lights(rig, LEDS.key, rig.name).get(name)
    return float("nan") if led is None or led.centre is None else float(led.centre)


def _drift(first: _Lit | None, again: _Lit | None) -> Measured:
    """Return the light of the last reading over that of the first, with σ; NaN without both."""
    unknown = Measured(float("nan"), float("nan"))
    if first is None or again is None:
        return unknown
    before, after = first.spectrum, again.spectrum
    weight = before.value / np.maximum(before.sigma, 1e-300) ** 2
    scale = float(weight @ before.value)
    if not scale > SIGNIFICANT * float(np.sqrt(weight**2 @ before.sigma**2)):
        return unknown
    ratio = float(weight @ after.value) / scale
    variance = weight**2 @ (after.sigma**2 + (ratio * before.sigma) ** 2)
    for spectrum, factor in ((after, 1.0), (before, ratio)):
        if spectrum.common_sigma is not None:
            variance += (factor * (weight @ spectrum.common_sigma)) ** 2
    return Measured(ratio, float(np.sqrt(variance)) / abs(scale))


def _came_back(lit: _Lit | None, white: _Lit | None) -> bool:
    """Return whether a sample gave back enough of a light to tell a drift."""
    if lit is None or white is None:
        return False
    power, of_white = (
        np.trapezoid(one.spectrum.value, one.spectrum.wavelength_nm) for one in (lit, white)
    )
    return bool(power > NOTHING * of_white)


def _is_drifted(drift: Measured) -> bool:
    return _has_lit(drift) and bool(abs(drift.value - 1) > SIGNIFICANT * drift.sigma)


def _has_lit(drift: Measured) -> bool:
    """Return whether the light was there once more; a light that has gone out has not drifted."""
    return drift.value > GONE


def _drift_warnings(what: str, light: str, drift: Measured) -> Iterator[ResultWarning]:
    if drift.value <= GONE:
        yield Unmeasured(
            "light-went-out",
            "under {light}, read once more at the end, it gave no light any more: the LED went "
            "out, check its plug; a drift or bleaching is not determined",
            subject=what,
            light=light,
        )
    if _is_drifted(drift) and abs(drift.value - 1) > TOLD_DRIFT:
        yield Disturbance(
            "sample-bleached",
            "under {light}, read once more at the end, it gave {ratio.plus_minus} of its light at "
            "the start: the light changed or the sample bleaches; the change is in σ",
            subject=what,
            light=light,
            ratio=drift,
        )


def _columns(
    name: str,
    whites: Mapping[str, _Lit],
    lit: Mapping[str, _Lit],
    output_nm: FloatArray,
    scale_sigma: FloatArray,
    card: Transmittance,
    drifts: tuple[Measured, Measured],
) -> tuple[DirectColumns | None, list[ResultWarning]]:
    """Return the columns of a sample, None without any, and what is wrong with the others."""
    warnings: list[ResultWarning] = []
    # What changed between the first reading and the last, evenly somewhere in between.
    changes = [abs(drift.value - 1) / np.sqrt(12) for drift in drifts if _is_drifted(drift)]
    used: list[str] = []
    for light, sample in lit.items():
        white = whites[light]
        one = bispectral_columns(
            [white.spectrum], [sample.spectrum], output_nm, windows_nm=[white.window_nm]
        )
        if (one.column <= SIGNIFICANT * one.column_sigma).all():
            warnings.append(
                Undetermined(
                    "no-light-back",
                    "no light came back under {light}; left out: did it light, and does the sample "
                    "lie before the spectrometer?",
                    subject=name,
                    light=light,
                )
            )
        elif stray := stray_in_column(name, light, one):
            warnings.append(stray)
        else:
            used.append(light)
    if not used:
        return None, warnings
    means_nm = np.array([_mean_nm(whites[light]) for light in used])
    relative = np.hypot(np.sqrt(np.sum(np.square(changes))), _card_sigma(card, means_nm))
    columns = bispectral_columns(
        [whites[light].spectrum for light in used],
        [lit[light].spectrum for light in used],
        output_nm,
        scale_sigma,
        relative,
        [whites[light].window_nm for light in used],
    )
    return direct_columns([used[place] for place in columns.order], columns, drifts[1]), warnings


def _card_sigma(card: Transmittance, at_nm: FloatArray) -> FloatArray:
    """Return the relative σ of a card's reflectance; 0 where it is not known."""
    if card.sigma is None:
        return np.zeros_like(at_nm)
    return np.interp(at_nm, card.wavelength_nm, card.sigma / card.value)


def _typical_sigma(curve: Spectrum | Transmittance) -> float:
    """Return the median relative σ of a curve, NaN if it is not known."""
    return float("nan") if curve.sigma is None else float(np.median(curve.sigma / curve.value))


def _light_spectrum(name: str, white: _Lit, rig: RigFile) -> LightSpectrum:
    light = white.spectrum
    low_nm, high_nm = white.window_nm
    inside = (light.wavelength_nm >= low_nm) & (light.wavelength_nm <= high_nm)
    nm, value = light.wavelength_nm[inside], light.value[inside]
    peak = int(value.argmax())
    above = nm[value >= value[peak] / 2]
    beyond, beyond_sigma = part_beyond(light, white.window_nm)
    return LightSpectrum(
        name=name,
        mean_nm=_mean_nm(white),
        peak_nm=float(nm[peak]),
        fwhm_nm=float(above[-1] - above[0]),
        named_nm=named_peak_nm(rig, name),
        integration_s=white.integration_s,
        beyond=beyond,
        beyond_sigma=beyond_sigma,
        wavelength_nm=nm,
        relative=value / value[peak],
    )
