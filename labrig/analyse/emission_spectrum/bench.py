"""What of the bench a spectrum needs: the filter where it is read, camera curves, the white."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from labrig.analyse.bench_curves import camera_curves, card_reflectance, lamp_spectrum
from labrig.analyse.emission_spectrum.picture import Pictures, combined
from labrig.analyse.emission_spectrum.white import taught_by
from labrig.analyse.part import Part
from labrig.analyse.strip_patches import Slices, StripPatch, cut, lean, strip_patches
from labrig.calibration.lvf_file import Strip
from labrig.errors import DataError, UsageError
from labrig.fit.spectrum import CurveError, SpectralSystem, system_through_lvf
from labrig.optics import (
    Bands,
    CameraResponse,
    Lvf,
    Spectrum,
    Transmittance,
    read_monochrome_camera,
    seen_through,
)
from labrig.reduce import RawFrame, SeriesFrame, read_raw
from labrig.region import Region, region_pixels

FloatArray = NDArray[np.float64]

#: From where to where the holder is read, in heights of the strip from its middle; the filter's own
#: blurred edges end at 0.7.
HOLDER = (0.8, 1.1)
#: Of the spectrum fitted: finer than the filter's 25 nm, and beyond the grid that is told.
KNOTS_NM: FloatArray = np.arange(380.0, 721.0, 5.0)


@dataclass(frozen=True, eq=False)
class SpectralBench:
    """The bench as the spectrum of one patch sees it.

    Attributes
    ----------
    slices, holder
        Where in the frame the filter is read, and where its opaque holder is seen beside it.
    lvfs
        The filter at the middle of each slice's own pixels, for every channel.
    camera
        Its curves.
    system
        From a spectrum to the values read, and how that may be wrong.
    white
        Whether a white picture has had its say.
    """

    slices: Mapping[str, Region]
    holder: Mapping[str, Region]
    lvfs: tuple[Lvf, ...]
    camera: CameraResponse
    system: SpectralSystem
    white: bool = False

    @property
    def centre_nm(self) -> FloatArray:
        """(positions · channels,) of the band in which each value is read."""
        return np.stack([lvf.bands.centre_nm for lvf in self.lvfs], axis=1).ravel()

    def seen_of(self, light: Spectrum) -> FloatArray:
        """(positions · channels,) what a light comes to."""
        columns = [
            seen_through(lvf, one, light)[:, 0]
            for lvf, one in zip(self.lvfs, _channels(self.camera), strict=True)
        ]
        return np.stack(columns, axis=1).ravel()


def spectral_benches(
    part: Part, frame: SeriesFrame
) -> tuple[dict[StripPatch, SpectralBench], tuple[str, ...]]:
    """The bench that a part was measured on, for every patch; and why there is none for one.

    Parameters
    ----------
    frame
        One of the part's: tells the camera's pixels and channels.

    Raises
    ------
    UsageError
        No LVF calibrated for this place, or no camera curves.
    DataError
        No patch lies below the filter.
    """
    known = part.inputs.lvf
    if known is None or known.before_camera is None:
        raise UsageError(
            "a spectrum needs the LVF calibrated before the camera: run the protocol "
            "lvf_calibration, and name its run in the rig file (optics: {lvf: …}) or to labrig "
            "process --optics"
        )
    raw, strip, lvf = read_raw(frame.path), known.before_camera, known.lvf
    camera, holder = _camera(part, raw.channels), _holder(strip)
    patches, refused = cut(strip_patches(part), strip, raw)
    benches = {}
    for patch, slices in patches.items():
        # At either end pixels reach a little beyond the places that were calibrated.
        places = np.clip(_positions(raw, strip, slices), lvf.position[0], lvf.position[-1])
        lvfs = tuple(lvf.at(own) for own in places)
        benches[patch] = SpectralBench(slices, holder, lvfs, camera, _system(lvfs, camera))
    return benches, refused


def with_white(
    bench: SpectralBench, part: Part, white: Pictures | None
) -> tuple[SpectralBench, tuple[str, ...]]:
    """The bench after its white picture, if there is one; and warnings.

    Raises
    ------
    UsageError
        The files of lamp or grey card are no good.
    """
    if white is None:
        return bench, ()
    optics = part.rig.optics
    if optics.lamp is None or optics.grey_card is None:
        return bench, (
            "the white picture says nothing, since the spectra of lamp and grey card are not "
            "known: name them in the rig file (optics: {lamp: …, grey_card: …})",
        )
    light = _light(lamp_spectrum(part.rig), card_reflectance(part.rig))
    picture = combined(white)
    if not picture.shows_light:
        return bench, ("the white picture is dark or clips throughout; the spectrum does without",)
    expected = bench.seen_of(light)
    system = taught_by(bench.system, picture.value, picture.sigma, light, expected)
    return replace(bench, system=system, white=True), ()


def _holder(strip: Strip) -> dict[str, Region]:
    """Dark stripes above and below the strip, as far as the frame reaches."""
    (left, left_y), (right, right_y) = strip.left, strip.right
    upper, lower = min(left_y, right_y), max(left_y, right_y)
    near, far = (share * strip.height for share in HOLDER)
    stripes = {"above": (upper - far, upper - near), "below": (lower + near, lower + far)}
    return {
        name: (left, top, right - left, bottom - top)
        for name, (top, bottom) in stripes.items()
        if top >= 0 and bottom <= 1
    }


def _positions(raw: RawFrame, strip: Strip, slices: Slices) -> FloatArray:
    """Middle of each channel's own pixels in every slice, (channels, positions).

    Pixels of one colour are two apart: where slices are few pixels wide, that is some nanometres.
    """
    side = raw.cfa_side
    cell = np.array(list(raw.cfa)).reshape(side, side)
    middles = np.empty((len(raw.channels), len(slices)))
    for number, name in enumerate(raw.channels):
        rows = np.count_nonzero(cell == name, axis=0)
        for place, region in enumerate(slices.values()):
            x, _, width, _ = region_pixels(region, raw.width, raw.height)
            columns = np.arange(x, x + width)
            middles[number, place] = np.average(columns + 0.5, weights=rows[columns % side])
    across = (strip.right[0] - strip.left[0]) * raw.width
    share = (middles - strip.left[0] * raw.width) / across + lean(strip, slices, raw)
    return share if strip.rising else 1 - share


def _system(lvfs: Sequence[Lvf], camera: CameraResponse) -> SpectralSystem:
    """The system whose channels each see the filter in a place of their own.

    An error of the filter is common to the channels of a slice, one of a curve is the channel's.
    """
    error = CurveError()
    parts = [
        system_through_lvf(lvf, one, KNOTS_NM, error)
        for lvf, one in zip(lvfs, _channels(camera), strict=True)
    ]
    of_filter = sum(
        int(np.count_nonzero(getattr(lvfs[0].sigma, one.name))) for one in fields(Bands)
    )
    curves = len(parts[0].modes) - of_filter
    count, knots = len(parts), len(KNOTS_NM)
    shape = (len(parts[0].design), count, knots)
    design = np.stack([part.design for part in parts], axis=1)
    modes = []
    for number, part in enumerate(parts):
        own = np.zeros((curves, *shape))
        own[:, :, number] = part.modes[:curves]
        modes.append(own)
    modes.append(np.stack([part.modes[curves:] for part in parts], axis=2))
    rows = shape[0] * count
    return SpectralSystem(
        KNOTS_NM, design.reshape(rows, knots), np.concatenate(modes).reshape(-1, rows, knots)
    )


def _channels(camera: CameraResponse) -> list[CameraResponse]:
    """Each channel as a camera of its own."""
    return [
        CameraResponse(camera.name, camera.wavelength_nm, column[:, np.newaxis], (name,))
        for column, name in zip(camera.sensitivity.T, camera.channels, strict=True)
    ]


def _light(lamp: Spectrum, card: Transmittance) -> Spectrum:
    """The lamp's light as the card throws it back."""
    inside = (card.wavelength_nm > lamp.wavelength_nm[0]) & (
        card.wavelength_nm < lamp.wavelength_nm[-1]
    )
    fine = np.union1d(lamp.wavelength_nm, card.wavelength_nm[inside])
    return Spectrum(lamp.name, fine, lamp.at(fine) * card.at(fine))


def _camera(part: Part, channels: tuple[str, ...]) -> CameraResponse:
    """Its curves, in the order of a frame's channels."""
    if len(channels) == 1:
        name = part.choices.camera or part.rig.optics.camera
        if name is not None:
            return read_monochrome_camera(name)
    camera = camera_curves(part.rig, part.choices, part.inputs.lvf)
    if camera.channels != channels:
        raise DataError(
            f"expected frames with the channels {', '.join(camera.channels)} or one alone, got "
            f"{', '.join(channels)}"
        )
    return camera
