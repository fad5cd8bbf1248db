"""A designed material: what it is made of, how it glows, and what could not be had."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from labrig.design.bands import XYZ_OF_RGB, DesignBands
from labrig.design.determined import Conflict, Estimate, visible_conflicts
from labrig.design.energy import emitted_over_absorbed
from labrig.design.glow import captures, emission
from labrig.design.keys import Keys
from labrig.design.light import LightProgramme, steps_to
from labrig.foundation.arrays import FloatArray
from labrig.foundation.notebook_views import CsvTable, NotebookViews
from labrig.material import REFERENCE_Y
from labrig.optics import CIE_1931, delta_e, lab, observer, white_xyz


def key_differences(
    wanted_rgb: FloatArray, got_rgb: FloatArray, luminance: FloatArray
) -> FloatArray:
    """Return colour differences of glows, each judged by an eye that is used to its brightness.

    Both are scaled so that what is wanted has half the luminance of a white under D65, so that a
    faint glow counts as much as a bright one.

    Parameters
    ----------
    wanted_rgb, got_rgb
        Linear sRGB, shape (n, 3).
    luminance
        Luminance of what is wanted, above 0 for black as well, shape (n,).

    Returns
    -------
    ndarray
        ΔE2000, shape (n,).

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.design import key_differences
    >>> wanted = np.array([[0.0, 0.1, 0.0], [0.0, 0.001, 0.0]])
    >>> key_differences(wanted, 1.02 * wanted, luminance=wanted[:, 1] * 0.7152).round(2).tolist()
    [0.46, 0.46]
    """
    scale = (REFERENCE_Y / luminance)[:, np.newaxis]
    white = white_xyz("D65", observer(CIE_1931))
    first, second = (lab(scale * rgb @ XYZ_OF_RGB.T, white) for rgb in (wanted_rgb, got_rgb))
    return np.atleast_1d(delta_e(first, second))


#: Excess of emitted over absorbed light that is rounding.
ROUNDED = 1e-6


@dataclass(frozen=True)
class Impossible:
    """A wish that no material of this kind can meet.

    Attributes
    ----------
    keys
        Indices of the keys that it is about; empty if it is about all of them.
    reason
        One sentence: what was wished for, and why it cannot be.
    nearest
        What is possible instead, in words.
    """

    keys: tuple[int, ...]
    reason: str
    nearest: str

    def __str__(self) -> str:
        return f"{self.reason}; the nearest that is possible is {self.nearest}"


#: Names and units of what each state has in each band.
_OF_A_STATE = (("k_e of state", " (1/s)"), ("Λ of state", ""))


@dataclass(frozen=True, eq=False)
class Design(NotebookViews):
    """The material that best glows as wanted.

    Attributes
    ----------
    programme, keys, bands
        What was wanted, under which light.
    k_r_per_s
        Re-radiation rates in 1/s, falling, shape (states,).
    k_e_per_s
        Excitation rates in 1/s per irradiance, 0 in bands without light, shape (states, bands).
    order
        Kinetic order b of the states.
    reradiation
        Λ in s/sr times the irradiance, shape (states, bands).
    albedo
        Albedo, 0 to 1, shape (bands,).
    cost
        Sum of the weighted squared residuals.
    other_costs
        Costs of the minima that searches in other basins reached, rising.
    estimates
        Parameters with σ, and whether the keys determine them.
    conflicts
        Keys that work against each other, the worst first.
    impossible
        Wishes that no material can meet.
    """

    programme: LightProgramme
    keys: Keys
    bands: DesignBands
    k_r_per_s: FloatArray
    k_e_per_s: FloatArray
    order: float
    reradiation: FloatArray
    albedo: FloatArray
    cost: float
    other_costs: tuple[float, ...]
    estimates: tuple[Estimate, ...]
    conflicts: tuple[Conflict, ...]
    impossible: tuple[Impossible, ...]

    @property
    def n_states(self) -> int:
        """Number of states."""
        return len(self.k_r_per_s)

    def csv_tables(self) -> dict[str, CsvTable]:
        """Return the rates as `states.csv`, and what has a value in each band as `bands.csv`."""
        numbers = range(1, self.n_states + 1)
        head = [f"{name} {number}{unit}" for name, unit in _OF_A_STATE for number in numbers]
        rows = zip(self.bands.names, *self.k_e_per_s, *self.reradiation, self.albedo, strict=True)
        return {
            "states.csv": CsvTable(
                ("state", "k_r (1/s)"), list(zip(numbers, self.k_r_per_s, strict=True))
            ),
            "bands.csv": CsvTable(("band", *head, "albedo"), list(rows)),
        }

    def radiance_at(self, place: ArrayLike, time_s: ArrayLike) -> FloatArray:
        """Return the radiance in the bands, reflected light included.

        Parameters
        ----------
        place
            Numbers of places, shape (n,) or one for all times.
        time_s
            Times in s on the clock of the light programme, shape (n,).

        Returns
        -------
        ndarray
            Radiance in the unit of the irradiance per sr, shape (n, bands).
        """
        times = np.asarray(time_s, dtype=np.float64)
        places = np.broadcast_to(np.asarray(place, dtype=np.intp), times.shape)
        steps = steps_to(self.programme, places, times)
        radiance = self.albedo * self.programme.at(places, times) / np.pi
        glow = emission(steps, len(times), self.k_e_per_s, self.k_r_per_s, self.order).value
        radiance = radiance + glow.T @ self.reradiation
        return radiance

    def rgb_at(self, place: ArrayLike, time_s: ArrayLike) -> FloatArray:
        """Return linear sRGB of the radiance that `radiance_at` returns, per sr, shape (n, 3)."""
        return self.radiance_at(place, time_s) @ self.bands.to_rgb.T

    @cached_property
    def got_rgb(self) -> FloatArray:
        """Linear sRGB at the keys, per sr, shape (keys, 3)."""
        return self.rgb_at(self.keys.place, self.keys.time_s)

    @cached_property
    def delta_e2000(self) -> FloatArray:
        """ΔE2000 of each key, both sides scaled so that it has half a white's luminance (keys,)."""
        return self.differences_to(self.got_rgb)

    @property
    def visible_conflicts(self) -> tuple[Conflict, ...]:
        """The worst conflicts that cost a key a difference that is seen, each pair once."""
        return visible_conflicts(self.conflicts, self.delta_e2000)

    def differences_to(self, rgb: FloatArray) -> FloatArray:
        """Return ΔE2000 of other colours (keys, 3), in linear sRGB per sr, to the wanted ones."""
        luminance = self.keys.screen_luminance(self.bands)
        return key_differences(self.keys.rgb(self.bands), rgb, luminance)

    @cached_property
    def emitted_over_absorbed(self) -> FloatArray:
        """Energy that each place emits after the light of the programme over what it absorbs.

        π ∫∫ L dλ dt over (1 − albedo) ∫∫ E dλ dt, shape (places,); above 1 it is not possible. The
        light counts up to the last key, the glow to its end.
        """
        programme = self.programme
        end = float(self.keys.time_s.max(initial=programme.begin_s[0 if self.keys.count else -1]))
        places = np.arange(programme.n_places)
        ratios = np.zeros(len(places))
        per_state = np.pi * self.reradiation @ self.bands.energy
        for steps in steps_to(programme, places, np.full(len(places), end)):
            light = (1 - self.albedo) * self.bands.energy * steps.irradiance
            absorbed = float(steps.duration_s @ light.sum(axis=1))
            emitted = sum(
                float(energy) * captures(steps, k_e, float(k_r), self.order)
                for energy, k_e, k_r in zip(per_state, self.k_e_per_s, self.k_r_per_s, strict=True)
            )
            # Of no emission nothing has to be absorbed.
            ratios[steps.keys[0]] = emitted / absorbed if absorbed > 0 else np.inf * (emitted > 0)
        return ratios

    def with_cost(self, cost: float) -> "Design":
        """Return the design with another sum of squares."""
        return replace(self, cost=cost)

    @property
    def emitted_over_absorbed_at_most(self) -> float:
        """What weak light makes it emit over what is absorbed of it, in the worst band."""
        ratio = emitted_over_absorbed(
            self.k_e_per_s, self.reradiation, self.albedo, self.bands.energy
        )
        return float(ratio.max(initial=0.0))

    @property
    def keeps_energy(self) -> bool:
        """Whether light of no band, however weak, makes it emit more than is absorbed of it."""
        return self.emitted_over_absorbed_at_most <= 1 + ROUNDED

    def with_impossible(self, impossible: tuple[Impossible, ...]) -> "Design":
        """Return the design with wishes that cannot be met."""
        return replace(self, impossible=impossible)
