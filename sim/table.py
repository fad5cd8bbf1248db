"""The table before lamp and camera: samples, their surfaces, and how the camera sees them."""

from dataclasses import dataclass
from typing import Self

from .angles import Spheres
from .layout import Layout
from .samples import Samples
from .simulation import Simulation
from .surfaces import Surfaces
from .view import View


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
