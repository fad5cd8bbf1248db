"""Directions in which samples throw light back: yarns under a light that turns, and spheres.

Flat samples also mirror a part of the light, in a lobe as wide as their surface is rough.
Cloth is brighter at its rim than a perfectly diffuse surface, since light is scattered by its
outermost fibres: a part of it follows Lommel's and Seeliger's law.
"""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.arrays import FloatArray
from labrig.foundation.region import region_pixels

from .arrangement import USUAL_LIGHT_DEG, Arrangement
from .simulation import Simulation

#: Angle in degrees by which the light is turned until a yarn reflects 1/e: its sheen.
SHEEN_DEG = 60.0
#: Slope of the facets of a glossy surface, root mean square, in Beckmann's distribution.
ROUGHNESS = 0.12
#: Mirrored light keeps its polarisation: what crossed polarisers pass of it, over diffuse light.
LEAKED = 2e-3
#: Part of the reflected light that follows Lommel's and Seeliger's law.
FIBRES = 0.4
#: Distance of the light from the centre of a sphere, in radii.
LIGHT_RADII = 10.0
#: Stream of random numbers of the placings, beside those of the room.
PLACING_STREAM = 4


class Angles:
    """Brightness of all cells by the angle of the light and by how the sample was put in.

    Parameters
    ----------
    simulation
        Settings of the room.
    patch : ndarray, shape (cells,)
        Sample of every cell, from 1 on; 0 is the cloth.
    """

    def __init__(self, simulation: Simulation, patch: NDArray[np.intp]) -> None:
        self._simulation = simulation
        is_sphere = [False, *(placed.shape == "sphere" for placed in simulation.patches)]
        self._is_sphere = np.array(is_sphere)[patch][:, np.newaxis]

    def reflected(self, arrangement: Arrangement) -> FloatArray:
        """Return the reflected light relative to that of the usual bench, shape (cells, 1)."""
        sheen = np.exp((USUAL_LIGHT_DEG - arrangement.light_deg) / SHEEN_DEG)
        return np.where(self._is_sphere, 1.0, sheen) * self._placed(arrangement)

    def reradiated(self, arrangement: Arrangement) -> FloatArray:
        """Return the re-radiated light relative to that at 0°, shape (cells, 1)."""
        kept = remaining(
            self._simulation.reradiation_anisotropy, np.cos(np.radians(arrangement.light_deg))
        )
        return np.where(self._is_sphere, 1.0, kept) * self._placed(arrangement)

    def mirrored(self, arrangement: Arrangement) -> FloatArray:
        """Return the mirrored light relative to that in the middle of its lobe, shape (cells, 1).

        Half-way between light and camera is the normal of the facets that mirror.
        """
        off_deg = min(abs(arrangement.light_deg / 2 - arrangement.tilt_deg), 89.0)
        lobe = np.exp(-((np.tan(np.radians(off_deg)) / ROUGHNESS) ** 2))
        if self._simulation.polarisers == "crossed":
            lobe *= LEAKED
        return np.where(self._is_sphere, 0.0, lobe) * self._placed(arrangement)

    def _placed(self, arrangement: Arrangement) -> float:
        """Return the brightness by the sample's position: a skewed number, as heights may be."""
        if not self._simulation.repositioning or not arrangement.placing:
            return 1.0
        rng = np.random.default_rng([self._simulation.seed, PLACING_STREAM, arrangement.placing])
        skewed = float(rng.gamma(4.0)) / 2.0 - 2.0
        return 1.0 + self._simulation.repositioning * skewed


def remaining(anisotropy: float, cosine: float | FloatArray) -> FloatArray:
    """Return what remains of re-radiation of which `anisotropy` is lost where the cosine is 0."""
    return np.asarray(1 - anisotropy * (1 - cosine))


class Spheres:
    """Shading of the samples that are spheres, relative to their points that face the camera.

    Attributes
    ----------
    reflected, reradiated : ndarray, shape (height, width)
        Factors of the light that each pixel reflects and re-radiates: 1 beside the spheres'
        regions, 0 in the dark around a sphere.
    """

    def __init__(self, simulation: Simulation) -> None:
        size = simulation.sensor.height, simulation.sensor.width
        self.reflected, self.reradiated = np.ones(size), np.ones(size)
        for placed in simulation.patches:
            if placed.shape != "sphere":
                continue
            x, y, wide, high = region_pixels(placed.region, *size[::-1])
            place = slice(y, y + high), slice(x, x + wide)
            self.reflected[place], self.reradiated[place] = _shading(
                wide, high, simulation.reradiation_anisotropy
            )


@cache
def _shading(width: int, height: int, anisotropy: float) -> tuple[FloatArray, FloatArray]:
    """Return the shading of a sphere in a region, of reflected and of re-radiated light."""
    radius = min(width, height) / 2
    across = (np.arange(width) + 0.5 - width / 2) / radius
    down = (np.arange(height) + 0.5 - height / 2)[:, np.newaxis] / radius
    from_axis2 = across**2 + down**2
    to_camera = np.sqrt(np.maximum(1 - from_axis2, 0.0))
    turned = np.radians(USUAL_LIGHT_DEG)
    light_x, light_z = -LIGHT_RADII * np.sin(turned), LIGHT_RADII * np.cos(turned)
    to_x, to_z = light_x - across, light_z - to_camera
    distance = np.sqrt(to_x**2 + down**2 + to_z**2)
    to_light = np.maximum((across * to_x - down**2 + to_camera * to_z) / distance, 0.0)
    facing = np.hypot(light_x, light_z - 1)
    facing_to_light = (light_z - 1) / facing
    lit = to_light / facing_to_light * (facing / distance) ** 2 * (from_axis2 < 1)
    at_rim = (facing_to_light + 1) / np.maximum(to_light + to_camera, 1e-6)
    return lit * (1 - FIBRES + FIBRES * at_rim), lit * remaining(anisotropy, to_camera)
