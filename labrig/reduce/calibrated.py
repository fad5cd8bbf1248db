"""A series as it is once the camera is known: true shutter times, no fall-off, one scale."""

from dataclasses import replace

import numpy as np

from labrig.errors import DataError
from labrig.optics import CameraModel
from labrig.region import Region
from labrig.results import Series


def calibrated(
    series: Series, camera: CameraModel, region: Region, width: int, height: int
) -> Series:
    """`series` of a region of frames of `width` × `height` pixels, in DN/s of its first row's
    settings in the middle of the lens.

    How well the factors are known is not in `sigma`: such errors are common to all frames of a
    setting, and cancel where there is but one.

    Raises
    ------
    DataError
        The calibration is of another sensor or aperture.
    """
    if series.channels != camera.channels:
        raise DataError(
            f"calibration of another camera: expected frames with the channels "
            f"{', '.join(camera.channels)}, got {', '.join(series.channels)}"
        )
    settings = [
        (float(iso), None if np.isnan(f_number) else float(f_number))
        for iso, f_number in zip(series.iso, series.f_number, strict=True)
    ]
    first, _ = camera.scale(*settings[0])
    gain = {
        one: camera.flat(one[1], region, width, height) * camera.scale(*one)[0] / first
        for one in set(settings)
    }
    true_s = np.array([camera.exposure_s(told_s)[0] for told_s in series.exposure_s])
    per_row = (true_s / series.exposure_s)[:, None] * np.array([gain[one] for one in settings])
    # As the offset acts on a fit, most where weights are highest.
    weights = 1 / np.square(series.sigma)
    return replace(
        series,
        exposure_s=true_s,
        values=series.values / per_row,
        sigma=series.sigma / per_row,
        dark_sigma=series.dark_sigma / np.average(per_row, axis=0, weights=weights),
    )
