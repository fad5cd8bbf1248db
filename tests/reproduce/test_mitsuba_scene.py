"""Files for Mitsuba; that it renders them rightly is shown by `tests.acceptance.mitsuba_export`."""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import OpenEXR
import pytest
from numpy.typing import NDArray

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DiskError, UsageError
from labrig.reproduce import ExportedMesh, Glow, Pinhole, write_mitsuba_scene

CORNERS = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 1.0, 0.0], [0.0, 1.0, 0.5]])
FACES = np.array([[0, 1, 2], [0, 2, 3]])
UV = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 0.8]])
GREY = np.array([0.5, 0.4, 0.3])
DECAY = np.array([[1.0, 2.0, 3.0], [0.5, 0.25, 0.125]])
CAMERA = Pinhole((1.0, 2.0, 3.0), (0.0, 0.5, -1.0), (0.0, 0.0, 1.0), 35.0, 64, 48)


def ply(path: Path) -> tuple[FloatArray, NDArray[np.uint32]]:
    """Vertices (n, x y z u v) and triangles of a binary PLY file of Mitsuba's kind."""
    head, body = path.read_bytes().split(b"end_header\n", 1)
    lines = head.decode().splitlines()
    assert lines[:2] == ["ply", "format binary_little_endian 1.0"]
    (vertices,) = [int(line.split()[2]) for line in lines if line.startswith("element vertex")]
    (faces,) = [int(line.split()[2]) for line in lines if line.startswith("element face")]
    names = [line.split()[2] for line in lines if line.startswith("property float")]
    assert "".join(names) in ("xyz", "xyzuv")
    size = 4 * vertices * len(names)
    rows = np.frombuffer(body[:size], "<f4").reshape(vertices, len(names))
    kind = np.dtype([("count", "u1"), ("indices", "<u4", (3,))])
    triangles = np.frombuffer(body[size:], kind)
    assert len(triangles) == faces
    assert (triangles["count"] == 3).all()
    return rows.astype(float), np.asarray(triangles["indices"])


def numbers(text: str) -> list[float]:
    return [float(number) for number in text.split(",")]


def test_a_scene_has_its_meshes_colours_and_glow_of_the_frame(tmp_path: Path) -> None:
    texels = np.random.default_rng(1).uniform(0, 7, (5, 8, 3))
    meshes = [
        ExportedMesh("plain -- <&ö", CORNERS, FACES, GREY),
        ExportedMesh("constant", CORNERS, FACES, GREY, None, Glow(DECAY)),
        ExportedMesh("texture", CORNERS, FACES, GREY, UV, Glow(DECAY, texels)),
    ]
    path = write_mitsuba_scene(tmp_path / "out", meshes, CAMERA, frame=1, samples=7)
    scene = ElementTree.parse(path).getroot()
    shapes = scene.findall("shape")
    for shape, mesh in zip(shapes, meshes, strict=True):
        vertices, faces = ply(path.parent / value(shape, "string", "filename"))
        np.testing.assert_allclose(vertices[:, :3], mesh.vertices_m, rtol=1e-7)
        np.testing.assert_array_equal(faces, FACES)
        reflectance = shape.find("bsdf[@type='twosided']/bsdf[@type='diffuse']/rgb")
        assert reflectance is not None
        assert numbers(reflectance.attrib["value"]) == GREY.tolist()
    np.testing.assert_allclose(vertices[:, 3:], np.stack([UV[:, 0], 1 - UV[:, 1]], 1), atol=1e-7)
    assert shapes[0].find("emitter") is None
    radiance = shapes[1].find("emitter[@type='area']/rgb[@name='radiance']")
    assert radiance is not None
    assert numbers(radiance.attrib["value"]) == DECAY[1].tolist()
    texture = shapes[2].find("emitter[@type='area']/texture[@type='bitmap']")
    assert texture is not None
    assert value(texture, "boolean", "raw") == "true"
    with OpenEXR.File(str(path.parent / value(texture, "string", "filename"))) as file:
        written = file.channels()["RGB"].pixels
    np.testing.assert_array_equal(written, (DECAY[1] * texels).astype(np.float32))


def value(parent: ElementTree.Element, tag: str, name: str) -> str:
    found = parent.find(f"{tag}[@name='{name}']")
    assert found is not None
    return found.attrib["value"]


def test_a_scene_has_its_camera(tmp_path: Path) -> None:
    mesh = ExportedMesh("plain", CORNERS, FACES, GREY)
    scene = ElementTree.parse(write_mitsuba_scene(tmp_path, [mesh], CAMERA)).getroot()
    sensor = scene.find("sensor[@type='perspective']")
    assert sensor is not None
    assert (value(sensor, "string", "fov_axis"), float(value(sensor, "float", "fov"))) == ("y", 35)
    lookat = sensor.find("transform/lookat")
    assert lookat is not None
    for key, expected in (
        ("origin", CAMERA.position_m),
        ("target", CAMERA.look_at_m),
        ("up", CAMERA.up),
    ):
        assert tuple(numbers(lookat.attrib[key])) == expected
    film = sensor.find("film")
    assert film is not None
    assert (value(film, "integer", "width"), value(film, "integer", "height")) == ("64", "48")


def test_what_cannot_be_exported_is_refused(tmp_path: Path) -> None:
    mesh = ExportedMesh("glow", CORNERS, FACES, GREY, None, Glow(DECAY))
    for frame, samples in ((2, 4), (-1, 4), (0, 0)):
        with pytest.raises(UsageError, match=r"^expected [^\n]+$"):
            write_mitsuba_scene(tmp_path, [mesh], CAMERA, frame, samples)
    with pytest.raises(UsageError, match="one mesh"):
        write_mitsuba_scene(tmp_path, [], CAMERA)
    (tmp_path / "file").write_text("no folder")
    with pytest.raises(DiskError):
        write_mitsuba_scene(tmp_path / "file", [mesh], CAMERA)
