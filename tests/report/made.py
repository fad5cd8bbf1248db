"""A small run to report: frames as DNG files, series and fits of a decay that is known."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import tifffile

from labrig.fit import DecayFit, fit_decay
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import LabrigError
from labrig.foundation.result_warning import as_warnings
from labrig.optics import read_camera
from labrig.protocols.decay.analysis import noise_budget
from labrig.protocols.decay.report import decay_sections
from labrig.record.frames import FrameRecord
from labrig.record.history import DeviceLine, RunDescription
from labrig.report import Report
from labrig.report.report_model import DecayReport, GlowPhotograph, PatchReport
from labrig.results import Series

RATES = np.array([0.08, 0.015])
AMPLITUDES = np.array([3000.0, 900.0])
WEIGHTS = np.array([0.3, 1.0, 0.55])
BLACK, WHITE = 1024, 15600


def decay_series(
    n: int = 30, channels: Sequence[str] = ("R", "G", "B"), seed: int = 1, name: str = "sample"
) -> Series:
    t_s = 0.5 + 5.0 * np.arange(n, dtype=np.float64)
    exposure_s = np.ones(n)
    x = np.multiply.outer(exposure_s, RATES)
    means = np.exp(-np.multiply.outer(t_s, RATES)) * -np.expm1(-x) / x
    rng = np.random.default_rng(seed)
    values = np.multiply.outer(means @ AMPLITUDES, WEIGHTS[: len(channels)])
    sigma = np.sqrt(0.02 * values + 1.0)
    values *= 1 + 0.007 * rng.standard_normal((n, 1))
    values += sigma * rng.standard_normal(values.shape)
    return Series(
        t_s=t_s,
        exposure_s=exposure_s,
        values=values,
        sigma=sigma,
        dark_sigma=np.zeros(len(channels)),
        channels=tuple(channels),
        iso=np.full(n, 400.0),
        f_number=np.full(n, 4.0),
        frame=tuple(f"{number:06d}.dng" for number in range(1, n + 1)),
        unit=("decay-1",) * n,
        flag=("",) * n,
        region=name,
    )


def fitted(series: Series) -> DecayFit | str:
    usable = series.take(np.flatnonzero(series.usable)) if series.usable.any() else None
    try:
        if usable is None:
            return "no usable frames: all are clipped or excluded; expose for less"
        return fit_decay(
            usable.t_s,
            usable.values,
            usable.sigma,
            exposure_s=usable.exposure_s,
            channels=usable.channels,
            flicker=None,
        )
    except LabrigError as error:
        return str(error)


def patch(series: Series) -> PatchReport:
    fit = fitted(series)
    noise = noise_budget(series, fit) if isinstance(fit, DecayFit) else None
    return PatchReport(series.region, (0.25, 0.25, 0.5, 0.5), series, fit, noise)


def write_dng(path: Path, signal_dn: FloatArray, size: tuple[int, int] = (48, 64)) -> Path:
    """RGGB, the R, G, B of `signal_dn` above black in the middle, black around."""
    mosaic = np.full(size, BLACK, np.float64)
    height, width = size
    for (row, column), value in zip(
        ((0, 0), (0, 1), (1, 0), (1, 1)), signal_dn[[0, 1, 1, 2]], strict=True
    ):
        mosaic[height // 4 + row : -height // 4 : 2, width // 4 + column : -width // 4 : 2] += value
    tifffile.imwrite(
        path,
        np.minimum(mosaic, 16383).astype(np.uint16),
        photometric=32803,
        metadata=None,
        extratags=[
            (271, 2, 7, "labrig", True),
            (272, 2, 5, "test", True),
            (33421, 3, 2, (2, 2), True),
            (33422, 1, 4, (0, 1, 1, 2), True),
            (50706, 1, 4, (1, 4, 0, 0), True),
            (50714, 3, 1, BLACK, True),
            (50717, 4, 1, WHITE, True),
        ],
    )
    return path


def frame(path: Path, number: int = 1, role: str = "decay", exposure_s: float = 1.0) -> FrameRecord:
    return FrameRecord(
        path=path,
        sha256=f"{number:064x}",
        size_bytes=1000,
        unit="decay-1",
        role=role,
        exposure_s=exposure_s,
        iso=400,
        f_number=4.0,
        start_time=1.8e9 + 5 * number,
        end_time=1.8e9 + 5 * number + exposure_s,
        late_s=0.0012 * number,
    )


def decay_report(folder: Path, patches: Sequence[PatchReport] | None = None) -> DecayReport:
    """With one photograph under the lamp and two of the glow in `folder`."""
    patches = [patch(decay_series())] if patches is None else patches
    day = write_dng(folder / "000101.dng", np.array([6000.0, 9000.0, 4000.0]))
    glow = [
        write_dng(folder / f"{number:06d}.dng", factor * np.array([300.0, 4000.0, 2000.0]))
        for number, factor in ((1, 1.0), (20, 0.02))
    ]
    decay = [frame(glow[0], 1), frame(glow[1], 20)]
    return DecayReport(
        about=RunDescription(
            title="blue-paint",
            protocol="decay",
            run="2026-01-01T00-00-00_decay_blue-paint",
            started="2026-01-01 00:00:00 UTC",
            ended="2026-01-01 02:00:00 UTC",
            rig="dark room",
            simulated=False,
            labrig_version="1.2.3",
            sample=(("thickness", "0.4 mm"),),
            devices=(DeviceLine("lamp", "COM3", "Numato relay 00000009"),),
            protocol_text="protocol: decay\n",
            rig_text="name: dark room\n",
        ),
        patches=tuple(patches),
        frames=(*decay, frame(day, 101, "daylight", 1 / 64)),
        daylight=(frame(day, 101, "daylight", 1 / 64),),
        glow=(GlowPhotograph(decay[0], 0.5), GlowPhotograph(decay[1], 95.5)),
        camera=read_camera("canon_eos_5d_mark_ii"),
    )


def page_of(report: DecayReport, warnings: Sequence[str] = ()) -> Report:
    """The page of a decay."""
    found, methods = decay_sections(report)
    return Report(report.about, as_warnings(warnings), found, methods, report.frames, report.camera)
