"""The camera's view of the bench: glow, and light reflected by samples, cards, door, cloth."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from labrig.foundation.arrays import FloatArray

from .angles import Angles, Spheres
from .arrangement import Arrangement
from .cards import brightened, reflectances
from .layout import Layout, Lvf, Places
from .lights import VisibleLight
from .optics import CLOTH_REFLECTANCE, REFLECTED
from .samples import Samples
from .sensor import BAYER_RGGB
from .simulation import Simulation
from .surfaces import Surfaces


class View:
    """The path of the light from the bench into the lens.

    Parameters
    ----------
    simulation
        Settings of the room.
    layout
        Layout of the picture.
    surfaces
        Surfaces of the samples.
    """

    def __init__(self, simulation: Simulation, layout: Layout, surfaces: Surfaces) -> None:
        self._simulation = simulation
        self._layout = layout
        self._surfaces = surfaces
        self._angles = Angles(simulation, layout.patch)
        self._reflected = REFLECTED * simulation.lamp.irradiance
        self._lvf = None if simulation.lvf is None else Lvf(simulation.lvf)

    def radiance_s(
        self,
        arrangement: Arrangement,
        glow_s: FloatArray,
        reflected: VisibleLight,
        opened: float = 1.0,
    ) -> FloatArray:
        """Return ∫ radiance dt of all places of an arrangement, shape (places, wavelengths).

        Parameters
        ----------
        arrangement
            Arrangement of the bench, which does not change meanwhile.
        glow_s : ndarray, shape (cells, wavelengths)
            ∫ visible glow dt of each cell.
        reflected
            Light that the camera sees by reflection.
        opened
            Fraction of the samples that the camera sees.
        """
        places = self._layout.places(arrangement)
        radiance = self._uncovered_and_covered(arrangement, places, glow_s, reflected)
        if self._simulation.inter_reflection:
            light = self._from_all_surfaces(radiance, places)
            again = VisibleLight(np.zeros_like(light), opened * light, (1 - opened) * light, light)
            dark_s = np.zeros_like(glow_s)
            radiance += self._uncovered_and_covered(arrangement, places, dark_s, again)
        through = self._layout.looked_through(arrangement)
        if through == "away":
            return radiance
        settings = self._simulation.lvf
        assert settings is not None
        assert self._lvf is not None
        strip = settings.on_sample if through == "on sample" else settings.before_camera
        radiance *= self._lvf.seen(strip, arrangement.turned)[places.piece]
        return radiance

    def reradiated_s(self, arrangement: Arrangement, reflected: VisibleLight) -> FloatArray:
        """Return the part of `radiance_s` that uncovered samples re-radiate at once."""
        from_lamp, stray, _ = self._on_samples(arrangement, reflected)
        reradiated = self._surfaces.reradiated(from_lamp + stray, self._layout.patch)
        seen: FloatArray = self._reflected * self._angles.reradiated(arrangement) * reradiated
        return seen[self._layout.places(arrangement).cell]

    def _uncovered_and_covered(
        self, arrangement: Arrangement, places: Places, glow_s: FloatArray, reflected: VisibleLight
    ) -> FloatArray:
        """Return ∫ radiance dt of all places before a filter at the lens."""
        radiance = self._samples(arrangement, glow_s, reflected)[places.cell]
        self._cover(radiance, arrangement, places, reflected)
        return radiance

    def _from_all_surfaces(self, radiance: FloatArray, places: Places) -> FloatArray:
        """Return the light that all surfaces in the frame throw on each, shape (wavelengths,)."""
        pixels = np.bincount(places.painted.ravel() // len(BAYER_RGGB), minlength=len(radiance))
        mean: FloatArray = pixels @ radiance / pixels.sum()
        return self._simulation.inter_reflection * mean / self._reflected

    def _samples(
        self, arrangement: Arrangement, glow_s: FloatArray, reflected: VisibleLight
    ) -> FloatArray:
        """Return the radiance of uncovered cells, shape (cells, wavelengths); cell 0 is cloth."""
        from_lamp, stray, door = self._on_samples(arrangement, reflected)
        is_blank = arrangement.card == "blank"
        radiance: FloatArray = glow_s * (
            0.0 if is_blank else self._turned_away(arrangement.tilt_deg)
        )
        # Most photographs of a decay are taken in the dark.
        if from_lamp.any() or stray.any() or door.any():
            thrown_back = self._thrown_back(arrangement, from_lamp, stray)
            radiance += self._reflected * (thrown_back + CLOTH_REFLECTANCE * door)
        radiance[0] = self._reflected * CLOTH_REFLECTANCE * reflected.cloth
        return radiance

    def _thrown_back(
        self, arrangement: Arrangement, from_lamp: FloatArray, stray: FloatArray
    ) -> FloatArray:
        """Return the light that comes back from uncovered cells, as from a white."""
        light = from_lamp + stray
        if arrangement.lvf == "on sample":
            passed = self._below_lvf(arrangement.turned)[self._layout.piece]
            light = passed * from_lamp + stray
        if arrangement.card == "blank":
            blank: FloatArray = reflectances("blank", self._simulation.grey_card)[1] * light
            return blank
        by_reflection = self._surfaces.reflected(light, self._layout.patch)
        by_reradiation = self._surfaces.reradiated(light, self._layout.patch)
        thrown_back = self._angles.reflected(arrangement) * by_reflection
        thrown_back += self._angles.reradiated(arrangement) * by_reradiation
        by_gloss = self._surfaces.mirrored(light, self._layout.patch)
        thrown_back += self._angles.mirrored(arrangement) * by_gloss
        return np.maximum(thrown_back, 0.0)

    def _on_samples(
        self, arrangement: Arrangement, reflected: VisibleLight
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the light from lamp and room on the samples, and that on the door over them."""
        if arrangement.card == "lit sample" and self._simulation.door is not None:
            return reflected.door, np.zeros_like(reflected.door), np.zeros_like(reflected.door)
        return reflected.sample, reflected.sample_stray, reflected.door

    def _cover(
        self,
        radiance: FloatArray,
        arrangement: Arrangement,
        places: Places,
        reflected: VisibleLight,
    ) -> None:
        """Lay a card on the door's outside, or without a door on everything."""
        covered = places.surface > 0
        if not covered.any():
            return
        card = reflectances(arrangement.card, self._simulation.grey_card)[places.surface[covered]]
        light = reflected.cloth if self._simulation.door is None else reflected.door
        on_card = np.broadcast_to(light, card.shape)
        if arrangement.lvf == "on sample":
            # The filter lies on the card as it would on the sample.
            piece = self._layout.piece[places.cell[covered]]
            on_card = self._below_lvf(arrangement.turned)[piece] * light
        thrown_back = card * on_card
        if arrangement.card == "grey card" and self._simulation.grey_card_fluorescence:
            glowing = brightened(on_card, self._simulation.grey_card_fluorescence)
            is_card = np.asarray(places.surface[covered] == 1)
            thrown_back += np.where(is_card[:, np.newaxis], glowing, 0.0)
        if self._simulation.door is None:
            radiance[covered] = self._reflected * thrown_back
        else:
            # What the closed door hides is what the card hides, and the door's own outside.
            radiance[covered] += self._reflected * (thrown_back - CLOTH_REFLECTANCE * light)

    def _turned_away(self, tilt_deg: int) -> float:
        """Return the radiance of a sample relative to one that faces the camera."""
        return float(1 - self._simulation.anisotropy * (1 - np.cos(np.radians(tilt_deg))))

    def _below_lvf(self, turned: bool) -> FloatArray:
        """Return the light below the pieces of the LVF on the sample, (pieces, wavelengths)."""
        settings = self._simulation.lvf
        assert settings is not None
        assert self._lvf is not None
        return self._lvf.below(settings.on_sample, turned)


@dataclass(frozen=True)
class Table:
    """The samples on the table, or on one place of the sample changer.

    Attributes
    ----------
    simulation
        Settings of the room with these samples.
    layout
        Layout of the picture.
    samples
        States of the samples.
    surfaces
        Surfaces of the samples.
    view
        The camera's view of them.
    spheres
        Shading of spheres; None if there are none.
    """

    simulation: Simulation
    layout: Layout
    samples: Samples
    surfaces: Surfaces
    view: View
    spheres: Spheres | None

    @classmethod
    def of(cls, simulation: Simulation, place: int | None = None, leak: float = 0.0) -> Self:
        """Return the table with the samples of a room.

        Parameters
        ----------
        simulation
            Settings of the room.
        place
            Place of the sample changer, from 1 on; 0 is the empty one, None: there is no changer.
        leak
            Light that reaches the samples while they are not in place, as a fraction.

        Raises
        ------
        UsageError
            A material does not exist or cannot glow, or a patch is outside the frame.
        """
        layout = Layout(simulation)
        samples = Samples(simulation, layout, place, leak)
        prompt = [patch.prompt for patch in simulation.patches]
        surfaces = Surfaces(samples.materials, simulation.gloss, prompt)
        has_sphere = any(patch.shape == "sphere" for patch in simulation.patches)
        return cls(
            simulation,
            layout,
            samples,
            surfaces,
            View(simulation, layout, surfaces),
            Spheres(simulation) if has_sphere else None,
        )
