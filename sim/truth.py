"""True parameters of the simulated room, which labrig has to find: for tests, never for a fit."""

import math
from pathlib import Path

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.foundation.models import FrozenModel
from labrig.foundation.output_file import write_text
from labrig.material import Material

from .bench_settings import StripSettings
from .kinetics import KineticsSettings
from .layout import Layout, Lvf, in_pixels
from .samples import Samples
from .simulation import Simulation

#: Places along the LVF's strip, as many as the paper takes.
SLICES = 31


class TrueState(FrozenModel):
    """One state of a patch.

    Attributes
    ----------
    k_r_per_s
        Re-radiation rate in 1/s, at the room's temperature at lamp off; with `kinetics` that of the
        material's file, for traps of the usual depth.
    k_e_per_s, reradiation
        Excitation rate and Λ of every band, as in the material's file.
    emission
        Λ on the room's `wavelength_nm`.
    concentration
        r at the moment of the last lamp off; null if the lamp was never switched off. Where an LVF
        has lain on the patch, the mean over its pixels; of `kinetics` the mean over all traps. So
        is the amplitude.
    amplitude_dn_per_s
        Signal of the state in R, G, B per second of exposure, extrapolated from the dark back to
        lamp off (the fade charges a little more), in the middle of the lens. Of traps that do not
        decay exponentially: the signal at lamp off if it had become dark at once.
    """

    k_r_per_s: float
    k_e_per_s: tuple[float, ...] | None
    reradiation: tuple[float, ...] | None
    emission: tuple[float, ...]
    concentration: float | None
    amplitude_dn_per_s: tuple[float, float, float] | None


class TruePatch(FrozenModel):
    """One sample and its states by falling rate; a fluorescent material has none.

    Attributes
    ----------
    kinetics
        Law of its traps; null: the rate equation, of the order in the material's file.
    """

    material: str
    region: tuple[float, float, float, float]
    bands_nm: tuple[float, ...] | None
    kinetics: KineticsSettings | None
    states: tuple[TrueState, ...]


class TrueStrip(FrozenModel):
    """The strip of the LVF in the picture, in pixels.

    Attributes
    ----------
    left, right
        x and y of the ends of its centre line.
    height
        Height of the strip across that line.
    rising
        Whether the wavelength rises from left to right.
    """

    left: tuple[float, float]
    right: tuple[float, float]
    height: float
    rising: bool


class TrueLvf(FrozenModel):
    """The linear variable filter.

    Attributes
    ----------
    u
        31 places along the strip: middles of even slices from its blue end, 0, to its red, 1.
    centre_nm, fwhm_nm
        Middle and full width at half maximum of the pass band in nm, the leakage subtracted.
    transmission
        Transmittance at these places, on the room's `wavelength_nm`.
    """

    u: tuple[float, ...]
    centre_nm: tuple[float, ...]
    fwhm_nm: tuple[float, ...]
    transmission: tuple[tuple[float, ...], ...]
    before_camera: TrueStrip
    on_sample: TrueStrip


class Truth(FrozenModel):
    """The room's parameters.

    Attributes
    ----------
    lamp_off_s
        Time of the last lamp off on the room's clock.
    iso, f_number
        Sensitivity and aperture to which the amplitudes belong.
    sensitivity
        Rows R, G, B of the camera's own curves on `wavelength_nm`.
    lamp_irradiance
        Relative spectral irradiance of the warm, new lamp on `wavelength_nm`.
    lvf
        The linear variable filter; null where there is none.
    """

    lamp_off_s: float | None
    iso: int
    f_number: float
    patches: tuple[TruePatch, ...]
    wavelength_nm: tuple[float, ...]
    sensitivity: tuple[tuple[float, ...], ...]
    lamp_irradiance: tuple[float, ...]
    lvf: TrueLvf | None

    def write(self, path: Path) -> None:
        """Write the parameters as JSON, which can be read back: of kinetics the keys given."""
        text = self.model_dump_json(indent=1, exclude_unset=True)
        write_text(path, f"{text}\n")


def true_patches(
    simulation: Simulation,
    samples: Samples,
    layout: Layout,
    level: FloatArray | None,
    effective: FloatArray | None,
    dn_per_s: FloatArray,
    faster: float,
) -> tuple[TruePatch, ...]:
    """Return all patches of the room.

    Parameters
    ----------
    level, effective : ndarray, shape (states,)
        Concentrations at lamp off, and those extrapolated from the dark.
    dn_per_s : ndarray, shape (states, 3)
        Signal of the states at r = 1 in DN/s.
    faster
        Factor of the room's temperature on their rates.
    """
    return tuple(
        TruePatch(
            material=material.name,
            region=placed.region,
            bands_nm=material.bands_nm if isinstance(material, Material) else None,
            kinetics=placed.kinetics,
            states=_true_states(
                number, material, samples, layout, level, effective, dn_per_s, faster
            )
            if isinstance(material, Material)
            else (),
        )
        for number, (placed, material) in enumerate(
            zip(simulation.patches, samples.materials, strict=True), start=1
        )
    )


def _true_states(
    number: int,
    material: Material,
    samples: Samples,
    layout: Layout,
    level: FloatArray | None,
    effective: FloatArray | None,
    dn_per_s: FloatArray,
    faster: float,
) -> tuple[TrueState, ...]:
    cells = np.flatnonzero(layout.patch == number)
    pixels = layout.pixels[cells]
    weight = pixels / pixels.sum() if pixels.any() else np.full(len(cells), 1 / len(cells))
    # One row a state, or one of the traps of which it consists; one column a cell.
    index = np.flatnonzero(np.isin(samples.cells.patch, cells)).reshape(len(cells), -1).T
    k_r, share = samples.cells.k_r_per_s[index[:, 0]], samples.share[index[:, 0]]
    state_of = samples.state[index[:, 0]] - samples.state[index[0, 0]]
    rates = np.array([state.k_r_per_s for state in material.states])
    states = []
    for rank in np.argsort(-rates, kind="stable").tolist():
        rows, state = np.flatnonzero(state_of == rank), material.states[rank]
        amplitude = None
        if effective is not None:
            red, green, blue = sum(
                dn_per_s[index[row, 0]] * float(weight @ effective[index[row]]) for row in rows
            )
            amplitude = (red, green, blue)
        concentration = None
        if level is not None:
            concentration = sum(share[row] * float(weight @ level[index[row]]) for row in rows)
        emission = samples.radiance_at_one[index[rows[0], 0]] / (k_r * share)[rows[0]]
        states.append(
            TrueState(
                k_r_per_s=faster * rates[rank],
                k_e_per_s=state.k_e_per_s,
                reradiation=state.reradiation,
                emission=tuple(emission),
                concentration=concentration,
                amplitude_dn_per_s=amplitude,
            )
        )
    return tuple(states)


def true_lvf(simulation: Simulation) -> TrueLvf | None:
    """Return the room's LVF."""
    settings = simulation.lvf
    if settings is None:
        return None
    u = (np.arange(SLICES) + 0.5) / SLICES
    fine_nm = np.linspace(300.0, 900.0, 12001)
    passed = Lvf(settings).transmission(u, fine_nm) - settings.leakage
    above = [fine_nm[row >= row.max() / 2] for row in passed]
    size = simulation.sensor.width, simulation.sensor.height
    return TrueLvf(
        u=tuple(u),
        centre_nm=tuple((nm[0] + nm[-1]) / 2 for nm in above),
        fwhm_nm=tuple(nm[-1] - nm[0] for nm in above),
        transmission=tuple(tuple(row) for row in Lvf(settings).transmission(u)),
        before_camera=_true_strip(settings.before_camera, *size),
        on_sample=_true_strip(settings.on_sample, *size),
    )


def _true_strip(strip: StripSettings, width: int, height: int) -> TrueStrip:
    x, y, wide, high = in_pixels(strip.region, width, height)
    half = np.array([math.cos(math.radians(strip.tilt)), math.sin(math.radians(strip.tilt))])
    half *= wide / 2
    middle = np.array([x + wide / 2, y + high / 2])
    (left, upper), (right, lower) = middle - half, middle + half
    return TrueStrip(left=(left, upper), right=(right, lower), height=high, rising=strip.rising)
