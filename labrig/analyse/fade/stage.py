"""A fade, from its run to fade.yaml."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from labrig.analyse.bench_curves import camera_curves, lamp_spectrum
from labrig.analyse.fade.change import Change
from labrig.analyse.fade.fit import ANY_LAG_S, fit_change
from labrig.analyse.fade.pictures import section, warming_sections
from labrig.analyse.fade.shots import Shots, shots_after
from labrig.analyse.fade.warming import warming
from labrig.analyse.part import Part, StageResult
from labrig.analyse.part_frames import part_frames, part_region
from labrig.analyse.this_camera import insist_on_this_camera
from labrig.calibration import Change as ChangeTable, FadeFile, Warming, write_fade_file
from labrig.errors import DataError
from labrig.optics import CameraResponse, Spectrum
from labrig.record import FrameRecord
from labrig.reduce import read_raw
from labrig.region import Region
from labrig.written_numbers import plus_minus, rounded

FloatArray = NDArray[np.float64]

#: Of a photograph's light where no camera file says.
TYPICAL_FLICKER = 0.007
#: Wavelengths on which curves are integrated, nm.
STEP_NM = 10.0
#: Times of the table, denser at first; until the slowest band is so near to its end.
TIMES, DENSER = 81, 1.5
GONE = 1e-4
LONGEST_S = 5.0
#: By which a relay may close sooner or later than it opens.
RELAY_S = 1e-3
#: χ² per degree of freedom beyond which the lamp is no glowing body.
BAD_CHI2 = 3.0


def process(part: Part) -> StageResult:
    """Write fade.yaml.

    Raises
    ------
    DataError, FitError
        The photographs show no lamp that is switched.
    UsageError
        The rig file does not name the curves of lamp and camera.
    """
    protocol, camera = part.protocol, part.inputs.camera
    curves = camera_curves(part.rig, part.choices, part.inputs.lvf)
    lamp = lamp_spectrum(part.rig)
    frames = part_frames(part, "fade", "rise", "steady")
    insist_on_this_camera(camera, part.run, frames)
    darks = part_frames(part, "dark")
    flicker = TYPICAL_FLICKER if camera is None else camera.flicker
    edges = np.array(protocol.bands)
    nm = np.arange(edges[0], edges[-1] + STEP_NM / 2, STEP_NM)
    places, weights = _places(part, frames, curves, lamp, nm)
    bands = _band_weights(edges, lamp, nm)
    found: dict[str, tuple[Shots, Change, ChangeTable]] = {}
    lag_s = ANY_LAG_S
    for purpose in ("fade", "rise") if protocol.rise else ("fade",):
        shots = shots_after(part.run, frames, darks, places, camera, purpose)
        seen = weights
        if protocol.through_lvf:
            # All channels of a place see the same band: one of them is enough.
            columns = shots.brightest(len(curves.channels))
            shots, seen = shots.of(columns), weights[columns]
        rises = purpose == "rise"
        change = fit_change(shots, seen, nm, flicker, rises=rises, lag_s=lag_s)
        lag_s = change.lag_s[0], float(np.hypot(change.lag_s[1], RELAY_S))
        found[purpose] = shots, change, _table(change, bands, nm)
    warm = _warming(part, darks, flicker)
    file = FadeFile(
        lamp=lamp.name,
        bands_nm=protocol.bands,
        fade=found["fade"][2],
        rise=found["rise"][2] if "rise" in found else None,
        warming=None if warm is None else warm[0],
        source="measured with labrig, fade",
        run=part.run.folder.resolve().name,
    )
    write_fade_file(part.folder / "fade.yaml", file)
    changes = {purpose: (shots, change) for purpose, (shots, change, _) in found.items()}
    return StageResult(
        known=replace(part.inputs, fade=file),
        sections=(section(file, changes), *warming_sections(warm)),
        lines=tuple(_lines(file, changes)),
        warnings=tuple(_warnings(changes)),
    )


def _warming(
    part: Part, darks: Sequence[FrameRecord], flicker: float
) -> tuple[Warming, FloatArray, FloatArray] | None:
    frames = part_frames(part, "warming")
    if not frames:
        return None
    card = part_region(part, part.protocol.card)
    return warming(part.run, frames, darks, card, part.inputs.camera, flicker)


def _places(
    part: Part,
    frames: Sequence[FrameRecord],
    curves: CameraResponse,
    lamp: Spectrum,
    nm: FloatArray,
) -> tuple[Mapping[str, Region], FloatArray]:
    """Regions, and what each channel of each of them sees of the steady lamp at `nm`."""
    seen = (lamp.at(nm)[:, np.newaxis] * curves.at(nm)).T
    if not part.protocol.through_lvf:
        return {"card": part_region(part, part.protocol.card)}, _normalised(seen)
    lvf = part.inputs.lvf
    if lvf is None or lvf.before_camera is None:
        raise DataError(
            "the fade through the variable filter needs its calibration: name it as optics.lvf in "
            "the rig file, or set through_lvf: false"
        )
    strip, frame = lvf.before_camera, read_raw(frames[0].path)
    transmission = lvf.lvf.at(strip.positions(frame.width, frame.height)).transmission(nm)
    through = transmission[:, np.newaxis, :] * seen
    return strip.slices(), _normalised(through.reshape(-1, len(nm)))


def _normalised(weights: FloatArray) -> FloatArray:
    result: FloatArray = weights / weights.sum(axis=1, keepdims=True)
    return result


def _band_weights(edges_nm: FloatArray, lamp: Spectrum, nm: FloatArray) -> FloatArray:
    """(bands, wavelengths) the lamp's light in each band; evenly where it has none."""
    middles = (edges_nm[1:] + edges_nm[:-1]) / 2
    inside = (nm >= edges_nm[:-1, np.newaxis]) & (nm <= edges_nm[1:, np.newaxis])
    for row, middle in enumerate(middles):
        if not inside[row].any():
            inside[row, np.argmin(np.abs(nm - middle))] = True
    even = inside.astype(np.float64)
    lit = even * np.maximum(lamp.at(nm), 0.0)
    return _normalised(np.where(lit.sum(axis=1, keepdims=True) > 0, lit, even))


def _table(change: Change, bands: FloatArray, nm: FloatArray) -> ChangeTable:
    last_s = _over_at(change, bands, nm)
    t_s = last_s * np.linspace(0, 1, TIMES) ** DENSER
    share, sigma = change.in_bands(bands, nm, t_s)
    first = 0.0 if change.best.shape.rises else 1.0
    share[0], sigma[0] = first, 0.0
    return ChangeTable(
        t_s=tuple(_short(value) for value in t_s),
        share=tuple(tuple(_short(value) for value in row) for row in share),
        sigma=tuple(tuple(_short(value) for value in row) for row in sigma),
    )


def _over_at(change: Change, bands: FloatArray, nm: FloatArray) -> float:
    """When all bands are as good as at their end."""
    t_s = np.linspace(0, LONGEST_S, 2001)
    share, _ = change.in_bands(bands, nm, t_s)
    left = 1 - share if change.best.shape.rises else share
    over = np.flatnonzero((left < GONE).all(axis=1))
    return float(t_s[over[0]]) if len(over) else LONGEST_S


def _short(value: float) -> float:
    return float(f"{value:.5g}")


def _lines(file: FadeFile, changes: Mapping[str, tuple[Shots, Change]]) -> Iterator[str]:
    for purpose, (_, change) in changes.items():
        table = file.fade if purpose == "fade" else file.rise
        assert table is not None
        missing_s = table.missing_s()
        if change.best.shape.rises:
            missing_s = table.t_s[-1] - missing_s
        first, last = 1e3 * missing_s[0], 1e3 * missing_s[-1]
        verb = "lacks" if change.best.shape.rises else "is worth"
        yield (
            f"the {purpose} {verb} {first:.1f} ms of the steady lamp in the first band, "
            f"{last:.1f} ms in the last; over after {rounded(table.t_s[-1], 3)} s; exponent of the "
            f"wavelength {plus_minus(*change.exponent)} (1: a glowing body)"
        )
    if file.warming is not None:
        warm = file.warming
        yield (
            f"a cold lamp lacks {plus_minus(100 * warm.lacks, 100 * warm.lacks_sigma)} % of its "
            f"light, which comes with a time constant of {warm.warms_s:.0f} s"
        )


def _warnings(changes: Mapping[str, tuple[Shots, Change]]) -> Iterator[str]:
    for purpose, (shots, change) in changes.items():
        if change.best.reduced_chi2 > BAD_CHI2:
            yield (
                f"the {purpose} is not that of a glowing body (χ² {change.best.reduced_chi2:.1f} a "
                "degree of freedom): is it a halogen lamp, and are its spectrum and the camera's "
                "curves those of this bench?"
            )
        exponent, sigma = change.exponent
        if abs(exponent - 1) > max(0.1, 4 * sigma):
            yield (
                f"the {purpose} follows the wavelength with an exponent of "
                f"{plus_minus(exponent, sigma)}, a glowing body has 1: see optics.lamp and "
                "optics.camera in the rig file"
            )
        if np.isnan(shots.value).any():
            clipped = int(np.isnan(shots.value).any(axis=1).sum())
            yield f"{clipped} photographs of the {purpose} clip and are left out; lower camera.iso"
