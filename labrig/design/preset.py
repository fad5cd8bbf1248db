"""Measured materials as a beginning of a design."""

import numpy as np
from numpy.typing import ArrayLike

from labrig.design.bands import DesignBands
from labrig.design.by_hand import Parameters
from labrig.design.conversion import Conversion
from labrig.design.efficiency import emitted_over_absorbed
from labrig.design.light import LightProgramme
from labrig.foundation.errors import UsageError
from labrig.material import Material

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
