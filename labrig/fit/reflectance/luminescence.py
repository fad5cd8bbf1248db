"""Luminescence that a sample has by white and by narrow light, as one excitation explains both.

White light is the sum of the narrow lights along the filter: what each of them excites adds up to
what white light does (Donaldson, *Spectrophotometry of fluorescent pigments*, Br. J. Appl. Phys. 5,
1954, has it as the sum over a row of the sample's matrix). With the emission as the glow shows it,
the amounts at all places are all that is unknown, and they vary along the filter no faster than its
band is wide.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.arrays import FloatArray

#: Distance in nm over which excitation through the filter stays alike, and over which its colour
#: does.
ALIKE_NM, COLOUR_ALIKE_NM = 20.0, 60.0
#: Prior σ of the amount at a place, over the mean of all places.
LARGEST = 6.0
#: Relative σ of the sum of the amounts against that by white light: the filter's transmission, lens
#: and lamp at the two places of the strip.
SUM_SIGMA = 0.1
#: Relative σ of what light of shorter wavelengths than the filter's excites, taken to be as much as
#: at the filter's blue end.
ULTRAVIOLET_SIGMA = 0.7
#: σ of the part of the emission that light of its own wavelengths does not excite, as it would be
#: if nothing were emitted at shorter wavelengths than the light's.
STOKES_SIGMA = 0.3
#: σ of the difference in colour between fluorescence and glow: relative, over a width (1 σ) of the
#: emission.
COLOUR_SIGMA = 0.2
#: Least part of the emission beyond a place's wavelength that counts in the prior.
MIN_BEYOND = 1e-4
#: Least part of the emission at longer wavelengths than a place's that tells its colour there.
MIN_SIDE = 0.02
#: Reach of the emission's change of colour, in its widths.
REDDEST = 2.5


@dataclass(frozen=True, eq=False)
class Luminescence:
    """Ratios to the card, of both strips in turn, that luminescence by each place's light has.

    Attributes
    ----------
    centre_nm
        Wavelength of the narrow light of each place, shape (p,).
    share
        Amount by white light per unit of the amount at each place, shape (p,).
    ultraviolet
        That by light of shorter wavelengths, per unit of the amount at each place, shape (p,): 0
        but at the blue end.
    beyond
        Part of the emission at longer wavelengths than those of each place's light, shape (p,).
    white, narrow
        Ratios of emission as of the glow by white light, shape (m,), and by narrow light per unit
        of the amount at each place, shape (p, n).
    white_redder, narrow_redder
        What is added to them if only wavelengths longer than the light's are emitted, as much in
        all, shapes (p, m) and (p, n).
    white_tilted, narrow_tilted
        What is added to them by an emission that is redder by its own relative slope, shapes (m,)
        and (p, n).
    """

    centre_nm: FloatArray
    share: FloatArray
    ultraviolet: FloatArray
    beyond: FloatArray
    white: FloatArray
    narrow: FloatArray
    white_redder: FloatArray
    narrow_redder: FloatArray
    white_tilted: FloatArray
    narrow_tilted: FloatArray

    def of(self, white: NDArray[np.bool_], narrow: NDArray[np.bool_]) -> "Luminescence":
        """Return that of a selection of the ratios of either strip."""
        return replace(
            self,
            white=self.white[white],
            white_redder=self.white_redder[:, white],
            white_tilted=self.white_tilted[white],
            narrow=self.narrow[:, narrow],
            narrow_redder=self.narrow_redder[:, narrow],
            narrow_tilted=self.narrow_tilted[:, narrow],
        )

    def by_white(self, amounts: FloatArray) -> float:
        """Return the amount by white light, from that at each place."""
        return float((self.share + self.ultraviolet) @ amounts)

    def courses(self, amounts: FloatArray) -> FloatArray:
        """Return the ratios of both strips per unit of each unknown, shape (2 p + 2, m + n).

        The unknowns are the amount at each place, that of which redder light is emitted only, the
        error of the sum over the σ that it has with the `amounts` (p,), and that of the colour.
        """
        by_white = self.by_white(amounts)
        share = (self.share + self.ultraviolet)[:, np.newaxis]
        dark = np.zeros(self.narrow.shape[1])
        rows = [
            np.hstack([share * self.white, self.narrow]),
            np.hstack([share * self.white_redder, self.narrow_redder]),
            np.hstack([self.sum_sigma(amounts) * self.white, dark])[np.newaxis],
            np.hstack([by_white * self.white_tilted, amounts @ self.narrow_tilted])[np.newaxis],
        ]
        return np.concatenate(rows)

    def sum_sigma(self, amounts: FloatArray) -> float:
        """Return σ of the amount by white light where that at each place is known."""
        ultraviolet = float(self.ultraviolet @ amounts)
        return float(np.hypot(SUM_SIGMA * self.by_white(amounts), ULTRAVIOLET_SIGMA * ultraviolet))

    def prior(self, amounts: FloatArray, mean: float) -> FloatArray:
        """Return the prior covariance of the unknowns of `courses`, shape (2 p + 2, 2 p + 2).

        Parameters
        ----------
        amounts
            Amount at each place as far as it is known, shape (p,).
        mean
            Mean amount of all places.
        """
        places = len(amounts)
        away_nm = self.centre_nm - self.centre_nm[:, np.newaxis]
        # Light as red as the emission excites as much less as there is less beyond it.
        sigma = LARGEST * mean * np.sqrt(np.maximum(self.beyond, MIN_BEYOND))
        redder = STOKES_SIGMA * np.maximum(amounts, 0.0)
        covariance = np.zeros((2 * places + 2, 2 * places + 2))
        covariance[:places, :places] = np.outer(sigma, sigma) * _alike(away_nm, ALIKE_NM)
        covariance[places:-2, places:-2] = np.outer(redder, redder) * _alike(
            away_nm, COLOUR_ALIKE_NM
        )
        covariance[-2, -2], covariance[-1, -1] = 1.0, COLOUR_SIGMA**2
        return covariance


@dataclass(frozen=True, eq=False)
class StripLight:
    """A strip as luminescence meets it.

    Attributes
    ----------
    centre_nm
        Wavelength of each place, shape (p,).
    card
        Light of the card at each place, shape (p, channels), in the same unit for both strips.
    weight
        Weights of the places whose sum is light that has not passed the filter, shape (p,).
    """

    centre_nm: FloatArray
    card: FloatArray
    weight: FloatArray

    def ratios(self, light: FloatArray) -> FloatArray:
        """Return the ratios to the card (…, p · channels) of light (…, p, channels)."""
        ratio = light / self.card
        return np.asarray(ratio.reshape(*ratio.shape[:-2], -1))


def luminescence_by_glow(
    glow: FloatArray,
    white: StripLight,
    narrow: StripLight,
    *,
    ultraviolet: FloatArray,
    is_direct: bool,
) -> Luminescence:
    """Return luminescence whose emission is that of the glow as it is seen through the filter.

    Parameters
    ----------
    glow
        Light of the glow through the filter, shape (p, channels), in the unit of the card's.
    white, narrow
        Strip before the camera, and on the sample.
    ultraviolet
        See `Luminescence`, shape (p,).
    is_direct
        Whether the camera sees the narrow strip's places directly, as the sum over the filter;
        otherwise it sees them through it.

    Returns
    -------
    Luminescence
        Luminescence in units of the glow's.
    """
    white_nm, narrow_nm = white.centre_nm, narrow.centre_nm
    by_place = white.weight * glow.sum(axis=1)
    whole = float(by_place.sum())
    mean_nm = float(by_place @ white_nm) / whole
    width_nm = float(np.sqrt(by_place @ (white_nm - mean_nm) ** 2 / whole))
    slope = np.clip((white_nm - mean_nm) / width_nm, -REDDEST, REDDEST)[:, np.newaxis]
    is_beyond = white_nm > narrow_nm[:, np.newaxis]
    beyond = is_beyond @ by_place / whole
    is_within = beyond > MIN_SIDE
    more = np.where(is_within, 1 / np.where(is_within, beyond, 1.0), 0.0)[:, np.newaxis]
    added = is_beyond * more - is_within[:, np.newaxis]
    redder = added[:, :, np.newaxis] * glow

    def by_narrow(emitted: FloatArray) -> FloatArray:
        """Return ratios (p, p · channels) of what each place emits, (p or 1, places, channels)."""
        each = np.broadcast_to(emitted, (len(narrow_nm), *glow.shape))
        if is_direct:
            light = np.einsum("q,pqc->pc", white.weight, each)
        else:
            light = np.array(
                [[np.interp(nm, white_nm, channel) for channel in one.T]
                 for nm, one in zip(narrow_nm, each, strict=True)]
            )  # fmt: skip
        return narrow.ratios(np.einsum("pq,pc->pqc", np.eye(len(light)), light))

    return Luminescence(
        centre_nm=narrow_nm,
        share=narrow.weight,
        ultraviolet=ultraviolet,
        beyond=beyond,
        white=white.ratios(glow),
        narrow=by_narrow(glow[np.newaxis]),
        white_redder=white.ratios(redder),
        narrow_redder=by_narrow(redder),
        white_tilted=white.ratios(slope * glow),
        narrow_tilted=by_narrow((slope * glow)[np.newaxis]),
    )


def _alike(away_nm: FloatArray, over_nm: float) -> FloatArray:
    return np.asarray(np.exp(-((away_nm / over_nm) ** 2) / 2))
