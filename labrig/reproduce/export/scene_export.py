"""A rendered scene for other programs: its meshes, and their glow over the frames, in sRGB."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.optics import XYZ_TO_SRGB, illuminant
from labrig.reproduce.export.rgb_preview import RgbPreview, rgb_preview
from labrig.reproduce.picture.display import Display, tristimulus
from labrig.reproduce.picture.render_folder import RenderFolder
from labrig.reproduce.picture.rendering import Renderer
from labrig.reproduce.scene.built_scene import Scene
from labrig.reproduce.transport.geometry import Geometry

IntArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Glow:
    """Light that a surface emits at each frame: a colour of the frame times a texture.

    Parameters
    ----------
    colour
        Radiance at each frame in linear sRGB, ≥ 0, shape (frames, 3), in cd/m² of D65 for (1, 1, 1)
        or relative.
    texture
        Factor of each texel, ≥ 0, shape (height, width, 3), top row first; None for 1 everywhere.
    lost
        What a colour times a texture could not express, as RMS error relative to the RMS radiance.

    Raises
    ------
    UsageError
        A shape is another, or a value is negative (a colour out of gamut) or not finite.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.reproduce import Glow
    >>> Glow(np.outer(np.exp([0.0, -1.0, -2.0]), [0.1, 1.0, 0.5])).colour.shape
    (3, 3)
    """

    colour: FloatArray
    texture: FloatArray | None = None
    lost: float = 0.0

    def __post_init__(self) -> None:
        if self.colour.ndim != 2 or self.colour.shape[1:] != (3,) or not len(self.colour):
            raise UsageError(f"expected colours of shape (frames, 3), got {self.colour.shape}")
        _check_light(self.colour)
        if self.texture is not None:
            if self.texture.ndim != 3 or self.texture.shape[2:] != (3,) or not self.texture.size:
                raise UsageError(
                    f"expected a texture of shape (height, width, 3), got {self.texture.shape}"
                )
            _check_light(self.texture)

    @classmethod
    def of_textures(cls, radiance: ArrayLike) -> Self:
        """Return the glow that is nearest to a texture of each frame.

        For each of R, G and B it is the product of a texture and a course over time, the best in
        least squares. Texels that decay at rates of their own are given the mean course: the error
        is `lost`.

        Parameters
        ----------
        radiance
            Linear sRGB, ≥ 0, shape (frames, height, width, 3).

        Raises
        ------
        UsageError
            The shape is another, or a value is negative or not finite.
        """
        whole = np.asarray(radiance, dtype=np.float64)
        if whole.ndim != 4 or whole.shape[3:] != (3,) or not whole.size:
            raise UsageError(
                f"expected textures of shape (frames, height, width, 3), got {whole.shape}"
            )
        _check_light(whole)
        frames = len(whole)
        colour, texture = np.zeros((frames, 3)), np.zeros((*whole.shape[1:3], 3))
        for channel in range(3):
            table = whole[..., channel].reshape(frames, -1)
            # Of a table without negative values, the first singular vectors have one sign.
            # Through the frames' own products: there are far fewer frames than texels.
            course = np.abs(np.linalg.eigh(table @ table.T)[1][:, -1])
            texels = course @ table
            largest = float(texels.max())
            colour[:, channel] = course * largest
            if largest > 0:
                texture[..., channel] = texels.reshape(texture.shape[:2]) / largest
        error = whole - colour[:, np.newaxis, np.newaxis] * texture
        power = float((whole**2).sum())
        lost = float(np.sqrt((error**2).sum() / power)) if power > 0 else 0.0
        return cls(colour, texture, lost)


@dataclass(frozen=True, eq=False)
class ExportedMesh:
    """A mesh for other programs.

    Parameters
    ----------
    name
        Name of the object.
    vertices_m
        Positions in metres, shape (n, 3).
    faces
        Indices of the corners of triangles, anticlockwise from outside, shape (m, 3).
    base_colour
        Reflectance in linear sRGB, 0 to 1, shape (3,).
    uv
        Place of each vertex in the textures, shape (n, 2): (0, 0) is their lower left corner.
    glow
        Light that it emits; None for none.
    preview
        What it does to light as a fluorescent surface, in three colours; None of other surfaces.

    Raises
    ------
    UsageError
        A shape is another, an index is out of range, a number is not finite, a reflectance is none,
        or a glow with a texture has no `uv`.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.reproduce import ExportedMesh
    >>> corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    >>> ExportedMesh("sheet", corners, np.array([[0, 1, 2]]), np.full(3, 0.5)).faces.shape
    (1, 3)
    """

    name: str
    vertices_m: FloatArray
    faces: IntArray
    base_colour: FloatArray
    uv: FloatArray | None = None
    glow: Glow | None = None
    preview: RgbPreview | None = None

    def __post_init__(self) -> None:
        n = len(self.vertices_m)
        if self.vertices_m.shape != (n, 3) or not n or not np.isfinite(self.vertices_m).all():
            raise UsageError(f"{self.name}: expected finite vertices of shape (n, 3)")
        faces = self.faces
        if faces.ndim != 2 or faces.shape[1] != 3 or not len(faces):
            raise UsageError(f"{self.name}: expected faces of shape (m, 3), got {faces.shape}")
        if faces.min() < 0 or faces.max() >= n:
            raise UsageError(
                f"{self.name}: expected indices from 0 to {n - 1}, got {faces.min()} to "
                f"{faces.max()}"
            )
        is_reflectance = (self.base_colour >= 0) & (self.base_colour <= 1)
        if self.base_colour.shape != (3,) or not is_reflectance.all():
            raise UsageError(f"{self.name}: expected a base colour of three numbers from 0 to 1")
        if self.uv is not None and (self.uv.shape != (n, 2) or not np.isfinite(self.uv).all()):
            raise UsageError(f"{self.name}: expected finite uv of shape ({n}, 2)")
        if self.uv is None and self.glow is not None and self.glow.texture is not None:
            raise UsageError(f"{self.name}: its glow has a texture, for which it needs uv")


def _check_light(values: FloatArray) -> None:
    if not (np.isfinite(values).all() and values.min() >= 0):
        raise UsageError(
            "expected light that is finite and ≥ 0 in linear sRGB, got other; "
            "bring colours into the gamut by Display.linear"
        )


def frame_count(meshes: list[ExportedMesh]) -> int:
    """Return the number of frames of all glows, 1 where nothing glows.

    Raises
    ------
    UsageError
        There is no mesh, or glows have several numbers of frames.
    """
    if not meshes:
        raise UsageError("expected at least one mesh, got none")
    counts = {len(mesh.glow.colour) for mesh in meshes if mesh.glow is not None}
    if len(counts) > 1:
        raise UsageError(f"expected glows of one number of frames, got {sorted(counts)}")
    return counts.pop() if counts else 1


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
