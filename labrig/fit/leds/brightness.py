"""Brightness of LEDs relative to one another, by a camera, a spectrometer, or both.

A white reference of reflectance ρ under LED m, of spectrum l_m with ∫ l_m = 1 and brightness b_m,
gives a camera's channel k and the spectrometer

    V_mk = g b_m ∫ ρ l_m c_k dλ,        S_m = b_m r(λ_m),

with the camera's gain g and the spectrometer's response r at the LED. The errors of the camera's
curves c_k are smooth over wavelength (`CurveError`), so are those of ln r (`ResponseError`), and
an LED whose spectrum is from a data sheet may be shifted and wider. All are found together by
linear least squares, repeated from the values found: so the camera calibrates a spectrometer of
unknown response where it sees the LEDs, and the spectrometer carries the scale to the ultraviolet.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import solve_triangular

from labrig.fit.spectrum import CurveError, camera_modes
from labrig.foundation.arrays import FloatArray
from labrig.optics import CameraResponse, Spectrum, Transmittance, band_integrals

#: Standard deviation of ln b and of ln g about a first guess: a factor of 20, and any at all.
UNKNOWN_BRIGHTNESS, UNKNOWN_GAIN = 3.0, 30.0
#: Largest change of ln b from that guess.
LIMIT = 3 * UNKNOWN_BRIGHTNESS
#: Relative error of the width of an LED's spectrum by its data sheet, whose normal curve of the
#: same width at half maximum lacks the wings; and σ of its skew, of which that says nothing: 0.2
#: for blue, green and red ones.
WIDTH_SIGMA, SKEW_SIGMA = 0.3, 0.2
#: Precision of what is not to be found.
FIXED = 1e8
#: Step in nm of integrals over spectra.
NODE_NM = 2.0
#: Step of derivatives by a spectrum's shape, in standard deviations.
SHAPE_STEP = 0.2
#: Least ratio of some channel's response to an LED to that response's error by curves and shape;
#: what the camera says of other LEDs would depend on that error alone.
CLEAR = 3.0
#: Relative error of the camera's exposure of one LED, common to its channels.
EXPOSURE_SIGMA = 0.005
#: Number of linearisations; a change below this ends them.
ROUNDS, SMALL = 20, 1e-6
#: Number of linearisations about other shapes, and the largest change of shape from a data sheet in
#: standard deviations about which it is linearised.
SHAPE_ROUNDS, FAR = 4, 2.5


@dataclass(frozen=True)
class ResponseError:
    """Error of ln r, the logarithm of a spectrometer's response, smooth over wavelength.

    Attributes
    ----------
    sigma
        One standard deviation.
    correlation_nm
        Distance in nm at which errors are independent.
    """

    sigma: float
    correlation_nm: float


#: Error of a camera's curves that were not measured on its own body: three published sets of one
#: model differ by 0.02 to 0.06 rms of the peak, in the flanks by more than two of them do.
CURVES_OF_MODEL = CurveError(relative=0.1, added=0.02)
#: Response of a grating spectrometer with a silicon detector of which nothing is known: from its
#: peak to a fifth of it over some hundred nm.
RESPONSE_UNKNOWN = ResponseError(0.7, 120.0)
#: Error of a response that a standard lamp has calibrated, beyond that of its file.
RESPONSE_CALIBRATED = ResponseError(0.01, 120.0)


@dataclass(frozen=True, eq=False)
class LedLightMeasured:
    """Measurement of one LED.

    Attributes
    ----------
    name
        Name of the LED.
    spectrum
        Its spectrum on any scale, as measured or from a data sheet.
    wavelength_sigma_nm
        Standard uncertainty in nm of an error of all wavelengths.
    is_nominal
        Whether the spectrum is a curve by peak and width from a data sheet, so that its width and
        its skew are uncertain, too.
    value, variance : ndarray, shape (channels,), or None
        Values of the white reference by the camera and their variances; None without them.
    light, light_sigma
        Light in the LED's band by the spectrometer and its relative σ; None without one.
    """

    name: str
    spectrum: Spectrum
    wavelength_sigma_nm: float
    is_nominal: bool = False
    value: FloatArray | None = None
    variance: FloatArray | None = None
    light: float | None = None
    light_sigma: float | None = None


@dataclass(frozen=True, eq=False)
class BrightnessFit:
    """Brightness and spectrum of every LED.

    Attributes
    ----------
    log_brightness : ndarray, shape (m,)
        ln b_m, on the spectrometer's scale, or on one of its own without one.
    covariance : ndarray, shape (m, m)
        Its covariance, relative to the LEDs' common scale.
    scale_sigma
        Standard uncertainty of the logarithm of that common scale.
    shift_nm, width_factor, skew : ndarray, shape (m,)
        Change of each spectrum from the one given, for `changed_spectrum`.
    wavelength_sigma_nm : ndarray, shape (m,)
        Standard uncertainty of the centroid of each changed spectrum in nm.
    centre_nm, response_weight : ndarray, shape (m,)
        Centroids of the spectra given in nm, and weights of the response's correlation with them.
    response_slope_sigma_per_nm : ndarray, shape (m,)
        Standard uncertainty of the slope of ln r at each LED, by which a spectrum is skewed.
    response
        Error model of the spectrometer's response.
    by_camera
        Whether the camera's values count, for each LED.
    """

    log_brightness: FloatArray
    covariance: FloatArray
    scale_sigma: float
    shift_nm: FloatArray
    width_factor: FloatArray
    skew: FloatArray
    wavelength_sigma_nm: FloatArray
    centre_nm: FloatArray
    response_weight: FloatArray
    response_slope_sigma_per_nm: FloatArray
    response: ResponseError
    by_camera: tuple[bool, ...]

    @property
    def sigma(self) -> FloatArray:
        """Relative standard uncertainty of each brightness, shape (m,)."""
        return np.asarray(np.sqrt(np.maximum(np.diag(self.covariance), 0.0)))

    def log_response_at(self, wavelength_nm: FloatArray) -> FloatArray:
        """Return ln r at some wavelengths in nm, relative to the common scale."""
        return _correlated(self.response, wavelength_nm, self.centre_nm) @ self.response_weight


def centroid_nm(spectrum: Spectrum) -> float:
    """Return the centroid of a spectrum in nm.

    Parameters
    ----------
    spectrum
        A spectrum with light.

    Returns
    -------
    float
        ∫ λ l dλ / ∫ l dλ.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.fit.leds import centroid_nm
    >>> from labrig.optics import Spectrum
    >>> centroid_nm(Spectrum("line", np.array([500.0, 510.0, 520.0]), np.array([0.0, 1.0, 0.0])))
    510.0
    """
    weight = spectrum.value * np.gradient(spectrum.wavelength_nm)
    return float(weight @ spectrum.wavelength_nm / weight.sum())


def fit_brightness(
    leds: Sequence[LedLightMeasured],
    camera: CameraResponse,
    card: Transmittance,
    response: ResponseError = RESPONSE_UNKNOWN,
    curve_error: CurveError | None = CURVES_OF_MODEL,
) -> BrightnessFit:
    """Find the brightnesses of LEDs from a white reference.

    Parameters
    ----------
    leds
        What was measured of each LED; values of one camera on one scale, of one spectrometer.
    camera, card
        The camera's curves, and the reflectance of the white reference.
    response
        Error of the spectrometer's response; nothing of it is known by default.
    curve_error
        Error of the camera's curves; None takes them for exact.

    Returns
    -------
    BrightnessFit
        Logarithms of the brightnesses with their covariance. σ is huge where nothing tells one.

    Examples
    --------
    >>> import numpy as np
    >>> import labrig
    >>> from labrig.fit.leds import LedLightMeasured, fit_brightness
    >>> from labrig.optics import Transmittance, read_light
    >>> camera, card = labrig.read_camera("canon_eos_5d_mark_ii"), np.array([300.0, 800.0])
    >>> leds = [
    ...     LedLightMeasured(name, read_light(name), 0.2, value=value, variance=np.full(3, 1e-8))
    ...     for name, value in [
    ...         ("450nm", np.array([0.0086, 0.0928, 0.8636])),
    ...         ("530nm", np.array([0.3138, 1.9785, 0.2227])),
    ...     ]
    ... ]
    >>> fit = fit_brightness(leds, camera, Transmittance("white", card, np.ones(2)))
    >>> ratio = np.exp(fit.log_brightness[1] - fit.log_brightness[0])
    >>> f"{ratio:.1f}"
    '2.0'
    """
    model = _Model(leds, camera, card, response, curve_error)
    return model.fit()


class _Model:
    """The linearised equations. Unknowns: ln b (m), ln g, ln r (m), shapes, curves.

    Shapes are shifts (m), widths (m) and skews (m) of the spectra.

    All but ln b and ln g have unit variance a priori.
    """

    def __init__(
        self,
        leds: Sequence[LedLightMeasured],
        camera: CameraResponse,
        card: Transmittance,
        response: ResponseError,
        curve_error: CurveError | None,
    ) -> None:
        self.leds = leds
        self.count = len(leds)
        self._camera = camera
        self._card = card
        self._error = curve_error
        self.has_spectrometer = any(led.light is not None for led in leds)
        self._response = response
        self._centre_nm = np.array([centroid_nm(led.spectrum) for led in leds])
        prior = _correlated(response, self._centre_nm, self._centre_nm)
        prior += 1e-6 * response.sigma**2 * np.eye(self.count)
        self.response_root = np.linalg.cholesky(prior)
        self.shapes: FloatArray = np.zeros((3, self.count))
        self.exposed, self.modes = self._exposed()
        error = np.linalg.norm(self.modes, axis=0)
        is_seen = (self.exposed > CLEAR * np.maximum(error, 1e-12)).any(axis=1)
        self.by_camera = [
            bool(seen) and led.value is not None for seen, led in zip(is_seen, leds, strict=True)
        ]

    def _exposed(self) -> tuple[FloatArray, FloatArray]:
        """Return channels per brightness (m, k), and their changes by one σ each (z, m, k).

        The changes are by shapes, then by the curves.
        """
        grid_nm = self._camera.wavelength_nm
        nodes = np.arange(grid_nm[0], grid_nm[-1] + NODE_NM, NODE_NM)
        card = self._card.at(nodes)
        curves = self._camera.at(nodes)
        changes = camera_modes(self._camera, nodes, self._error)
        sensitivities = np.array([curves, *changes]) * card[:, np.newaxis]

        def seen(spectrum: Spectrum) -> FloatArray:
            light = spectrum.resampled(nodes).value / _power(spectrum) * NODE_NM
            return np.asarray(light @ sensitivities)

        base = np.array(  # (m, 1 + curves, k)
            [seen(_shaped(led, now)) for led, now in zip(self.leds, self.shapes.T, strict=True)]
        )
        by_shape = np.zeros((3, self.count, self.count, base.shape[2]))
        for number, led in enumerate(self.leds):
            for kind, sigma in enumerate(_shape_errors(led)):
                if sigma == 0:
                    continue
                step = np.where(np.arange(3) == kind, SHAPE_STEP, 0.0)
                ahead, behind = (
                    seen(_shaped(led, self.shapes[:, number] + sign * step))[0] for sign in (1, -1)
                )
                by_shape[kind, number, number] = (ahead - behind) / (2 * SHAPE_STEP)
        by_curves = np.moveaxis(base[:, 1:], 1, 0)
        return base[:, 0], np.concatenate([*by_shape, by_curves])

    def fit(self) -> BrightnessFit:
        """Solve, each time linearised about the brightnesses found before."""
        start = self._start()
        log_b, log_g = start
        m = self.count
        is_sketched = any(led.is_nominal for led in self.leds)
        for _ in range(SHAPE_ROUNDS if is_sketched else 1):
            for _ in range(ROUNDS):
                mean, covariance = self._solve(log_b, log_g, start)
                change = np.clip(mean[: m + 1] - np.append(log_b, log_g), -1.0, 1.0)
                log_b = np.clip(log_b + change[:m], start[0] - LIMIT, start[0] + LIMIT)
                log_g += float(change[m])
                if np.abs(change).max() < SMALL:
                    break
            if is_sketched:
                self.shapes = np.clip(mean[2 * m + 1 : 5 * m + 1].reshape(3, m), -FAR, FAR)
                self.exposed, self.modes = self._exposed()
        return self._relative(mean, covariance)

    def _start(self) -> tuple[FloatArray, float]:
        """Return first brightnesses and gain, by whatever saw an LED."""
        by_camera = np.full(self.count, np.nan)
        by_spectrometer = np.full(self.count, np.nan)
        for number, led in enumerate(self.leds):
            if self.by_camera[number] and led.value is not None and led.variance is not None:
                row = self.exposed[number]
                value = float(row @ led.value) / max(float(row @ row), 1e-300)
                noise = math.sqrt(float(row**2 @ led.variance)) / max(float(row @ row), 1e-300)
                by_camera[number] = math.log(value) if value > 3 * noise else np.nan
            if led.light is not None and led.light > 0:
                by_spectrometer[number] = math.log(led.light)
        if not self.has_spectrometer:
            typical = np.nanmedian(by_camera) if np.isfinite(by_camera).any() else 0.0
            return np.where(np.isfinite(by_camera), by_camera, typical), 0.0
        both = by_camera - by_spectrometer
        log_g = float(np.nanmedian(both)) if np.isfinite(both).any() else 0.0
        typical = float(np.nanmedian(by_spectrometer))
        log_b = np.where(np.isfinite(by_spectrometer), by_spectrometer, by_camera - log_g)
        return np.where(np.isfinite(log_b), log_b, typical), log_g

    def _solve(
        self, log_b: FloatArray, log_g: float, start: tuple[FloatArray, float]
    ) -> tuple[FloatArray, FloatArray]:
        """Return mean and covariance of all unknowns, linearised about some brightnesses."""
        m, z = self.count, len(self.modes)
        size = 2 * m + 1 + z
        rows, targets = [], []
        for number, led in enumerate(self.leds):
            if self.by_camera[number] and led.value is not None and led.variance is not None:
                scale = math.exp(log_b[number] + log_g)
                exposed = self.exposed[number]
                seen = led.value / scale
                noise = np.diag(led.variance / scale**2)
                noise += EXPOSURE_SIGMA**2 * np.outer(seen, seen)
                row = np.zeros((len(exposed), size))
                row[:, number] = row[:, m] = exposed
                row[:, 2 * m + 1 :] = self.modes[:, number].T
                about = exposed * (log_b[number] + log_g)
                about = about + self.modes[: 3 * m, number].T @ self.shapes.ravel()
                whiten = np.linalg.inv(np.linalg.cholesky(noise))
                rows.append(whiten @ row)
                targets.append(whiten @ (seen - exposed + about))
            if led.light is not None and led.light_sigma is not None and led.light > 0:
                row = np.zeros((1, size))
                row[0, number] = 1.0
                row[0, m + 1 : 2 * m + 1] = self.response_root[number]
                rows.append(row / led.light_sigma)
                targets.append(np.array([math.log(led.light) / led.light_sigma]))
        prior_mean = np.zeros(size)
        prior_mean[: m + 1] = [*start[0], start[1]]
        precision: FloatArray = np.ones(size)
        precision[:m] = UNKNOWN_BRIGHTNESS**-2
        precision[m] = UNKNOWN_GAIN**-2 if self.has_spectrometer else FIXED
        root = np.sqrt(precision)
        # By QR, since normal equations lose half of the digits.
        orthogonal, upper = np.linalg.qr(np.concatenate([*rows, np.diag(root)]))
        inverse = solve_triangular(upper, np.eye(size))
        mean = inverse @ (orthogonal.T @ np.concatenate([*targets, root * prior_mean]))
        return mean, inverse @ inverse.T

    def _centroid_changes(self, number: int) -> list[float]:
        """Return the change of an LED's centroid in nm with one σ of shift, width and skew."""
        led, now = self.leds[number], self.shapes[:, number]
        centre = centroid_nm(_shaped(led, now))
        return [
            (centroid_nm(_shaped(led, now + SHAPE_STEP * axis)) - centre) / SHAPE_STEP
            for axis in np.eye(3)
        ]

    def _slope_sigma(self, covariance: FloatArray) -> FloatArray:
        """Return σ of the slope of ln r at each LED from rows of the unknowns' covariance, (m,)."""
        m, nm = self.count, self._response.correlation_nm
        own = covariance[:, m + 1 : 2 * m + 1]
        centre = self._centre_nm
        prior = _correlated(self._response, centre, centre)
        derivative = -prior * (centre[:, np.newaxis] - centre) / nm**2
        onto = np.linalg.solve(self.response_root, derivative.T).T
        told = np.einsum("ij,jk,ik->i", onto, np.eye(m) - own, onto)
        return np.asarray(np.sqrt(np.maximum((self._response.sigma / nm) ** 2 - told, 0.0)))

    def _relative(self, mean: FloatArray, covariance: FloatArray) -> BrightnessFit:
        """Return brightnesses with the covariance about their common scale."""
        m = self.count
        # LEDs of which nothing is known do not blur the scale of the others.
        known = np.diag(covariance)[:m] < 1.0
        between = covariance[:m, :m][np.ix_(known, known)]
        weight = np.where(known, _centred_weights(between, known), 0.0)
        about = np.eye(m) - np.outer(np.ones(m), weight)
        errors = np.array([_shape_errors(led) for led in self.leds])
        shapes = slice(2 * m + 1, 5 * m + 1)
        shift_nm, wider, skew = mean[shapes].reshape(3, m) * errors.T
        # By how much each σ of shift, width and skew of an LED moves its centroid.
        moved = np.array([self._centroid_changes(number) for number in range(m)])
        onto = np.concatenate([np.diag(column) for column in moved.T], axis=1)
        own = onto @ covariance[shapes, shapes] @ onto.T
        normalised = np.linalg.solve(self.response_root.T, mean[m + 1 : 2 * m + 1])
        return BrightnessFit(
            log_brightness=mean[:m],
            covariance=about @ covariance[:m, :m] @ about.T,
            scale_sigma=float(np.sqrt(weight @ covariance[:m, :m] @ weight)),
            shift_nm=shift_nm,
            width_factor=1 + wider,
            skew=skew,
            wavelength_sigma_nm=np.sqrt(np.maximum(np.diag(own), 0.0)),
            centre_nm=self._centre_nm,
            response_weight=normalised if self.has_spectrometer else np.zeros(m),
            response_slope_sigma_per_nm=self._slope_sigma(covariance[m + 1 : 2 * m + 1]),
            response=self._response,
            by_camera=tuple(self.by_camera),
        )


def _correlated(response: ResponseError, first_nm: FloatArray, second_nm: FloatArray) -> FloatArray:
    """Return the prior covariance of ln r between wavelengths, shape (first, second)."""
    distance = (first_nm[:, np.newaxis] - second_nm) / response.correlation_nm
    return np.asarray(response.sigma**2 * np.exp(-(distance**2) / 2))


def _centred_weights(covariance: FloatArray, known: np.ndarray) -> FloatArray:
    """Return weights of the common scale, which sum to 1 over the LEDs known."""
    weights = np.zeros(len(known))
    if known.any():
        # The common scale is itself almost unknown: weigh by what differs between the LEDs.
        number = len(covariance)
        centring = np.eye(number) - 1 / number
        own = np.diag(centring @ covariance @ centring) + 1e-12
        weights[known] = (1 / own) / (1 / own).sum()
    return weights


def changed_spectrum(
    spectrum: Spectrum, shift_nm: float, width_factor: float = 1.0, skew: float = 0.0
) -> Spectrum:
    """Return a spectrum shifted, and widened about its centroid.

    Parameters
    ----------
    spectrum
        A spectrum with light.
    shift_nm, width_factor
        Shift in nm, and factor of its width.
    skew
        Part by which the side of long wavelengths is wider, and the other one narrower.

    Returns
    -------
    Spectrum
        The spectrum with other wavelengths.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.fit.leds import changed_spectrum
    >>> from labrig.optics import Spectrum
    >>> line = Spectrum("line", np.array([500.0, 510.0, 520.0]), np.array([0.0, 1.0, 0.0]))
    >>> changed_spectrum(line, 1.0, 2.0, 0.1).wavelength_nm.tolist()
    [493.0, 511.0, 533.0]
    """
    centre = centroid_nm(spectrum)
    off_nm = spectrum.wavelength_nm - centre
    stretched = width_factor * off_nm * (1 + skew * np.sign(off_nm))
    return replace(spectrum, wavelength_nm=centre + shift_nm + stretched)


def _shape_errors(led: LedLightMeasured) -> tuple[float, float, float]:
    """Return σ of shift in nm, width and skew of an LED's spectrum."""
    nominal = float(led.is_nominal)
    return led.wavelength_sigma_nm, nominal * WIDTH_SIGMA, nominal * SKEW_SIGMA


def _shaped(led: LedLightMeasured, shape: FloatArray) -> Spectrum:
    """Return an LED's spectrum changed by shift, width and skew in their standard deviations."""
    shift_nm, wider, skew = (float(one) for one in shape * _shape_errors(led))
    return changed_spectrum(led.spectrum, shift_nm, 1 + wider, skew)


def _power(spectrum: Spectrum) -> float:
    ends = spectrum.wavelength_nm[[0, -1]]
    return float(band_integrals(spectrum.wavelength_nm, spectrum.value, ends)[0])
