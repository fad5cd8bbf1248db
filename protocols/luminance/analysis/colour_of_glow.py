"""From a camera's three channels to the luminance of a glow, and what three channels cannot tell.

The signal of the glow over that of the card under the lamp is ∫ c S dλ / ∫ c L dλ in channel c.
With the shape of S known, each channel gives the luminance by itself, and their weights are those
of least variance by the errors of curves, lamp and shape. Without it, all smooth non-negative
spectra that explain the channels are drawn from, and the spread of their luminances is the σ.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.special import chdtrc

from labrig.analyse.inputs import AnalysisContext
from labrig.fit.spectrum import (
    CurveError,
    SpectralSystem,
    camera_modes,
    curve_modes,
    fit_spectrum,
)
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError, UsageError
from labrig.foundation.named_files import is_path
from labrig.foundation.result_warning import Contradiction, ResultWarning, Undetermined
from labrig.material import Material, read_material
from labrig.optics import (
    CameraResponse,
    Spectrum,
    Transmittance,
    hat_functions,
    photopic_efficacy,
    quadrature,
    read_spectrum,
    scotopic_efficacy,
)
from labrig.protocols.luminance.protocol import TABLES
from labrig.results import Measured, read_result

#: Error of a camera's curves: laboratories differ by 2 % to 6 % RMS of the peak, which is some 7 %
#: of the curve itself.
CURVES = CurveError(relative=0.07)
#: Relative errors of a lamp's spectrum and of an emission without σ, smooth over so many nm (1 σ).
LAMP_ERROR, EMISSION_ERROR, SMOOTH_NM = 0.02, 0.02, 40.0
#: Relative σ of a card's reflectance without one in its file.
CARD_ERROR = 0.01
#: Knots of an estimated spectrum, and limits of all integrals, in nm.
KNOTS_NM: FloatArray = np.arange(400.0, 701.0, 10.0)
LIMITS_NM = (360.0, 830.0)
#: Emissions of phosphors, before anything is measured: middles of bands, median and spread of ln of
#: their widths at half maximum, and number of candidates.
BAND_NM, MEDIAN_FWHM_NM, SPREAD_FWHM, CANDIDATES = (420.0, 670.0), 75.0, 0.35, 5000
#: Noise of the colour's channels, at least.
MIN_NOISE = 1e-3
#: Relative σ of an estimated emission's luminance that is told.
OPEN = 0.06
#: Probability of a colour below which it is doubted.
DOUBTED = 1e-4


@dataclass(frozen=True)
class Emission:
    """A known emission spectrum, its origin, and the relative error of its shape."""

    spectrum: Spectrum
    source: str
    error: float


@dataclass(frozen=True, eq=False)
class ColourScale:
    """Weights of the channels that make luminances of ratios to the card.

    Attributes
    ----------
    weights
        Luminance in cd/m² per ratio of the glow's to the card's signal, shape (channels,).
    relative_sigma
        Relative σ of all luminances by the curves, the lamp's spectrum and the emission.
    wavelength_nm, spectrum
        Emission spectrum, shape (n,).
    source
        Origin of the emission.
    scotopic_ratio
        Scotopic over photopic luminance.
    card_sigma, card_source
        Relative σ of the card's reflectance and its origin.
    expected_card
        Signals of the card under the lamp by the curves, on any scale, shape (channels,).
    card_errors
        Their relative errors in each mode, shape (modes, channels).
    has_ratios
        Whether the curves tell the ratios between the channels.
    doubt
        Why the colour is not that of the emission, or what it leaves open; None if all is well.
    """

    weights: FloatArray
    relative_sigma: float
    wavelength_nm: FloatArray
    spectrum: FloatArray
    source: str
    scotopic_ratio: Measured
    card_sigma: float
    card_source: str
    expected_card: FloatArray
    card_errors: FloatArray
    has_ratios: bool
    doubt: ResultWarning | None

    def card_doubt(self, card: FloatArray, sigma: float) -> ResultWarning | None:
        """Return a warning if the card's light is not that of the lamp, None if it is."""
        if not self.has_ratios:
            return None
        logs = np.log(card / self.expected_card)
        if _probability(logs, self.card_errors, max(sigma, MIN_NOISE)) > DOUBTED:
            return None
        return Contradiction(
            "card-colour-differs",
            "the card under the lamp has another colour than the rig file's curves say (channels "
            "{ratios:.2f} of the expected values): another lamp than its spectrum, a card that "
            "fluoresces, or another light; luminances may be wrong by as much",
            ratios=tuple(np.exp(logs - logs[np.argmax(card)]).tolist()),
        )


def emission_of(context: AnalysisContext, name: str) -> Emission | None:
    """Return the emission spectrum of a patch that the protocol names, or an earlier part measured.

    Raises
    ------
    UsageError
        What the protocol names is no material, run or table with an emission spectrum.
    """
    measured = context.inputs.spectra.get(name) or context.inputs.spectra.get("")
    named = context.protocol.emission
    if named is None and measured is None:
        return None
    if named is not None and is_path(named) and Path(named).is_dir():
        result = read_result(Path(named))
        spectra = result.provides().get("spectra")
        if not spectra:
            raise UsageError(
                f"emission: {named}: expected a run of emission_spectrum, got one of {result.kind}"
            )
        measured = spectra.get(name) or next(iter(spectra.values()))
    elif named is not None and Path(named).suffix in TABLES:
        spectrum = read_spectrum(Path(named))
        return Emission(spectrum, Path(named).name, _error(spectrum))
    elif named is not None:
        return _of_material(read_material(named))
    assert measured is not None
    nm, value, sigma = map(np.asarray, (measured.wavelength_nm, measured.value, measured.sigma))
    spectrum = Spectrum(measured.sample, nm, value, sigma)
    return Emission(
        spectrum, f"emission spectrum {measured.run or measured.sample}", _error(spectrum)
    )


def _error(spectrum: Spectrum) -> float:
    """Return the relative error of a spectrum's shape, about its peak."""
    if spectrum.sigma is None:
        return EMISSION_ERROR
    weight = np.maximum(spectrum.value, 0.0)
    return float(np.sqrt((weight * np.square(spectrum.sigma)).sum() / (weight**3).sum()))


def _of_material(material: Material) -> Emission:
    if material.spectrum is None:
        raise UsageError(
            f"emission: {material.name}: expected a material with a spectrum, got none (bands are "
            "too coarse for a luminance); measure it with emission_spectrum, or leave it out"
        )
    measured = material.spectrum
    sigma = None if measured.sigma is None else np.array(measured.sigma)
    nm, value = np.array(measured.wavelength_nm), np.array(measured.value)
    spectrum = Spectrum(material.name, nm, value, sigma)
    return Emission(spectrum, f"material {material.name}", _error(spectrum))


def colour_scale(
    colour: FloatArray,
    noise: FloatArray,
    camera: CameraResponse,
    card: Spectrum,
    lamp: Spectrum,
    reflectance: Transmittance,
    known: Emission | None,
) -> ColourScale:
    """Return the weights of the channels for a glow of that colour.

    Parameters
    ----------
    colour, noise
        Ratios of the glow to the card in the channels on any scale, and their σ, (channels,).
    camera
        Curves of the camera.
    card
        Spectral radiance of the card under the lamp in W m⁻² sr⁻¹ nm⁻¹.
    lamp, reflectance
        Spectrum of the lamp and reflectance of the card, for their σ.
    known
        Emission spectrum; None estimates it.

    Raises
    ------
    DataError
        The channels do not see the emission.
    """
    knots = [] if known is None else [known.spectrum.wavelength_nm]
    nodes, step = quadrature(*LIMITS_NM, camera.wavelength_nm, KNOTS_NM, *knots)
    bench = _Bench.of(nodes, step, camera, card, lamp)
    noise = np.maximum(noise, MIN_NOISE * colour)
    if known is not None:
        shape, shapes = known.spectrum.at(nodes), _smooth_errors(nodes, known.spectrum, known.error)
        nm, spectrum = known.spectrum.wavelength_nm, known.spectrum.value
        expected = bench.signals(shape)
        if not (expected > 0).all():
            raise DataError(
                f"{known.source}: expected an emission that all channels see, got one that some do "
                "not; name another one under 'emission:', or none"
            )
        seen = float(step @ (photopic_efficacy(nodes) * shape))
        luminous = shapes @ (step * photopic_efficacy(nodes)) / seen
        errors = np.vstack([bench.errors(shape), bench.signals(shapes) / expected])
        errors_v = np.concatenate([np.zeros(len(bench.changes)), luminous])
        share, sigma = _shares(errors, errors_v, noise / colour)
        weights, source = share * seen / expected, known.source
        dark = float(step @ (scotopic_efficacy(nodes) * shape))
        by_shape = shapes @ (step * scotopic_efficacy(nodes)) / dark - luminous
        ratio = dark / seen
        scotopic = Measured(ratio, ratio * float(np.linalg.norm(by_shape)))
        doubt: ResultWarning | None = None
        if _probability(np.log(colour / expected), errors, float((noise / colour).max())) < DOUBTED:
            doubt = Contradiction(
                "glow-colour-differs",
                "the glow has another colour than the emission of {emission}: name another one "
                "under 'emission:', or none, which estimates it",
                emission=known.source,
            )
    else:
        hats = hat_functions(KNOTS_NM, nodes)
        system = bench.system(hats)
        fit = fit_spectrum(colour, noise, system, decisive=np.inf)
        # Half of the draws have no other shape than smooth, half are a band or two.
        draws = np.vstack([fit.samples, _bands(colour, noise, system, len(fit.samples))])
        photopic, dark_adapted = (
            draws @ ((step * efficacy) @ hats)
            for efficacy in (photopic_efficacy(nodes), scotopic_efficacy(nodes))
        )
        nm, spectrum, doubt = KNOTS_NM, draws.mean(axis=0), None
        shape = hats @ spectrum
        share, _ = _shares(bench.errors(shape), np.zeros(len(bench.changes)), noise / colour)
        weights = share * float(photopic.mean()) / colour
        sigma = float(photopic.std(ddof=1) / photopic.mean())
        source = "estimated from three channels"
        if sigma > OPEN:
            doubt = Undetermined(
                "luminance-by-channels",
                "three channels leave {sigma:.0%} of this glow's luminance open: measure its "
                "emission with emission_spectrum, and name that run under 'emission:'",
                sigma=sigma,
            )
        ratios = dark_adapted / photopic
        scotopic = Measured(float(ratios.mean()), float(ratios.std(ddof=1)))
    card_sigma, card_source = card_error(reflectance)
    return ColourScale(
        weights=np.asarray(weights),
        relative_sigma=float(sigma),
        wavelength_nm=np.asarray(nm),
        spectrum=np.asarray(spectrum),
        source=source,
        scotopic_ratio=scotopic,
        card_sigma=card_sigma,
        card_source=card_source,
        expected_card=bench.card,
        card_errors=bench.card_errors,
        has_ratios=camera.has_ratios,
        doubt=doubt,
    )


def card_error(reflectance: Transmittance) -> tuple[float, str]:
    """Return the relative σ of a card's reflectance and its origin."""
    if reflectance.sigma is None:
        return CARD_ERROR, f"assumed: {100 * CARD_ERROR:g} %"
    return float(np.mean(reflectance.sigma / reflectance.value)), "its curve"


@dataclass(frozen=True, eq=False)
class _Bench:
    """Curves and the lit card at the nodes of integrals.

    Attributes
    ----------
    weighted
        Curves times the steps of integrals, shape (q, channels).
    card
        Signals of the card, shape (channels,).
    changes
        Changes of `weighted` in each mode of error, shape (modes, q, channels); 0 for the lamp's.
    card_errors
        Relative changes of the card's signals in each mode, shape (modes, channels).
    """

    weighted: FloatArray
    card: FloatArray
    changes: FloatArray
    card_errors: FloatArray

    @staticmethod
    def of(
        nodes: FloatArray, step: FloatArray, camera: CameraResponse, card: Spectrum, lamp: Spectrum
    ) -> "_Bench":
        sensitivity = camera.at(nodes)
        weighted = step[:, np.newaxis] * sensitivity
        light = card.at(nodes)
        lit = light @ weighted
        curves = [step[:, np.newaxis] * mode for mode in camera_modes(camera, nodes, CURVES)]
        lamp_errors = _smooth_errors(nodes, card, _lamp_error(lamp))
        efficacy = step * photopic_efficacy(nodes)
        # The reading fixes the luminance of the light, so that only its distribution errs.
        common = (lamp_errors @ efficacy) / (light @ efficacy)
        by_lamp = lamp_errors @ weighted / lit - common[:, np.newaxis]
        by_curves = np.array([light @ change for change in curves]) / lit
        changes = np.concatenate([np.array(curves), np.zeros((len(by_lamp), *weighted.shape))])
        return _Bench(weighted, lit, changes, np.vstack([by_curves, by_lamp]))

    def signals(self, light: FloatArray) -> FloatArray:
        """Return the signals of spectra (…, q) relative to the card's, shape (…, channels)."""
        signals: FloatArray = light @ self.weighted / self.card
        return signals

    def errors(self, light: FloatArray) -> FloatArray:
        """Return the relative errors of a spectrum's signals in each mode, (modes, channels)."""
        relative: FloatArray = np.einsum("q,mqc->mc", light, self.changes) / (light @ self.weighted)
        return relative - self.card_errors

    def system(self, hats: FloatArray) -> SpectralSystem:
        """Return the system from a spectrum on knots to the ratios."""
        design = (self.weighted.T @ hats) / self.card[:, np.newaxis]
        modes = np.einsum("mqc,qn->mcn", self.changes, hats) / self.card[:, np.newaxis]
        modes -= self.card_errors[:, :, np.newaxis] * design
        return SpectralSystem(KNOTS_NM, design, modes)


def _bands(colour: FloatArray, noise: FloatArray, system: SpectralSystem, count: int) -> FloatArray:
    """Return draws of spectra of one band or two that explain the colour, shape (count, knots).

    The prior is that of emissions of phosphors; each candidate counts by its likelihood, and has
    its scale by the channels.
    """
    rng = np.random.default_rng(0)
    middle = rng.uniform(*BAND_NM, (2, CANDIDATES, 1))
    width = MEDIAN_FWHM_NM * np.exp(SPREAD_FWHM * rng.standard_normal((2, CANDIDATES, 1)))
    bands = np.exp(-4 * np.log(2) * ((system.knots_nm - middle) / width) ** 2) / width
    second = rng.uniform(0, 0.5, CANDIDATES) * (rng.uniform(size=CANDIDATES) < 0.5)
    candidates = bands[0] + second[:, np.newaxis] * (bands[1] - bands[0])
    signals = candidates @ system.design.T
    errors = np.einsum("mcn,kn->kmc", system.modes, candidates) / signals[:, np.newaxis]
    covariance = np.swapaxes(errors, 1, 2) @ errors + np.diag((noise / colour) ** 2)
    inverse = np.linalg.inv(covariance)
    logs = np.log(colour / signals)
    precision = inverse.sum(axis=(1, 2))
    level = np.einsum("kc,kcd->k", logs, inverse) / precision
    left = logs - level[:, np.newaxis]
    chi2 = np.einsum("kc,kcd,kd->k", left, inverse, left)
    evidence = -(chi2 + np.linalg.slogdet(covariance)[1] + np.log(precision)) / 2
    probability = np.exp(evidence - evidence.max())
    chosen = rng.choice(CANDIDATES, count, p=probability / probability.sum())
    scale = np.exp(level + rng.standard_normal(CANDIDATES) / np.sqrt(precision))
    drawn: FloatArray = candidates[chosen] * scale[chosen, np.newaxis]
    return drawn


def _lamp_error(lamp: Spectrum) -> float:
    return LAMP_ERROR if lamp.sigma is None else _error(lamp)


def _smooth_errors(nodes: FloatArray, spectrum: Spectrum, relative: float) -> FloatArray:
    """Return changes of a spectrum at the nodes by smooth relative errors, shape (modes, q)."""
    error = CurveError(relative, 0.0, SMOOTH_NM)
    modes = curve_modes(error, nodes, spectrum.at(nodes)[:, np.newaxis], np.ones(1))
    return np.array([mode[:, 0] for mode in modes])


def _shares(
    errors: FloatArray, errors_v: FloatArray, noise: FloatArray
) -> tuple[FloatArray, float]:
    """Return the parts of the channels in the luminance, of sum 1, and its relative σ.

    Parameters
    ----------
    errors, errors_v
        Relative errors of the channels' signals (modes, channels), and of the luminance of the same
        spectrum, (modes,), in each mode.
    noise
        Relative σ of the channels' signals, shape (channels,).
    """
    n = len(noise)
    system = np.zeros((n + 1, n + 1))
    system[:n, :n] = errors.T @ errors + np.diag(noise**2)
    system[:n, n] = system[n, :n] = 1.0
    target = np.append(errors.T @ errors_v, 1.0)
    share = np.linalg.solve(system, target)[:n]
    left = errors @ share - errors_v
    return share, float(np.sqrt(left @ left + np.square(noise * share).sum()))


def _probability(logs: FloatArray, errors: FloatArray, noise: float) -> float:
    """Return the probability of logarithms (channels,) that differ so by their errors."""
    weight = np.linalg.inv(errors.T @ errors + noise**2 * np.eye(len(logs)))
    ones = np.ones(len(logs))
    left = logs - (ones @ weight @ logs) / (ones @ weight @ ones)
    return float(chdtrc(len(logs) - 1, left @ weight @ left))
