"""The glow through colour filters before the camera, one charge for each, as one frame.

Filters and channels are broad, so that they tell a smooth spectrum only. What else differs from
filter to filter is the brightness: every filter is seen after a charge of its own. It is taken from
the glow without a filter, before the filters and after them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from labrig.analyse.combined_frames import combined
from labrig.analyse.exciting_lights import FILTER_NM, FILTER_SIGMA
from labrig.analyse.forward_model import KNOTS_NM, ForwardModel, channel_curves
from labrig.analyse.inputs import Part
from labrig.analyse.place_reduction import PatchReduction
from labrig.analyse.strip import StripPatch, strip_regions
from labrig.bench_optics import filter_transmittances
from labrig.fit.spectrum import CurveError, SpectralSystem, camera_modes
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError
from labrig.optics import Spectrum, Transmittance, hat_functions, quadrature
from labrig.protocols.emission_spectrum.protocol import (
    AFTERWARDS,
    BEFORE,
    CameraFilters,
    glow_unit,
    white_unit,
)
from labrig.reduce import FLICKER, SeriesFrame, sensor_layout
from labrig.results import FilterFrames

#: Name of the only place of a patch.
PLACE = "sample"
#: σ of what a filter lets through far from its own band.
LEAKAGE = 1e-4
#: Least relative σ of the glow after one charge over that after another.
REPEATED = 0.01
#: Change of the glow from the first charge to the last that causes a warning.
NOTABLE = 0.05
#: Relative difference of times at which photographs belong together.
SAME_TIME = 0.2


@dataclass(frozen=True, eq=False)
class CameraFilterModel(ForwardModel):
    """Model of the values of the glow without a filter and with each, by channel.

    Attributes
    ----------
    filters
        Transmittances of the filters; None where there is none.
    """

    filters: tuple[Transmittance | None, ...] = ()

    @property
    def centre_nm(self) -> FloatArray:
        """Mean wavelength of filter and channel in nm, shape (filters · channels,)."""
        design = self.system.design
        return np.asarray(design @ self.system.knots_nm / design.sum(axis=1))

    def expected_of(self, light: Spectrum) -> FloatArray:
        """Return the values of a light by the model, shape (filters · channels,)."""
        camera = self.camera
        low, high = float(camera.wavelength_nm[0]), float(camera.wavelength_nm[-1])
        knots = [one.wavelength_nm for one in self.filters if one is not None]
        nodes, weights = quadrature(low, high, camera.wavelength_nm, light.wavelength_nm, *knots)
        seen = (weights * light.at(nodes))[:, np.newaxis] * camera.at(nodes)
        return np.concatenate([_passed(each, nodes) @ seen for each in self.filters])


def filter_models(
    part: Part, select: CameraFilters, frame: SeriesFrame
) -> dict[StripPatch, ForwardModel]:
    """Return the model of every patch of a part.

    Parameters
    ----------
    part
        Part of a run.
    select
        Filters of the part's protocol.
    frame
        Any of the part's frames, for the camera's channels.

    Raises
    ------
    UsageError
        There is no file of a filter, or there are no camera curves.
    """
    camera = channel_curves(part, sensor_layout(frame).channels)
    filters = (None, *filter_transmittances(part.rig, select.filters))
    knots = [one.wavelength_nm for one in filters if one is not None]
    nodes, weights = quadrature(
        float(KNOTS_NM[0]), float(KNOTS_NM[-1]), camera.wavelength_nm, KNOTS_NM, *knots
    )
    onto_knots = weights[:, np.newaxis] * hat_functions(KNOTS_NM, nodes)
    sensitivity = camera.at(nodes)
    passed = np.array([_passed(each, nodes) for each in filters])

    def design(transmission: FloatArray, curves: FloatArray) -> FloatArray:
        """Return the design matrix (filters · channels, knots)."""
        seen = transmission[:, np.newaxis] * curves.T
        return np.asarray(seen.reshape(-1, len(nodes)) @ onto_knots)

    modes = [design(passed, error) for error in camera_modes(camera, nodes, CurveError())]
    for number, each in enumerate(filters):
        if each is not None:
            modes += [
                design(change, sensitivity) for change in _changes(number, each, passed, nodes)
            ]
    system = SpectralSystem(KNOTS_NM, design(passed, sensitivity), np.array(modes))
    return {
        patch: CameraFilterModel(
            slices={PLACE: patch.region or part.protocol.region},
            holder={},
            camera=camera,
            system=system,
            filters=filters,
        )
        for patch in strip_regions(part)
    }


def _passed(transmittance: Transmittance | None, nodes: FloatArray) -> FloatArray:
    return np.ones(len(nodes)) if transmittance is None else transmittance.at(nodes)


def _changes(
    number: int, transmittance: Transmittance, passed: FloatArray, nodes: FloatArray
) -> list[FloatArray]:
    """Return changes (filters, q) by one σ of a filter's height, wavelengths and leakage."""
    own = passed[number]
    moved = transmittance.at(nodes - FILTER_NM) - own
    changes = []
    for change in (FILTER_SIGMA * own, moved, np.full(len(nodes), LEAKAGE)):
        changes.append(np.zeros_like(passed))
        changes[-1][number] = change
    return changes


@dataclass(frozen=True, eq=False)
class GlowThroughFilters:
    """The glow after the charges by one lamp.

    Attributes
    ----------
    frames
        Values without a filter and with each, at one brightness, a row for each time.
    change
        Brightness after the last charge over that after the first, less 1.
    """

    frames: FilterFrames
    change: float

    @property
    def repeated_sigma(self) -> float:
        """Relative σ of the brightness from filter to filter."""
        return float(np.hypot(REPEATED, self.change / 2))


def glow_through_filters(
    reduction: PatchReduction, lamp: str, select: CameraFilters
) -> GlowThroughFilters:
    """Return the glow after the charges by a lamp.

    What changes from charge to charge, since something is left of those before or the lamp warms
    up, is taken to change evenly.

    Raises
    ------
    DataError
        The frames of a filter are missing.
    """
    scenes = {scene: reduction.of_unit(glow_unit(lamp, scene)) for scene in select.scenes()}
    first, last = scenes[BEFORE], scenes.pop(AFTERWARDS)
    both = combined(_side_by_side([first, _at_times(last, first.t_s)]))
    channels = len(both.value) // 2
    before, after = both.value[:channels], both.value[channels:]
    weight = np.nan_to_num(before / both.sigma[:channels] ** 2)
    change = float(weight @ np.nan_to_num(after) / (weight @ np.nan_to_num(before))) - 1
    brightness = {
        scene: 1 + change * number / (len(select.filters) + 1)
        for number, scene in enumerate(scenes)
    }
    columns = [
        _scaled(_at_times(frames, first.t_s), 1 / brightness[scene])
        for scene, frames in scenes.items()
    ]
    return GlowThroughFilters(_side_by_side(columns), change)


def white_through_filters(reduction: PatchReduction, select: CameraFilters) -> FilterFrames:
    """Return the light of the card without a filter and with each, one row of all exposures.

    Raises
    ------
    DataError
        The frames of a filter are missing.
    """
    scenes = [reduction.of_unit(white_unit(name)) for name in (BEFORE, *select.filters)]
    value, sigma = np.concatenate([_steady(frames) for frames in scenes], axis=1)
    no_common = np.zeros((1, len(value)))
    return FilterFrames(np.zeros(1), value[np.newaxis], sigma[np.newaxis], no_common)


def _steady(frames: FilterFrames) -> FloatArray:
    """Return the weighted mean of frames of a steady light and its σ, (2, m); NaN if all clip."""
    variance = frames.sigma_dn_per_s**2 + frames.dark_sigma_dn_per_s**2
    is_known = np.isfinite(variance) & np.isfinite(frames.value_dn_per_s)
    weight = np.where(is_known, 1 / np.where(is_known, variance, 1.0), 0.0)
    total = weight.sum(axis=0)
    none = total == 0
    total[none] = np.nan
    mean = (weight * np.nan_to_num(frames.value_dn_per_s)).sum(axis=0) / total
    return np.stack([mean, 1 / np.sqrt(total)])


def with_repeats(model: ForwardModel, sigma: float) -> ForwardModel:
    """Return the model with errors of the brightness from filter to filter.

    Parameters
    ----------
    model
        Model of the values through filters.
    sigma
        Relative σ of the brightness after one charge over that after another.
    """
    system = model.system
    channels = len(model.camera.channels)
    modes = []
    for begin in range(0, len(system.design), channels):
        mode = np.zeros_like(system.design)
        mode[begin : begin + channels] = sigma * system.design[begin : begin + channels]
        modes.append(mode)
    return replace(model, system=replace(system, modes=np.concatenate([system.modes, modes])))


def repeat_warnings(glows: Mapping[str, GlowThroughFilters]) -> list[str]:
    """Return a line for each lamp after whose charges the glow changed much."""
    return [
        f"after the last charge by the {lamp} lamp the sample glowed {100 * glow.change:+.0f} % as "
        "compared with the first: filters are compared by a brightness between; charge for longer, "
        "or let the sample rest until it is dark"
        for lamp, glow in glows.items()
        if abs(glow.change) > NOTABLE
    ]


def _at_times(frames: FilterFrames, t_s: FloatArray) -> FilterFrames:
    """Return the frame at each of some times; NaN where there is none.

    Raises
    ------
    DataError
        There is none at all.
    """
    rows = [int(np.argmin(np.abs(frames.t_s - each))) for each in t_s.tolist()]
    found = frames.take(rows)
    is_there = np.abs(found.t_s - t_s) < SAME_TIME * t_s
    if not is_there.any():
        raise DataError(
            "expected photographs through every filter at the times of those without, got others; "
            "was the run changed?"
        )
    value = np.where(is_there[:, np.newaxis], found.value_dn_per_s, np.nan)
    # The lamp flickers while it charges, and so does the shutter.
    sigma = np.hypot(found.sigma_dn_per_s, FLICKER * np.nan_to_num(value))
    return replace(found, t_s=t_s, value_dn_per_s=value, sigma_dn_per_s=sigma)


def _scaled(frames: FilterFrames, factor: float) -> FilterFrames:
    return replace(
        frames,
        value_dn_per_s=factor * frames.value_dn_per_s,
        sigma_dn_per_s=factor * frames.sigma_dn_per_s,
        dark_sigma_dn_per_s=factor * frames.dark_sigma_dn_per_s,
    )


def _side_by_side(parts: Sequence[FilterFrames]) -> FilterFrames:
    """Return frames of the same times as frames with the values of all."""
    columns = [
        np.concatenate([getattr(part, name) for part in parts], axis=1)
        for name in ("value_dn_per_s", "sigma_dn_per_s", "dark_sigma_dn_per_s")
    ]
    return FilterFrames(parts[0].t_s, *columns)
