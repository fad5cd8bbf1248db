"""A rendered scene for other programs: meshes, glow over the frames and re-radiation, in sRGB.

A fluorescent surface turns light of one wavelength into that of others; three colours know neither
the ultraviolet, which they do not have, nor lines within a colour. What is left is a preview, whose
colour differences are stated with it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.optics import (
    CIE_1931,
    XYZ_TO_SRGB,
    Spectrum,
    delta_e,
    illuminant,
    is_narrow,
    lab,
    observer,
    white_xyz,
)
from labrig.reproduce.picture.display import Display, tristimulus
from labrig.reproduce.picture.render_folder import RenderFolder
from labrig.reproduce.picture.rendering import Renderer
from labrig.reproduce.scene.built_scene import Scene
from labrig.reproduce.surface.bands import Bands
from labrig.reproduce.surface.surface_material import SurfaceMaterial
from labrig.reproduce.transport.geometry import Geometry
from labrig.reproduce.transport.lamp import Lamp

#: Illuminants over which matrices are fitted, and the wavelengths in nm between their parts: light
#: in a scene has passed coloured walls, and three illuminants alone leave a matrix open.
ILLUMINANTS = ("D65", "A", "FL11")
PARTED_NM = (500.0, 580.0)
FITTED_OVER = (
    f"{', '.join(ILLUMINANTS)}, each whole and its parts below {PARTED_NM[0]:g} nm, up to "
    f"{PARTED_NM[1]:g} nm and beyond"
)
#: White, and luminance of the surface, where a lamp shows no white.
SCREEN, MIDDLE = "D65", 0.5


@dataclass(frozen=True, eq=False)
class RgbPreview:
    """Matrix of what a fluorescent surface does to light in linear sRGB, approximately.

    Attributes
    ----------
    matrix
        Matrix from the light that falls on it to the light that comes back, π L/E, in linear sRGB,
        shape (3, 3); row by row the red, green and blue that come back.
    delta_e
        ΔE2000 of it under each lamp of the scene, against all wavelengths; None where the lamp
        makes no colour.
    delta_e_of_colour
        The same of a single base colour, that under D65, as far as it is from 0 to 1.
    """

    matrix: FloatArray
    delta_e: Mapping[str, float | None]
    delta_e_of_colour: Mapping[str, float | None]

    @property
    def statement(self) -> str:
        """Return its kind and how far it is off, in one line for people."""
        told = ", ".join(
            f"{'–' if value is None else f'{value:.1f}'} under {lamp}"
            for lamp, value in self.delta_e.items()
        )
        return (
            "preview of re-radiation in linear sRGB, by least squares over "
            f"{FITTED_OVER}; ΔE2000 {told or 'not known without lamps'}"
        )

    def to_dict(self) -> dict[str, object]:
        """Return it for JSON."""
        return {
            "preview": self.statement,
            "linearSrgbFromLinearSrgb": np.round(self.matrix, 6).tolist(),
            "deltaE2000UnderLamps": _rounded(self.delta_e),
            "deltaE2000OfBaseColorUnderLamps": _rounded(self.delta_e_of_colour),
        }


def rgb_preview(material: SurfaceMaterial, bands: Bands, lamps: Sequence[Lamp]) -> RgbPreview:
    """Return the matrix of linear sRGB that is nearest to a fluorescent surface.

    It minimises the squared differences of linear sRGB over some illuminants, D65, A and FL11, and
    three parts of each; all have the luminance 1 as a whole.

    Parameters
    ----------
    material
        The surface.
    bands
        Bands of its matrix.
    lamps
        Lamps of the scene, under which it is judged against all wavelengths: with a perfect white
        under the lamp; where the lamp is narrow, with D65 and the surface's luminance at half of
        the white's.

    Returns
    -------
    RgbPreview
        The matrix and its colour differences.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.optics import illuminant
    >>> from labrig.material import read_any_material
    >>> from labrig.reproduce import Bands, Lamp, of_matrix, rgb_preview
    >>> bands = Bands.even()
    >>> textile = of_matrix(read_any_material("yellow-textile"), bands)
    >>> lamp = Lamp("window", "distant", bands.means(illuminant("D65")))
    >>> preview = rgb_preview(textile, bands, [lamp])
    >>> bool(preview.matrix[1, 2] > 0.2)  # blue comes back as green
    True
    >>> preview.delta_e["window"] < 2
    True
    """
    matrix = material.matrix.astype(np.float64)
    falls, comes = [], []
    for light in _fitted_over(bands):
        falls.append(_linear(light, bands))
        comes.append(_linear(matrix @ light, bands))
    fitted = np.linalg.lstsq(np.array(falls), np.array(comes), rcond=None)[0].T
    colour = np.diag(np.clip(_linear(matrix @ _whole(SCREEN, bands), bands), 0.0, 1.0))
    return RgbPreview(
        fitted,
        {lamp.name: _delta_e(fitted, matrix, lamp.light, bands) for lamp in lamps},
        {lamp.name: _delta_e(colour, matrix, lamp.light, bands) for lamp in lamps},
    )


def _rounded(differences: Mapping[str, float | None]) -> dict[str, float | None]:
    return {lamp: None if value is None else round(value, 2) for lamp, value in differences.items()}


def _whole(name: str, bands: Bands) -> FloatArray:
    """Return an illuminant in bands, of luminance 1 (bands,)."""
    light = bands.means(illuminant(name))
    return np.asarray(light / tristimulus(light, bands.edges_nm)[1])


def _fitted_over(bands: Bands) -> list[FloatArray]:
    part = np.digitize(bands.centre_nm, PARTED_NM)
    lights = []
    for whole in (_whole(name, bands) for name in ILLUMINANTS):
        lights += [whole, *(np.where(part == number, whole, 0.0) for number in range(3))]
    return lights


def _linear(light: FloatArray, bands: Bands) -> FloatArray:
    """Return linear sRGB of a light, not clipped (3,)."""
    return np.asarray(XYZ_TO_SRGB @ tristimulus(light, bands.edges_nm))


def _delta_e(
    reduced: FloatArray, matrix: FloatArray, light: FloatArray, bands: Bands
) -> float | None:
    """Return ΔE2000 of a reduced matrix under a light; None where no colour comes back."""
    seen = tristimulus(matrix @ light, bands.edges_nm)
    if not seen[1] > 0:
        return None
    approximate = np.linalg.solve(XYZ_TO_SRGB, reduced @ _linear(light, bands))
    if is_narrow(Spectrum("", bands.centre_nm, light)):
        white, scale = white_xyz(SCREEN, observer(CIE_1931)), MIDDLE / seen[1]
    else:
        white = tristimulus(light, bands.edges_nm)
        white, scale = white / white[1], 1 / white[1]
    colours = [lab(np.maximum(scale * xyz, 0.0), white) for xyz in (seen, approximate)]
    return float(delta_e(*colours))


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
