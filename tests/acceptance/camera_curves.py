"""Curves of cameras that a family lacks, by a ColorChecker, and by a filter, too.

    python -m tests.acceptance.camera_curves

Every shipped camera by all of the others, then the cameras of two other laboratories (those of the
same model left out). One's own chart differs from its file by 2 % of level and 1.5 % of course, the
lamp by 1 %; or the chart is another published one, which the fit does not expect. Errors are the
root mean square of the difference from 400 to 700 nm over all channels, relative to each channel's
true peak, after one common factor. Pulls are errors over σ.
"""

from collections.abc import Sequence

import colour
import numpy as np

from labrig.fit.camera_curves import GRID_NM, fit_camera_curves
from labrig.optics import read_camera, shipped_cameras
from tests.fit import unknown_cameras as made
from tests.fit.lvf_pictures import CAMERAS


def of_other_laboratories(with_filter: bool) -> list[made.Estimate]:
    """Estimates of measured cameras by the shipped ones of other models."""
    family = {camera: read_camera(camera.path) for camera in shipped_cameras()}
    estimates = []
    for number, path in enumerate(sorted((CAMERAS / "ssf_data").glob("*.csv"))):
        camera, rng = read_camera(path), np.random.default_rng(number)
        others = [curves for one, curves in family.items() if not one.is_called(camera.name)]
        light = made.own_lamp(rng)
        readings = made.photographed(camera, rng, made.own_chart(rng), light)
        through = made.through_filter(camera, rng, light) if with_filter else None
        fit = fit_camera_curves(readings, made.lamp(), others, through)
        estimates.append(made.compared(path.stem, fit, camera))
    return estimates


def line(title: str, estimates: Sequence[made.Estimate]) -> str:
    """One row of the table."""
    rms = np.array([each.rms for each in estimates])
    pulls = np.array([each.pulls for each in estimates])
    misfit = np.median([each.fit.misfit for each in estimates])
    family = np.median([each.family_rms for each in estimates])
    return (
        f"{title:44s}{np.median(rms):8.2%}{np.quantile(rms, 0.9):8.2%}{rms.max():8.2%}"
        f"  {estimates[int(rms.argmax())].name:36s}{family:8.2%}"
        f"{np.sqrt(np.mean(np.square(pulls))):7.2f}{misfit:7.2f}"
    )


def main() -> None:
    """Print the table."""
    names = [camera.name for camera in shipped_cameras()]
    table = colour.SDS_COLOURCHECKERS["ColorChecker N Ohta"].values()
    other = np.array([np.interp(GRID_NM, patch.wavelengths, patch.values) for patch in table])
    print(f"{'cameras':44s}  median    90 %   worst  {'which':36s}  family  pulls misfit")
    for with_filter, text in ((False, "chart"), (True, "chart and filter")):
        shipped = made.left_out(names, with_filter=with_filter)
        print(line(f"52 shipped, {text}", shipped), flush=True)
        chart = made.left_out(names, with_filter=with_filter, patches=other)
        print(line(f"52 shipped, {text}; another chart", chart), flush=True)
        print(line(f"32 of others, {text}", of_other_laboratories(with_filter)), flush=True)


if __name__ == "__main__":
    main()
