"""The camera file: what it gives back, what it corrects, which frames it refuses."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from labrig.calibration import CAMERA_KIND, Linearity, Noise
from labrig.foundation.errors import DataError, UsageError
from labrig.optics import Factor, Flat
from tests.calibration.cameras import BODY, camera
from tests.quick_yaml import write_quickly

positive = st.floats(1e-6, 1e6)
sigma = st.floats(0, 1)
factors = st.lists(
    st.builds(Factor, setting=positive, factor=st.floats(0.5, 2), sigma=sigma), max_size=4
).map(tuple)
flats = st.builds(
    Flat,
    f_number=st.none() | st.floats(1, 32),
    falloff=st.lists(st.tuples(st.floats(-0.4, 0.4), st.floats(-0.4, 0.4)), min_size=1, max_size=3),
    gradient=st.just(((0.1, -0.2),)),
    sigma=sigma,
)


@settings(max_examples=20)
@given(factors, factors, st.lists(flats, min_size=1, max_size=3).map(tuple), positive)
def test_a_written_camera_reads_back_as_itself(
    tmp_path_factory: pytest.TempPathFactory,
    shutter: tuple[Factor, ...],
    iso_gain: tuple[Factor, ...],
    fields: tuple[Flat, ...],
    gain: float,
) -> None:
    file = camera(
        shutter=shutter,
        iso_gain=iso_gain,
        flats=fields,
        noise=(
            Noise(iso=100, gain_e_per_dn=gain, gain_e_per_dn_sigma=0.1, read_noise_e=3.0,
                  read_noise_e_sigma=0.1),
        ),
        linearity=Linearity(level_dn=(1.0, 2.0), deviation=(0.0, -0.01), sigma=(0.001, 0.002)),
    )  # fmt: skip
    folder = tmp_path_factory.mktemp("camera")
    CAMERA_KIND.write(folder, file)
    assert CAMERA_KIND.read(folder / "camera.yaml") == file


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"flats": []}, "flats"),
        ({"shuter": []}, "did you mean 'shutter'?"),
        ({"flats": [{"f_number": 4, "falloff": [[-1.2]]}]}, "leaves some light"),
        ({"linearity": {"level_dn": [1], "deviation": [], "sigma": [1]}}, "for every 'level_dn'"),
    ],
)
def test_a_malformed_file_is_one_clear_line(
    tmp_path: Path, changes: dict[str, object], said: str
) -> None:
    path = tmp_path / "camera.yaml"
    path.write_text(write_quickly(camera().model_dump(mode="json") | changes))
    with pytest.raises(UsageError) as caught:
        CAMERA_KIND.read(path)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("identity", "lens", "f_number", "said"),
    [
        ("Canon EOS 6D, serial 7, firmware 1", None, 4.0, "another camera"),
        ("Canon EOS 5D Mark II, serial 8, firmware 2.1.2", None, 4.0, "another camera"),
        (BODY, "85 mm", 4.0, "calibration of another lens: expected 50 mm"),
        (BODY, "50 mm", 5.6, "another lens or aperture: expected f/4, the frames were taken at"),
        (BODY, None, None, "at an unknown aperture"),
    ],
)
def test_frames_of_another_camera_lens_or_aperture_are_refused(
    identity: str, lens: str | None, f_number: float | None, said: str
) -> None:
    with pytest.raises(DataError) as caught:
        camera(lens="50 mm").require_match(identity, lens, f_number)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("lens", [None, "50 mm"])
def test_its_own_frames_are_accepted_with_newer_firmware_too(lens: str | None) -> None:
    identity = "Canon EOS 5D Mark II, serial 7, firmware 2.1.3"
    camera(lens="50 mm").require_match(identity, lens, 4.0)


def test_shutter_times_are_put_right_between_and_beyond_those_measured() -> None:
    file = camera(
        shutter=(
            Factor(setting=0.001, factor=1.2, sigma=0.01),
            Factor(setting=0.01, factor=1.1, sigma=0.004),
            Factor(setting=0.1, factor=1.0, sigma=0.002),
        )
    )
    assert file.exposure_s(0.01) == pytest.approx((0.011, 0.004))
    assert file.exposure_s(math.sqrt(0.01 * 0.001))[0] == pytest.approx(
        1.15 * math.sqrt(0.01 * 0.001)
    )
    assert file.exposure_s(1e-4)[0] == pytest.approx(1.2e-4)
    # An error of milliseconds, the longer the less.
    assert file.exposure_s(10.0) == pytest.approx((10.0, 0.002 * 0.1 / 10.0))


def test_settings_are_brought_to_one_scale_with_their_sigma() -> None:
    file = camera(
        iso_gain=(Factor(setting=400, factor=0.97, sigma=0.003),),
        aperture=(Factor(setting=8, factor=1.05, sigma=0.004),),
    )
    assert file.scale(100, 4.0) == (1.0, 0.0)
    scale, uncertain = file.scale(400, 8.0)
    assert scale == pytest.approx(4 * 0.97 * 1.05 / 4)
    assert uncertain == pytest.approx(math.hypot(0.003, 0.004))
    assert file.scale(400, None)[0] == pytest.approx(4 * 0.97)


@given(st.integers(0, 40), st.integers(0, 20), st.integers(2, 50), st.integers(2, 40))
def test_the_flat_of_a_region_is_the_mean_of_its_pixels(x: int, y: int, w: int, h: int) -> None:
    flat = Flat(f_number=4.0, falloff=((-0.3, 0.05),))
    columns, rows = np.meshgrid(np.arange(x, x + w) + 0.5, np.arange(y, y + h) + 0.5)
    rho2 = ((columns - 48) ** 2 + (rows - 32) ** 2) / (48**2 + 32**2)
    mean = flat.mean((float(x), float(y), float(w), float(h)), 96, 64)
    assert mean[0] == pytest.approx(flat.at(rho2).mean(), abs=3e-4)
