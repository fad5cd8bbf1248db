"""Model of a strip's profile under a mercury lamp: a sum of lines on a background."""

from dataclasses import dataclass

import numpy as np

from labrig.fit.least_squares import least_squares
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import FitError
from labrig.optics import peak_shape
from labrig.results import LocatedLines

FEWEST_LINES = 3
#: Smallest fraction of the profile's variance that lines and background must explain.
MIN_EXPLAINED = 0.9
#: Largest deviation, in σ, of a blend's fraction from its prior: an imperfect shape would bias it
#: otherwise.
FRACTION_SIGMAS = 2.0
#: Height of a line in σ from which it is significant.
SIGNIFICANT = 6.0
#: σ of the position, in widths, below which a line is located.
LOCATED = 0.2
#: Largest distance of a line from its assigned position, in widths: 405 and 436 nm are 1.2 apart,
#: and must not be exchanged.
NEAR = 0.6
_STEP = 1e-5


@dataclass(frozen=True)
class Line:
    """A spectral line, or an unresolved pair.

    Attributes
    ----------
    wavelength_nm
        Wavelengths in air in nm; of a pair, the shorter one first.
    second_fraction
        Fraction of the second line in the light of a pair, and its σ; it depends on the lamp and on
        the camera.
    """

    wavelength_nm: tuple[float, ...]
    second_fraction: tuple[float, float] = (0.0, 0.0)

    @property
    def centre_nm(self) -> float:
        """Mean wavelength weighted by the fractions, in nm."""
        if len(self.wavelength_nm) == 1:
            return self.wavelength_nm[0]
        fraction = self.second_fraction[0]
        return (1 - fraction) * self.wavelength_nm[0] + fraction * self.wavelength_nm[1]


#: Mercury in air (Sansonetti, Salit and Reader, *Wavelengths of spectral lines in mercury pencil
#: lamps*, Appl. Opt. 35, 1996), as far as cameras see it. Fractions: lamps and cameras differ.
MERCURY = (
    Line((404.6565, 407.7837), (0.12, 0.08)),
    Line((435.8335,)),
    Line((546.0750,)),
    Line((576.9610, 579.0670), (0.5, 0.06)),
)


@dataclass(frozen=True)
class Assignment:
    """Assignment of peaks to lines, λ ≈ offset + slope · position, with a score."""

    offset_nm: float
    slope_nm: float
    fwhm: float
    score: float


class LineModel:
    """Profile as a sum of lines; heights and background are eliminated at every step."""

    def __init__(
        self, u: FloatArray, values: FloatArray, lines: tuple[Line, ...], assignment: Assignment
    ) -> None:
        self.u, self.values, self.way = u, values, assignment
        expected = [
            (line.wavelength_nm[0] - assignment.offset_nm) / assignment.slope_nm for line in lines
        ]
        inside = [u[0] < position < u[-1] for position in expected]
        self.lines = [line for line, is_inside in zip(lines, inside, strict=True) if is_inside]
        self.start = [
            position for position, is_inside in zip(expected, inside, strict=True) if is_inside
        ]
        self.middle, self.reach = float(u.mean()), float(np.ptp(u)) / 2

    def located(self) -> LocatedLines:
        """Fit; lines too faint to be located are dropped, and the rest fitted again."""
        while True:
            x, sigma, noise = self._fitted()
            position, at_sigma = x[: len(self.lines)], sigma[: len(self.lines)]
            heights, height_sigma = self._heights(x, noise)
            fwhm = float(np.exp(x[len(self.lines)]))
            clear = (heights > SIGNIFICANT * height_sigma).any(axis=1) & (at_sigma < LOCATED * fwhm)
            if clear.all():
                break
            if clear.sum() < FEWEST_LINES:
                raise FitError(
                    f"no lines of mercury: {clear.sum()} could be located, {FEWEST_LINES} are "
                    "needed; expose longer, or check the lamp"
                )
            self.lines = [
                line for line, is_clear in zip(self.lines, clear, strict=True) if is_clear
            ]
            self.start = [
                float(start) for start, is_clear in zip(position, clear, strict=True) if is_clear
            ]
        residual = self.values - self._fit_values(x)
        explained = 1 - float(residual.var() / (self.values - self.values.mean(axis=0)).var())
        if explained < MIN_EXPLAINED:
            raise FitError(
                f"no lines of mercury: lines explain {explained:.0%} of the profile, expected "
                f"{MIN_EXPLAINED:.0%} or more; check that no other lamp is lit"
            )
        wavelength_nm = np.array([line.wavelength_nm[0] for line in self.lines])
        return LocatedLines(
            wavelength_nm, position, at_sigma, fwhm, self.way.slope_nm > 0, explained
        )

    def _fitted(self) -> tuple[FloatArray, FloatArray, float]:
        """Return positions, log width and its change, skew and fractions; their σ; the noise."""
        fractions = [line.second_fraction for line in self.lines if len(line.wavelength_nm) == 2]
        start = np.array(
            [*self.start, np.log(self.way.fwhm), 0.0, 0.0, *(fraction for fraction, _ in fractions)]
        )
        prior = np.array([sigma for _, sigma in fractions])
        low, high = np.full(len(start), -np.inf), np.full(len(start), np.inf)
        n = len(self.lines)
        reach = NEAR * self.way.fwhm
        low[:n], high[:n] = start[:n] - reach, start[:n] + reach
        low[n], high[n] = start[n] - 1, start[n] + 1
        low[n + 1 : n + 3], high[n + 1 : n + 3] = -0.5, 0.5
        low[n + 3 :] = np.maximum(start[n + 3 :] - FRACTION_SIGMAS * prior, 0.0)
        high[n + 3 :] = np.minimum(start[n + 3 :] + FRACTION_SIGMAS * prior, 1.0)
        noise = 1.0
        for _ in range(2):

            def residuals(x: FloatArray, noise: float = noise) -> tuple[FloatArray, FloatArray]:
                return self._with_derivatives(x, start, noise, prior)

            fit = least_squares(residuals, start, lower=low, upper=high, tolerance=1e-6)
            residual = self.values - self._fit_values(fit.parameters)
            noise = float(np.sqrt((residual**2).sum() / (residual.size - len(start))))
        covariance = np.linalg.pinv(fit.jacobian.T @ fit.jacobian, hermitian=True)
        variance = np.maximum(np.diag(covariance), 0.0)
        variance[:n] += self._blend_variance(fit.parameters)
        return fit.parameters, np.sqrt(variance), noise

    def _blend_variance(self, x: FloatArray) -> FloatArray:
        """Return the positions' variance from the fractions of unresolved blends, (lines,)."""
        per_nm, fwhm = abs(self._per_nm(x[: len(self.lines)])), np.exp(x[len(self.lines)])
        distance = np.array([per_nm * np.ptp(line.wavelength_nm) for line in self.lines])
        fraction_sigma = np.array([line.second_fraction[1] for line in self.lines])
        variance: FloatArray = np.where(distance < fwhm, (distance * fraction_sigma) ** 2, 0.0)
        return variance

    def _with_derivatives(
        self, x: FloatArray, scale: FloatArray, noise: float, prior: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return residuals and their Jacobian by central differences."""
        steps = np.diag(_STEP * np.maximum(np.abs(scale), 1.0))
        centre, up, down = np.split(
            self._residuals(np.concatenate([x[np.newaxis], x + steps, x - steps]), noise, prior),
            [1, 1 + len(x)],
        )
        return centre[0], ((up - down) / (2 * np.diag(steps)[:, np.newaxis])).T

    def _residuals(self, x: FloatArray, noise: float, prior: FloatArray) -> FloatArray:
        """Return residuals (..., residuals) of parameters (..., parameters)."""
        misfit = (self.values - self._fit_values(x)) / noise
        fractions = [line.second_fraction[0] for line in self.lines if len(line.wavelength_nm) == 2]
        prior_residuals = (x[..., len(self.lines) + 3 :] - fractions) / prior
        return np.concatenate([misfit.reshape(*x.shape[:-1], -1), prior_residuals], axis=-1)

    def _shapes(self, x: FloatArray) -> FloatArray:
        """Return every line at height 1, and the background, shape (..., n, lines + 2)."""
        n = len(self.lines)
        positions, common = x[..., :n], x[..., n : n + 3, np.newaxis]
        log_width, change, skew = common[..., 0, :], common[..., 1, :], common[..., 2:, :]
        width = np.exp(log_width + change * (positions - self.middle) / self.reach)

        def peaks(centre: FloatArray, width: FloatArray) -> FloatArray:
            distance = self.u[:, np.newaxis] - centre[..., np.newaxis, :]
            return peak_shape(distance, width[..., np.newaxis, :], skew)

        lines = peaks(positions, width)
        blends = [k for k, line in enumerate(self.lines) if len(line.wavelength_nm) == 2]
        if blends:
            fraction = x[..., np.newaxis, n + 3 :]
            distance_nm = np.array([np.ptp(self.lines[k].wavelength_nm) for k in blends])
            second_position = (
                positions[..., blends] + distance_nm * self._per_nm(positions)[..., np.newaxis]
            )
            second = peaks(second_position, width[..., blends])
            lines[..., blends] = (1 - fraction) * lines[..., blends] + fraction * second
        slope = (self.u - self.middle) / self.reach
        background = np.stack([np.ones_like(slope), slope], axis=-1)
        return np.concatenate([lines, np.broadcast_to(background, (*lines.shape[:-1], 2))], axis=-1)

    def _per_nm(self, positions: FloatArray) -> FloatArray:
        """Return the slope of the positions (..., lines) over the wavelengths, shape (...,)."""
        nm = np.array([line.wavelength_nm[0] for line in self.lines])
        nm -= nm.mean()
        slope: FloatArray = positions @ nm / (nm @ nm)
        return slope

    def _fit_values(self, x: FloatArray) -> FloatArray:
        """Return the best fit to the values, shape (..., n, channels)."""
        basis, _ = np.linalg.qr(self._shapes(x))
        fitted: FloatArray = basis @ (np.swapaxes(basis, -1, -2) @ self.values)
        return fitted

    def _heights(self, x: FloatArray, noise: float) -> tuple[FloatArray, FloatArray]:
        """Return the heights (lines, channels) and their σ (lines, 1)."""
        shapes, n = self._shapes(x), len(self.lines)
        heights = np.asarray(np.linalg.lstsq(shapes, self.values)[0][:n], dtype=np.float64)
        variance = np.diag(np.linalg.pinv(shapes.T @ shapes))[:n]
        sigma: FloatArray = noise * np.sqrt(variance)[:, np.newaxis]
        return heights, sigma
