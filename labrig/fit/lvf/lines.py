"""Location of the lines of a mercury lamp in the profile of a strip, to a fraction of a pixel."""

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike
from scipy.ndimage import gaussian_filter1d
from scipy.special import chdtri

from labrig.fit.nonlinear_least_squares import least_squares
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import FitError
from labrig.optics import NOMINAL_FWHM_NM, WavelengthMap, peak_shape
from labrig.results import LocatedLines

MIN_LINES = 3
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
            if clear.sum() < MIN_LINES:
                raise FitError(
                    f"no lines of mercury: {clear.sum()} could be located, {MIN_LINES} are "
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
                f"no lines of mercury: lines explain {100 * explained:.0f} % of the profile, "
                f"expected {100 * MIN_EXPLAINED:.0f} % or more; check that no other lamp is lit"
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


#: Smallest prominence in units of the noise.
MIN_PROMINENCE = 10.0
#: Smallest prominence as a fraction of the channel's range, and of the largest range.
MIN_FRACTION, MIN_OF_ALL = 0.03, 0.003
MAX_PEAKS = 8
MAX_SAMPLES = 20_000
#: Distance, in widths, below which peaks of two channels are one.
SAME = 0.5
#: Width of the smoothing as a fraction of the profile.
SMOOTHING = 0.002
#: Median absolute third difference over σ, for normal noise; a smooth profile has hardly any, even
#: if a line is but a few samples wide.
_MAD = 0.6745 * np.sqrt(20.0)


@dataclass(frozen=True)
class Peak:
    """A peak of at least one channel.

    Attributes
    ----------
    position, fwhm
        Position and full width at half maximum, in the unit of the profile's positions.
    prominence
        Prominence in units of the noise.
    blueness
        Fraction of blue in blue and red; 0 without colours.
    """

    position: float
    fwhm: float
    prominence: float
    blueness: float


def find_line_peaks(position: FloatArray, values: FloatArray) -> list[Peak]:
    """Return the most prominent peaks of a profile (n, channels), by rising position.

    They are searched channel by channel: in the sum neighbouring lines merge.
    """
    from scipy.signal import find_peaks, peak_widths  # takes as long to load as half of labrig

    finest = max(float(np.diff(position).min()), float(np.ptp(position)) / MAX_SAMPLES)
    grid = np.arange(position[0], position[-1], finest)
    channels = np.stack([np.interp(grid, position, column) for column in values.T], axis=1)
    smooth = gaussian_filter1d(channels, len(grid) * SMOOTHING, axis=0)
    noise = np.median(np.abs(np.diff(values, n=3, axis=0)), axis=0) / _MAD
    height = float(np.ptp(smooth, axis=0).max())
    above = np.maximum(smooth - np.percentile(smooth, 5, axis=0), 0.0)
    peaks: list[Peak] = []
    for channel, channel_noise in zip(smooth.T, noise, strict=True):
        unit = max(float(channel_noise), 1e-6 * height)
        extent = float(np.ptp(channel))
        least = max(MIN_PROMINENCE * unit, MIN_FRACTION * extent, MIN_OF_ALL * height)
        if not height:
            continue
        indices, properties = find_peaks(channel, prominence=least)
        widths = peak_widths(channel, indices, rel_height=0.5)[0] * finest
        for number, index in enumerate(indices):
            blue, red = (above[index, -1], above[index, 0]) if values.shape[1] == 3 else (0.0, 1.0)
            peaks.append(
                Peak(
                    position=float(grid[index]),
                    fwhm=float(widths[number]),
                    prominence=float(properties["prominences"][number] / unit),
                    blueness=float(blue / (blue + red)),
                )
            )
    return _distinct(peaks)


def _distinct(peaks: list[Peak]) -> list[Peak]:
    """Return the most prominent one of peaks at the same place in several channels."""
    kept: list[Peak] = []
    for peak in sorted(peaks, key=lambda peak: -peak.prominence):
        if all(abs(peak.position - other.position) > SAME * other.fwhm for other in kept):
            kept.append(peak)
    return sorted(kept[:MAX_PEAKS], key=lambda peak: peak.position)


#: Largest deviation of peaks from an assignment, in widths.
TOLERANCE = 0.4
#: Difference of scores below which assignments are ambiguous, and the number of them fitted.
AMBIGUOUS = 1.0
MAX_CANDIDATES = 4
#: Largest bend of a strip in nm, in its middle against its ends.
MAX_BEND_NM = 20.0
#: Ratio of the unexplained variances at which the better orientation is accepted.
CLEARLY = 1.3


def locate_lines(
    position: ArrayLike,
    profile: ArrayLike,
    *,
    lines: tuple[Line, ...] = MERCURY,
    fwhm_nm: float = NOMINAL_FWHM_NM,
    rising: bool | None = None,
) -> LocatedLines:
    """Assign peaks to lines, then fit all lines at once.

    A blend is the sum of its two lines at their known distance. All lines have the same skewed
    shape, whose width may change linearly along the strip, and lie on a linear background.

    Parameters
    ----------
    position, profile
        Rising positions (n,), and profile (n,) or (n, channels); the colours of R, G and B tell the
        blue end.
    lines
        Lines to find, by rising wavelength.
    fwhm_nm
        Width of a line in nm, to within a factor of two.
    rising
        Whether the wavelength is expected to rise with the position; None accepts both.

    Raises
    ------
    FitError
        There are no such lines, the strip is the wrong way round, or its orientation is ambiguous.
    """
    u = np.asarray(position, dtype=np.float64)
    values = np.asarray(profile, dtype=np.float64).reshape(len(u), -1)
    if not np.isfinite(values).all() or len(u) < 20:
        raise FitError("expected a profile of 20 or more finite values along the strip")
    peaks = find_line_peaks(u, values)
    assignments = [
        trial
        for orientation in (True, False)
        for trial in _assignments(peaks, lines, fwhm_nm, orientation)
    ]
    if not assignments:
        raise FitError(
            f"no lines of mercury: of {len(peaks)} peaks no {MIN_LINES} stand like "
            f"{', '.join(f'{line.centre_nm:.0f}' for line in lines)} nm; check that the mercury "
            "lamp is lit and the whole strip in the picture"
        )
    assignments.sort(key=lambda trial: -trial.score)
    candidates = [
        trial
        for trial in assignments[:MAX_CANDIDATES]
        if assignments[0].score - trial.score < AMBIGUOUS
    ]
    located = _best_by_orientation([LineModel(u, values, lines, trial) for trial in candidates])
    if len(located) == 2:
        located.sort(key=lambda orientation: -orientation.explained)
        unexplained = [1 - orientation.explained for orientation in located]
        if unexplained[1] < CLEARLY * unexplained[0] and rising is None:
            raise FitError(
                "the lines fit either way round, and without colours neither can be excluded; "
                "say whether the wavelength rises along the strip"
            )
        if unexplained[1] < CLEARLY * unexplained[0]:
            located.sort(key=lambda orientation: orientation.rising != rising)
    if rising is not None and located[0].rising != rising:
        raise FitError(
            f"the strip is the wrong way round: the wavelength {'falls' if rising else 'rises'} "
            f"with the position, expected it to {'rise' if rising else 'fall'}; turn the filter, "
            "or say that it is turned"
        )
    return located[0]


def _best_by_orientation(models: list[LineModel]) -> list[LocatedLines]:
    """Return the model that explains most for each orientation, of those that can be fitted."""
    best: dict[bool, LocatedLines] = {}
    refusal: FitError | None = None
    for model in models:
        try:
            located = model.located()
        except FitError as error:
            refusal = refusal or error
            continue
        if _bend_nm(located, model.middle, model.reach) > MAX_BEND_NM:
            refusal = refusal or FitError(
                "no lines of mercury: the peaks could only be lines of a strip bent as none is; "
                "check that no other lamp is lit"
            )
            continue
        if located.rising not in best or located.explained > best[located.rising].explained:
            best[located.rising] = located
    if refusal is not None and not best:
        raise refusal
    return list(best.values())


def _bend_nm(lines: LocatedLines, middle: float, reach: float) -> float:
    """Return the distance of the strip's middle from the line between its ends, in nm."""
    scaled = (lines.position - middle) / reach
    return abs(float(np.polyfit(scaled, lines.wavelength_nm, 2, w=1 / lines.sigma)[0]))


def _assignments(
    peaks: list[Peak], lines: tuple[Line, ...], fwhm_nm: float, rising: bool
) -> list[Assignment]:
    """Return the peaks that agree best with each choice of lines."""
    centres = [line.centre_nm for line in lines]
    assignments: list[Assignment] = []
    for number in range(min(len(lines), len(peaks)), MIN_LINES - 1, -1):
        for chosen in combinations(range(len(lines)), number):
            chosen_nm = [centres[k] for k in chosen]
            trials = [
                _assignment(chosen_nm, list(subset), fwhm_nm)
                for subset in combinations(peaks if rising else peaks[::-1], number)
            ]
            possible = [trial for trial in trials if trial is not None]
            if possible:
                assignments.append(max(possible, key=lambda trial: trial.score))
    return assignments


def _assignment(centres_nm: list[float], peaks: list[Peak], fwhm_nm: float) -> Assignment | None:
    positions = np.array([peak.position for peak in peaks])
    slope, offset = np.polyfit(positions, centres_nm, 1)
    width = float(np.median([peak.fwhm for peak in peaks]))
    if not 0.5 < width * abs(slope) / fwhm_nm < 2:
        return None
    worst = float(np.abs(offset + slope * positions - centres_nm).max())
    blueness = [peak.blueness for peak in peaks]
    if worst > TOLERANCE * fwhm_nm or (len(set(blueness)) > 1 and blueness[0] < blueness[-1]):
        return None
    # Strong peaks count, and one more of them outweighs a better agreement.
    strength = sum(np.log1p(peak.prominence) for peak in peaks)
    return Assignment(float(offset), float(slope), width, strength - worst / fwhm_nm)


#: Significance level of a bend (F-test with known σ).
RARE = 0.01
#: Smallest σ of a line in nm: shapes of bands differ slightly.
FLOOR_NM = 0.1
#: Prior σ of the bend of a strip in nm, between its middle and its ends.
USUAL_BEND_NM = 5.0


@dataclass(frozen=True, eq=False)
class WavelengthFit:
    """A wavelength map along a strip, and its residuals.

    Attributes
    ----------
    map
        Wavelength map with the covariance of its coefficients; it includes a bend that was not
        significant, so that σ grows realistically where the map is extrapolated.
    residual_nm
        Wavelength of the map minus that of each line in nm, shape (l,).
    order
        Order of the polynomial: 1 straight, 2 bent.
    """

    map: WavelengthMap
    residual_nm: FloatArray
    order: int


def fit_wavelengths(lines: LocatedLines, span: tuple[float, float]) -> WavelengthFit:
    """Fit the wavelength along a strip, linear or, where clearly better, quadratic.

    Parameters
    ----------
    lines
        Three or more located lines.
    span
        First and last position of the strip.

    Raises
    ------
    FitError
        The lines are not monotone along the strip.
    """
    middle, half = (span[0] + span[1]) / 2, (span[1] - span[0]) / 2
    powers = np.vander((lines.position - middle) / half, 3, increasing=True)
    nm_per_unit = abs(float(np.polyfit(lines.position, lines.wavelength_nm, 1)[0]))
    sigma_nm = np.hypot(lines.sigma * nm_per_unit, FLOOR_NM)
    straight, _, straight_chi2 = _weighted(powers[:, :2], lines.wavelength_nm, sigma_nm, np.inf)
    bent, covariance, bent_chi2 = _weighted(powers, lines.wavelength_nm, sigma_nm, USUAL_BEND_NM)
    order = 2 if straight_chi2 - bent_chi2 > chdtri(1, RARE) else 1
    if order == 1:
        coefficients = np.append(straight, 0.0)
        # What was not believed is an error that the straight map may have.
        covariance = covariance + np.outer(coefficients - bent, coefficients - bent)
    else:
        coefficients = bent
    try:
        wavelength_map = WavelengthMap(coefficients, span, covariance)
    except ValueError as error:
        raise FitError(str(error)) from None
    return WavelengthFit(
        wavelength_map, wavelength_map.wavelength_nm(lines.position) - lines.wavelength_nm, order
    )


def _weighted(
    powers: FloatArray, wavelength_nm: FloatArray, sigma: FloatArray, bend_sigma: float
) -> tuple[FloatArray, FloatArray, float]:
    """Return coefficients, covariance and χ²; the last of three has the prior 0 ± `bend_sigma`."""
    rows = powers / sigma[:, np.newaxis]
    precision = rows.T @ rows
    if np.isfinite(bend_sigma):
        precision[-1, -1] += 1 / bend_sigma**2
    covariance = np.asarray(np.linalg.inv(precision), dtype=np.float64)
    coefficients = covariance @ (rows.T @ (wavelength_nm / sigma))
    chi2 = float((((wavelength_nm - powers @ coefficients) / sigma) ** 2).sum())
    return coefficients, covariance, chi2
