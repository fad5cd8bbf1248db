"""Scenes for Mitsuba 3, with what glows at one frame as textures of emitters.

Its variants `*_rgb` render them: re-radiation has no place there. Matrices of linear sRGB stand
beside the scene as previews of it.
"""

import json
import re
from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.foundation.exr_file import write_exr
from labrig.foundation.output_file import make_folder, write_durably, write_text
from labrig.reproduce.export.scene_export import (
    ExportedMesh,
    Glow,
    frame_count,
)
from labrig.reproduce.transport.tracing import Pinhole

SCENE, PREVIEWS = "scene.xml", "reradiation_previews.json"
#: Version of the scene's language.
_VERSION = "3.0.0"


def write_mitsuba_scene(
    folder: Path,
    meshes: Sequence[ExportedMesh],
    camera: Pinhole,
    frame: int = 0,
    samples: int = 256,
    most_vertices: int = 12,
) -> Path:
    """Write one frame of a scene for Mitsuba 3: `scene.xml`, meshes and textures beside it.

    Surfaces are Lambertian and reflect on both sides. They emit on the side that their faces show
    anticlockwise, as Mitsuba's emitters do, with the radiance of the glow. Mitsuba interpolates
    textures linearly between the centres of texels. Fluorescent surfaces have their colour under
    D65; what they do to other light is in `reradiation_previews.json` by their names, a matrix of
    linear sRGB with its ΔE2000, for renderers that can use one.

    Parameters
    ----------
    folder
        Folder of the files, made if it is not there.
    meshes
        At least one mesh; all glows have one number of frames.
    camera
        Camera of the picture.
    frame
        Index of the frame.
    samples
        Paths for each pixel.
    most_vertices
        Largest number of vertices of a path, the camera's not counted.

    Returns
    -------
    pathlib.Path
        Path of `scene.xml`.

    Raises
    ------
    UsageError
        There is no such frame or no mesh, or a number is not positive.
    DiskError
        A file cannot be written.

    Examples
    --------
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from labrig.reproduce import ExportedMesh, Glow, Pinhole, write_mitsuba_scene
    >>> corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    >>> glow = Glow(np.array([[0.1, 1.0, 0.5]]))
    >>> sheet = ExportedMesh("sheet", corners, np.array([[0, 1, 2]]), np.full(3, 0.5), glow=glow)
    >>> camera = Pinhole((0.5, 0.5, 3.0), (0.5, 0.5, 0.0), (0.0, 1.0, 0.0), 40.0, 64, 64)
    >>> path = write_mitsuba_scene(Path("sheet"), [sheet], camera)
    >>> sorted(file.name for file in path.parent.iterdir())
    ['mesh_00.ply', 'scene.xml']
    """
    frames = frame_count(list(meshes))
    if not 0 <= frame < frames:
        raise UsageError(f"expected a frame from 0 to {frames - 1}, got {frame}")
    if samples < 1 or most_vertices < 1:
        raise UsageError(
            f"expected samples and vertices of at least 1, got {samples} and {most_vertices}"
        )
    scene = ElementTree.Element("scene", version=_VERSION)
    integrator = _add(scene, "integrator", type="path")
    _add(integrator, "integer", name="max_depth", value=str(most_vertices))
    _add_camera(scene, camera, samples)
    path = folder / SCENE
    make_folder(folder)
    for number, mesh in enumerate(meshes):
        file = folder / f"mesh_{number:02d}.ply"
        _write_ply(file, mesh)
        shape = _add(scene, "shape", type="ply", id=f"mesh_{number:02d}")
        said = mesh.name if mesh.preview is None else f"{mesh.name}: {mesh.preview.statement}"
        scene.insert(len(scene) - 1, ElementTree.Comment(f" {_comment(said)} "))
        _add(shape, "string", name="filename", value=file.name)
        _add(shape, "boolean", name="face_normals", value="true")
        both_sides = _add(shape, "bsdf", type="twosided")
        _add_rgb(_add(both_sides, "bsdf", type="diffuse"), "reflectance", mesh.base_colour)
        if mesh.glow is not None:
            texture = folder / f"glow_{number:02d}.exr"
            _add_glow(shape, mesh.glow, frame, texture)
    previews = {mesh.name: mesh.preview.to_dict() for mesh in meshes if mesh.preview is not None}
    if previews:
        text = json.dumps(previews, indent=2, ensure_ascii=False)
        write_text(folder / PREVIEWS, f"{text}\n")
    ElementTree.indent(scene)
    write_durably(path, ElementTree.tostring(scene, "utf-8", xml_declaration=True))
    return path


def _add(parent: ElementTree.Element, tag: str, /, **attributes: str) -> ElementTree.Element:
    return ElementTree.SubElement(parent, tag, attributes)


def _add_rgb(parent: ElementTree.Element, name: str, colour: FloatArray) -> None:
    _add(parent, "rgb", name=name, value=_numbers(colour))


def _add_camera(scene: ElementTree.Element, camera: Pinhole, samples: int) -> None:
    sensor = _add(scene, "sensor", type="perspective")
    _add(sensor, "string", name="fov_axis", value="y")
    _add(sensor, "float", name="fov", value=f"{camera.vertical_fov_deg:.9g}")
    to_world = _add(sensor, "transform", name="to_world")
    _add(
        to_world,
        "lookat",
        origin=_numbers(camera.position_m),
        target=_numbers(camera.look_at_m),
        up=_numbers(camera.up),
    )
    _add(_add(sensor, "sampler", type="independent"), "integer", name="sample_count",
         value=str(samples))  # fmt: skip
    film = _add(sensor, "film", type="hdrfilm")
    _add(film, "integer", name="width", value=str(camera.width_px))
    _add(film, "integer", name="height", value=str(camera.height_px))
    _add(film, "string", name="pixel_format", value="rgb")
    _add(film, "rfilter", type="box")


def _add_glow(shape: ElementTree.Element, glow: Glow, frame: int, path: Path) -> None:
    """Add an emitter with the radiance of a frame, whose texture is written as EXR."""
    emitter = _add(shape, "emitter", type="area")
    if glow.texture is None:
        _add_rgb(emitter, "radiance", glow.colour[frame])
        return
    _write_texture(path, glow.colour[frame] * glow.texture)
    texture = _add(emitter, "texture", type="bitmap", name="radiance")
    _add(texture, "string", name="filename", value=path.name)
    # Numbers are taken as they are.
    _add(texture, "boolean", name="raw", value="true")
    _add(texture, "string", name="wrap_mode", value="clamp")


def _write_ply(path: Path, mesh: ExportedMesh) -> None:
    columns = [("x", "<f4"), ("y", "<f4"), ("z", "<f4")]
    values = [mesh.vertices_m]
    if mesh.uv is not None:
        columns += [("u", "<f4"), ("v", "<f4")]
        # Mitsuba counts from the upper left corner.
        values.append(np.stack([mesh.uv[:, 0], 1.0 - mesh.uv[:, 1]], axis=1))
    vertices = np.concatenate(values, axis=1).astype("<f4")
    faces = np.empty(len(mesh.faces), dtype=[("corners", "u1"), ("indices", "<u4", (3,))])
    faces["corners"], faces["indices"] = 3, mesh.faces
    head = [
        "ply",
        "format binary_little_endian 1.0",
        f"element vertex {len(vertices)}",
        *(f"property float {name}" for name, _ in columns),
        f"element face {len(faces)}",
        "property list uchar uint vertex_indices",
        "end_header",
    ]
    content = "\n".join(head).encode() + b"\n" + vertices.tobytes() + faces.tobytes()
    write_durably(path, content)


def _write_texture(path: Path, linear: FloatArray) -> None:
    write_exr(path, {}, {"RGB": linear})


def _numbers(values: Sequence[float] | FloatArray) -> str:
    return ", ".join(f"{value:.9g}" for value in values)


def _comment(name: str) -> str:
    """Return a name as XML allows it within a comment."""
    printable = "".join(letter if letter.isprintable() else " " for letter in name)
    return re.sub(r"-{2,}", "-", printable)
