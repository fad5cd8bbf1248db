"""Analysis of a calibration's check, from its frames to what changed on the bench."""

from pathlib import Path

from labrig.acquire import CalibrationRules
from labrig.analyse.inputs import AnalysisContext
from labrig.calibration import REFERENCE_KIND
from labrig.foundation.errors import DataError
from labrig.protocols.calibration_check.protocol import (
    CheckFrames,
    broken_rules,
    picture_change,
    picture_of,
)
from labrig.protocols.calibration_check.result import CalibrationCheckResult


def analyse(context: AnalysisContext) -> CalibrationCheckResult:
    """Compare the card through the filter with the picture of the calibration.

    Raises
    ------
    DataError
        The frames are missing, or show no strip.
    UsageError
        The calibration is no longer there.
    """
    protocol = context.protocol
    frames = [
        frame
        for frame in context.run.frames(CheckFrames.CARD)
        if not context.overrides.excludes(frame)
    ]
    if not frames:
        raise DataError(
            f"{context.run.folder}: no picture of the card through the filter is complete; go on "
            f"with: labrig resume {context.run.folder}"
        )
    reference = REFERENCE_KIND.read(Path(protocol.reference))
    change = picture_change(frames, picture_of(reference, protocol.reference))
    rules = protocol.rules or CalibrationRules()
    return CalibrationCheckResult(
        calibration=reference.run or protocol.reference,
        age_h=reference.age_s(frames[0].start_time) / 3600,
        change=change,
        warnings=tuple(warning for _, warning in broken_rules(change, rules)),
    )
