"""Checks of the lights: two alight, another order, light of the room, a white that fluoresces."""

from collections.abc import Iterator, Mapping, Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from labrig.fit.bispectral import BispectralColumns, IlluminatedSpectrum
from labrig.foundation.result_warning import Contradiction, Disturbance, ResultWarning
from labrig.optics import SpectrometerReading

#: Ends of the range within which a light's power is counted, in nm.
Window: TypeAlias = tuple[float, float]

#: Significance in σ from which something counts as seen.
SIGNIFICANT = 6.0
#: Noise of a pixel over the median of all from which the detector is all but blind there.
LOUD = 2.0
#: Part of a light beyond its band that is told, and that of another light.
TOLD_BEYOND, TOLD_OTHER = 0.002, 0.005
#: Height of a second peak above the dip before it, of the first; and pixels that are averaged.
SECOND_PEAK, SMOOTHED_PIXELS = 0.03, 9
#: Correlation of what is beyond a light's band with another light, from which it is that light.
SAME_LIGHT = 0.9
#: Distance of a light's peak from what the rig file says that is told, in nm.
TOLD_SHIFT_NM = 15.0
#: Anti-Stokes light in a column that is told, as part of the light's power per band.
TOLD_STRAY = 5e-4
#: Largest reflectance of a sample.
WHITE_REFLECTANCE = 1.1
#: Part of the pixels at each end of the range, where little light of a room is.
END_PART = 0.08
#: Light in the dark that is told, in counts per second.
TOLD_AMBIENT_PER_S = 2.0
#: Part of a light that is told if it is there without the light.
TOLD_LEFT = 2e-3


def second_peak(name: str, light: IlluminatedSpectrum, window_nm: Window) -> ResultWarning | None:
    """Return a warning of a light whose band on the white reference has two peaks."""
    from scipy.signal import find_peaks  # takes as long to load as half of labrig

    low_nm, high_nm = window_nm
    nm = light.wavelength_nm
    inside = (nm >= low_nm) & (nm <= high_nm)
    even = np.full(SMOOTHED_PIXELS, 1 / SMOOTHED_PIXELS)
    smooth = np.convolve(light.value, even, mode="same")[inside]
    noise = float(light.sigma[inside].max()) / np.sqrt(SMOOTHED_PIXELS)
    prominence = max(SECOND_PEAK * float(smooth.max()), SIGNIFICANT * noise)
    places, _ = find_peaks(smooth, prominence=prominence)
    if len(places) < 2:
        return None
    return Disturbance(
        "two-lights",
        "the white reference shows peaks at {peaks}: two lights are alight; left out",
        subject=name,
        peaks=" and ".join(f"{at_nm:.0f} nm" for at_nm in nm[inside][places]),
    )


def other_light(
    name: str, lights: Mapping[str, IlluminatedSpectrum], windows_nm: Mapping[str, Window]
) -> ResultWarning | None:
    """Return a warning of a light whose white reading shows another of the lights as well."""
    light = lights[name]
    low_nm, high_nm = windows_nm[name]
    nm = light.wavelength_nm
    outside = (nm < low_nm) | (nm > high_nm)
    power = _integral(light, ~outside)
    for other, spectrum in lights.items():
        if other == name:
            continue
        left_nm, right_nm = windows_nm[other]
        there = outside & (nm > left_nm) & (nm < right_nm)
        amount, sigma = _integral(light, there), _integral_sigma(light, there)
        if not there.any() or amount < max(SIGNIFICANT * sigma, TOLD_OTHER * power):
            continue
        if np.corrcoef(light.value[there], spectrum.value[there])[0, 1] > SAME_LIGHT:
            return Disturbance(
                "two-lights",
                "{other} shines with it ({part:.1%} of its light on the white reference): two are "
                "alight; left out",
                subject=name,
                other=other,
                part=amount / power,
            )
    return None


def part_beyond(light: IlluminatedSpectrum, window_nm: Window) -> tuple[float, float]:
    """Return the light of longer wavelength than a light's band over its power, and σ."""
    low_nm, high_nm = window_nm
    nm = light.wavelength_nm
    # The ends of the range, where a detector sees little, hold noise only.
    beyond = (nm > high_nm) & (light.sigma < LOUD * np.median(light.sigma))
    power = _integral(light, (nm >= low_nm) & (nm <= high_nm))
    return _integral(light, beyond) / power, _integral_sigma(light, beyond) / power


def light_beyond(
    name: str, light: IlluminatedSpectrum, window_nm: Window, *, is_filter: bool
) -> Iterator[ResultWarning]:
    """Yield a warning of light at longer wavelengths than a light's own band."""
    part, sigma = part_beyond(light, window_nm)
    if part <= max(SIGNIFICANT * sigma, TOLD_BEYOND):
        return
    if is_filter:
        yield Disturbance(
            "filter-leaks",
            "{part:.2%} of its light is beyond its pass band: the filter leaks, and re-radiation "
            "there is hardly distinguished from that; put a short-pass filter with it",
            subject=name,
            part=part,
        )
    else:
        yield Disturbance(
            "reference-fluoresces",
            "{part:.2%} of its light on the white reference is beyond its band: the reference "
            "fluoresces, or the light shines there, too; use a reference of PTFE or barium "
            "sulphate to find out",
            subject=name,
            part=part,
        )


def disorder(
    name: str, light: IlluminatedSpectrum, window_nm: Window, named_nm: float
) -> Iterator[ResultWarning]:
    """Yield a warning of a light with another peak than the rig file says."""
    low_nm, high_nm = window_nm
    inside = (light.wavelength_nm >= low_nm) & (light.wavelength_nm <= high_nm)
    peak_nm = float(light.wavelength_nm[inside][light.value[inside].argmax()])
    if abs(peak_nm - named_nm) > TOLD_SHIFT_NM:
        yield Contradiction(
            "peak-differs",
            "its light has its peak at {peak_nm:.0f} nm, the rig file says {named_nm:.0f} nm: are "
            "the LEDs connected in another order? The measured spectrum is taken",
            subject=name,
            peak_nm=peak_nm,
            named_nm=named_nm,
        )


def stray_in_column(name: str, light: str, column: BispectralColumns) -> ResultWarning | None:
    """Return a warning of a column with light at shorter wavelengths than its own."""
    ends = column.output_nm < column.window_nm[0, 0] - 5.0
    # What a light itself has there, as a filter that leaks, comes back at most as of a white.
    own = WHITE_REFLECTANCE * np.maximum(column.share[ends, 0], 0.0)
    value, sigma = column.column[ends, 0] - own, column.column_sigma[ends, 0]
    if not ends.any():
        return None
    worst = int(np.argmax(value / np.maximum(sigma, 1e-300)))
    if value[worst] > max(SIGNIFICANT * sigma[worst], TOLD_STRAY):
        return Disturbance(
            "stray-light",
            "under {light} light came back at {wavelength_nm:g} nm, of shorter wavelength than the "
            "light: another light was on, or the room's changed; its column is left out",
            subject=name,
            light=light,
            wavelength_nm=column.output_nm[ends][worst],
        )
    return None


def ambient_light(darks: Sequence[SpectrometerReading]) -> Iterator[ResultWarning]:
    """Yield a warning of light with all lights off.

    Offsets fall out between a long and a short reading, dark current is that of the ends.
    """
    if len(darks) < 2:
        return
    longest, shortest = (
        select(darks, key=lambda dark: dark.integration_s) for select in (max, min)
    )
    time_s = longest.integration_s - shortest.integration_s
    if time_s <= 0:
        return
    grown = longest.corrected().counts - shortest.corrected().counts
    light, sigma = _standing_out(np.delete(grown, list(longest.dark_pixels)))
    if light > max(SIGNIFICANT * sigma, TOLD_AMBIENT_PER_S * time_s):
        yield Disturbance(
            "light-left",
            "with all lights off the spectrometer sees light ({counts_per_s:.0f} counts a second); "
            "its constant part is subtracted: darken the room, cover displays",
            counts_per_s=light / time_s,
        )


def left_light(
    lit: SpectrometerReading, off: SpectrometerReading, dark: SpectrometerReading
) -> float:
    """Return the part of a light that is there when it is off; 0 where that is too little to tell.

    A dark that had a light in it is too bright by that.
    """
    on, after = (
        np.delete(reading.corrected(dark).counts, list(dark.dark_pixels)) for reading in (lit, off)
    )
    total, _ = _standing_out(on)
    light, sigma = max(_standing_out(after), _standing_out(-after))
    if light < max(SIGNIFICANT * sigma, TOLD_LEFT * total):
        return 0.0
    return light / max(total, light)


def _standing_out(counts: NDArray[np.float64]) -> tuple[float, float]:
    """Return the strongest light in the middle of a range above that at its ends, and its σ."""
    number = max(int(END_PART * len(counts)), 2)
    ends, middle = np.concatenate([counts[:number], counts[-number:]]), counts[number:-number]
    # Averaged over neighbours, so that a broad light stands out of the pixels' scatter.
    smooth = np.convolve(middle, np.full(number, 1 / number), mode="valid")
    light = float(smooth.max() - ends.mean())
    return light, float(ends.std(ddof=1)) * float(np.sqrt(1 / number + 1 / len(ends)))


def _integral(light: IlluminatedSpectrum, where: NDArray[np.bool_]) -> float:
    return float(np.gradient(light.wavelength_nm)[where] @ light.value[where])


def _integral_sigma(light: IlluminatedSpectrum, where: NDArray[np.bool_]) -> float:
    step_nm = np.gradient(light.wavelength_nm)[where]
    sigma = float(np.sqrt(step_nm**2 @ light.sigma[where] ** 2))
    if light.common_sigma is None:
        return sigma
    return float(np.hypot(sigma, step_nm @ light.common_sigma[where]))
