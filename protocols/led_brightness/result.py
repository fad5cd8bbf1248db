"""Result of a calibration of LEDs: spectrum and brightness of each, and what was found amiss."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from labrig.calibration import LEDS_KIND, LedsFile, UvScale
from labrig.foundation.arrays import FloatArray
from labrig.results.budget import Budget
from labrig.results.measured import Measured
from labrig.results.run_result import RunResult


@dataclass(frozen=True, eq=False)
class LedMeasured:
    """Measurement of one LED.

    Attributes
    ----------
    named_peak_nm, centroid_nm
        Peak by the rig file, and centroid of the spectrum found, in nm.
    nominal_nm, nominal
        Spectrum by the rig file, the largest value 1, over its wavelengths in nm, shape (n,).
    brightness
        Brightness on the scale of the calibration; null where it is unknown.
    by_camera, by_spectrometer
        Brightness by the camera alone, and by the spectrometer alone, each on the scale on which
        both agree best; null where there is none.
    value_dn_per_s, sigma_dn_per_s
        Values of the white reference in the camera's channels, and σ without the shutter's flicker,
        which they share, in DN/s, shape (channels,); NaN where there are none.
    change
        Relative change of the light between the spectrometer's readings before and after the
        photographs; null without one.
    """

    named_peak_nm: float
    centroid_nm: float
    nominal_nm: FloatArray
    nominal: FloatArray
    brightness: Measured | None
    by_camera: Measured | None
    by_spectrometer: Measured | None
    value_dn_per_s: FloatArray
    sigma_dn_per_s: FloatArray
    change: float | None


@dataclass(frozen=True, eq=False, kw_only=True)
class LedBrightnessResult(RunResult):
    """Spectra and brightnesses of LEDs.

    Attributes
    ----------
    calibration
        Calibration for `led_fluorescence` on the same bench; the file `leds.yaml`.
    uv_scale
        Whether the brightness of LEDs below 400 nm is on the scale of the others: `measured`,
        `unknown`, or `none` where there is no such LED.
    channels
        Names of the camera's channels.
    leds
        Measurement of each LED by its name.
    drift
        Relative change of the first LED from the start to the end of the run; null if it was not
        lit twice.

    Examples
    --------
    >>> result = labrig.read_result(run)  # doctest: +SKIP
    >>> print(result.uv_scale, result.leds["530 nm"].brightness)
    """

    kind: ClassVar[str] = "led_brightness"

    calibration: LedsFile
    uv_scale: UvScale
    channels: tuple[str, ...]
    leds: Mapping[str, LedMeasured]
    drift: Measured | None

    def budgets(self) -> dict[str, Budget]:
        """Return the budgets of the brightness of every LED, whose σ has card and curves in it."""
        known = {name: led.brightness for name, led in self.leds.items() if led.brightness}
        return {
            f"brightness of {name}": Budget(light.value, light.unit, undivided=light.sigma)
            for name, light in known.items()
        }

    def provides(self) -> Mapping[str, Any]:
        """Return the calibration."""
        return {LEDS_KIND.name: self.calibration}

    def write_files(self, folder: Path) -> None:
        """Write `leds.yaml`."""
        LEDS_KIND.write(folder, self.calibration)
