"""Colour filters before lamp and camera, in truth a little different; the monochromator's band.

Filters are curves from a folder. The band is rounder than a triangle and has some stray light.
"""

import csv
import zlib
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

from labrig.foundation import resources
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.foundation.input_file import read_text
from labrig.foundation.yaml_file import did_you_mean

from .arrangement import USUAL_LAMP_M, Arrangement, Arrangements
from .bench_settings import MonochromatorSettings
from .lamp import IS_VISIBLE, WAVELENGTH_NM

#: Blaze of the grating and width of its efficiency in nm.
BLAZE_NM, BLAZE_WIDTH_NM = 480.0, 260.0
#: Equal slits give a triangle; lens errors round it by a normal curve of this part of its width.
ROUNDED = 0.18


def passed_by(settings: MonochromatorSettings, wavelength_nm: float) -> FloatArray:
    """Return the transmittance where the monochromator is tuned to, shape (wavelengths,)."""
    centre_nm = wavelength_nm + settings.off_nm
    spread_nm = ROUNDED * settings.fwhm * np.linspace(-3, 3, 25)
    weight = np.exp(-((spread_nm / (ROUNDED * settings.fwhm)) ** 2) / 2)
    away = np.abs(WAVELENGTH_NM - centre_nm - spread_nm[:, None]) / settings.fwhm
    band = weight @ np.clip(1 - away, 0.0, None) / weight.sum()
    blaze = np.exp(-(((WAVELENGTH_NM - BLAZE_NM) / BLAZE_WIDTH_NM) ** 2))
    passed: FloatArray = settings.level * blaze * (band + settings.stray)
    return passed


SHIPPED = "config/optics/filters"
SUFFIX = ".csv"
#: Distance of the random knots of what a filter differs from its curve.
KNOTS_NM: FloatArray = np.arange(360.0, 820.0, 50.0)


class Filters:
    """The filters that the changer has.

    Parameters
    ----------
    folder
        Folder of the filters' curves; None: the shipped one.
    bent
        Root mean square difference of the true transmittances from the files'.
    seed
        Seed of that difference.
    monochromator
        Settings of the monochromator; None if there is none.

    Raises
    ------
    UsageError
        There is no such folder, or no curve in it.
    """

    def __init__(
        self,
        folder: str | None,
        bent: float,
        seed: int,
        monochromator: MonochromatorSettings | None = None,
    ) -> None:
        place = resources.folder(SHIPPED) if folder is None else Path(folder)
        if not place.is_dir():
            raise UsageError(f"{place}: expected a folder of colour filters ({SUFFIX})")
        self._files = {path.stem: path for path in sorted(place.glob(f"*{SUFFIX}"))}
        if not self._files:
            raise UsageError(f"{place}: expected a {SUFFIX} file for each colour filter, got none")
        self._monochromator = monochromator
        self._bent = bent
        self._seed = seed
        self._transmissions: dict[str | None, FloatArray] = {None: np.ones_like(WAVELENGTH_NM)}

    def check(self, name: str) -> None:
        """Raise UsageError if there is no filter of that name."""
        if name not in self._files:
            raise UsageError(f"no filter '{name}'; {did_you_mean(name, list(self._files))}")

    def history(self, arrangements: Arrangements) -> tuple[tuple[float, FloatArray], ...]:
        """Return times, and the transmission of the lamp's light from each on; the first is 0.

        A lamp that is further away than usual gives less light by the square of its distance.
        """
        history: list[tuple[float, Arrangement]] = []
        for since_s, arrangement in zip(arrangements.since_s, arrangements.states, strict=True):
            if not history or _before_lamp(history[-1][1]) != _before_lamp(arrangement):
                history.append((since_s, arrangement))
        return tuple((since_s, self._passed(arrangement)) for since_s, arrangement in history)

    def _passed(self, arrangement: Arrangement) -> FloatArray:
        """Return what all that is before the lamp lets through, shape (wavelengths,)."""
        passed = self.transmission(arrangement.filter) * (USUAL_LAMP_M / arrangement.lamp_m) ** 2
        if arrangement.wheel is not None:
            passed = passed * self.transmission(arrangement.wheel)
        if not arrangement.is_monochromatic or self._monochromator is None:
            return passed
        if arrangement.monochromator_nm is None:
            return np.zeros_like(passed)
        return passed * passed_by(self._monochromator, arrangement.monochromator_nm)

    def before_camera(self, arrangement: Arrangement) -> FloatArray:
        """Return what the filters before the camera let through, shape (wavelengths,)."""
        by_hand = self.transmission(arrangement.camera_filter)
        return by_hand * self.transmission(arrangement.camera_wheel)

    def transmission(self, name: str | None) -> FloatArray:
        """Return the filter's transmittance, shape (wavelengths,); no filter: 1."""
        if name is not None and name not in self._transmissions:
            self._transmissions[name] = self._really(name)
        return self._transmissions[name]

    def _really(self, name: str) -> FloatArray:
        self.check(name)
        curve = read_curve(self._files[name])
        if not self._bent:
            return curve
        rng = np.random.default_rng([self._seed, zlib.crc32(name.encode())])
        knots = CubicSpline(KNOTS_NM, rng.standard_normal(len(KNOTS_NM)))
        factor = knots(WAVELENGTH_NM.clip(KNOTS_NM[0]))
        factor /= np.sqrt(np.mean(factor[IS_VISIBLE] ** 2))
        bent: FloatArray = np.clip(curve * (1 + self._bent * factor), 0.0, 1.0)
        return bent


def _before_lamp(arrangement: Arrangement) -> tuple[object, ...]:
    """Return all that changes the lamp's light on its way."""
    tuned = arrangement.monochromator_nm if arrangement.is_monochromatic else None
    return (
        arrangement.filter,
        arrangement.wheel,
        arrangement.lamp_m,
        arrangement.is_monochromatic,
        tuned,
    )


def read_curve(path: Path) -> FloatArray:
    """Return a curve from a file's first two columns, on `WAVELENGTH_NM`, constant at the ends.

    Raises
    ------
    UsageError
        The file is no table of wavelength and value.
    """
    try:
        lines = read_text(path).splitlines()
        rows = list(csv.reader(line for line in lines if line.strip() and line[0] != "#"))
        body = rows[1:] if rows[0][0] == "wavelength_nm" else rows
        table = np.array([[float(row[0]), float(row[1])] for row in body])
    except (ValueError, IndexError, csv.Error) as error:
        raise UsageError(
            f"{path}: expected wavelength_nm and a value in two columns ({error})"
        ) from None
    curve: FloatArray = np.interp(WAVELENGTH_NM, table[:, 0], table[:, 1])
    return curve
