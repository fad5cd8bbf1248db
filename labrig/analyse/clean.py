"""Frames after lamp-off that show nothing but the glow, as far as a blank knows."""

from collections.abc import Sequence
from dataclasses import replace

from labrig.analyse.timed_frames import IntactFrames
from labrig.calibration import BlankFile
from labrig.errors import DataError
from labrig.results import add_flag

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
    left_out = left_out_lines([frame.t_s for frame in frames.decay], blank)
    kept = [
        frame if blank.is_clean(frame.t_s) else replace(frame, flag=add_flag(frame.flag, AFTERGLOW))
        for frame in frames.decay
    ]
    return replace(frames, decay=kept), (*left_out, *blank.leaks())


def left_out_lines(t_s: Sequence[float], blank: BlankFile) -> tuple[str, ...]:
    """What to say of frames that begin so long after lamp-off, where the bench is still bright.

    Raises
    ------
    DataError
        The blank never became clean, or no frame begins late enough.
    """
    early = [t for t in t_s if not blank.is_clean(t)]
    if not early:
        return ()
    if len(early) == len(t_s):
        raise DataError(
            f"all frames begin before the bench is dark, the last {max(early):.3g} s after "
            f"lamp-off; the blank is clean from {blank.first_clean_s:.3g} s on: begin later, or "
            "use a shield"
        )
    return (
        f"{len(early)} frames begin before the bench is dark and are left out: the blank is clean "
        f"from {blank.first_clean_s:.3g} s after lamp-off on (begin later, or use a shield)",
    )
