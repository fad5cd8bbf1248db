"""The material file: the result of measuring a phosphor, and the definition of a simulated sample.

A state i has the rates of Nalbach et al., eq. 1 and 3, with a kinetic order b that is 1 there:
dr/dt = (1 − r) Σ_j k_e,j E_j − k_r rᵇ, and radiance L_j = Σ_i Λ_i,j k_r,i r_iᵇ in the dark.
"""

import os
from itertools import pairwise
from math import prod
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import (
    Field,
    SerializerFunctionWrapHandler,
    model_serializer,
    model_validator,
)

from labrig.foundation import resources
from labrig.foundation.models import FrozenModel, NotNegative
from labrig.foundation.notebook_views import NotebookViews
from labrig.foundation.yaml_file import model_text, read_model, write_yaml

Rate = Annotated[float, Field(gt=0, allow_inf_nan=False)]
#: Largest kinetic order; above 2 it is empirical.
MAX_ORDER = 4.0
Order = Annotated[float, Field(ge=1, le=MAX_ORDER)]
Concentration = Annotated[float, Field(ge=0, le=1)]
Series = tuple[NotNegative, ...]
#: A surface that does not fluoresce may look brighter than a white by its gloss, but not by much.
Reflectance = Annotated[float, Field(ge=0, le=1.2)]

#: Name of the scale factor that depends on the camera's curves: what is seen through the same
#: curves again does not depend on it.
SEEN_FACTOR = "card's reflected light, as the channel sees it, over a glow of peak 1"
#: Fields of a state that may have an uncertainty.
MEASURED = (
    "k_r_per_s",
    "kinetic_order",
    "amplitude",
    "r0",
    "decay_time_s",
    "k_e_per_s",
    "reradiation",
)
#: Fields of a state that may have a range by the thickness of the sample, which is written where
#: it is known.
RANGED = ("k_e_per_s", "reradiation")
#: Fields that are written where the kinetic order is not 1.
OF_ORDER = ("kinetic_order", "kinetic_order_sigma", "decay_time_s", "decay_time_s_sigma")
ORDER_LIMIT = "kinetic_order_limit_95"
#: Fields of a material that are written where they are known.
WHERE_KNOWN = (
    "scale",
    "scale_factors",
    "albedo",
    "radiance_factor",
    "thickness_mm",
    "mass_per_area_g_per_m2",
)
#: What only the level of charge tells of a state of an order other than 1.
OF_LEVEL = ("k_r_per_s", "r0", "k_e_per_s", "reradiation")
#: Relative σ of r(0) from which a state of an order other than 1 was not seen to saturate.
LEVEL_KNOWN = 0.3
#: Relative difference of `decay_time_s` to that of rate and concentration, by rounding.
SAME_TIME = 1e-3


class IrradianceNorm(FrozenModel):
    """Normalisation of the irradiance E to which the excitation rates belong.

    Attributes
    ----------
    kind
        Norm of the irradiance: `vector_length`, the Euclidean length of the vector E of the lamp's
        irradiance, one number for each band.
    value
        Length to which E was scaled; Table 1 of Nalbach et al. uses 1.
    """

    kind: Literal["vector_length"]
    value: Rate


class State(FrozenModel):
    """One excited state: what was not measured is null; every σ is one standard deviation.

    A 0 with a σ is at its bound, since neither rate nor light is negative: with 95 % probability
    the quantity is below 1.645 σ. An `r0` of 1 likewise is above 1 − 1.645 σ.

    Attributes
    ----------
    k_r_per_s
        Re-radiation rate k_r of the state, in 1/s; of a kinetic order that of a full state.
    kinetic_order
        Kinetic order b of the state, which re-radiates k_r times its concentration to this power. 1
        is the rate equation of Nalbach et al., and not written; the light of a higher order decays
        as (1 + t/τ)^(−b/(b − 1)) with τ = 1/((b − 1) k_r r(0)^(b − 1)), so that its amplitude needs
        `r0`.
    amplitude
        Amplitude a = Λ k_r r(0) of the state in the decay, in the camera's or the fit's own unit;
        Λ k_r r(0)ᵇ with a kinetic order.
    amplitude_unit
        Unit of `amplitude` and its σ, for example `DN/s`; null if it is not known.
    r0
        Concentration r(0) of the state at lamp off to which `amplitude` belongs, 0 to 1.
    decay_time_s
        Time τ of the decay of a kinetic order after that lamp off, in s, which is known better than
        `k_r_per_s` and `r0` where the charge does not tell them apart. Default: that of their
        values.
    k_e_per_s
        Excitation rate k_e of the state in every band, in 1/s per unit of the normalised
        irradiance; as many numbers as there are bands.
    reradiation
        Re-radiation Λ of the state in every band, as relative radiance; as many numbers as there
        are bands.
    k_e_per_s_range
        Least and largest k_e of every band, in the same unit, that the thickness of the sample may
        hide: light falls with depth, and k_e is fitted as that of a surface. It is a range, no σ.
        Default: not looked at.
    reradiation_range
        Least and largest Λ of every band likewise. Default: not looked at.
    k_r_per_s_sigma
        Standard deviation of `k_r_per_s`, in 1/s.
    kinetic_order_sigma
        Standard deviation of `kinetic_order`.
    kinetic_order_limit_95
        Limit of the order with 95 % probability, where its fit ended at the least or largest
        possible order, `kinetic_order`: the order is between the two. Default: the order is inside
        its bounds, or it was not fitted.
    amplitude_sigma
        Standard deviation of `amplitude`, in its unit.
    r0_sigma
        Standard deviation of `r0`.
    decay_time_s_sigma
        Standard deviation of `decay_time_s`, in s.
    k_e_per_s_sigma
        Standard deviation of each number of `k_e_per_s`, in the same unit.
    reradiation_sigma
        Standard deviation of each number of `reradiation`, in the same unit.
    """

    k_r_per_s: Rate
    kinetic_order: Order = 1.0
    amplitude: NotNegative | None = None
    amplitude_unit: str | None = None
    r0: Concentration | None = None
    decay_time_s: Rate | None = None
    k_e_per_s: Series | None = None
    reradiation: Series | None = None
    k_e_per_s_range: tuple[Series, Series] | None = None
    reradiation_range: tuple[Series, Series] | None = None
    k_r_per_s_sigma: NotNegative | None = None
    kinetic_order_sigma: NotNegative | None = None
    kinetic_order_limit_95: Order | None = None
    amplitude_sigma: NotNegative | None = None
    r0_sigma: NotNegative | None = None
    decay_time_s_sigma: NotNegative | None = None
    k_e_per_s_sigma: Series | None = None
    reradiation_sigma: Series | None = None

    @model_validator(mode="after")
    def _sigma_has_its_value(self) -> Self:
        for name in MEASURED:
            value, sigma = getattr(self, name), getattr(self, f"{name}_sigma")
            if sigma is None:
                continue
            if value is None:
                raise ValueError(f"expected '{name}' beside '{name}_sigma', got nothing")
            if isinstance(value, tuple) and len(sigma) != len(value):
                raise ValueError(
                    f"expected {len(value)} values in '{name}_sigma' as in '{name}', "
                    f"got {len(sigma)}"
                )
        return self

    @model_validator(mode="after")
    def _range_has_its_value(self) -> Self:
        for name in RANGED:
            value, ends = getattr(self, name), getattr(self, f"{name}_range")
            if ends is None:
                continue
            bands = 0 if value is None else len(value)
            if any(len(end) != bands for end in ends):
                raise ValueError(
                    f"expected {bands} least and {bands} largest values in '{name}_range', as in "
                    f"'{name}', got {len(ends[0])} and {len(ends[1])}"
                )
        return self

    @model_validator(mode="after")
    def _amplitude_of_an_order_has_its_charge(self) -> Self:
        if self.kinetic_order != 1 and self.amplitude is not None and not self.r0:
            raise ValueError(
                "expected 'r0' above 0 beside 'amplitude' of a state with 'kinetic_order', since "
                f"its decay depends on the charge, got {'nothing' if self.r0 is None else self.r0}"
            )
        return self

    @model_validator(mode="after")
    def _decay_time_is_that_of_the_rate(self) -> Self:
        if self.decay_time_s is None:
            return self
        time_s = self.decay_time_of_rate_s
        if time_s is None or abs(self.decay_time_s / time_s - 1) > SAME_TIME:
            raise ValueError(
                "expected 'decay_time_s' with a 'kinetic_order' above 1 and 'r0', equal to "
                f"1/((b − 1) k_r r(0)^(b − 1)), got {self.decay_time_s:g} instead of "
                f"{'nothing' if time_s is None else format(time_s, 'g')}"
            )
        return self

    @property
    def decay_time_of_rate_s(self) -> float | None:
        """Time τ = 1/((b − 1) k_r r(0)^(b − 1)) in s; None of the first order or without r(0)."""
        beyond = self.kinetic_order - 1
        return 1 / (beyond * self.k_r_per_s * self.r0**beyond) if beyond and self.r0 else None

    @property
    def is_level_known(self) -> bool:
        """Whether k_r, k_e, r(0) and Λ are known apart, as always of the first order.

        Of another order a charge far from saturation tells only what their common scale leaves
        alone: amplitude, τ and the order.
        """
        if self.kinetic_order == 1 or self.r0 is None or self.r0_sigma is None:
            return True
        return self.r0_sigma < LEVEL_KNOWN * self.r0

    def known(self, name: str) -> Any:
        """Return a value by its name; None where the charge does not tell it."""
        if name in OF_LEVEL and not self.is_level_known:
            return None
        return getattr(self, name)

    @model_serializer(mode="wrap")
    def _without_what_does_not_apply(
        self, handler: SerializerFunctionWrapHandler
    ) -> dict[str, Any]:
        content: dict[str, Any] = handler(self)
        if self.amplitude_unit is None:
            content.pop("amplitude_unit", None)
        if self.kinetic_order_limit_95 is None:
            content.pop(ORDER_LIMIT, None)
        if self.kinetic_order == 1:
            held = () if self.kinetic_order_limit_95 is None else OF_ORDER[:2]
            for name in OF_ORDER:
                if name not in held:
                    content.pop(name, None)
        for name in RANGED:
            if getattr(self, f"{name}_range") is None:
                content.pop(f"{name}_range", None)
        return content


class Spectrum(FrozenModel):
    """Emission on a finer grid than the bands, largest value 1 (Λ* of section 4.3).

    Attributes
    ----------
    wavelength_nm
        Wavelengths of the emission spectrum in nm, rising.
    value
        Relative spectral radiance at each wavelength, the largest 1.
    sigma
        Standard deviation of each number of `value`. Default: not measured.
    """

    wavelength_nm: tuple[Rate, ...]
    value: Series
    sigma: Series | None = None

    @model_validator(mode="after")
    def _same_lengths(self) -> Self:
        _one_each(self.wavelength_nm, self.value, self.sigma)
        return self


class Albedo(FrozenModel):
    """Reflectance R of eq. 2 of Nalbach et al.: light that comes back at its own wavelength.

    Attributes
    ----------
    wavelength_nm
        Wavelengths in nm, rising; between them the albedo is linear, beyond them constant.
    value
        Fraction of the light at each wavelength that a diffuse white of reflectance 1 would return
        and this surface does, in the geometry of the measurement.
    sigma
        Standard deviation of each number of `value`, with what they have in common. Default: not
        measured.
    common_sigma
        Relative standard deviation that all numbers have in common, by the grey card and the lamp.
        Default: not measured.
    """

    wavelength_nm: tuple[Rate, ...]
    value: Annotated[tuple[Reflectance, ...], Field(min_length=2)]
    sigma: Series | None = None
    common_sigma: NotNegative | None = None

    @model_validator(mode="after")
    def _same_lengths(self) -> Self:
        _one_each(self.wavelength_nm, self.value, self.sigma)
        return self


class RadianceFactor(FrozenModel):
    """All light that comes back under a lamp: reflection, prompt fluorescence and steady glow.

    Attributes
    ----------
    lamp
        Name of the lamp, to whose spectrum the numbers belong.
    wavelength_nm
        Wavelengths in nm, rising.
    value
        Spectral radiance at each wavelength over that of a diffuse white of reflectance 1 beside
        it; more than 1 is possible where the sample fluoresces.
    sigma
        Standard deviation of each number of `value`. Default: not measured.
    """

    lamp: Annotated[str, Field(min_length=1)]
    wavelength_nm: tuple[Rate, ...]
    value: Annotated[Series, Field(min_length=2)]
    sigma: Series | None = None

    @model_validator(mode="after")
    def _same_lengths(self) -> Self:
        _one_each(self.wavelength_nm, self.value, self.sigma)
        return self


class ScaleFactor(FrozenModel):
    """One factor of the chain from the camera's counts to `reradiation` and `amplitude`.

    Attributes
    ----------
    name
        What the factor is, for example `card's radiance over irradiance`.
    value
        The factor.
    sigma
        Standard deviation of `value`. Default: not known.
    unit
        Unit of the factor, `1` for none.
    """

    name: Annotated[str, Field(min_length=1)]
    value: Rate
    sigma: NotNegative | None = None
    unit: str = "1"


class Provenance(FrozenModel):
    """Origin of the numbers.

    Attributes
    ----------
    source
        Origin of the numbers: a publication, or the measurement.
    run
        Name of the run folder in which the numbers were measured.
    frames
        Names of the frames from which the numbers were derived.
    version
        Version of labrig that derived the numbers.
    note
        Remark on the numbers, as free text.
    temperature_c
        Mean temperature while the glow was measured, in degrees Celsius: rates belong to it.
    """

    source: str
    run: str | None = None
    frames: tuple[str, ...] | None = None
    version: str | None = None
    note: str | None = None
    temperature_c: Annotated[float, Field(ge=-273.15, le=1000)] | None = None


class Material(FrozenModel, NotebookViews):
    """A phosphorescent material.

    Attributes
    ----------
    name
        Name of the material, for example `blue-paint`.
    kind
        Kind of the material: `phosphor`, the only one so far.
    bands_nm
        Edges of the wavelength bands in nm, rising; one more than there are bands. They are needed
        for excitation rates and re-radiation.
    irradiance_norm
        Norm of the irradiance to which the excitation rates belong. A state with excitation rates
        needs it; without it they are per W m⁻² in their band, where `scale` is `absolute`.
    states
        Excited states of the material, at least one.
    spectrum
        Emission spectrum on a finer grid than the bands. Default: not measured.
    scale
        What `amplitude` and `reradiation` are measured in: `relative`, by the lamp's mean spectral
        irradiance over the bands, in sr⁻¹ and s sr⁻¹; or `absolute`, in W m⁻² sr⁻¹ nm⁻¹ and
        W s m⁻² sr⁻¹ nm⁻¹. Default: in a unit of their own.
    scale_factors
        Factors by which counts became numbers on that scale, in order. Default: not recorded.
    albedo
        Reflectance over wavelength. Default: not measured.
    radiance_factor
        All light that comes back under a lamp. Default: not measured.
    thickness_mm
        Thickness of the layer, in mm. Default: not known.
    mass_per_area_g_per_m2
        Mass of the layer per area, in g/m². Default: not known.
    provenance
        Origin of the numbers. Default: not recorded.
    """

    name: Annotated[str, Field(min_length=1)]
    kind: Literal["phosphor"]
    bands_nm: tuple[Rate, ...] | None = None
    irradiance_norm: IrradianceNorm | None = None
    states: Annotated[tuple[State, ...], Field(min_length=1)]
    spectrum: Spectrum | None = None
    scale: Literal["relative", "absolute"] | None = None
    scale_factors: tuple[ScaleFactor, ...] = ()
    albedo: Albedo | None = None
    radiance_factor: RadianceFactor | None = None
    thickness_mm: Rate | None = None
    mass_per_area_g_per_m2: Rate | None = None
    provenance: Provenance | None = None

    @model_serializer(mode="wrap")
    def _without_what_is_unknown(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        content: dict[str, Any] = handler(self)
        for name in WHERE_KNOWN:
            if not getattr(self, name):
                content.pop(name, None)
        return content

    @property
    def scale_per_count(self) -> float:
        """Product of all scale factors: radiance per count; 1 without a scale."""
        return prod(factor.value for factor in self.scale_factors)

    @model_validator(mode="after")
    def _scale_has_its_factors(self) -> Self:
        if self.scale_factors and self.scale is None:
            raise ValueError("expected 'scale' beside 'scale_factors', got nothing")
        return self

    @property
    def is_first_order(self) -> bool:
        """Whether all states decay as exponentials."""
        return all(state.kinetic_order == 1 for state in self.states)

    @model_validator(mode="after")
    def _fits_its_bands(self) -> Self:
        if self.bands_nm is not None:
            _rising(self.bands_nm, "bands_nm")
        bands = 0 if self.bands_nm is None else len(self.bands_nm) - 1
        for number, state in enumerate(self.states):
            for name in ("k_e_per_s", "reradiation"):
                series = getattr(state, name)
                if series is not None and len(series) != bands:
                    raise ValueError(
                        f"states.{number}.{name}: expected {bands} values, one for each band of "
                        f"'bands_nm', got {len(series)}"
                    )
            is_relative = self.irradiance_norm is None and self.scale != "absolute"
            if state.k_e_per_s is not None and is_relative:
                raise ValueError(
                    f"expected 'irradiance_norm' beside states.{number}.k_e_per_s, got nothing"
                )
        return self


def read_material(name_or_path: str | os.PathLike[str]) -> Material:
    """Read a material from a file, or a shipped one by its name.

    Parameters
    ----------
    name_or_path
        Path of a material file, or the name of a shipped material such as `blue-paint`.

    Returns
    -------
    Material
        The validated material.

    Raises
    ------
    UsageError
        There is no such material, or its file is malformed.

    Examples
    --------
    >>> import labrig
    >>> material = labrig.read_material("material.yaml")
    >>> [round(state.k_r_per_s, 3) for state in material.states]
    [0.205, 0.01]
    >>> labrig.read_material("blue-paint").bands_nm
    (400.0, 437.5, 475.0, 512.5, 550.0, 587.5, 625.0, 662.5, 700.0)
    """
    return read_model(resources.find("config/materials", "material", name_or_path), Material)


def write_material(path: Path, material: Material) -> None:
    """Write a material to a file that `read_material` reads.

    Parameters
    ----------
    path
        Path of the file, which is overwritten.
    material
        The material.

    Examples
    --------
    >>> from pathlib import Path
    >>> import labrig
    >>> material = labrig.read_material("blue-paint")
    >>> labrig.write_material(Path("mine.yaml"), material.model_copy(update={"name": "mine"}))
    >>> labrig.read_material("mine.yaml").name
    'mine'
    """
    write_yaml(path, material)


def material_text(material: Material) -> str:
    """Return the text of the file that `write_material` writes.

    Parameters
    ----------
    material
        The material.

    Returns
    -------
    str
        YAML.

    Examples
    --------
    >>> from labrig.material import material_text, read_material
    >>> material_text(read_material("blue-paint")).splitlines()[0]
    'name: blue-paint'
    """
    return model_text(material)


def _one_each(
    wavelength_nm: tuple[float, ...],
    value: tuple[float, ...],
    sigma: tuple[float, ...] | None,
) -> None:
    """Refuse columns of different lengths, or wavelengths that do not rise."""
    _rising(wavelength_nm, "wavelength_nm")
    for name, series in (("value", value), ("sigma", sigma)):
        if series is not None and len(series) != len(wavelength_nm):
            raise ValueError(
                f"expected {len(wavelength_nm)} numbers in '{name}' as in "
                f"'wavelength_nm', got {len(series)}"
            )


def _rising(values: tuple[float, ...], name: str) -> None:
    if len(values) < 2 or any(right <= left for left, right in pairwise(values)):
        raise ValueError(f"expected two or more rising wavelengths in '{name}', got {list(values)}")
