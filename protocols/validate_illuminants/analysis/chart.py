"""A ColorChecker under a lamp, found in its photographs."""

import numpy as np

from labrig.analyse.inputs import Part
from labrig.analyse.lit_patches import lit_patches
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError
from labrig.protocols.validate_illuminants.protocol import CHART, IlluminantFrames
from labrig.reduce import find_colour_chart

#: ΔE2000 of a chart's patches, on average, from which it is not what was taken for one.
ODD_CHART = 6.0


def chart_values(part: Part, lamp: str) -> FloatArray:
    """Return the values of the chart's 24 patches in DN/s, shape (24, k).

    Raises
    ------
    DataError
        There is no photograph of a chart, none is found in it, or all exposures clip.
    """
    role = IlluminantFrames.CHART
    frames = part.run.frames(role)
    if not frames:
        raise DataError(
            f"{part.run.folder}: there are no complete '{role}' frames; go on with: labrig resume "
            f"{part.run.folder}"
        )
    # The shortest exposure of a bracket is metered: nothing clips.
    metered = min(frames, key=lambda frame: frame.exposure_s)
    regions = {
        f"{number:02d}": region for number, region in enumerate(find_colour_chart(metered.path))
    }
    patches = lit_patches(part, role, CHART, [lamp], patches=regions)
    return np.array([patch.without_rest().value[0] for _, patch in sorted(patches.items())])
