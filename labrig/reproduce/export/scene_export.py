"""A rendered scene for other programs: its meshes, and their glow over the frames, in sRGB."""

import numpy as np
from numpy.typing import ArrayLike

from labrig.foundation.arrays import FloatArray
from labrig.optics import XYZ_TO_SRGB, illuminant
from labrig.reproduce.export.exported_scene import ExportedMesh, Glow
from labrig.reproduce.export.rgb_preview import RgbPreview, rgb_preview
from labrig.reproduce.picture.display import Display, tristimulus
from labrig.reproduce.picture.render_folder import RenderFolder
from labrig.reproduce.picture.rendering import Renderer
from labrig.reproduce.scene.built_scene import Scene
from labrig.reproduce.transport.geometry import Geometry


def exported_meshes(scene: Scene, folder: RenderFolder) -> list[ExportedMesh]:
    """Return the objects of a rendered scene, with what each emits at its frames.

    They are where they stand at the first frame. Light is reduced to linear sRGB in cd/m²: lamps
    emit theirs, phosphors their glow; surfaces have the colour that they have under D65, and
    fluorescent ones also a matrix of linear sRGB as a preview, see `rgb_preview`.

    Parameters
    ----------
    scene
        The scene.
    folder
        Its finished rendering.

    Returns
    -------
    list of ExportedMesh
        Objects in the order of the scene; those without light have no glow.

    Raises
    ------
    UsageError
        The levels of a frame are missing.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.reproduce import RenderFolder, exported_meshes, load_scene
    >>> scene = load_scene("cornell-box").resized(width_px=8, height_px=8, paths=2)
    >>> folder = RenderFolder.open(Path("exported"), scene)
    >>> frames = list(folder.rendered(scene))
    >>> [mesh.name for mesh in exported_meshes(scene, folder) if mesh.glow is not None]
    ['left', 'lamp']
    """
    geometry = scene.geometry(folder.times_s[0])
    renderer = Renderer(scene)
    emitted = np.stack(
        [
            _srgb(renderer.emitted_at(t_s, folder.levels(number)), scene)
            for number, t_s in enumerate(folder.times_s)
        ]
    )
    meshes = []
    for number, surface in enumerate(geometry.surfaces):
        glow = None
        if surface.lamp >= 0:
            lamp = scene.lamps(folder.times_s[0])[surface.lamp]
            light = np.array([scene.levels(t_s)[surface.lamp] for t_s in folder.times_s])
            glow = Glow(light[:, None] * _srgb(lamp.light, scene))
        elif surface.samples is not None:
            glow = _glow(emitted[:, geometry.places_of(number)], geometry, number)
        colour = _colour(scene, surface.material)
        mesh = surface.mesh
        uv = None if glow is None or glow.texture is None else mesh.uv
        faces = mesh.faces.astype(np.int64)
        preview = _preview(scene, surface.material, folder.times_s[0])
        meshes.append(ExportedMesh(surface.name, mesh.vertices_m, faces, colour, uv, glow, preview))
    return meshes


def _preview(scene: Scene, material: int, t_s: float) -> RgbPreview | None:
    """Return the reduction of a fluorescent material, judged under the scene's lamps."""
    if material < 0 or scene.materials[material].is_diagonal:
        return None
    return rgb_preview(scene.materials[material], scene.bands, scene.lamps(t_s))


def _glow(emitted: FloatArray, geometry: Geometry, number: int) -> Glow | None:
    """Return the glow of a surface from that of its places (frames, places, 3)."""
    if not emitted.any():
        return None
    samples = geometry.surfaces[number].samples
    if not isinstance(samples, tuple):
        return Glow(emitted.mean(axis=1))
    columns, rows = samples
    # Textures begin at the top.
    return Glow.of_textures(emitted.reshape(len(emitted), rows, columns, 3)[:, ::-1])


def _srgb(radiance: ArrayLike, scene: Scene) -> FloatArray:
    """Return spectral radiances (…, bands) in linear sRGB and cd/m², within its gamut."""
    xyz = tristimulus(radiance, scene.bands.edges_nm)
    largest = float(xyz.max(initial=0.0))
    if largest <= 0:
        return np.zeros(xyz.shape)
    # The transform clips what is brighter than white: a white beyond all of it.
    white = 100 * largest
    return np.asarray(Display(white).linear(xyz) * white)


def _colour(scene: Scene, material: int) -> FloatArray:
    """Return the mean colour of a material under D65 in linear sRGB, with its re-radiation."""
    if material < 0:
        return np.zeros(3)
    daylight, surface = scene.bands.means(illuminant("D65")), scene.materials[material]
    factor = None if surface.texture is None else surface.texture.albedo_factor
    returned = surface.matrix @ daylight * (1.0 if factor is None else float(factor.mean()))
    seen = tristimulus(returned, scene.bands.edges_nm)
    white = tristimulus(daylight, scene.bands.edges_nm)
    return np.asarray(np.clip(XYZ_TO_SRGB @ seen / white[1], 0.0, 1.0))
