"""Published colours of a chart under a lamp, and what errors do to measured ones."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from labrig.fit.camera_curves import ADDED, COURSE, COURSE_NM, LEVEL
from labrig.fit.spectrum import CurveError, smooth_modes
from labrig.foundation.arrays import FloatArray
from labrig.optics import (
    CHART_PATCHES,
    CIE_1931,
    CameraResponse,
    Spectrum,
    Transmittance,
    delta_e,
    lab,
    observer,
    white_xyz,
)
from labrig.protocols.colour_check.result import CheckedColour, ColourSummary

#: Wavelengths in nm of sums over spectra.
GRID_NM: FloatArray = np.arange(380.0, 781.0, 5.0)
#: Number of draws of errors, and parts of the draws that are allowed: of one patch, of the mean.
DRAWS, OF_A_PATCH, OF_THE_MEAN = 400, 0.95, 0.995
#: Distance in nm over which estimated curves err together.
CURVES_NM = 40.0


@dataclass(frozen=True, eq=False)
class PublishedChart:
    """Colours of a chart under a lamp.

    Attributes
    ----------
    reflectance
        Reflectances on `GRID_NM`, shape (p, n).
    light
        The lamp on `GRID_NM`, shape (n,).
    seen
        x̄, ȳ, z̄ times the light, on the scale on which a perfect white has Y = 1, shape (n, 3).
    """

    reflectance: FloatArray
    light: FloatArray
    seen: FloatArray

    @classmethod
    def under(cls, patches: Sequence[Transmittance], lamp: Spectrum) -> "PublishedChart":
        """Return the colours of patches under a lamp."""
        eye = observer(CIE_1931)
        functions = np.array([np.interp(GRID_NM, eye.wavelength_nm, f) for f in eye.functions.T]).T
        light = lamp.at(GRID_NM)
        seen = light[:, np.newaxis] * functions
        reflectance = np.array([patch.at(GRID_NM) for patch in patches])
        return cls(reflectance, light, seen / seen[:, 1].sum())

    @property
    def white(self) -> FloatArray:
        """X, Y, Z of a perfect white, shape (3,)."""
        return np.asarray(self.seen.sum(axis=0))

    @property
    def xyz(self) -> FloatArray:
        """X, Y, Z of the patches, shape (p, 3)."""
        return np.asarray(self.reflectance @ self.seen)

    def lab(self, xyz: FloatArray) -> FloatArray:
        """Return L*, a*, b* of X, Y, Z (…, 3)."""
        return lab(np.maximum(xyz, 0.0), self.white)

    def picture(self, xyz: FloatArray) -> FloatArray:
        """Return X, Y, Z (…, 3) on a screen on which the white is the screen's."""
        screen = white_xyz("D65", observer(CIE_1931))
        return np.asarray(np.maximum(xyz, 0.0) / self.white * screen)

    def own_reflectances(
        self, rng: np.random.Generator, draws: int, rows: slice = slice(None)
    ) -> FloatArray:
        """Draw the reflectances of patches of one's own chart, shape (draws, p, n)."""
        known = self.reflectance[rows]
        smooth = smooth_modes(GRID_NM, COURSE_NM)
        courses, added = rng.standard_normal((2, draws, len(known), len(smooth))) @ smooth
        level = rng.standard_normal((draws, len(known), 1))
        relative = 1 + LEVEL * level + COURSE * courses
        return np.asarray(np.maximum(known * relative + ADDED * added, 0.0))


def drawn_curves(camera: CameraResponse, rng: np.random.Generator, draws: int) -> FloatArray:
    """Draw curves of a camera with their errors on `GRID_NM`, shape (draws, n, k).

    Curves without σ err as those of one camera by several laboratories do.
    """
    curves = camera.at(GRID_NM)
    if camera.sigma is None:
        error, peak = CurveError(), curves.max(axis=0)
        smooth = smooth_modes(GRID_NM, error.correlation_nm)
        shape = (2, draws, curves.shape[1], len(smooth))
        relative, added = np.swapaxes(rng.standard_normal(shape) @ smooth, 2, 3)
        changed = curves * (1 + error.relative * relative) + error.added * peak * added
        return np.asarray(np.maximum(changed, 0.0))
    smooth = smooth_modes(GRID_NM, CURVES_NM)
    courses = rng.standard_normal((draws, curves.shape[1], len(smooth))) @ smooth
    sigma = np.array([np.interp(GRID_NM, camera.wavelength_nm, s) for s in camera.sigma.T]).T
    return np.asarray(np.maximum(curves + sigma * np.swapaxes(courses, 1, 2), 0.0))


def checked(
    chart: PublishedChart, rows: Sequence[int], xyz: FloatArray, drawn: FloatArray
) -> tuple[dict[int, CheckedColour], ColourSummary]:
    """Compare measured colours with the published ones.

    Parameters
    ----------
    chart
        The published chart.
    rows
        Patches that were measured.
    xyz
        X, Y, Z of each as measured, shape (r, 3).
    drawn
        X, Y, Z as errors alone would make them, shape (draws, r, 3).
    """
    published = chart.lab(chart.xyz[list(rows)])
    measured = chart.lab(xyz)
    off = delta_e(measured, published)
    by_errors = delta_e(chart.lab(drawn), np.broadcast_to(published, drawn.shape))
    allowed = np.quantile(by_errors, OF_A_PATCH, axis=0)
    mean_allowed = float(np.quantile(by_errors.mean(axis=1), OF_THE_MEAN))
    pictures = chart.picture(xyz)
    colours = {
        row: CheckedColour(measured[n], pictures[n], float(off[n]), float(allowed[n]))
        for n, row in enumerate(rows)
    }
    beyond = tuple(CHART_PATCHES[row] for n, row in enumerate(rows) if off[n] > allowed[n])
    summary = ColourSummary(
        mean=float(off.mean()),
        largest=float(off.max()),
        allowed=mean_allowed,
        worst=CHART_PATCHES[rows[int(off.argmax())]],
        beyond=beyond,
        verdict="agrees" if off.mean() <= mean_allowed else "differs",
    )
    return colours, summary
