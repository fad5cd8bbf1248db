"""A material whose parameters somebody sets by hand, from a measured one, judged by its wishes."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from labrig.design.bands import Conversion, DesignBands
from labrig.design.energy import emitted_over_absorbed
from labrig.design.keys import Keys
from labrig.design.light import LightProgramme
from labrig.design.possible import impossible_keys
from labrig.design.result import Design
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.material import MAX_ORDER, Material

#: Largest rate or Λ.
LARGEST = 1e9


@dataclass(frozen=True, eq=False)
class Parameters:
    """Parameters of a phosphorescent material in the bands of a design.

    Attributes
    ----------
    k_r_per_s
        Re-radiation rates in 1/s, shape (states,).
    k_e_per_s
        Excitation rates in 1/s per irradiance, shape (states, bands).
    reradiation
        Λ in s/sr times the irradiance, shape (states, bands).
    albedo
        Albedo, 0 to 1, shape (bands,).
    order
        Kinetic order b of the states, 1 to 4.
    """

    k_r_per_s: FloatArray
    k_e_per_s: FloatArray
    reradiation: FloatArray
    albedo: FloatArray
    order: float = 1.0

    @classmethod
    def checked(
        cls,
        k_r_per_s: ArrayLike,
        k_e_per_s: ArrayLike,
        reradiation: ArrayLike,
        albedo: ArrayLike,
        order: float = 1.0,
    ) -> "Parameters":
        """Return parameters whose shapes and ranges were checked.

        Raises
        ------
        UsageError
            Shapes disagree, or a value is outside of its range.

        Examples
        --------
        >>> from labrig.design import Parameters
        >>> glow = Parameters.checked([0.1], [[1e-3, 2e-3, 5e-3]], [[0.0, 0.1, 0.02]], [0.6] * 3)
        >>> glow.albedo.tolist()
        [0.6, 0.6, 0.6]
        """
        try:
            k_r, k_e, emitted, reflected = (
                np.asarray(each, dtype=np.float64)
                for each in (k_r_per_s, k_e_per_s, reradiation, albedo)
            )
        except ValueError:
            raise UsageError("expected as many k_e and Λ of each state as bands") from None
        shape = (k_r.size, reflected.size)
        if k_r.ndim != 1 or reflected.ndim != 1 or not k_e.shape == emitted.shape == shape:
            raise UsageError(
                f"expected k_e and Λ of {shape[0]} states and {shape[1]} bands, got shapes "
                f"{k_e.shape} and {emitted.shape}"
            )
        for name, each in (("k_r", k_r), ("k_e", k_e), ("Λ", emitted), ("the albedo", reflected)):
            if not (np.isfinite(each).all() and each.min(initial=0.0) >= 0):
                raise UsageError(f"expected {name} that is finite and ≥ 0, got {each.tolist()}")
            if each.max(initial=0.0) > LARGEST:
                raise UsageError(f"expected {name} up to {LARGEST:g}, got {each.max():g}")
        if not k_r.size or k_r.min() == 0:
            raise UsageError("expected one or more k_r above 0, got none or 0")
        if reflected.max(initial=0.0) > 1:
            raise UsageError(f"expected an albedo up to 1, got {reflected.max():g}")
        if not 1 <= order <= MAX_ORDER:
            raise UsageError(f"expected a kinetic order from 1 to {MAX_ORDER:g}, got {order:g}")
        return cls(k_r, k_e, emitted, reflected, float(order))

    @classmethod
    def of(cls, design: Design) -> "Parameters":
        """Return the parameters of a design."""
        return cls(
            design.k_r_per_s, design.k_e_per_s, design.reradiation, design.albedo, design.order
        )


def judge(
    parameters: Parameters,
    programme: LightProgramme,
    keys: Keys,
    bands: DesignBands,
    weights: Literal["luminance", "plain"] = "luminance",
) -> Design:
    """Return a material set by hand as a design, with its differences to what is wanted.

    Parameters
    ----------
    parameters
        Parameters of the material.
    programme, keys, bands, weights
        As of `solve`; there may be no keys.

    Returns
    -------
    Design
        The material; nothing about it is estimated, so it has neither σ nor conflicts.

    Raises
    ------
    UsageError
        Numbers of bands disagree.

    Examples
    --------
    >>> from labrig.design import Keys, LightProgramme, Parameters, judge, three_bands
    >>> glow = Parameters.checked([0.1], [[1e-3, 2e-3, 5e-3]], [[0.0, 0.1, 0.02]], [0.6] * 3)
    >>> light = LightProgramme.checked([0.0, 10.0], [[1.0, 1.0, 1.0], [0.0, 0.0, 0.0]])
    >>> keys = Keys.checked(0, [11.0], [[0.0, 0.0006, 0.0001]])
    >>> judge(glow, light, keys, three_bands()).delta_e2000.round(0).tolist()
    [7.0]
    """
    if parameters.albedo.size != bands.count or programme.irradiance.shape[2] != bands.count:
        raise UsageError(
            f"expected parameters and light of {bands.count} bands, got those of "
            f"{parameters.albedo.size} and {programme.irradiance.shape[2]}"
        )
    design = Design(
        programme=programme,
        keys=keys,
        bands=bands,
        k_r_per_s=parameters.k_r_per_s,
        k_e_per_s=parameters.k_e_per_s,
        order=parameters.order,
        reradiation=parameters.reradiation,
        albedo=parameters.albedo,
        cost=0.0,
        other_costs=(),
        estimates=(),
        conflicts=(),
        impossible=(),
    )
    if not keys.count:
        return design
    return design.with_cost(_cost(design, weights)).with_impossible(impossible_keys(design))


def _cost(design: Design, weights: Literal["luminance", "plain"]) -> float:
    keys, bands = design.keys, design.bands
    got = design.radiance_at(keys.place, keys.time_s)
    missed = keys.radiance - (got @ bands.to_rgb.T if keys.is_colour(bands) else got)
    return float(((missed * keys.weights(bands, weights)[:, np.newaxis]) ** 2).sum())


#: Part of what is absorbed that a material whose file has no scale emits.
EFFICIENCY = 0.3


def preset_parameters(
    material: Material, programme: LightProgramme, bands: DesignBands, albedo: ArrayLike
) -> Parameters:
    """Return a measured material in the three channels of a design.

    The programme's strongest light is given the length to which its excitation rates belong. How
    bright it glows is not known without a scale: it then emits a third of what it absorbs.

    Parameters
    ----------
    material
        Material with excitation rates and re-radiation in bands, of one order.
    programme
        Light of the design.
    bands
        Bands of the design, three channels.
    albedo
        Albedo of the design, one or one for each band.

    Returns
    -------
    labrig.design.Parameters
        Rates, Λ and albedo, for `judge`.

    Raises
    ------
    UsageError
        The bands are not three channels, there is no light, or the material's orders differ.

    Examples
    --------
    >>> from labrig.design import LightProgramme, preset_parameters, presets, three_bands
    >>> light = LightProgramme.checked([0.0, 60.0], [[1.0, 1.0, 1.0], [0.0, 0.0, 0.0]])
    >>> blue = preset_parameters(presets()[0], light, three_bands(), albedo=0.6)
    >>> blue.k_r_per_s.round(4).tolist(), int(blue.reradiation[0].argmax())
    ([0.032], 2)
    """
    orders = {state.kinetic_order for state in material.states}
    if bands.edges_nm is not None:
        raise UsageError("expected a design in three channels for a measured material, got bands")
    if len(orders) != 1 or not programme.irradiance.any():
        raise UsageError(f"{material.name}: expected states of one order, and light to charge them")
    assert material.bands_nm is not None
    assert material.irradiance_norm is not None
    conversion = Conversion.to(bands, material.bands_nm)
    length = float(np.linalg.norm(conversion.strongest_light(programme.irradiance)))
    k_e = np.array([state.k_e_per_s for state in material.states]) @ conversion.of_light
    k_e *= material.irradiance_norm.value / length
    measured = np.array([state.reradiation for state in material.states])
    emitted = np.maximum(measured @ conversion.to_rgb.T, 0.0)
    reflected = np.broadcast_to(np.asarray(albedo, dtype=np.float64), (bands.count,))
    scale = EFFICIENCY / float(emitted_over_absorbed(k_e, emitted, reflected, bands.energy).max())
    k_r = [state.k_r_per_s for state in material.states]
    return Parameters.checked(k_r, k_e, scale * emitted, reflected, orders.pop())
