"""The dark room of a bench as a scene: samples in the camera's frame, the lamp and nothing else.

The walls are black: they return nothing, and are therefore left out. The lamp is far away, so that
its irradiance is even over the sample plane, as its calibration states it. Below the frame lies the
grey card, where there is one.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from labrig.foundation.region import Region
from labrig.reproduce.scene.entries import LampEntry, ObjectEntry, RectangleEntry
from labrig.reproduce.scene.scene_file import (
    BandsEntry,
    BenchLightEntry,
    CameraEntry,
    MaterialEntry,
    PathsEntry,
    ProgrammeEntry,
    SceneFile,
)

#: Height of the frame at the sample plane and distance of the camera, in m; only their ratio, a
#: narrow field of view, is seen.
FRAME_M, CAMERA_M = 0.1, 1.0
#: Heights of the gap and of the card below the frame, in heights of the frame.
GAP, CARD = 0.05, 0.15
#: Direction of the lamp, 45° from the side.
TOWARDS_LAMP = (1.0, 0.0, 1.0)
#: Irradiance across that direction over that on the plane, by the cosine of 45°.
ACROSS_OVER_ON_PLANE = math.sqrt(2)
#: Bands of 10 nm: bands of 20 nm displace colours by ΔE2000 up to 0.7, these by up to 0.2.
BANDS = BandsEntry(count=48)
#: Names in the scene.
LAMP, CARD_NAME = "lamp", "grey card"
#: All light is direct, and the same everywhere on a sample: few paths and places are exact.
PATHS = PathsEntry(per_pixel=1, per_place=1, vertices=2, survival=0.0)
PLACES = (2, 2)


@dataclass(frozen=True)
class DarkRoomLamp:
    """The lamp of a bench.

    Attributes
    ----------
    spectrum
        Its spectrum: a CIE illuminant, or the path of a file.
    illuminance_lux
        Its illuminance at the sample in lux. Glow over reflected light does not depend on it,
        unless the materials' scale is absolute.
    """

    spectrum: str
    illuminance_lux: float


@dataclass(frozen=True)
class DarkRoomPicture:
    """Picture of the dark room.

    Attributes
    ----------
    width_px, height_px
        Size of the camera's frame in the picture; the grey card is below it.
    """

    width_px: int
    height_px: int

    def rows_below(self, card: str | None) -> int:
        """Return how many rows the picture has below the frame."""
        return 0 if card is None else math.ceil((GAP + CARD) * self.height_px)


def dark_room(
    name: str,
    patches: Mapping[str, tuple[Region, MaterialEntry]],
    lamp: DarkRoomLamp,
    programme: Sequence[tuple[float, float]],
    frames_s: Sequence[float],
    picture: DarkRoomPicture,
    card: str | None = None,
) -> SceneFile:
    """Return the dark room as a scene.

    The camera is a pinhole right above the sample plane, to which it maps its frame. The lamp is
    distant, 45° from the side, with an irradiance that is that of the bench on the plane.

    Parameters
    ----------
    name
        Name of the scene.
    patches
        Region in the frame, as fractions of it, and material of each sample by its name.
    lamp
        The lamp, by which the materials were measured.
    programme
        Time in s and level of the lamp from then on, in order of time; 1 is its full strength.
    frames_s
        Times of the pictures in s.
    picture
        Size of the frame in pixels.
    card
        Path of the grey card's reflectance; None leaves the card out.

    Returns
    -------
    SceneFile
        The scene, for `build_scene`.

    Examples
    --------
    >>> from labrig.reproduce import DarkRoomLamp, DarkRoomPicture, MaterialEntry, dark_room
    >>> paint = MaterialEntry(file="blue-paint", assume_albedo=0.7, assume_scale=0.2)
    >>> scene = dark_room(
    ...     "bench",
    ...     {"paint": ((0.25, 0.25, 0.5, 0.5), paint)},
    ...     DarkRoomLamp("A", 1000.0),
    ...     [(-600.0, 1.0), (0.0, 0.0)],
    ...     [-1.0, 1.0, 10.0],
    ...     DarkRoomPicture(60, 40),
    ... )
    >>> scene.camera.width_px, scene.camera.height_px, sorted(scene.objects)
    (60, 40, ['paint'])
    """
    metre_per_px = FRAME_M / picture.height_px
    width_m, below_px = picture.width_px * metre_per_px, picture.rows_below(card)
    materials = {patch: entry for patch, (_, entry) in patches.items()}
    objects = {
        patch: ObjectEntry(
            material=patch,
            samples=PLACES,
            rectangle=_in_plane(
                (region[0] - 0.5) * width_m,
                (0.5 - region[1] - region[3]) * FRAME_M,
                region[2] * width_m,
                region[3] * FRAME_M,
            ),
        )
        for patch, (region, _) in patches.items()
    }
    if card is not None:
        materials[CARD_NAME] = MaterialEntry(albedo=card)
        low_m = -FRAME_M / 2 - below_px * metre_per_px
        objects[CARD_NAME] = ObjectEntry(
            material=CARD_NAME,
            rectangle=_in_plane(
                -width_m / 2, low_m, width_m, below_px * metre_per_px - GAP * FRAME_M
            ),
        )
    height_px = picture.height_px + below_px
    middle_m = -below_px * metre_per_px / 2
    return SceneFile(
        name=name,
        kind="scene",
        bands=BANDS,
        bench_light=BenchLightEntry(spectrum=lamp.spectrum, illuminance_lux=lamp.illuminance_lux),
        materials=materials,
        lamps={
            LAMP: LampEntry(
                kind="distant",
                spectrum=lamp.spectrum,
                illuminance_lux=lamp.illuminance_lux * ACROSS_OVER_ON_PLANE,
                towards=TOWARDS_LAMP,
            )
        },
        objects=objects,
        camera=CameraEntry(
            position_m=(0.0, middle_m, CAMERA_M),
            look_at_m=(0.0, middle_m, 0.0),
            up=(0.0, 1.0, 0.0),
            vertical_fov_deg=2 * math.degrees(math.atan(height_px * metre_per_px / 2 / CAMERA_M)),
            width_px=picture.width_px,
            height_px=height_px,
        ),
        programme=tuple(
            ProgrammeEntry(at_s=at_s, lamps={LAMP: level}) for at_s, level in programme
        ),
        frames_s=tuple(frames_s),
        paths=PATHS,
    )


def under_lamps(
    room: SceneFile, spectra: Mapping[str, str], pictures: Sequence[Mapping[str, float]]
) -> SceneFile:
    """Return a dark room with other lamps, and a picture under each of some mixtures of them.

    Parameters
    ----------
    room
        A dark room; its lamp is replaced.
    spectra
        Spectrum of each lamp by its name: a CIE illuminant, or the path of a file.
    pictures
        For each picture the irradiance of the plane by the lamps that burn, in W m⁻² over all of
        their wavelengths; the first picture is at 0 s, each other one a second later.

    Returns
    -------
    SceneFile
        The scene, for `build_scene`.

    Examples
    --------
    >>> from labrig.reproduce import (
    ...     DarkRoomLamp, DarkRoomPicture, MaterialEntry, dark_room, under_lamps
    ... )
    >>> paper = {"paper": ((0.25, 0.25, 0.5, 0.5), MaterialEntry(file="white-paper"))}
    >>> picture = DarkRoomPicture(60, 40)
    >>> room = dark_room("bench", paper, DarkRoomLamp("A", 1000.0), [(0.0, 1.0)], [0.0], picture)
    >>> lit = under_lamps(room, {"day": "D65", "black light": "365nm"}, [{"day": 1.0}, {}])
    >>> sorted(lit.lamps), lit.frames_s
    (['black light', 'day'], (0.0, 1.0))
    """
    (placed,) = room.lamps.values()
    lamps = {
        name: placed.model_copy(
            update={
                "spectrum": spectrum,
                "illuminance_lux": None,
                "irradiance_w_per_m2": ACROSS_OVER_ON_PLANE,
            }
        )
        for name, spectrum in spectra.items()
    }
    programme = tuple(
        ProgrammeEntry(at_s=float(at_s), lamps=dict.fromkeys(spectra, 0.0) | dict(levels))
        for at_s, levels in enumerate(pictures)
    )
    times = tuple(part.at_s for part in programme)
    return room.model_copy(update={"lamps": lamps, "programme": programme, "frames_s": times})


def _in_plane(left_m: float, low_m: float, width_m: float, height_m: float) -> RectangleEntry:
    """Return a rectangle in the sample plane, its front towards the camera."""
    return RectangleEntry(
        corner_m=(left_m, low_m, 0.0),
        edge_u_m=(width_m, 0.0, 0.0),
        edge_v_m=(0.0, height_m, 0.0),
    )
