"""Albedo and total radiance factor from the ratios of a sample's light to a grey card's.

Light that comes back is reflection, prompt fluorescence and glow (Nalbach et al., eq. 2). Two
pictures through a variable filter divide them. Lit by white light and seen at one wavelength after
the other, luminescence is where the emission is; lit by one wavelength after the other and seen as
a whole, it has the emission's colour wherever the light excites, and there is next to none where
the light is as red as the emission. In both its course is that of the glow, which is photographed
alone. A sample that does not fluoresce has just the glow; of another one the amounts are free, one
or two for the white light and for each place of the narrow light. The albedo is what both pictures
have in common.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space

from labrig.fit.reflectance.luminescence import Luminescence
from labrig.fit.spectrum import SpectralSystem, SpectrumFit, fit_spectrum
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import FitError
from labrig.optics import Transmittance

#: σ of the part of a sample's light that a filter close above it throws back onto it.
THROWN_BACK_SIGMA = 0.02
#: Number of draws of a reflectance, and of those that are only a step to it.
SAMPLES, FEW_SAMPLES = 400, 100
#: Significance of an amount of luminescence above the glow's, and ratio of misfits without and with
#: free amounts, from which a sample fluoresces.
PROMPT_SIGMAS, PROMPT_MISFIT = 3.0, 1.2
#: Stiffest prior of an albedo: second differences of 0.3 % over 5 nm, as of reflectances of paints.
STIFFEST = 1e5
#: Error at the foot of an edge that a filter's band is too wide for, over the second difference of
#: the albedo there, over two times 10 nm.
UNRESOLVED, UNRESOLVED_NM = 0.1, 10.0
#: Of that part, where sample and card are alike and nothing tells it.
MIN_PRECISION = 1.0


@dataclass(frozen=True, eq=False)
class LitStrip:
    """Light of a sample over that of a grey card in one arrangement of lamp, filter and camera.

    Attributes
    ----------
    value, sigma
        Ratios and their independent σ, shape (m,); NaN where they are not known.
    system
        Linear model of the ratios by the reflectance at its knots, as `relative_to_card` gives it.
    glow, glow_sigma
        Ratios of the steady glow, and σ of what they have in error together, shape (m,); 0 for a
        sample that does not glow.
    luminescence
        Ratios of luminescence alone per unit of each of its free amounts, shape (k, m); no rows for
        a sample that does not glow.
    scale_sigma
        Relative σ of an error that all ratios have in common.
    """

    value: FloatArray
    sigma: FloatArray
    system: SpectralSystem
    glow: FloatArray
    glow_sigma: FloatArray
    luminescence: FloatArray
    scale_sigma: float

    @property
    def known(self) -> NDArray[np.bool_]:
        """Which ratios are known, shape (m,)."""
        known = np.isfinite(self.value) & np.isfinite(self.sigma) & (self.sigma > 0)
        known &= np.isfinite(self.system.design).all(axis=1)
        known &= np.isfinite(self.luminescence).all(axis=0) & np.isfinite(self.glow)
        return known

    @property
    def usable(self) -> "LitStrip":
        """The ratios that are known."""
        known = self.known
        return LitStrip(
            self.value[known],
            self.sigma[known],
            self.system.of(known),
            self.glow[known],
            self.glow_sigma[known],
            self.luminescence[:, known],
            self.scale_sigma,
        )

    @property
    def lit_only(self) -> "LitStrip":
        """The strip as if nothing luminesced."""
        return replace(self, luminescence=self.luminescence[:0])

    @property
    def without_prompt(self) -> "LitStrip":
        """The strip of a sample that does not fluoresce, whose only luminescence is its glow."""
        return replace(
            self,
            value=self.value - self.glow,
            sigma=np.hypot(self.sigma, self.glow_sigma),
            luminescence=self.luminescence[:0],
        )

    def with_modes(self, changes: FloatArray) -> "LitStrip":
        """Return the strip with further errors of the design, relative to it, shape (k, m)."""
        added = changes[:, :, np.newaxis] * self.system.design
        modes = np.concatenate([self.system.modes, added]) if len(self.system.modes) else added
        return replace(self, system=replace(self.system, modes=modes))

    def reflected(self) -> tuple[FloatArray, SpectralSystem]:
        """Return values of σ 1 that luminescence does not change, and their system.

        They are all combinations of the ratios that are orthogonal to each of its courses.
        """
        onto = np.diag(1 / self.sigma)
        if courses := [row for row in self.luminescence / self.sigma if row.any()]:
            onto = null_space(np.array(courses)).T @ onto
        shape = (len(onto), len(self.system.knots_nm))
        modes = onto @ self.system.modes if len(self.system.modes) else np.empty((0, *shape))
        system = SpectralSystem(self.system.knots_nm, onto @ self.system.design, modes)
        return onto @ self.value, system


@dataclass(frozen=True, eq=False)
class AlbedoFit:
    """Albedo and total radiance factor at the knots of the systems.

    Attributes
    ----------
    albedo
        Light that comes back at its own wavelength; without what the ratios have in common.
    radiance_factor
        All light that comes back under the white lamp.
    amount, amount_sigma
        Luminescence under the white lamp over the first course that was given, and σ; NaN without
        one.
    is_prompt
        Whether there is more luminescence than the glow, so that its amounts were free.
    thrown_back, thrown_back_sigma
        Part of the light of the sample below the filter that is thrown back onto it, and σ.
    """

    albedo: SpectrumFit
    radiance_factor: SpectrumFit
    amount: float
    amount_sigma: float
    is_prompt: bool
    thrown_back: float
    thrown_back_sigma: float


def relative_to_card(light: SpectralSystem, card: Transmittance) -> SpectralSystem:
    """Return the system of ratios of a sample to a card, from that of their light.

    Parameters
    ----------
    light
        System of the values by the reflectance of what is lit: lamp, filter and camera.
    card
        Reflectance of the card.

    Returns
    -------
    SpectralSystem
        A card of the same reflectance has the ratio 1. Errors of the design that change sample and
        card alike leave the ratio as it is; where the reflectance varies within a band, they count.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.fit.reflectance import relative_to_card
    >>> from labrig.fit.spectrum import SpectralSystem
    >>> from labrig.optics import Transmittance
    >>> card = Transmittance("grey", np.array([400.0, 700.0]), np.array([0.2, 0.2]))
    >>> light = SpectralSystem(np.array([500.0, 510.0]), np.array([[1.0, 3.0]]))
    >>> relative_to_card(light, card).design @ np.array([0.2, 0.2])
    array([1.])
    """
    grey = card.at(light.knots_nm)
    of_card = (light.design @ grey)[:, np.newaxis]
    with np.errstate(divide="ignore", invalid="ignore"):
        design = light.design / of_card
        if not len(light.modes):
            return replace(light, design=design)
        modes = light.modes / of_card
    modes = modes - (modes @ grey)[:, :, np.newaxis] * design
    return replace(light, design=design, modes=modes)


def fit_albedo(
    white: LitStrip, narrow: LitStrip, card: Transmittance, excited: Luminescence | None = None
) -> AlbedoFit:
    """Fit the albedo that explains the ratios by white and by narrow light.

    Parameters
    ----------
    white
        Lit by white light, seen through the filter.
    narrow
        Lit through the filter.
    card
        Reflectance of the card.
    excited
        Luminescence of both as one excitation explains it; None leaves the amounts free of one
        another.

    Returns
    -------
    AlbedoFit
        Albedo and total radiance factor, without the errors common to all ratios of `white`.

    Raises
    ------
    FitError
        Too few ratios are known, or none above its noise.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.fit.reflectance import LitStrip, fit_albedo, relative_to_card
    >>> from labrig.fit.spectrum import SpectralSystem
    >>> from labrig.optics import Transmittance
    >>> knots_nm = np.arange(400.0, 701.0, 10.0)
    >>> card = Transmittance("grey", knots_nm, np.full(31, 0.2))
    >>> bands = np.exp(-(((knots_nm - knots_nm[:, np.newaxis]) / 15) ** 2))
    >>> system = relative_to_card(SpectralSystem(knots_nm, bands), card)
    >>> none, dark = np.empty((0, 31)), np.zeros(31)
    >>> strip = LitStrip(np.full(31, 2.0), np.full(31, 0.01), system, dark, dark, none, 0.001)
    >>> fit_albedo(strip, strip, card).albedo.value[15].round(2)
    0.4
    """
    if excited is not None:
        excited = excited.of(white.known, narrow.known)
    white, narrow = white.usable, narrow.usable
    total = _fitted([white.lit_only])
    found = _free(white, narrow, card)
    if excited is not None and np.isfinite(found.amount):
        tied = _tied(white, narrow, card, excited, found)
        # Fluorescence of a colour that is not the glow's, or none that adds up.
        if tied.albedo.misfit < PROMPT_MISFIT * found.albedo.misfit:
            found = tied
    strips = (white.without_prompt, narrow.without_prompt)
    albedo = _albedo(*strips, card)
    steady, steady_sigma = _steady(white)
    is_prompt = bool(
        found.amount - steady > PROMPT_SIGMAS * np.hypot(found.amount_sigma, steady_sigma)
        or albedo.misfit > PROMPT_MISFIT * found.albedo.misfit
    )
    if is_prompt:
        strips, albedo = (white, narrow), found.albedo
    thrown_back = _thrown_back(*strips, card)
    return AlbedoFit(albedo, total, found.amount, found.amount_sigma, is_prompt, *thrown_back)


@dataclass(frozen=True, eq=False)
class _Luminescent:
    """Albedo of a sample that may fluoresce, amount of its luminescence by white light, and σ."""

    albedo: SpectrumFit
    amount: float
    amount_sigma: float


def _free(white: LitStrip, narrow: LitStrip, card: Transmittance) -> _Luminescent:
    """Fit with amounts of luminescence that are free of one another."""
    albedo = _albedo(white, narrow, card)
    return _Luminescent(albedo, *_amount(white, albedo))


def _tied(
    white: LitStrip,
    narrow: LitStrip,
    card: Transmittance,
    excited: Luminescence,
    free: _Luminescent,
) -> _Luminescent:
    """Fit with amounts that one excitation explains, near those that were free."""
    scaled = _scaled_freely(narrow, white.scale_sigma)
    excess = _excess(narrow, free.albedo, card)
    scaled = scaled.with_modes(THROWN_BACK_SIGMA * excess[np.newaxis])
    value, system = _stacked([(one.value, one.system) for one in (white, scaled)])
    noise = np.concatenate([white.sigma, scaled.sigma]) ** 2
    largest = abs(free.amount) + 2 * free.amount_sigma
    mean = largest / excited.by_white(np.ones_like(excited.share))
    amounts = np.zeros_like(excited.share)
    for samples in (FEW_SAMPLES, SAMPLES):
        last = amounts
        courses, prior = excited.courses(last), excited.prior(last, mean)
        lever = prior @ courses
        spread = np.diag(noise) + courses.T @ lever
        lower = np.asarray(np.linalg.cholesky(spread), dtype=np.float64)
        albedo = _fitted_whole(value, system, lower, samples)
        spread += system.covariance(albedo.value)
        gain = np.linalg.solve(spread, lever.T).T
        unknowns = gain @ (value - system.design @ albedo.value)
        amounts = unknowns[: len(amounts)]
    by_white = np.zeros(len(prior))
    by_white[: len(amounts)] = excited.share + excited.ultraviolet
    by_white[-2] = excited.sum_sigma(last)
    draws = (value - albedo.samples @ system.design.T) @ (by_white @ gain)
    rest = by_white @ (prior - gain @ lever.T) @ by_white
    return _Luminescent(albedo, float(by_white @ unknowns), float(np.sqrt(draws.var() + rest)))


def _albedo(white: LitStrip, narrow: LitStrip, card: Transmittance) -> SpectrumFit:
    """Fit the reflectance of two strips, with the light that the filter may throw back."""
    scaled = _scaled_freely(narrow, white.scale_sigma)
    excess = _excess(narrow, _fitted([white, scaled], FEW_SAMPLES), card)
    return _fitted([white, scaled.with_modes(THROWN_BACK_SIGMA * excess[np.newaxis])])


def _steady(white: LitStrip) -> tuple[float, float]:
    """Return the amount of the first course that the steady glow has, and its σ."""
    if not white.luminescence.any():
        return 0.0, 0.0
    course = white.luminescence[0] / white.sigma**2
    norm = float(course @ white.luminescence[0])
    return float(course @ white.glow) / norm, float(course @ white.glow_sigma) / norm


def unresolved(wavelength_nm: FloatArray, value: FloatArray) -> FloatArray:
    """Return the error of an albedo by bends that the filter's band does not resolve.

    Parameters
    ----------
    wavelength_nm
        Evenly spaced wavelengths in nm, shape (n,).
    value
        Albedo at them, shape (n,).

    Returns
    -------
    ndarray
        One standard deviation, shape (n,).

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.fit.reflectance import unresolved
    >>> unresolved(np.arange(500.0, 541.0, 10.0), np.array([0.1, 0.1, 0.1, 0.3, 0.5])).round(3)
    array([0.  , 0.  , 0.02, 0.  , 0.  ])
    """
    step = max(round(UNRESOLVED_NM / (wavelength_nm[1] - wavelength_nm[0])), 1)
    bend = np.zeros_like(value)
    bend[step:-step] = value[2 * step :] - 2 * value[step:-step] + value[: -2 * step]
    bend[:step], bend[-step:] = bend[step], bend[-step - 1]
    return np.asarray(UNRESOLVED * np.abs(bend))


def _scaled_freely(narrow: LitStrip, other_sigma: float) -> LitStrip:
    """Return a strip whose scale is free against another's by the errors of both."""
    sigma = float(np.hypot(narrow.scale_sigma, other_sigma))
    return narrow.with_modes(np.full((1, len(narrow.value)), sigma))


def _fitted(strips: Sequence[LitStrip], samples: int = SAMPLES) -> SpectrumFit:
    """Fit one reflectance to several strips, each with errors of its own."""
    value, system = _stacked([strip.reflected() for strip in strips])
    return _fitted_whole(value, system, None, samples)


def _stacked(
    parts: Sequence[tuple[FloatArray, SpectralSystem]],
) -> tuple[FloatArray, SpectralSystem]:
    """Return values and system of several strips of one reflectance, with errors of their own."""
    rows = [len(value) for value, _ in parts]
    if min(rows) == 0:
        raise FitError("expected light of sample and card along the filter, got none that is known")
    modes, first = [], 0
    for count, (_, system) in zip(rows, parts, strict=True):
        padded = np.zeros((len(system.modes), sum(rows), len(system.knots_nm)))
        if len(system.modes):
            padded[:, first : first + count] = system.modes
        modes.append(padded)
        first += count
    whole = SpectralSystem(
        parts[0][1].knots_nm,
        np.concatenate([system.design for _, system in parts]),
        np.concatenate(modes),
    )
    return np.concatenate([value for value, _ in parts]), whole


def _fitted_whole(
    value: FloatArray, system: SpectralSystem, lower: FloatArray | None, samples: int
) -> SpectrumFit:
    """Fit a reflectance to values of σ 1, or of the covariance of a Cholesky factor."""
    if lower is not None:
        onto = np.linalg.inv(lower)
        value = onto @ value
        system = SpectralSystem(system.knots_nm, onto @ system.design, onto @ system.modes)
    ones = np.ones_like(value)
    return fit_spectrum(
        value, ones, system, samples=samples, decisive=np.inf, stiffest=STIFFEST, is_local=True
    )


def _excess(strip: LitStrip, fit: SpectrumFit, card: Transmittance) -> FloatArray:
    """Return reflectance of the sample minus that of the card in the band of each ratio, (m,)."""
    knots = strip.system.knots_nm
    sample = np.interp(knots, fit.knots_nm, fit.value)
    weight = strip.system.design / strip.system.design.sum(axis=1, keepdims=True)
    return np.asarray(weight @ (sample - card.at(knots)))


def _thrown_back(white: LitStrip, narrow: LitStrip, card: Transmittance) -> tuple[float, float]:
    """Return the part of the light thrown back by a filter on the sample, and σ.

    It brightens what is brighter than the card by more than the card: the ratio of narrow to white
    light rises with the excess.
    """
    seen = _fitted([white], FEW_SAMPLES)
    value, system = narrow.reflected()
    knots = system.knots_nm
    draws = np.array([np.interp(knots, seen.knots_nm, draw) for draw in seen.samples])
    mean = draws.mean(axis=0)
    excess = _excess(narrow, seen, card)
    onto, _ = replace(narrow, value=excess * (narrow.system.design @ mean)).reflected()
    expected = system.design @ mean
    spread = np.cov(system.design @ draws.T) + system.covariance(mean) + np.eye(len(value))
    missed = system.design * unresolved(knots, mean)
    spread += missed @ missed.T
    # The two strips' scales differ by their own errors, too.
    scale_sigma = float(np.hypot(white.scale_sigma, narrow.scale_sigma))
    slopes = np.column_stack([onto, expected])
    weighted = np.linalg.solve(spread, slopes)
    precision = slopes.T @ weighted + np.diag([MIN_PRECISION, scale_sigma**-2])
    covariance = np.linalg.inv(precision)
    part, _ = covariance @ weighted.T @ (value - expected)
    return float(part), float(np.sqrt(covariance[0, 0]))


def _amount(white: LitStrip, albedo: SpectrumFit) -> tuple[float, float]:
    """Return the amount of luminescence under the white lamp and its σ; NaN without a course.

    It is that of the first course which all of them together have in the mean over the strip.
    """
    if not white.luminescence.any():
        return float("nan"), float("nan")
    courses = white.luminescence / white.sigma
    whole = courses @ courses.T
    mean = whole[0] / whole[0, 0]
    knots = white.system.knots_nm
    amounts = []
    for x in albedo.samples:
        rest = white.value - white.system.design @ np.interp(knots, albedo.knots_nm, x)
        amounts.append(float(mean @ np.linalg.lstsq(courses.T, rest / white.sigma, rcond=None)[0]))
    return float(np.mean(amounts)), float(np.hypot(np.std(amounts), whole[0, 0] ** -0.5))
