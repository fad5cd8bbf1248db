"""The estimate of a re-radiation matrix, by either method."""

from collections.abc import Sequence

from numpy.typing import ArrayLike

from labrig.fit.fluorescence.joint import JointEstimator
from labrig.fit.fluorescence.per_led import fit_per_led
from labrig.fit.fluorescence.result import FluorescenceFit, Method
from labrig.fit.fluorescence.system import FluorescenceSystem
from labrig.foundation.errors import UsageError
from labrig.optics import Spectrum


def fit_fluorescence(
    name: str,
    value: ArrayLike,
    variance: ArrayLike,
    system: FluorescenceSystem,
    method: Method = "joint",
    library: Sequence[Spectrum] = (),
    seed: int = 0,
) -> FluorescenceFit:
    """Estimate the re-radiation matrix of a surface from its values under several lights.

    For many surfaces under the same lights, `JointEstimator` does the common work once.

    Parameters
    ----------
    name
        Name of the surface.
    value, variance
        Values of each channel under each light, without dark level and afterglow, and their
        variances, shape (m, k).
    system
        Lights and camera.
    method
        "joint" fits all lights at once and knows its uncertainty, "per-led" fits two Gaussians
        under each, as the thesis does.
    library
        Measured emissions that the surface may have; of the joint method.
    seed
        Seed of the draws of the joint method.

    Returns
    -------
    FluorescenceFit
        The matrix.

    Raises
    ------
    UsageError
        Shapes disagree, a value is not finite, a variance is not above 0, or there is no such
        method.

    Examples
    --------
    >>> import numpy as np
    >>> import labrig
    >>> from labrig.fit.fluorescence import Exposure, fit_fluorescence, fluorescence_system
    >>> from labrig.optics import read_light
    >>> lights = [Exposure(read_light(f"{nm}nm")) for nm in (420, 450, 480, 520, 560, 600, 640)]
    >>> system = fluorescence_system(lights, labrig.read_camera("canon_eos_5d_mark_ii"))
    >>> value = system.values(np.full(41, 0.3), np.zeros((41, 49)))
    >>> fit = fit_fluorescence("grey", value, (0.001 * value) ** 2 + 1e-12, system)
    >>> fit.numbers[0].fluorophores, fit.numbers[0].probability > 0.9
    (0, True)
    >>> [round(float(rho), 2) for rho in fit.matrix.reflectance[5:26:10]]
    [0.3, 0.3, 0.3]
    """
    if method == "joint":
        return JointEstimator(system, library).fit(name, value, variance, seed)
    if method == "per-led":
        return fit_per_led(name, value, variance, system)
    raise UsageError(f"expected the method joint or per-led, got '{method}'")
