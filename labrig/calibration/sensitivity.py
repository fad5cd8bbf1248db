"""Signal of a light at one setting of a camera over that at another, calibrated or nominal."""

import math

from labrig.calibration.camera_file import CameraFile

#: Relative σ of a nominal ISO and of a nominal f-number whose ratio was not calibrated.
ISO_SIGMA, APERTURE_SIGMA = 0.02, 0.05

#: ISO and f-number; None for a lens that does not report it.
Settings = tuple[float, float | None]


def relative_sensitivity(
    camera: CameraFile | None, settings: Settings, reference: Settings
) -> tuple[float, float]:
    """Return the signal of a light at some settings over that at others, and its relative σ.

    Parameters
    ----------
    camera
        Calibration of the camera; None takes the nominal ratio.
    settings, reference
        ISO and f-number of the two.

    Returns
    -------
    tuple of float
        The ratio, and its relative σ: 0 where both settings are the same.

    Examples
    --------
    >>> from labrig.calibration import relative_sensitivity
    >>> relative_sensitivity(None, (400.0, 4.0), (100.0, 4.0))
    (4.0, 0.02)
    """
    if camera is not None:
        at_settings, sigma = camera.scale(*settings)
        at_reference, reference_sigma = camera.scale(*reference)
        differ = at_settings != at_reference
        return at_settings / at_reference, math.hypot(sigma, reference_sigma) if differ else 0.0
    (iso, f_number), (reference_iso, reference_f_number) = settings, reference
    value, sigma = iso / reference_iso, 0.0 if iso == reference_iso else ISO_SIGMA
    if f_number is not None and reference_f_number is not None and f_number != reference_f_number:
        value *= (reference_f_number / f_number) ** 2
        sigma = math.hypot(sigma, APERTURE_SIGMA)
    return value, sigma
