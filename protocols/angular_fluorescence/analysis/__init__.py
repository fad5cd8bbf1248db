"""Analysis of an angular run: a yarn, or a sphere."""

import math
from collections.abc import Iterator
from dataclasses import replace

from labrig.analyse.inputs import AnalysisContext
from labrig.foundation.result_warning import Disturbance, ResultWarning, Unmeasured
from labrig.protocols.angular_fluorescence.analysis.sphere import sphere_views
from labrig.protocols.angular_fluorescence.analysis.yarn import yarn_views
from labrig.protocols.angular_fluorescence.result import (
    AngularFluorescenceResult,
    SphereViews,
    YarnViews,
)

#: Fraction of reflected light in the signal from which a warning is given.
MUCH_REFLECTED = 0.1


def analyse(context: AnalysisContext) -> AngularFluorescenceResult:
    """Test whether re-radiation depends on angle.

    Raises
    ------
    DataError
        Frames are damaged, no sphere is found, or there are too few views.
    UsageError
        The channels cannot be chosen.
    """
    if context.protocol.shape == "sphere":
        spheres, warnings = sphere_views(context)
        result = AngularFluorescenceResult(spheres=spheres)
    else:
        yarns, warnings = yarn_views(context)
        result = AngularFluorescenceResult(yarns=yarns)
    return replace(result, warnings=(*warnings, *dict.fromkeys(_warnings(result))))


def _warnings(result: AngularFluorescenceResult) -> Iterator[ResultWarning]:
    reradiated = [views for views in result.spheres if views.part == "re-radiated"]
    measured: list[YarnViews | SphereViews] = [*result.yarns, *reradiated]
    for views in measured:
        if math.isnan(views.reflected_at_most):
            yield Unmeasured(
                "reflected-light-unknown",
                "how much of the signal in {channels} is reflected light, which does depend on "
                "angle, is unknown; name centre and fwhm of the LED and the camera's curves in the "
                "rig file",
                subject=views.led,
                channels=tuple(views.channels),
            )
        if views.reflected_at_most > MUCH_REFLECTED:
            yield Disturbance(
                "reflected-light",
                "up to {reflected:.0%} of the signal in {channels} may be reflected light, which "
                "does depend on angle; take an LED of a shorter wavelength",
                subject=views.led,
                reflected=views.reflected_at_most,
                channels=tuple(views.channels),
            )
