"""Spectra with narrow lines from one picture through a variable filter: are they within their σ?

    python -m tests.acceptance.spectrum_lines [count]

Lights of each kind, with places, widths and noise of their own: rms and largest error in σ of the
means over 10 nm that are above 2 % of the largest, rms error in σ of the mean over 50 nm about the
largest, rms error and rms σ of the 10 nm in per cent of the largest, and how many are said to have
lines. Broad spectra, one or two bands of 30 to 120 nm at a signal-to-noise ratio from 100 to 1000,
must not; there are ten times as many.
"""

import sys
from collections.abc import Sequence

import numpy as np

from labrig.fit.spectrum import fit_spectrum, system_through_lvf
from labrig.foundation.arrays import FloatArray
from labrig.optics import Spectrum, band_means
from tests.fit import lvf_pictures as made

BRIGHT = 0.02
SNR = 300.0
FINE_NM: FloatArray = np.arange(380.0, 720.1, 0.25)
TB_NM = (487, 493, 542, 548, 583, 588, 619, 624)
TB_HEIGHTS = (0.3, 0.25, 1, 0.8, 0.2, 0.2, 0.12, 0.08)
EU_NM = (591, 596, 611, 617, 624, 651, 656, 688, 698, 704)
EU_HEIGHTS = (0.4, 0.3, 1, 0.6, 0.3, 0.1, 0.08, 0.2, 0.5, 0.5)
BROAD = "broad"
KINDS = (
    BROAD, "line 5", "line 8", "line 15", "line 25", "line 5 on a band",
    "two 5 10", "two 5 20", "Tb", "Eu", "mercury",
)  # fmt: skip


def light_of(kind: str, rng: np.random.Generator) -> Spectrum:
    """A light of a kind, its places and widths drawn."""
    place_nm = float(rng.uniform(430, 650))
    match kind.split():
        case ["mercury"]:
            return made.mercury_lamp(rng)
        case ["broad"]:
            value = _peak(place_nm, float(rng.uniform(30, 120)))
            if rng.random() < 0.5:
                other = _peak(float(rng.uniform(430, 660)), float(rng.uniform(30, 120)))
                value = value + rng.uniform(0.1, 1) * other
        case ["line", fwhm]:
            value = _peak(place_nm, float(fwhm))
        case ["line", fwhm, "on", "a", "band"]:
            value = _peak(float(rng.uniform(480, 600)), float(rng.uniform(60, 120)))
            value = value + rng.uniform(0.5, 3) * _peak(place_nm, float(fwhm))
        case ["two", fwhm, apart]:
            value = _peak(place_nm, float(fwhm))
            value = value + rng.uniform(0.3, 1) * _peak(place_nm + float(apart), float(fwhm))
        case ["Tb"]:
            value = _rare_earth(rng, TB_NM, TB_HEIGHTS)
        case _:
            value = _rare_earth(rng, EU_NM, EU_HEIGHTS)
    return Spectrum(kind, FINE_NM, value)


def _peak(centre_nm: float, fwhm_nm: float) -> FloatArray:
    shape: FloatArray = np.exp(-np.log(16) * ((FINE_NM - centre_nm) / fwhm_nm) ** 2)
    return shape


def _rare_earth(
    rng: np.random.Generator, nm: Sequence[float], heights: Sequence[float]
) -> FloatArray:
    """Lines of 4 to 7 nm about the given places, of about the given heights."""
    total = np.zeros_like(FINE_NM)
    for place, height in zip(nm, heights, strict=True):
        total += height * rng.uniform(0.6, 1.4) * _peak(place + rng.normal(), rng.uniform(4, 7))
    return total


def row(kind: str, count: int) -> str:
    """Return a row of the table."""
    lvf, camera = made.curved_lvf(), made.of_the_house()
    system = system_through_lvf(lvf, camera, made.KNOTS_NM)
    pulls, sums, errors, sigmas, with_lines = [], [], [], [], 0
    for number in range(count):
        rng = np.random.default_rng([KINDS.index(kind), number])
        light = light_of(kind, rng)
        snr = float(10 ** rng.uniform(2, 3)) if kind == BROAD else SNR
        picture = made.photographed(light, lvf, camera, rng, snr)
        fit = fit_spectrum(picture.value, picture.sigma, system)
        with_lines += bool(fit.lines_nm)
        true = light.in_bands(made.EDGES_NM)
        draws = band_means(fit.knots_nm, fit.samples.T, made.EDGES_NM)
        difference, covariance = draws.mean(axis=1) - true, np.cov(draws)
        bright = true > BRIGHT * true.max()
        sigma = np.sqrt(np.diag(covariance)[bright])
        pulls.append(difference[bright] / sigma)
        errors.append(difference[bright] / true.max())
        sigmas.append(sigma / true.max())
        window = np.abs(made.GRID_NM - made.GRID_NM[np.argmax(true)]) <= 20
        sums.append(difference[window].sum() / np.sqrt(covariance[np.ix_(window, window)].sum()))
    rms_pull, rms_sum, rms_error, rms_sigma = (
        float(np.sqrt(np.mean(np.square(one))))
        for one in (np.concatenate(pulls), sums, np.concatenate(errors), np.concatenate(sigmas))
    )
    return (
        f"{kind:20s}{rms_pull:7.2f}{np.abs(np.concatenate(pulls)).max():7.1f}{rms_sum:7.2f}"
        f"{rms_error:8.2%}{rms_sigma:8.2%}{with_lines:6d}/{count}"
    )


def main(count: int) -> None:
    """Print the table."""
    title = f"{'light, nm':20s}{'rms/σ':>7s}{'max/σ':>7s}{'50 nm':>7s}{'error':>8s}{'σ':>8s}"
    print(f"{title}{'lines':>9s}")
    for kind in KINDS:
        print(row(kind, 10 * count if kind == BROAD else count), flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 10)
