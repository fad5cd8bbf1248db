"""What is measured of an excitation: charges of a sample, and photographs of its glow after each.

One photograph shows many sites at once: places under the linear variable filter that were charged
by different wavelengths, or samples under the lamp itself.
"""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from labrig.errors import FitError
from labrig.results.measured import BoolArray, FloatArray

#: Charges that are first looked at so many times later than most (those of a metering, by the next
#: look at what is left) do not go with the others.
LATER = 3.0


@dataclass(frozen=True, eq=False)
class Transient:
    """How the lamp comes on or goes dark, band by band.

    Attributes
    ----------
    duration_s
        (m,) of steps from the switch on.
    fraction
        (m, B) mean irradiance during each over the steady lamp's.
    """

    duration_s: FloatArray
    fraction: FloatArray

    @classmethod
    def sampled(cls, t_s: ArrayLike, fraction: ArrayLike) -> Self:
        """From samples: (m + 1,) rising times from the switch, 0 first, and (m + 1, B) values.

        Raises
        ------
        FitError
            Times that do not rise from 0, or shapes that do not go together.
        """
        times, values = np.asarray(t_s, dtype=np.float64), np.asarray(fraction, dtype=np.float64)
        rising = times.ndim == 1 and len(times) > 1 and times[0] == 0 and (np.diff(times) > 0).all()
        if not rising or values.ndim != 2 or len(values) != len(times):
            raise FitError(
                "expected the lamp's irradiance at two or more times that rise from 0 s (the "
                f"switch), one row for each, got {times.shape} times and {values.shape} values"
            )
        return cls(np.diff(times), (values[1:] + values[:-1]) / 2)

    @classmethod
    def none(cls, bands: int) -> Self:
        """A lamp that switches at once."""
        return cls(np.zeros(0), np.zeros((0, bands)))

    @property
    def total_s(self) -> float:
        """From the switch until nothing changes any more."""
        return float(self.duration_s.sum())


@dataclass(frozen=True, eq=False)
class Charge:
    """One charge and the photographs after it, before the next one; times on one clock.

    Attributes
    ----------
    on_s, off_s
        When the lamp was switched.
    start_s, exposure_s
        (n,) of the photographs.
    brightness
        The lamp's, over the one that `irradiance` belongs to.
    cold
        Part of what a cold lamp lacks that it lacked in this charge on average, 0 to 1.
    fresh
        Whether the sample was exchanged for one that has never seen light.
    saturated
        Take all states for fully charged at lamp-off, r = 1, as Nalbach et al. do after 90 minutes.
    """

    on_s: float
    off_s: float
    start_s: FloatArray
    exposure_s: FloatArray
    brightness: float = 1.0
    cold_deficit: float = 0.0
    fresh: bool = False
    saturated: bool = False


@dataclass(frozen=True, eq=False)
class ChargingSeries:
    """Charges in one geometry, and n photographs of P sites in C channels.

    Attributes
    ----------
    name
        In messages and results.
    charges
        By rising time; the first finds the sample dark.
    rise, fade
        The lamp's, after it was switched on and off.
    irradiance
        (P, B) E of every site in every band of the steady lamp, relative to the stated norm.
    values, sigma
        (n, P, C) mean signal per second of exposure, and independent standard uncertainty; NaN
        where nothing was measured.
    site_modes
        (M, P, B) ln of the sites' irradiance in every band may be off by Σ_m z_m site_modes[m], the
        z_m independent and of unit variance, the same at every charge; None: exact.
    across
        (Q, P, B) irradiance at Q places within every site that stand for it, over the site's: where
        light is uneven, a mean level is not the level of the mean light. None: it is even.
    """

    name: str
    charges: tuple[Charge, ...]
    rise: Transient
    fade: Transient
    irradiance: FloatArray
    values: FloatArray
    sigma: FloatArray
    site_modes: FloatArray | None = None
    across: FloatArray | None = None

    def spread(self) -> Self:
        """The same with every place within the sites a site of its own, place by place."""
        if self.across is None:
            return self
        irradiance = (self.across * self.irradiance).reshape(-1, self.irradiance.shape[1])
        return replace(self, irradiance=irradiance, across=None)

    def first_frames(self, usable: BoolArray) -> dict[int, int]:
        """Row of its first usable photograph, for each charge photographed as soon as most.

        Parameters
        ----------
        usable
            (n,) photographs that may be taken.
        """
        ends = np.cumsum([0, *(len(charge.start_s) for charge in self.charges)])
        first = {
            number: low + int(np.argmax(usable[low:high]))
            for number, (low, high) in enumerate(pairwise(ends))
            if usable[low:high].any()
        }
        begins_s = np.concatenate([charge.start_s - charge.off_s for charge in self.charges])
        if not first:
            return {}
        usual_s = float(np.median([begins_s[row] for row in first.values()]))
        return {number: row for number, row in first.items() if begins_s[row] <= LATER * usual_s}

    def checked(self) -> Self:
        """Itself, if nothing is wrong with it.

        Raises
        ------
        FitError
            Charges or photographs that overlap, or shapes that do not go together.
        """
        shots = sum(len(charge.start_s) for charge in self.charges)
        sites, bands = self.irradiance.shape
        lamp = (self.rise.fraction.shape[1], self.fade.fraction.shape[1])
        if (
            self.values.shape != self.sigma.shape
            or self.values.shape[:2] != (shots, sites)
            or lamp != (bands, bands)
        ):
            raise FitError(
                f"{self.name}: expected values and sigma of {shots} photographs of {sites} sites, "
                f"rise and fade in {bands} bands, got {self.values.shape}, {self.sigma.shape} and "
                f"{lamp}"
            )
        modes = self.site_modes
        if modes is not None and not (
            modes.shape[1:] == (sites, bands) and np.isfinite(modes).all()
        ):
            raise FitError(f"{self.name}: expected finite 'site_modes' of {sites} x {bands}")
        if not (self.irradiance >= 0).all():
            raise FitError(f"{self.name}: expected irradiances of 0 or more, got a smaller one")
        measured = np.isfinite(self.values) & np.isfinite(self.sigma)
        if not measured.any() or (self.sigma[measured] <= 0).any():
            raise FitError(f"{self.name}: expected values with uncertainties above 0, got none")
        for charge in self.charges:
            self._check_charge(charge)
        for before, after in pairwise(self.charges):
            ends_s = [before.off_s + self.fade.total_s, *(before.start_s + before.exposure_s)]
            if after.on_s < max(ends_s):
                raise FitError(
                    f"{self.name}: expected every charge after the photographs of the one before, "
                    f"got one at {after.on_s:g} s"
                )
        return self

    def _check_charge(self, charge: Charge) -> None:
        dark_s = charge.off_s + self.fade.total_s
        if charge.on_s >= charge.off_s or len(charge.start_s) != len(charge.exposure_s):
            raise FitError(f"{self.name}: expected 'on' before 'off', got {charge}")
        if charge.off_s - charge.on_s < self.rise.total_s:
            raise FitError(
                f"{self.name}: expected charges that outlast the lamp's rise of "
                f"{self.rise.total_s:g} s, got one of {charge.off_s - charge.on_s:g} s"
            )
        if len(charge.start_s) and charge.start_s.min() < dark_s - 1e-6:
            raise FitError(
                f"{self.name}: expected photographs after the lamp has faded, {dark_s:.3f} s, got "
                f"one at {charge.start_s.min():.3f} s; leave it out"
            )
