"""Which shipped curves belong to a camera, by what it calls itself."""

import pytest

from labrig.foundation.errors import UsageError
from labrig.optics import read_camera, shipped_camera, shipped_cameras


@pytest.mark.parametrize(
    ("camera", "name"),
    [
        ("Canon EOS 5D Mark II", "canon_eos_5d_mark_ii"),
        ("Canon Inc. Canon EOS 5D", "canon_eos_5d"),
        ("EOS 5DS", "canon_eos_5ds"),
        ("canon_eos_5d_mark_iv", "canon_eos_5d_mark_iv"),
        ("Canon EOS-1Ds Mark III", "canon_eos_1ds_mark_iii"),
        ("Canon EOS Kiss X5", "canon_eos_600d"),
        ("Canon EOS 400D DIGITAL", "canon_digital_rebel_xti"),
        ("Canon EOS R6 Mark II", "canon_eos_r6m2"),
        ("NIKON CORPORATION NIKON D70", "nikon_d70"),
        ("NIKON D700", "nikon_d700"),
        ("NIKON Z f", "nikon_z_f"),
        ("SONY ILCE-7RM3", "sony_ilce_7rm3"),
        ("FUJIFILM X-T4", "fujifilm_x_t4"),
        ("Hasselblad L2D-20c", "hasselblad_l2d_20c"),
    ],
)
def test_a_camera_is_found_by_its_own_name(camera: str, name: str) -> None:
    found = shipped_camera(camera)
    assert found is not None
    assert found.name == name
    assert read_camera(camera).name == f"{found.maker} {found.model}"


@pytest.mark.parametrize(
    "camera", ["", "Canon", "Canon EOS 5D Mark VI", "EOS", "NIKON D7", "camera", "D70 D700", "5D"]
)
def test_another_model_is_none_of_them(camera: str) -> None:
    assert shipped_camera(camera) is None
    with pytest.raises(UsageError, match=r"no (shipped|such) camera"):
        read_camera(camera or "none")


def test_names_and_models_are_one_to_one() -> None:
    cameras = shipped_cameras()
    assert len(cameras) == 52
    for camera in cameras:
        assert shipped_camera(f"{camera.maker} {camera.model}") is camera
        assert shipped_camera(camera.name) is camera


def test_channels_that_were_scaled_one_by_one_are_known_as_such() -> None:
    scaled = [one.name for one in shipped_cameras() if not read_camera(one.path).has_ratios]
    assert scaled == ["arri_d21", "nikon_d5100"]
