r"""What a camera sees of a fluorescent surface, light by light.

A surface of reflectance ρ and re-radiation Φ under the light b_m l_m, ∫ l_m = 1, gives channel k

    I_km = b_m ∫ [ρ(λ_o) l_m(λ_o) + ∫ Φ(λ_i, λ_o) l_m(λ_i) dλ_i] c_k(λ_o) dλ_o

(the thesis, equations 4.2 and 4.3). Where one dye re-radiates, Φ = a(λ_i) e(λ_o), and the light in
its emission e is s_m = ∫ a l_m ≈ a(λ_m) ∫ l_m: the thesis divides by ∫ l_m, by misprint. A white
of reflectance 1 gives b_m ∫ l_m c_k.

The errors of the lights' spectra, of their brightnesses and of the camera's curves are small
changes of the same equation, one for each independent error of unit variance. A white reference
under the same lights tells most of them.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import solve_triangular

from labrig.fit.leds import changed_spectrum
from labrig.fit.spectrum import CurveError, camera_modes, curve_modes
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.optics import (
    CameraResponse,
    Spectrum,
    Transmittance,
    band_integrals,
    edges_from_centres,
    hat_functions,
    quadrature,
)

INPUT_NM = np.arange(300.0, 781.0, 10.0)
OUTPUT_NM = np.arange(380.0, 781.0, 10.0)
#: Step in nm of the derivative of a light's spectrum by its wavelength, and in standard deviations
#: of that by its width and skew.
SHIFT_NM, SHAPE_STEP = 0.5, 0.5
#: Step in nm on which lights are averaged: LEDs are no finer, and lines keep their power.
LIGHT_STEP_NM = 1.0
#: Relative brightness error that stands for "unknown"; much more would cost digits.
UNKNOWN = 30.0
#: Relative error of the brightness from which its light tells the colour of what it excites only:
#: less still says whether that is little or much.
LOOSE = 1.0
#: Fraction of a light's strongest input band from which another one counts as lit by it.
LIT = 0.1
#: Least part of a light's power that must lie within the input bands.
MIN_INSIDE = 0.9


@dataclass(frozen=True, eq=False)
class Exposure:
    """A light under which the surface was photographed: one LED, or any other lamp.

    Attributes
    ----------
    light
        Its spectrum, on any scale.
    brightness, brightness_sigma
        Brightness b, and its standard deviation: the camera's value of a perfect white is b times
        its curve's mean under the light. The deviation is infinite where the brightness is not
        known, as of ultraviolet LEDs that no camera sees.
    wavelength_sigma_nm
        Standard deviation of an error of all its wavelengths in nm.
    width_sigma, skew_sigma
        Standard deviations of width and skew, as `labrig.fit.leds.changed_spectrum` has them, of a
        spectrum that is a curve by peak and width only.
    spectrum_error
        Error of its spectrum's shape, smooth over wavelength, as of a lamp that is another one than
        that of the file; None for none.
    """

    light: Spectrum
    brightness: float = 1.0
    brightness_sigma: float = 0.0
    wavelength_sigma_nm: float = 0.0
    width_sigma: float = 0.0
    skew_sigma: float = 0.0
    spectrum_error: CurveError | None = None

    def changes(self) -> Iterator[tuple[float, Spectrum, Spectrum]]:
        """Yield, of each error of shape, σ over two steps, and spectra a step ahead and behind."""
        sigmas = self.wavelength_sigma_nm, self.width_sigma, self.skew_sigma
        for kind, sigma in enumerate(sigmas):
            if sigma > 0:
                step = SHIFT_NM if kind == 0 else SHAPE_STEP * sigma
                yield sigma / (2 * step), self._changed(kind, step), self._changed(kind, -step)

    def _changed(self, kind: int, step: float) -> Spectrum:
        shift_nm, wider, skew = (step if number == kind else 0.0 for number in range(3))
        return changed_spectrum(self.light, shift_nm, 1 + wider, skew)

    @property
    def is_lamp(self) -> bool:
        """Whether it is a lamp whose spectrum is another one's: it tells sums over bands only."""
        return self.spectrum_error is not None

    def __post_init__(self) -> None:
        name = self.light.name
        if not (math.isfinite(self.brightness) and self.brightness > 0):
            raise UsageError(
                f"light '{name}': expected a brightness above 0, got {self.brightness}; give 1 and "
                "an infinite brightness_sigma where it is not known"
            )
        for what in ("brightness_sigma", "wavelength_sigma_nm", "width_sigma", "skew_sigma"):
            if not getattr(self, what) >= 0:
                raise UsageError(
                    f"light '{name}': expected {what} of 0 or more, got {getattr(self, what)}"
                )
        if math.isinf(self.wavelength_sigma_nm):
            raise UsageError(f"light '{name}': expected a finite wavelength_sigma_nm, got inf")
        power = _power(self.light)
        if self.light.value.min() < -0.05 * self.light.value.max() or not power > 0:
            raise UsageError(f"light '{name}': expected a spectrum above 0, got one below")


@dataclass(frozen=True, eq=False)
class _Response:
    """The equation's factors, of a light of unit power; or a change of all of them.

    Attributes
    ----------
    reflected
        Value per reflectance at the middle of each output band, shape (…, m, k, o).
    absorbed
        Light in each input band, shape (…, m, i).
    seen
        Integral of each curve over each output band, shape (…, o, k).
    """

    reflected: FloatArray
    absorbed: FloatArray
    seen: FloatArray


@dataclass(frozen=True, eq=False)
class FluorescenceSystem:
    """The linear system from a surface to the camera's values, and its errors.

    Attributes
    ----------
    exposures
        The lights.
    camera
        The camera.
    input_nm, output_nm
        Middles of the input bands (i,) and output bands (o,) in nm. Reflectance is linear between
        the output bands' middles, re-radiation constant in each band.
    brightness
        Brightness of each light, shape (m,).
    is_loose
        Whether the brightness of a light is practically unknown, shape (m,), bool.
    response
        The factors of the equation.
    modes
        One standard deviation of them for each independent error, stacked along the first axis.
    """

    exposures: tuple[Exposure, ...]
    camera: CameraResponse
    input_nm: FloatArray
    output_nm: FloatArray
    brightness: FloatArray
    is_loose: np.ndarray
    response: _Response
    modes: _Response

    @property
    def shape(self) -> tuple[int, int]:
        """Number of lights and of channels."""
        return len(self.exposures), self.response.seen.shape[1]

    @property
    def is_stokes(self) -> FloatArray:
        """1 where the output has the longer wavelength, else 0, shape (o, i)."""
        return np.asarray(self.output_nm[:, np.newaxis] > self.input_nm, dtype=np.float64)

    @property
    def is_lit(self) -> np.ndarray:
        """Whether some light is strong in an input band, relative to its strongest one, (i,).

        Lamps do not count.
        """
        absorbed = self.response.absorbed[[not each.is_lamp for each in self.exposures]]
        return np.asarray((absorbed > LIT * absorbed.max(axis=1, keepdims=True)).any(axis=0))

    def values(self, reflectance: FloatArray, reradiation: FloatArray) -> FloatArray:
        """Return the camera's values of a surface, per brightness.

        Parameters
        ----------
        reflectance, reradiation
            ρ (…, o) and Φ (…, o, i).

        Returns
        -------
        ndarray
            Values, shape (…, m, k).
        """
        seen = self.response.absorbed @ np.swapaxes(reradiation, -1, -2) @ self.response.seen
        reflected = np.einsum("mko,...o->...mk", self.response.reflected, reflectance)
        return np.asarray(reflected + seen)

    def covariance(self, reflectance: FloatArray, reradiation: FloatArray) -> FloatArray:
        """Return the covariance (mk, mk) of the values per brightness, from the system's errors."""
        emitted = reradiation @ self.response.absorbed.T
        modes = self.modes
        change = np.einsum("zmko,o->zmk", modes.reflected, reflectance)
        change += modes.absorbed @ reradiation.T @ self.response.seen
        change += np.einsum("om,zok->zmk", emitted, modes.seen)
        flat = change.reshape(len(change), math.prod(self.shape))
        return np.asarray(flat.T @ flat)

    def informed_by_white(
        self,
        value: ArrayLike,
        variance: ArrayLike,
        white: Transmittance | None = None,
        white_sigma: float = 0.0,
        white_error: CurveError | None = None,
    ) -> Self:
        """Return the system that the values of a white reference under the same lights leave.

        Parameters
        ----------
        value, variance
            Values of the reference and their variances, in the unit of the surface's values, shape
            (m, k). Lights under which it does not show count little by themselves.
        white
            Reflectance of the reference, which must not fluoresce; None stands for 1.
        white_sigma
            Standard deviation of the reference's reflectance, relative and common to all lights.
        white_error
            Error of the reflectance's course over wavelength; None takes it for exact.

        Returns
        -------
        FluorescenceSystem
            The most likely brightnesses, spectra and curves, and what is still unknown of them.

        Raises
        ------
        UsageError
            Shapes disagree, or a variance is not above 0.
        """
        values, variances = checked_values(self, value, variance)
        reflectance = np.ones_like(self.output_nm) if white is None else white.at(self.output_nm)
        expected = self.response.reflected @ reflectance
        brightness = self.brightness.copy()
        weight = (expected**2 / variances).sum(axis=1)
        ratio = (expected * values / variances).sum(axis=1) / np.where(weight > 0, weight, 1.0)
        is_visible = self.is_loose & (ratio * np.sqrt(weight) > 1 / LOOSE)
        brightness[is_visible] = ratio[is_visible]

        # Linear in the errors: value = b · (expected + Σ z change), b = brightness · (1 + error).
        scale = brightness[:, np.newaxis]
        change = np.einsum("zmko,o->zmk", self.modes.reflected, reflectance)
        loose = np.flatnonzero(self.is_loose)
        free = np.zeros((len(loose), *self.shape))
        free[np.arange(len(loose)), loose] = UNKNOWN * expected[loose]
        change = np.concatenate([change, free]).reshape(len(change) + len(loose), -1)
        noise = np.diag((variances / scale**2).ravel())
        for (course,) in _courses(white_error, self.output_nm, reflectance):
            course_change = (self.response.reflected @ course).ravel()
            noise += np.outer(course_change, course_change)
        lower = np.linalg.cholesky(noise)
        target = solve_triangular(lower, (values / scale - expected).ravel(), lower=True)
        whitened = solve_triangular(lower, change.T, lower=True)
        precision = np.eye(len(change)) + whitened.T @ whitened
        root = np.linalg.inv(np.linalg.cholesky(precision)).T
        mean = root @ (root.T @ (whitened.T @ target))
        return self._updated(brightness, loose, mean, root, white_sigma)

    def with_drift(self, sigma: ArrayLike) -> Self:
        """Return the system whose lights changed between the white reference and the surface.

        Parameters
        ----------
        sigma
            Relative standard deviation of each light's brightness, common to the channels: of
            shutter and lamp from frame to frame, of lamps that warm and age, shape (m,).
        """
        relative = np.asarray(sigma, dtype=np.float64)
        lights = np.flatnonzero(relative > 0)
        by_light = relative[lights][:, np.newaxis, np.newaxis]
        more = _Response(
            by_light[..., np.newaxis] * _only(self.response.reflected, lights),
            by_light * _only(self.response.absorbed, lights),
            np.zeros((len(lights), *self.response.seen.shape)),
        )
        modes = _Response(
            *(
                np.concatenate([getattr(self.modes, part), getattr(more, part)])
                for part in ("reflected", "absorbed", "seen")
            )
        )
        return replace(self, modes=modes)

    def _updated(
        self,
        brightness: FloatArray,
        loose: np.ndarray,
        mean: FloatArray,
        root: FloatArray,
        white_sigma: float,
    ) -> Self:
        """Return the system whose errors z have some mean and covariance root · rootᵀ."""
        before, count = self.response, len(self.modes.reflected)
        sigma = np.linalg.norm(root[count:], axis=1) * UNKNOWN
        is_loose = np.zeros_like(self.is_loose)
        is_loose[loose] = sigma > LOOSE
        # What stays loose is left to the fit of the surface, which sees its light's colour only.
        # Its most likely factor means nothing, and may even be negative.
        kept_mean, kept_root = mean.copy(), root.copy()
        kept_mean[count:][sigma > LOOSE] = 0.0
        kept_root[count:][sigma > LOOSE] = 0.0
        lit = [UNKNOWN * _only(part, loose) for part in (before.reflected, before.absorbed)]
        dark = np.zeros((len(loose), *before.seen.shape))
        modes = [
            np.concatenate(pair)
            for pair in zip(
                (self.modes.reflected, self.modes.absorbed, self.modes.seen),
                (*lit, dark),
                strict=True,
            )
        ]
        response = _Response(
            *(
                part + np.tensordot(kept_mean, mode, 1)
                for part, mode in zip(
                    (before.reflected, before.absorbed, before.seen), modes, strict=True
                )
            )
        )
        left = [np.tensordot(kept_root.T, mode, 1) for mode in modes]
        scale = [white_sigma * part[np.newaxis] for part in (response.reflected, response.absorbed)]
        left = [
            np.concatenate(pair)
            for pair in zip(left, (*scale, np.zeros((1, *before.seen.shape))), strict=True)
        ]
        return replace(
            self, brightness=brightness, is_loose=is_loose, response=response,
            modes=_Response(*left),
        )  # fmt: skip


def fluorescence_system(
    exposures: Sequence[Exposure],
    camera: CameraResponse,
    curve_error: CurveError | None = None,
    input_nm: ArrayLike = INPUT_NM,
    output_nm: ArrayLike = OUTPUT_NM,
) -> FluorescenceSystem:
    """Return the system of a camera and some lights.

    Parameters
    ----------
    exposures
        The lights, one or more; an estimate needs two.
    camera
        The camera, with its curves on their own wavelengths.
    curve_error
        Error of its curves; None takes them for exact.
    input_nm, output_nm
        Rising middles of the bands in nm, of the matrix that is to be found.

    Returns
    -------
    FluorescenceSystem
        The system and its errors.

    Raises
    ------
    UsageError
        There are no lights, a light lies outside of the input bands, or the camera's
        curves lie outside of the output bands.

    Examples
    --------
    >>> import numpy as np
    >>> import labrig
    >>> from labrig.fit.fluorescence import Exposure, fluorescence_system
    >>> from labrig.optics import read_light
    >>> lights = [Exposure(read_light(name)) for name in ("450nm", "520nm", "630nm")]
    >>> system = fluorescence_system(lights, labrig.read_camera("canon_eos_5d_mark_ii"))
    >>> grey = system.values(np.full(41, 0.2), np.zeros((41, 49)))
    >>> grey.shape, grey[1].round(3).tolist()
    ((3, 3), [0.015, 0.198, 0.048])
    """
    inputs, outputs = (np.asarray(nm, dtype=np.float64) for nm in (input_nm, output_nm))
    if not exposures:
        raise UsageError("expected one or more lights, got none")
    in_edges, out_edges = edges_from_centres(inputs), edges_from_centres(outputs)
    low_nm, high_nm = camera.wavelength_nm[[0, -1]]
    if high_nm <= out_edges[0] or low_nm >= out_edges[-1]:
        raise UsageError(
            f"camera '{camera.name}': expected curves between {out_edges[0]:g} and "
            f"{out_edges[-1]:g} nm, got {low_nm:g} to {high_nm:g} nm; look for a wrong unit"
        )
    for exposure in exposures:
        inside = _power(exposure.light, (in_edges[0], in_edges[-1])) / _power(exposure.light)
        if inside < MIN_INSIDE:
            raise UsageError(
                f"light '{exposure.light.name}': expected its power from {in_edges[0]:g} to "
                f"{in_edges[-1]:g} nm, got {100 * inside:.0f} % of it there; leave it out"
            )
    low_nm, high_nm = min(in_edges[0], out_edges[0]), max(in_edges[-1], out_edges[-1])
    grid_nm = np.arange(low_nm, high_nm + LIGHT_STEP_NM, LIGHT_STEP_NM)
    nodes, weights = quadrature(low_nm, high_nm, camera.wavelength_nm, outputs, out_edges, grid_nm)
    # Beyond the outermost middles reflectance goes on, as in `appearance`.
    hats = hat_functions(outputs, np.clip(nodes, outputs[0], outputs[-1]))
    in_output = np.asarray(
        (nodes[:, np.newaxis] >= out_edges[:-1]) & (nodes[:, np.newaxis] < out_edges[1:]),
        dtype=np.float64,
    )
    in_input = np.asarray(
        (nodes[:, np.newaxis] >= in_edges[:-1]) & (nodes[:, np.newaxis] < in_edges[1:]),
        dtype=np.float64,
    )
    curves = camera.at(nodes)
    spectra = [exposure.light.resampled(grid_nm) for exposure in exposures]
    lights = np.array([_at(spectrum, nodes) for spectrum in spectra])

    def reflected(spectra: FloatArray, sensitivity: FloatArray) -> FloatArray:
        weighted = weights[:, np.newaxis] * sensitivity
        return np.stack([(weighted * light[:, np.newaxis]).T @ hats for light in spectra])

    def seen(sensitivity: FloatArray) -> FloatArray:
        return np.asarray((weights[:, np.newaxis] * in_output).T @ sensitivity)

    def absorbed(light: Spectrum) -> FloatArray:
        return band_integrals(light.wavelength_nm, light.value, in_edges) / _power(light)

    response = _Response(
        reflected(lights, curves),
        np.array([absorbed(exposure.light) for exposure in exposures]),
        seen(curves),
    )
    modes: list[_Response] = []
    for change in camera_modes(camera, nodes, curve_error):
        modes.append(
            _Response(reflected(lights, change), np.zeros_like(response.absorbed), seen(change))
        )
    for number, exposure in enumerate(exposures):
        for per_step, ahead, behind in exposure.changes():
            moved = _Response(
                np.zeros_like(response.reflected), np.zeros_like(response.absorbed),
                np.zeros_like(response.seen),
            )  # fmt: skip
            power = _at(ahead.resampled(grid_nm), nodes) - _at(behind.resampled(grid_nm), nodes)
            moved.reflected[number] = per_step * reflected(power[np.newaxis], curves)[0]
            moved.absorbed[number] = per_step * (absorbed(ahead) - absorbed(behind))
            modes.append(moved)
        light = lights[number][:, np.newaxis]
        for change in curve_modes(exposure.spectrum_error, nodes, light, light.max(axis=0)):
            bent = _Response(
                np.zeros_like(response.reflected), np.zeros_like(response.absorbed),
                np.zeros_like(response.seen),
            )  # fmt: skip
            bent.reflected[number] = reflected(change.T, curves)[0]
            bent.absorbed[number] = (weights * change[:, 0]) @ in_input
            modes.append(bent)
    brightness = np.array([exposure.brightness for exposure in exposures])
    relative = np.array([exposure.brightness_sigma for exposure in exposures]) / brightness
    for number in np.flatnonzero((relative > 0) & (relative <= LOOSE)).tolist():
        modes.append(
            _Response(
                relative[number] * _only(response.reflected, np.array([number]))[0],
                relative[number] * _only(response.absorbed, np.array([number]))[0],
                np.zeros_like(response.seen),
            )
        )
    return FluorescenceSystem(
        tuple(exposures), camera, inputs, outputs, brightness, relative > LOOSE, response,
        _stacked(modes, response),
    )  # fmt: skip


def checked_values(
    system: FluorescenceSystem, value: ArrayLike, variance: ArrayLike
) -> tuple[FloatArray, FloatArray]:
    """Return values and variances, shape (m, k), or raise UsageError in one line."""
    values, variances = (np.asarray(x, dtype=np.float64) for x in (value, variance))
    for what, numbers in (("values", values), ("variances", variances)):
        if numbers.shape != system.shape:
            lights, channels = system.shape
            raise UsageError(
                f"expected {what} of {lights} lights and {channels} channels, shape "
                f"({lights}, {channels}), got {numbers.shape}"
            )
    for number, exposure in enumerate(system.exposures):
        name = exposure.light.name
        if not np.isfinite(values[number]).all():
            raise UsageError(
                f"light '{name}': expected a finite value of every channel, got "
                f"{values[number].tolist()}; leave this light out"
            )
        if not (np.isfinite(variances[number]) & (variances[number] > 0)).all():
            raise UsageError(
                f"light '{name}': expected variances above 0, got {variances[number].tolist()}; "
                "give the noise of every value"
            )
    return values, variances


def require_scale(system: FluorescenceSystem) -> None:
    """Raise UsageError if there are fewer than two lights, or none has a known brightness."""
    if len(system.exposures) < 2:
        raise UsageError(
            f"expected two or more lights, got {len(system.exposures)}: one light does not show "
            "the light that others excite; photograph the surface under others"
        )
    if system.is_loose.all():
        raise UsageError(
            "expected one light or more of known brightness, got none; photograph a white "
            "reference under them"
        )


def _power(light: Spectrum, ends_nm: tuple[float, float] | None = None) -> float:
    ends = light.wavelength_nm[[0, -1]] if ends_nm is None else ends_nm
    return float(band_integrals(light.wavelength_nm, light.value, ends)[0])


def _courses(error: CurveError | None, nm: FloatArray, curve: FloatArray) -> Iterator[FloatArray]:
    """Yield changes (1, o) of a curve, each one σ of an independent error."""
    for mode in curve_modes(error, nm, curve[:, np.newaxis], np.array([curve.max()])):
        yield mode.T


def _at(light: Spectrum, nodes_nm: FloatArray) -> FloatArray:
    return light.at(nodes_nm) / _power(light)


def _only(part: FloatArray, lights: np.ndarray) -> FloatArray:
    """Return copies of `part` (m, …), one for each of some lights, 0 but for that light."""
    copies = np.zeros((len(lights), *part.shape))
    copies[np.arange(len(lights)), lights] = part[lights]
    return copies


def _stacked(modes: Sequence[_Response], like: _Response) -> _Response:
    parts = []
    for name in ("reflected", "absorbed", "seen"):
        part = getattr(like, name)
        parts.append(
            np.array([getattr(mode, name) for mode in modes])
            if modes
            else np.zeros((0, *part.shape))
        )
    return _Response(*parts)
