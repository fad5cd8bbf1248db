"""Curves of cameras that the family lacks, from charts and lamps that are not their files."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from labrig.fit.camera_curves import GRID_NM, ChartReadings, fit_camera_curves
from labrig.foundation.errors import FitError
from labrig.optics import (
    CIE_1931,
    CameraResponse,
    delta_e,
    illuminant,
    lab,
    observer,
    read_camera,
    shipped_cameras,
)
from labrig.reduce import find_colour_chart, measure, read_raw
from tests.fit import unknown_cameras as made
from tests.pulls import assert_sigma_is_right

#: Of three makers, and none of them like the camera of the simulated room.
THREE = ("nikon_d850", "sony_ilce_7m3", "fujifilm_x_t3")


@cache
def estimates(with_filter: bool = False) -> dict[str, made.Estimate]:
    """Every third shipped camera and the three, each by all of the others."""
    names = [camera.name for camera in shipped_cameras()]
    some = [*names[::3], *(name for name in THREE if name not in names[::3])]
    return {each.name: each for each in made.left_out(some, with_filter=with_filter)}


def test_curves_of_three_makers_are_within_five_per_cent() -> None:
    for name in THREE:
        estimate = estimates()[name]
        assert estimate.rms < 0.05
        assert estimate.fit.misfit < 1.5
    every = list(estimates().values())
    assert np.median([each.rms for each in every]) < 0.03
    assert np.median([each.rms / each.family_rms for each in every]) < 0.6


def test_their_sigma_is_that_of_their_errors() -> None:
    assert_sigma_is_right([each.pulls for each in estimates().values()])


def test_a_filter_tells_curves_to_two_per_cent() -> None:
    names = [THREE[0], "canon_powershot_s90"]
    refined = made.left_out(names, with_filter=True)
    assert max(each.rms for each in refined) < 0.03
    for each in refined[:1]:
        assert each.rms < estimates()[each.name].rms


@pytest.mark.campaign
@pytest.mark.parametrize("with_filter", [False, True])
def test_every_shipped_camera_by_all_of_the_others(with_filter: bool) -> None:
    every = made.left_out([camera.name for camera in shipped_cameras()], with_filter=with_filter)
    rms = np.array([each.rms for each in every])
    assert np.median(rms) < (0.012 if with_filter else 0.028)
    assert rms.max() < (0.03 if with_filter else 0.09)
    assert_sigma_is_right([each.pulls for each in every])


def test_a_chart_that_is_not_its_file_is_said_and_widens_sigma() -> None:
    rng = np.random.default_rng(3)
    exact = made.left_out(["nikon_d850"], patches=made.chart())[0]
    faded = made.chart() * (1 + 0.12 * made.smooth(rng, 24, 80.0))
    other = made.left_out(["nikon_d850"], patches=faded)[0]
    assert other.fit.misfit > 2
    assert exact.fit.misfit < 1
    wide, narrow = other.fit.camera.sigma, exact.fit.camera.sigma
    assert wide is not None
    assert narrow is not None
    assert wide.mean() > 1.15 * narrow.mean()
    assert np.sqrt(np.mean(np.square(other.pulls))) < 1.3


def test_a_camera_like_no_other_is_told() -> None:
    (usual,) = [estimates()[name] for name in THREE[:1]]
    (odd,) = made.left_out(["arri_d21"])
    assert odd.fit.unusualness > 1.5 * usual.fit.unusualness
    assert odd.rms < odd.family_rms


@pytest.mark.campaign
def test_colours_by_the_estimated_curves_are_those_of_the_chart() -> None:
    """What curves are for: values that they predict of other surfaces, here as ΔE2000."""
    eye = observer(CIE_1931)
    light = made.lamp()
    seen = np.array([np.interp(GRID_NM, eye.wavelength_nm, f) for f in eye.functions.T]).T
    seen = light.at(GRID_NM)[:, np.newaxis] * seen
    patches = made.chart()
    for name in THREE:
        fitted = estimates()[name].fit.camera
        family = {camera.name: camera.path for camera in shipped_cameras()}
        truth = read_camera(family[name])
        ours, true = (
            patches @ (light.at(GRID_NM)[:, np.newaxis] * each.at(GRID_NM))
            for each in (fitted, truth)
        )
        matrix = np.linalg.lstsq(ours, patches @ seen, rcond=None)[0]
        factor = float((ours[18:22] * true[18:22]).sum() / (true[18:22] ** 2).sum())
        white = seen.sum(axis=0)
        labs = [lab(value @ matrix / white[1], white / white[1]) for value in (ours, factor * true)]
        assert delta_e(*labs).mean() < 2


def test_missing_patches_and_a_chart_without_greys_are_one_clear_line() -> None:
    patches, cameras = made.chart(), [read_camera(one.path) for one in shipped_cameras()]
    value = patches[:, :3] + 1.0
    value[5, 1] = np.nan
    readings = ChartReadings(value, 0.01 * value, patches, made.PLACE, 0.05)
    with pytest.raises(FitError, match="expected a value of every patch"):
        fit_camera_curves(readings, made.lamp(), cameras)
    colourful = np.tile(np.linspace(0, 1, len(GRID_NM)), (24, 1))
    without = ChartReadings(value, 0.01 * value, colourful, made.PLACE, 0.05)
    with pytest.raises(FitError, match="with grey patches"):
        fit_camera_curves(without, made.lamp(), cameras)


def test_cameras_of_another_laboratory_are_found_within_what_laboratories_differ(
    shared_data: Path,
) -> None:
    jiang = shared_data / "camera_sensitivity/ssf_data"
    family = {camera: read_camera(camera.path) for camera in shipped_cameras()}
    rms, pulls = [], []
    for number, path in enumerate(sorted(jiang.glob("jiang2013_*.csv"))[::5]):
        camera = read_camera(path)
        others = [curves for one, curves in family.items() if not one.is_called(camera.name)]
        rng = np.random.default_rng(number)
        readings = made.photographed(camera, rng, made.own_chart(rng), made.own_lamp(rng))
        each = made.compared(path.stem, fit_camera_curves(readings, made.lamp(), others), camera)
        rms.append(each.rms)
        pulls.append(each.pulls)
    # Three laboratories differ by 2 to 6 % about one camera.
    assert np.median(rms) < 0.05
    assert np.sqrt(np.mean(np.square(pulls))) < 1.7


def test_a_real_photograph_of_a_chart_tells_the_sensor_and_what_lamp_it_was(
    real_data: Path,
) -> None:
    """A Canon EOS 550D, whose sensor is that of the 600D; nothing is known of the light."""
    photograph = real_data / "canon_550d/canon_550d_kissx4_colorchecker.dng"
    raw = read_raw(photograph)
    seen = [measure(raw, region).channels for region in find_colour_chart(photograph)]
    value = np.array([[patch[name].mean for name in "RGB"] for patch in seen])
    noise = np.array([[patch[name].sigma for name in "RGB"] for patch in seen])
    readings = ChartReadings(
        value, np.hypot(noise, 0.003 * value), made.chart(), made.PLACE, unevenness=0.1
    )
    sister = "canon_eos_600d"
    others = [read_camera(one.path) for one in shipped_cameras() if one.name != sister]
    fits = {name: fit_camera_curves(readings, illuminant(name), others) for name in ("A", "D50")}
    unusual = {name: fit.unusualness for name, fit in fits.items()}
    assert unusual["A"] < 1.3 < 2 < unusual["D50"], "it was a filament"
    found = fits["A"]
    assert 1 < found.misfit < 3, "another edition of the chart, in a room that is not dark"
    truth = read_camera(sister)
    for name, ours, true in zip(
        "RGB", found.camera.sensitivity.T, truth.sensitivity.T, strict=True
    ):
        one = CameraResponse(name, GRID_NM, ours[:, np.newaxis], (name,))
        other = CameraResponse(name, truth.wavelength_nm, true[:, np.newaxis], (name,))
        # The ratios between the channels depend on the lamp, which is not known.
        assert made.rms_of_curves(one, other) < 0.06
