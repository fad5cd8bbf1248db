"""Tests whether re-radiated light depends on angle, with their power; shading of spheres."""

from labrig.fit.angular.dependence import detectable_sigmas, fit_dependence, typical
from labrig.fit.angular.shading import (
    NearLight,
    SphereImage,
    fit_shading,
    incidence,
    oren_nayar,
)

__all__ = [
    "NearLight",
    "SphereImage",
    "detectable_sigmas",
    "fit_dependence",
    "fit_shading",
    "incidence",
    "oren_nayar",
    "typical",
]
