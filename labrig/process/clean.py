"""Frames after lamp-off that show nothing but the glow, as far as a blank knows."""

from dataclasses import replace

from labrig.calibration import BlankFile
from labrig.errors import DataError
from labrig.process.timed_frames import IntactFrames
from labrig.reduce import add_flag

#: Of a frame that begins while something else than the glow still fades.
AFTERGLOW = "afterglow"


def cleaned(frames: IntactFrames, blank: BlankFile | None) -> tuple[IntactFrames, tuple[str, ...]]:
    """Frames that begin too early flagged, so that nothing is made of them; and what to say of it.

    How much of the lamp's afterglow a sample throws back is not what the blank does: it cannot be
    subtracted.

    Raises
    ------
    DataError
        The blank never became clean, or no frame begins late enough.
    """
    if blank is None:
        return frames, ()
    early = [frame.t_s for frame in frames.decay if not blank.is_clean(frame.t_s)]
    if len(early) == len(frames.decay):
        raise DataError(
            f"all frames begin before the bench is dark, the last {max(early):.3g} s after "
            f"lamp-off; the blank is clean from {blank.first_clean_s:.3g} s on: begin later, or "
            "use a shield"
        )
    if not early:
        return frames, blank.leaks()
    kept = [
        frame if blank.is_clean(frame.t_s) else replace(frame, flag=add_flag(frame.flag, AFTERGLOW))
        for frame in frames.decay
    ]
    left_out = (
        f"{len(early)} frames begin before the bench is dark and are left out: the blank is clean "
        f"from {blank.first_clean_s:.3g} s after lamp-off on (begin later, or use a shield)"
    )
    return replace(frames, decay=kept), (left_out, *blank.leaks())
