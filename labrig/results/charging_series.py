"""Measurement of an excitation: charges of a sample, and photographs of its glow after each.

One photograph shows many sites at once: places under the linear variable filter that were charged
by different wavelengths, or samples under the lamp itself.
"""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from labrig.foundation.arrays import BoolArray, FloatArray, IntArray
from labrig.foundation.errors import FitError

#: Delay of the first photograph, in multiples of the median, beyond which a charge is left out
#: (metering charges are photographed only before the next charge).
LATER = 3.0


@dataclass(frozen=True, eq=False)
class Transient:
    """Turn-on or turn-off transient of the lamp in B bands.

    Attributes
    ----------
    duration_s
        Durations of m steps from the switch on, in seconds, shape (m,).
    fraction
        Mean irradiance during each step relative to the steady lamp's, shape (m, B).
    """

    duration_s: FloatArray
    fraction: FloatArray

    @classmethod
    def sampled(cls, t_s: ArrayLike, fraction: ArrayLike) -> Self:
        """Construct a transient from samples.

        Parameters
        ----------
        t_s
            Times in seconds after the switch, rising from 0, shape (m + 1,).
        fraction
            Irradiance at these times relative to the steady lamp's, shape (m + 1, B).

        Raises
        ------
        FitError
            The times do not rise from 0, or the shapes do not agree.
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
        """Construct the transient of a lamp that switches instantly."""
        return cls(np.zeros(1), np.ones((1, bands)))

    def in_parts(self, most: int) -> Self:
        """Return the transient in at most so many steps, each with its mean light."""
        steps = np.arange(len(self.duration_s))
        if len(steps) <= most:
            return self
        parts = np.array_split(steps, most)
        means = [np.average(self.fraction[p], axis=0, weights=self.duration_s[p]) for p in parts]
        return type(self)(
            np.array([self.duration_s[part].sum() for part in parts]), np.array(means)
        )

    @property
    def total_s(self) -> float:
        """Duration of the transient in seconds."""
        return float(self.duration_s.sum())


@dataclass(frozen=True, eq=False)
class Charge:
    """One charge and the n photographs between it and the next one; times on one clock.

    Attributes
    ----------
    on_s, off_s
        Times in seconds at which the lamp was switched on and off.
    start_s, exposure_s
        Begins and exposure times of the photographs in seconds, shape (n,).
    brightness
        Brightness of the lamp relative to the one that `irradiance` belongs to.
    cold
        Mean warm-up deficit during this charge as a fraction of a cold lamp's, 0 to 1.
    fresh
        Whether the sample was exchanged for one that has never been exposed to light.
    saturated
        Whether all states count as fully charged at lamp off, r = 1, as Nalbach et al. assume after
        90 minutes.
    light
        Row of the series' irradiance by which all sites are charged, where one light is selected
        after another. None: every site has the row of its own.
    """

    on_s: float
    off_s: float
    start_s: FloatArray
    exposure_s: FloatArray
    brightness: float = 1.0
    cold_deficit: float = 0.0
    fresh: bool = False
    saturated: bool = False
    light: int | None = None


@dataclass(frozen=True, eq=False)
class EarlierCharges:
    """Charges of the same sites before a series began, of which something may be left.

    Attributes
    ----------
    charges
        The charges by rising time, on the same clock.
    irradiance
        Irradiance of every site, or of every selected light, in every band, shape (P, B).
    rise, fade
        Turn-on and turn-off transients of their light.
    """

    charges: tuple[Charge, ...]
    irradiance: FloatArray
    rise: Transient
    fade: Transient


@dataclass(frozen=True, eq=False)
class ChargingSeries:
    """Charges in one geometry, and n photographs of P sites in C channels.

    Attributes
    ----------
    name
        Name of the series in messages and results.
    charges
        Charges by rising time; the first finds the sample dark, but for `start` and what `earlier`
        left.
    rise, fade
        Turn-on and turn-off transients of the lamp.
    irradiance
        Irradiance E of every site in every band of the steady lamp, relative to the stated norm,
        shape (P, B). Where one light is selected after another, E of every light, shape (L, B).
    values, sigma
        Mean signal per second of exposure and its independent standard uncertainty, shape (n, P,
        C); NaN where nothing was measured.
    site_modes
        Error modes of the rows of `irradiance`, shape (M, P, B): its logarithm in every band may be
        off by Σ_m z_m site_modes[m], the z_m independent and of unit variance, the same at every
        charge. None: it is exact.
    mode_kind
        Kind of each mode, from 0, shape (M,): modes of one kind have a common size that a fit may
        find; −1 if the size is known. None: all sizes are known.
    across
        Irradiance at Q places within every site relative to the site's, shape (Q, P, B): in uneven
        light, the mean level is not the level of the mean light. None: the light is even.
    frame_light
        Mean light of the whole frame of each photograph, a fraction of which may veil every site,
        in the unit of the site's values, shape (n, P, C). None: nothing does.
    veil_shapes
        Courses along the sites by which the veil may differ from an even one, shape (K, P). None:
        it is even.
    earlier
        Charges before the first one of the series, which slow states and those of a kinetic order
        above 1 remember for long; None: there were none.
    start
        Concentration of every state at all sites when the first of all charges begins, shape (N,).
        None: the sample is dark.
    arriving
        Fraction of the light of each band that arrives at Q depths of the sample, each of which
        stands for as much of it, shape (Q, B). None: the sample is a surface.
    """

    name: str
    charges: tuple[Charge, ...]
    rise: Transient
    fade: Transient
    irradiance: FloatArray
    values: FloatArray
    sigma: FloatArray
    site_modes: FloatArray | None = None
    mode_kind: IntArray | None = None
    across: FloatArray | None = None
    frame_light: FloatArray | None = None
    veil_shapes: FloatArray | None = None
    earlier: EarlierCharges | None = None
    start: FloatArray | None = None
    arriving: FloatArray | None = None

    @property
    def sites(self) -> int:
        """Number P of sites."""
        return int(self.values.shape[1] if self.is_by_light else len(self.irradiance))

    @property
    def is_by_light(self) -> bool:
        """Whether one light after another charges all sites."""
        return any(charge.light is not None for charge in self.charges)

    def irradiance_of(self, charge: Charge) -> FloatArray:
        """Return the irradiance of every site in a charge of the series, shape (P, B) or (1, B)."""
        return self.irradiance if charge.light is None else self.irradiance[[charge.light]]

    def row_of_shots(self) -> IntArray:
        """Return the row of `irradiance` by which each photograph's charge was, shape (n, P)."""
        own = np.arange(self.sites)
        rows = [own if charge.light is None else 0 * own + charge.light for charge in self.charges]
        return np.repeat(rows, [len(charge.start_s) for charge in self.charges], axis=0)

    def by_light(self) -> list[Self]:
        """Return the charges by each light as a series without its errors, or the series itself.

        What earlier charges have left is not in them.
        """
        if not self.is_by_light:
            return [self]
        series, row = [], self.row_of_shots()[:, 0]
        for light, irradiance in enumerate(self.irradiance):
            own = tuple(
                replace(charge, light=None) for charge in self.charges if charge.light == light
            )
            if own:
                series.append(
                    type(self)(
                        self.name,
                        own,
                        self.rise,
                        self.fade,
                        np.tile(irradiance, (self.sites, 1)),
                        self.values[row == light],
                        self.sigma[row == light],
                    )
                )
        return series

    @property
    def places(self) -> int:
        """Number of parts of every site that `spread` makes sites: places within it at depths."""
        depths = self._depths_of_sites()
        return (1 if depths is None else len(depths)) * (
            1 if self.across is None else len(self.across)
        )

    def _depths_of_sites(self) -> FloatArray | None:
        """Return `arriving` if the rows of every irradiance are sites, and not selected lights."""
        earlier = () if self.earlier is None else self.earlier.charges
        is_of_sites = all(charge.light is None for charge in (*self.charges, *earlier))
        return self.arriving if is_of_sites else None

    def spread(self) -> Self:
        """Return the series with every place within the sites at every depth as a site.

        All sites follow each other for each of the `places`. Where one light after another is
        selected, a row of `irradiance` is no site, and depths remain: see `at_depths`.
        """
        if self.places == 1:
            return self
        depths, earlier = self._depths_of_sites(), self.earlier
        of_depths = np.ones((1, 1, 1, 1)) if depths is None else depths[:, None, None]
        across = np.ones((1, 1, 1)) if self.across is None else self.across
        bands = self.irradiance.shape[1]
        if earlier is not None:
            everywhere = np.broadcast_to(
                of_depths * earlier.irradiance,
                (len(of_depths), len(across), *earlier.irradiance.shape),
            )
            earlier = replace(earlier, irradiance=everywhere.reshape(-1, bands))
        return replace(
            self,
            irradiance=(of_depths * across * self.irradiance).reshape(-1, bands),
            across=None,
            arriving=self.arriving if depths is None else None,
            earlier=earlier,
        )

    def at_depths(self) -> list[Self]:
        """Return the series at each depth of the sample, as of a surface in the light there."""
        return [
            replace(
                self,
                irradiance=self.irradiance * fraction,
                earlier=self.earlier
                and replace(self.earlier, irradiance=self.earlier.irradiance * fraction),
                arriving=None,
            )
            for fraction in (() if self.arriving is None else self.arriving)
        ]

    def before(self) -> Self | None:
        """Return the series of earlier charges, without photographs; None if there were none."""
        if self.earlier is None:
            return None
        nothing: FloatArray = np.empty((0, *self.values.shape[1:]))
        never: FloatArray = np.empty(0)
        return replace(
            self,
            charges=tuple(
                replace(charge, start_s=never, exposure_s=never) for charge in self.earlier.charges
            ),
            rise=self.earlier.rise,
            fade=self.earlier.fade,
            irradiance=self.earlier.irradiance,
            values=nothing,
            sigma=nothing,
            earlier=None,
        )

    def first_frames(self, usable: BoolArray) -> dict[int, int]:
        """Return the row of its first usable photograph for each charge.

        Charges first photographed more than three times later than most are left out.

        Parameters
        ----------
        usable
            Whether each photograph may be used, shape (n,).
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
        """Return the series itself if it is consistent.

        Raises
        ------
        FitError
            Charges or photographs overlap, or shapes do not agree.
        """
        shots = sum(len(charge.start_s) for charge in self.charges)
        rows, bands = self.irradiance.shape
        sites = self.sites
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
            modes.shape[1:] == (rows, bands) and np.isfinite(modes).all()
        ):
            raise FitError(f"{self.name}: expected finite 'site_modes' of {rows} x {bands}")
        light = self.frame_light
        if light is not None and not (
            light.shape == self.values.shape and np.isfinite(light).all()
        ):
            raise FitError(
                f"{self.name}: expected a finite 'frame_light' of {shots} photographs of {sites} "
                "sites"
            )
        if self.mode_kind is not None and (modes is None or len(self.mode_kind) != len(modes)):
            raise FitError(f"{self.name}: expected a kind of each of the 'site_modes'")
        lights = [-1 if charge.light is None else charge.light for charge in self.charges]
        if self.is_by_light and not (
            0 <= min(lights) <= max(lights) < rows and self.across is None
        ):
            raise FitError(f"{self.name}: expected one of {rows} lights at every charge")
        if self.arriving is not None and self.arriving.shape[1] != bands:
            raise FitError(
                f"{self.name}: expected fractions of light in {bands} bands at each depth"
            )
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
