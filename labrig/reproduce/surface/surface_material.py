"""What a surface does with light in the bands of a rendering: returns it at once, or later."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from labrig.foundation.arrays import Float32Array, FloatArray
from labrig.foundation.errors import UsageError
from labrig.foundation.result_warning import Contradiction, ResultWarning, Unmeasured
from labrig.material import (
    Albedo,
    Material,
    ReradiationMatrix,
    StoredMixture,
    physical_warnings,
    self_excitation,
)
from labrig.optics import Spectrum, Transmittance, edges_from_centres
from labrig.reproduce.surface.bands import Bands
from labrig.reproduce.surface.field import FieldParameters
from labrig.reproduce.surface.parameter_texture import ParameterTexture

#: Negative re-radiation, as a part of the light of a band, that is told, and that is refused.
TOLD_NEGATIVE, REFUSED_NEGATIVE = 0.005, 0.05
#: Relative difference up to which Λ of all states has the shape of the finer spectrum.
SAME_SHAPE = 0.05


@dataclass(frozen=True, eq=False)
class BenchLight:
    """Light that charged materials when they were measured: their rates are relative to it.

    Attributes
    ----------
    spectrum
        Spectral irradiance at the sample in W m⁻² nm⁻¹.
    """

    spectrum: Spectrum

    def vector_length(self, edges_nm: Sequence[float]) -> float:
        """Return the length of E, the vector of its irradiance in W m⁻² in each band of some."""
        edges = np.asarray(edges_nm, dtype=np.float64)
        return float(np.linalg.norm(self.spectrum.in_bands(edges) * np.diff(edges)))

    def mean(self, edges_nm: Sequence[float]) -> float:
        """Return its mean over all bands together, in W m⁻² nm⁻¹."""
        return float(self.spectrum.in_bands([edges_nm[0], edges_nm[-1]])[0])


@dataclass(frozen=True, eq=False)
class SurfaceMaterial:
    """A Lambertian surface: L = M E/π + glow, in bands.

    Attributes
    ----------
    name
        Name of the material.
    matrix
        Matrix M of what comes back at once: the albedo on its diagonal, re-radiation off it; shape
        (bands out, bands in).
    parameters
        Parameters of the glow in the scene's units, of each texel of `texture` where they differ;
        None of a material that does not glow.
    notes
        Warnings about values that were assumed or are missing.
    texture
        Parameters that differ from place to place; None where all are the same.
    """

    name: str
    matrix: Float32Array
    parameters: FieldParameters | None = None
    notes: tuple[ResultWarning, ...] = ()
    texture: ParameterTexture | None = None

    @property
    def is_diagonal(self) -> bool:
        """Whether light keeps its wavelength."""
        return bool(np.count_nonzero(self.matrix - np.diag(np.diagonal(self.matrix))) == 0)


def of_albedo(
    name: str,
    albedo: Albedo | Transmittance | float,
    bands: Bands,
    notes: tuple[ResultWarning, ...] = (),
) -> SurfaceMaterial:
    """Return a surface that reflects and does nothing else.

    Parameters
    ----------
    name
        Name of the material.
    albedo
        Fraction of the light that comes back, 0 to below 1; between its wavelengths linear, beyond
        them constant.
    bands
        Bands of the rendering.
    notes
        Warnings about values that were assumed.

    Returns
    -------
    SurfaceMaterial
        The surface in these bands.

    Raises
    ------
    UsageError
        Some albedo is 1 or more: light would never be lost.

    Examples
    --------
    >>> from labrig.reproduce import Bands, of_albedo
    >>> of_albedo("grey", 0.5, Bands.even(400, 700, 3)).matrix.diagonal().tolist()
    [0.5, 0.5, 0.5]
    """
    diagonal = _albedo_in_bands(albedo, bands)
    return SurfaceMaterial(name, _checked(name, np.diag(diagonal)), None, notes)


def of_matrix(matrix: ReradiationMatrix, bands: Bands) -> SurfaceMaterial:
    """Return a fluorescent surface.

    The matrix is brought into the bands so that light which is constant in each of them comes back
    as it does by the matrix; the reflectance is continued as a constant beyond its wavelengths.

    Parameters
    ----------
    matrix
        Measured reflectance and re-radiation.
    bands
        Bands of the rendering.

    Returns
    -------
    SurfaceMaterial
        The surface in these bands.

    Raises
    ------
    UsageError
        Its unit is relative, no band overlaps, or its largest eigenvalue reaches 1.
    DataError
        It returns more light than any surface does, see `physical_warnings`.

    Examples
    --------
    >>> from labrig.material import read_any_material
    >>> from labrig.reproduce import Bands, of_matrix
    >>> textile = of_matrix(read_any_material("yellow-textile"), Bands.even())
    >>> textile.is_diagonal, textile.matrix.shape
    (False, (24, 24))
    """
    if matrix.unit == "relative":
        raise UsageError(
            f"{matrix.name}: expected a re-radiation in 1/nm, got a relative one; measure the "
            "brightness of the lights that excite it"
        )
    return _fluorescent(matrix, _albedo_in_bands(_reflectance_of(matrix), bands), bands)


def of_mixture(
    name: str,
    stored: StoredMixture,
    reflectance: Albedo | Transmittance | ReradiationMatrix | float,
    bands: Bands,
) -> SurfaceMaterial:
    """Return a fluorescent surface whose re-radiation is a mixture.

    The mixture is evaluated at the centres of the bands on which it was fitted, and this matrix is
    brought into the bands of the rendering as every other by `of_matrix`.

    Parameters
    ----------
    name
        Name of the material.
    stored
        The mixture with its bands.
    reflectance
        Radiance factor without re-radiation, which a mixture does not have: of a surface, or that
        of a measured matrix.
    bands
        Bands of the rendering.

    Returns
    -------
    SurfaceMaterial
        The surface in these bands.

    Raises
    ------
    UsageError
        No band overlaps, the matrix has no reflectance, or the largest eigenvalue reaches 1.
    DataError
        It returns more light than any surface does, see `physical_warnings`.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.fit import fit_mixture
    >>> from labrig.material import read_mixture, read_reradiation
    >>> from labrig.reproduce import Bands, of_matrix, of_mixture
    >>> paper = read_reradiation("paper.csv")
    >>> _ = Path("fit.json").write_text(fit_mixture(paper, 3, threshold=1e-3).to_json())
    >>> dyed = of_mixture("paper", read_mixture("fit.json"), paper, Bands.even())
    >>> bool(abs(dyed.matrix - of_matrix(paper, Bands.even()).matrix).max() < 0.02)
    True
    """
    surface = (
        _reflectance_of(reflectance) if isinstance(reflectance, ReradiationMatrix) else reflectance
    )
    output_nm = stored.output_nm(bands.edges_nm[0], bands.edges_nm[-1])
    on_output = _albedo_in_bands(surface, Bands(edges_from_centres(output_nm)))
    matrix = stored.to_matrix(output_nm, on_output, name)
    return _fluorescent(matrix, _albedo_in_bands(surface, bands), bands)


def _reflectance_of(matrix: ReradiationMatrix) -> Spectrum:
    """Return the measured reflectance of a matrix."""
    known = ~np.isnan(matrix.reflectance)
    if not known.any():
        raise UsageError(f"{matrix.name}: expected a reflectance, got none in its file")
    return Spectrum(matrix.name, matrix.output_nm[known], matrix.reflectance[known])


def _fluorescent(
    matrix: ReradiationMatrix, reflectance: FloatArray, bands: Bands
) -> SurfaceMaterial:
    """Return a surface of a reflectance in the bands, and of a matrix's re-radiation."""
    notes = physical_warnings(matrix)
    for edges_nm in (matrix.output_edges_nm, matrix.input_edges_nm):
        _require_overlap(matrix.name, edges_nm, bands)
    into = bands.overlap_nm(matrix.output_edges_nm) / bands.width_nm
    absorbed = bands.overlap_nm(matrix.input_edges_nm)
    reradiated = into.T @ np.nan_to_num(matrix.reradiation) @ absorbed
    notes += _negative_notes(reradiated, bands)
    return SurfaceMaterial(
        matrix.name, _checked(matrix.name, np.diag(reflectance) + reradiated), None, notes
    )


def _negative_notes(reradiated: FloatArray, bands: Bands) -> tuple[ResultWarning, ...]:
    """Return a warning about re-radiation that takes light away instead of giving it back."""
    out, into = np.unravel_index(int(np.argmin(reradiated)), reradiated.shape)
    lowest = float(reradiated[out, into])
    if lowest >= -TOLD_NEGATIVE:
        return ()
    return (
        Contradiction(
            "reradiation-negative",
            "noise of its matrix takes up to {fraction:.1%} of light away instead of re-radiating "
            "it (at {output_nm:g} nm, of light at {input_nm:g} nm); a mixture (labrig fit mixture) "
            "does not",
            fraction=-lowest,
            output_nm=bands.centre_nm[out],
            input_nm=bands.centre_nm[into],
        ),
    )


def of_phosphor(
    material: Material,
    bands: Bands,
    bench: BenchLight,
    albedo: float | None = None,
    reradiation_scale: float | None = None,
    prompt: float = 0.0,
    texture: ParameterTexture | None = None,
) -> SurfaceMaterial:
    """Return a phosphorescent surface, with rates in the units of the scene.

    Excitation rates belong to a light E of stated length in the material's own bands: here to the
    bench's light, or are per W m⁻² where no length is stated; outside of the measured bands they
    are zero. Λ is spread in its bands as the
    finer emission spectrum where all states have its shape, else evenly.

    Parameters
    ----------
    material
        Measured phosphor.
    bands
        Bands of the rendering.
    bench
        Light by which it was measured.
    albedo
        Albedo to assume where the material has none.
    reradiation_scale
        Factor from Λ to s sr⁻¹ relative to the bench's mean spectral irradiance, to assume where
        the material has no scale.
    prompt
        Part η of captures that emit at once.
    texture
        Parameters of each texel in the bands and units of the material, instead of its own.

    Returns
    -------
    SurfaceMaterial
        The surface in these bands.

    Raises
    ------
    UsageError
        Λ, albedo or scale is missing, no band overlaps, an albedo reaches 1, or the texture has
        another number of states or bands.

    Examples
    --------
    >>> from labrig.material import read_material
    >>> from labrig.optics import absolute_irradiance, read_light
    >>> from labrig.reproduce import Bands, BenchLight, of_phosphor
    >>> bench = BenchLight(absolute_irradiance(1000.0, read_light("A")))
    >>> paint = of_phosphor(read_material("blue-paint"), Bands.even(), bench, 0.7, 1.0)
    >>> print(paint.notes[0])
    its albedo is assumed to be 0.7 at all wavelengths
    """
    rates = FieldParameters.of(material, prompt)
    if texture is not None:
        rates = _textured(material.name, rates, texture)
    assert material.bands_nm is not None
    edges = material.bands_nm
    _require_overlap(material.name, edges, bands)
    overlap = bands.overlap_nm(edges)
    notes: list[ResultWarning] = []
    if (surface := material.albedo or albedo) is None:
        raise UsageError(
            f"{material.name}: its file has no albedo, so the light that it reflects is not known; "
            "measure it (labrig run reflectance) or assume one (--assume-albedo 0.8)"
        )
    if material.albedo is None:
        notes.append(
            Unmeasured(
                "albedo-assumed",
                "its albedo is assumed to be {albedo:g} at all wavelengths",
                albedo=albedo,
            )
        )
    factor = 1.0 if material.scale == "absolute" else bench.mean(edges)
    if material.scale is None:
        if reradiation_scale is None:
            raise UsageError(
                f"{material.name}: its file has no scale, so the brightness of its glow beside "
                "reflected light is not known; measure it (labrig run phosphor with the grey card) "
                "or assume one (--assume-scale 1)"
            )
        factor *= reradiation_scale
        notes.append(
            Unmeasured(
                "scale-assumed",
                "the scale of its glow is assumed to be {scale_s_per_sr:g} s/sr for a Λ of 1",
                scale_s_per_sr=reradiation_scale,
            )
        )
    if not rates.k_e_per_s.any():
        notes.append(
            Unmeasured(
                "no-excitation-rates", "it has no excitation rates, so light does not charge it"
            )
        )
    k_e = rates.k_e_per_s.astype(np.float64)
    if material.irradiance_norm is not None:
        k_e *= material.irradiance_norm.value / bench.vector_length(edges)
    reflected = _checked(material.name, np.diag(_albedo_in_bands(surface, bands)))
    parameters = FieldParameters.checked(
        rates.k_r_per_s,
        in_bands(k_e, overlap),
        factor * _spread(material, rates.reradiation.astype(np.float64), bands),
        rates.order,
        prompt,
    )
    albedo_factor = None if texture is None else texture.texels("albedo_factor")
    _require_fading(material.name, reflected.diagonal(), albedo_factor, parameters)
    return SurfaceMaterial(material.name, reflected, parameters, tuple(notes), texture)


def _textured(name: str, rates: FieldParameters, texture: ParameterTexture) -> FieldParameters:
    """Return rates in which what a texture has takes the place of the material's."""
    arrays = []
    for what in ("k_r_per_s", "k_e_per_s", "reradiation"):
        own, texels = getattr(rates, what), texture.texels(what)
        if texels is not None and texels.shape[:-1] != own.shape:
            raise UsageError(
                f"{name}: expected a texture of {what} with {' × '.join(map(str, own.shape))} "
                "numbers for each texel, states and bands, as the material has, got "
                f"{' × '.join(map(str, texels.shape[:-1]))}"
            )
        arrays.append(own if texels is None else texels)
    k_r, k_e, emitted = arrays
    if texture.k_r_per_s is not None and (rates.order > 1).any():
        raise UsageError(
            f"{name}: expected a texture without k_r_per_s for states of an order above 1, whose "
            "steps are tabulated, got one with; give each rate a material of its own (material_map)"
        )
    return FieldParameters.checked(k_r, k_e, emitted, rates.order, rates.prompt)


def in_bands(values: FloatArray, weights: FloatArray) -> FloatArray:
    """Return sums over the bands of values (states, bands[, samples]) with weights (bands, n)."""
    return np.asarray(np.moveaxis(np.tensordot(values, weights, axes=(1, 0)), -1, 1))


def _require_overlap(name: str, edges_nm: ArrayLike, bands: Bands) -> None:
    """Refuse a material that was measured in no band of the rendering."""
    if not bands.overlap_nm(edges_nm).any():
        first, *_, last = np.asarray(edges_nm)
        raise UsageError(
            f"{name}: expected bands that overlap those of the rendering, "
            f"{bands.edges_nm[0]:g} to {bands.edges_nm[-1]:g} nm, got {first:g} to {last:g} nm"
        )


def _require_fading(
    name: str, albedo: Float32Array, factor: Float32Array | None, rates: FieldParameters
) -> None:
    """Refuse a phosphor that in a closed room of its own would glow ever more."""
    factors = np.ones(1) if factor is None else factor.astype(np.float64)
    if not float(factors.max()) * float(albedo.max()) < 1:
        raise UsageError(
            f"{name}: expected an albedo below 1 everywhere, got {albedo.max():.3g} with a factor "
            f"of {factors.max():.3g} in the texture"
        )
    gain = self_excitation(rates.k_e_per_s, rates.reradiation, factors * albedo[:, np.newaxis])
    if not gain < 1:
        raise UsageError(
            f"{name}: expected a glow of less light than it takes, got {gain:.3g} "
            "times as much; the scale of Λ or the bench's light (bench_light) is wrong"
        )


def _spread(material: Material, reradiation: FloatArray, bands: Bands) -> FloatArray:
    """Return Λ (states, bands[, samples]) in the bands of the rendering."""
    if reradiation.ndim == 2:
        return _spread_rows(material, reradiation, bands)
    rows = np.moveaxis(reradiation, 1, -1)
    spread = _spread_rows(material, rows.reshape(-1, rows.shape[-1]), bands)
    return np.moveaxis(spread.reshape(*rows.shape[:-1], -1), -1, 1)


def _spread_rows(material: Material, reradiation: FloatArray, bands: Bands) -> FloatArray:
    """Return spectra Λ (n, bands) in the bands of the rendering."""
    assert material.bands_nm is not None
    edges = np.array(material.bands_nm)
    flat = reradiation @ bands.overlap_nm(edges) / bands.width_nm
    if material.spectrum is None:
        return np.asarray(flat)
    fine = Spectrum(
        "glow", np.array(material.spectrum.wavelength_nm), np.array(material.spectrum.value)
    )
    coarse = fine.in_bands(edges)
    strength = reradiation @ coarse / (coarse @ coarse)
    differs = np.abs(reradiation - np.outer(strength, coarse)).max(axis=1)
    if (differs > SAME_SHAPE * reradiation.max(axis=1)).any():
        return np.asarray(flat)
    return np.outer(strength, bands.means(fine))


def _albedo_in_bands(albedo: Albedo | Transmittance | Spectrum | float, bands: Bands) -> FloatArray:
    if isinstance(albedo, float | int):
        return np.full(len(bands), float(albedo))
    return _in_bands(np.array(albedo.wavelength_nm), np.array(albedo.value), bands)


def _in_bands(wavelength_nm: FloatArray, values: FloatArray, bands: Bands) -> FloatArray:
    """Return means in bands of a curve that goes on as a constant beyond its ends."""
    ends = np.array([bands.edges_nm[0] - 1, bands.edges_nm[-1] + 1])
    low, high = min(ends[0], wavelength_nm[0] - 1), max(ends[1], wavelength_nm[-1] + 1)
    curve = Spectrum("", np.r_[low, wavelength_nm, high], np.r_[values[0], values, values[-1]])
    return bands.means(curve)


def _checked(name: str, matrix: FloatArray) -> Float32Array:
    """Return a matrix of which light is lost at every bounce."""
    if not np.isfinite(matrix).all() or matrix.min() < -REFUSED_NEGATIVE:
        raise UsageError(f"{name}: expected an albedo and re-radiation that are finite and ≥ 0")
    largest = float(np.abs(np.linalg.eigvals(matrix)).max())
    if largest >= 1:
        raise UsageError(
            f"{name}: expected a surface that loses light, got {largest:.3f} as the largest "
            "eigenvalue of its matrix (its albedo, if it is not fluorescent); below 1 is needed"
        )
    return matrix.astype(np.float32)
