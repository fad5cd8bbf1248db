"""The bench to which a calibration belongs, by which later runs know it again."""

from datetime import UTC, datetime

import numpy as np

from labrig.analyse.inputs import AnalysisContext
from labrig.analyse.strip import StripFrames
from labrig.calibration import (
    LVF_KIND,
    REFERENCE_KIND,
    CardPicture,
    LvfFile,
    ReferenceFile,
    kinds,
)
from labrig.fit.lvf import place_means
from labrig.foundation.input_file import MAX_FRAME_BYTES, read_bytes
from labrig.optics import SLICES
from labrig.protocols.steps.strip_scenes import LvfFrames, filter_unit
from labrig.reduce import read_exif, read_raw, strip_profile_in
from labrig.results import RunResult


def reference_of(context: AnalysisContext, result: RunResult) -> ReferenceFile | None:
    """Return the bench to which a run belongs that measures one kind of calibration of it.

    Parameters
    ----------
    context
        The run.
    result
        Its result.

    Returns
    -------
    ReferenceFile or None
        The bench; None where the run measures none, or has no frames.

    Raises
    ------
    DataError
        A frame is damaged.

    Examples
    --------
    >>> from labrig.acquire import read_run_protocol
    >>> from labrig.analyse import AnalysisContext, Inputs, Overrides
    >>> from labrig.analyse import reference_of
    >>> import labrig
    >>> run, result = labrig.read_run("runs/decay"), labrig.read_result("runs/decay")
    >>> rig = Overrides().bench(run.folder)
    >>> part = AnalysisContext(run, read_run_protocol(run.folder), rig, Overrides(), Inputs())
    >>> reference_of(part, result) is None
    True
    """
    kind = next((kind for kind in kinds() if kind.protocol == context.protocol.protocol), None)
    has_frames = any(attempt.frames for attempt in context.run.completed().values())
    if kind is None or not kind.of_bench or kind.name == REFERENCE_KIND.name or not has_frames:
        return None
    if kind.name not in result.provides():
        return None
    lvf = result.provides()[kind.name] if kind.name == LVF_KIND.name else None
    return bench_reference(
        context, None if lvf is None else card_picture(context, lvf), {kind.protocol}
    )


def bench_reference(
    context: AnalysisContext, picture: CardPicture | None, measured: set[str]
) -> ReferenceFile:
    run, optics = context.run, context.rig.optics
    frames = [frame for attempt in run.completed().values() for frame in attempt.frames]
    temperatures_c = [reading.temperature_c for reading in run.temperatures()]
    last_s = round(max(frame.end_time for frame in frames))
    return ReferenceFile(
        bench=context.rig.name,
        camera=run.camera_identity or None,
        lens=read_exif(read_bytes(frames[-1].path, MAX_FRAME_BYTES)).lens,
        lamp=optics.lamp,
        grey_card=optics.grey_card,
        curves=optics.camera,
        made=datetime.fromtimestamp(last_s, UTC),
        temperature_c=round(float(np.mean(temperatures_c)), 2) if temperatures_c else None,
        picture=picture,
        source=f"{', '.join(sorted(measured))}, measured with labrig",
        run=run.name,
    )


def card_picture(context: AnalysisContext, lvf: LvfFile) -> CardPicture:
    """Return the picture of the card through the filter, without a colour filter."""
    frames = StripFrames(context)
    shown = frames.of(LvfFrames.FILTER, filter_unit(None))
    strip = frames.find_strip(LvfFrames.FILTER, filter_unit(None)).strip(rising=True)
    assert lvf.before_camera is not None, "a calibration has the place of the filter"
    rising = lvf.before_camera.rising
    middles = (np.arange(SLICES) + 0.5) / SLICES
    nm = lvf.wavelengths.map().wavelength_nm(middles if rising else 1 - middles)
    raw = read_raw(shown[0].path)
    rates = np.maximum(place_means(strip_profile_in(shown, strip), SLICES), 0.0)
    return CardPicture(
        strip=strip.model_copy(update={"rising": rising}),
        iso=context.protocol.camera.iso,
        f_number=context.protocol.camera.f_number,
        channels=raw.channels,
        wavelength_nm=tuple(np.round(nm, 3).tolist()),
        rate_dn_per_s=tuple(tuple(row) for row in rates.tolist()),
        width=frames.size[0],
    )
