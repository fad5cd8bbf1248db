"""Noise, flicker and brightness of bench and camera from an earlier run."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from labrig.acquire import read_run_protocol
from labrig.foundation.errors import DataError, UsageError
from labrig.foundation.region import Region
from labrig.foundation.yaml_file import read_yaml
from labrig.predict.expectation import predictable
from labrig.predict.frames import (
    PEAK_SIGMAS,
    TYPICAL_DARK_ELECTRONS_PER_S,
    TYPICAL_ELECTRONS_PER_DN,
    CameraFigures,
)
from labrig.record import FrameRecord, FrameRole, RunRecord, read_run
from labrig.reduce import FrameMeasurement, NoiseModel, fit_dark, measure, read_raw, variance_terms
from labrig.results import Series, find_fitted_decays, read_fitted_decay, read_series

#: Relative uncertainty from which a flicker is not used.
FLICKER_KNOWN = 0.2
#: Number of dark frames used, of the shortest and of the longest exposures each.
DARKS_EACH = 2


@dataclass(frozen=True)
class Reference:
    """An earlier run on the same bench with the same camera.

    Attributes
    ----------
    run
        Name of the run folder.
    camera
        Noise and range of the camera at the ISO of the run.
    f_number
        Aperture of the run; None if it is not known.
    flicker
        Relative common-mode noise ρ; None if the run does not determine it.
    channel_weights
        Weights of the channels of the patch by name, maximum 1.
    """

    run: str
    camera: CameraFigures
    f_number: float | None
    flicker: float | None
    channel_weights: Mapping[str, float]


def result_places(run: Path) -> dict[str, Path]:
    """Return the folders of the fits of a run by patch, by "" if there is one patch only.

    Raises
    ------
    UsageError
        If there is no fit.
    """
    fits = find_fitted_decays(run / "result")
    if not fits:
        raise UsageError(f"{run}: expected a run with a fit in its result folder, got none")
    return {name: path.parent for name, path in fits.items()}


def run_of(place: Path) -> Path | None:
    """Return the run folder that contains the result folder `place`; None if there is none."""
    return next(
        (folder for folder in place.resolve().parents if (folder / "journal.jsonl").is_file()), None
    )


def read_reference(place: Path) -> Reference:
    """Read noise, flicker and channel weights from the run with the result folder `place`.

    Raises
    ------
    UsageError
        If there is no run around the folder.
    DataError
        If a file of the run is missing or damaged.
    """
    folder = run_of(place)
    if folder is None:
        raise UsageError(f"{place}: expected the result folder of a run, got no run around it")
    run, fit = read_run(folder), read_fitted_decay(place / "fit.json")
    series = read_series(place / "series.csv")[0]
    region = _region(folder, series.region)
    frame = _first_usable(run, series)
    measurement = measure(read_raw(frame.path), region)
    brightest = measurement.channels[fit.brightest_channel]
    noise_dn = PEAK_SIGMAS * brightest.sigma * np.sqrt(brightest.n)
    darks = _darks(run, region)
    gain, read_noise_dn = _photon_transfer(series, measurement, darks)
    gain = gain or TYPICAL_ELECTRONS_PER_DN * 100 / frame.iso
    dark_dn_per_s = _dark_current(darks)
    pixels = sum(stats.n for stats in measurement.channels.values())
    return Reference(
        run=folder.name,
        camera=CameraFigures(
            width=measurement.width,
            height=measurement.height,
            iso=frame.iso,
            electrons_per_dn=gain,
            read_noise_electrons=read_noise_dn * gain,
            dark_electrons_per_s=(
                TYPICAL_DARK_ELECTRONS_PER_S if dark_dn_per_s is None else dark_dn_per_s * gain
            ),
            range_dn=measurement.range_dn,
            unevenness=float(max((brightest.peak - noise_dn) / brightest.mean, 1.0)),
            channel_fractions={
                name: stats.n / pixels for name, stats in measurement.channels.items()
            },
        ),
        f_number=frame.f_number,
        flicker=fit.flicker if fit.flicker_sigma < FLICKER_KNOWN * fit.flicker else None,
        channel_weights=dict(zip(fit.channels, fit.channel_weights, strict=True)),
    )


def _region(folder: Path, patch: str) -> Region:
    """Return the region of a patch when it was processed, else that of the protocol."""
    protocol = predictable(read_run_protocol(folder))
    processed = folder / "result" / "provenance.yaml"
    patches = read_yaml(processed)["regions"] if processed.is_file() else protocol.patches
    region: Region = patches.get(patch) or next(iter(patches.values()))
    return region


def _first_usable(run: RunRecord, series: Series) -> FrameRecord:
    usable = {name for name, good in zip(series.frame, series.usable, strict=True) if good}
    for frame in run.frames(FrameRole.DECAY):
        if frame.path.name in usable:
            return frame
    raise DataError(f"{run.folder}: expected a usable frame of a decay, got none; take another run")


def _darks(run: RunRecord, region: Region) -> list[FrameMeasurement]:
    """Return measurements of the dark frames with the shortest and the longest exposures."""
    darks = sorted(run.frames(FrameRole.DARK), key=lambda frame: frame.exposure_s)
    if len(darks) > 2 * DARKS_EACH:
        darks = darks[:DARKS_EACH] + darks[-DARKS_EACH:]
    return [
        replace(measure(read_raw(dark.path), region), exposure_s=dark.exposure_s) for dark in darks
    ]


def _photon_transfer(
    series: Series, measurement: FrameMeasurement, darks: Sequence[FrameMeasurement]
) -> tuple[float, float]:
    """Return electrons per DN and read noise in DN from a photon transfer curve.

    The first is 0 if all frames are too dark to determine it.
    """
    pixels = np.array([measurement.channels[name].n for name in series.channels])
    exposure_s = series.exposure_s[:, np.newaxis]
    dark_channels = [channel for dark in darks for channel in dark.channels.values()]
    mean = np.append(
        (series.values * exposure_s)[series.usable], [channel.mean for channel in dark_channels]
    )
    variance = np.append(
        (pixels * np.square(series.sigma * exposure_s))[series.usable],
        [channel.n * channel.sigma**2 for channel in dark_channels],
    )
    line = NoiseModel.fit(variance_terms(mean)[:, :2], variance, sigma_dn2=variance)
    return 1 / line.photon_dn if line.photon_dn > 0 else 0.0, float(np.sqrt(line.read_dn2))


def _dark_current(darks: Sequence[FrameMeasurement]) -> float | None:
    """Return the dark current of a pixel in DN/s.

    It is an upper bound if all dark frames have one exposure time, and None without dark frames.
    """
    if not darks:
        return None
    stats = [list(dark.channels.values()) for dark in darks]
    exposure_s = np.array([dark.exposure_s for dark in darks], dtype=np.float64)
    model = fit_dark(
        exposure_s,
        np.array([[channel.mean for channel in row] for row in stats]),
        np.array([[channel.sigma for channel in row] for row in stats]),
    )
    longest_s = float(exposure_s.max())
    return max(float(np.median(model.current(longest_s))) / longest_s, 0.0)
