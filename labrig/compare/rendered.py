"""The dark room of a run, rendered through the measured camera, beside its photographs.

What is compared is glow over reflected light: the photographs' by the settings of the camera, the
rendering's by the measured curves, whose channels have the ratios of the card under the lamp. The
dark room of the run's material is charged by the lamp as the journal says; beside it are the sums
of one, two and three exponentials and Becquerel's law that were fitted to the decay, whose
brightness is fitted, too.
"""

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from labrig.acquire import read_result_rig
from labrig.bench_optics import with_shipped_camera
from labrig.calibration import shutter_sigma
from labrig.compare.glow import GlowComparison, compare_scaled, glow_sigma
from labrig.compare.nalbach2017 import emission
from labrig.compare.photographed_room import SAMPLE, DarkRoomScene, PhotographedRoom, ReflectedLight
from labrig.compare.rendered_lamps import LampsComparison
from labrig.compare.rendered_states import MEASURED, FittedGlow, RenderedBench, SeenPatch
from labrig.compare.residuals import Refit, fits_by_states
from labrig.compare.run import MeasuredPatch, measured_camera, read_patches, references_by_patch
from labrig.compare.viewing import DEFAULT_WHITE, Viewing, viewing
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError, UsageError
from labrig.foundation.output_file import make_folder
from labrig.foundation.result_warning import ResultWarning, Unmeasured
from labrig.material import Material
from labrig.record import read_run
from labrig.reproduce import Assumptions
from labrig.results import (
    ChainResult,
    RunResult,
    Series,
    read_result,
    write_csv,
)

#: Lightness of the photographed patch.
LIGHTNESS = 50.0


@dataclass(frozen=True, eq=False)
class GlowRatio:
    """Glow over reflected light in one channel, photographed and rendered.

    Attributes
    ----------
    channel
        Name of the channel, in which the glow is brightest.
    reflected_by
        What was lit by the lamp: the sample or the grey card.
    photographed, photographed_sigma
        Ratio of each photograph and σ, shape (n,).
    rendered, rendered_sigma
        Ratio of each rendering by name and σ by the σ of its material or fit, shape (n,).
    """

    channel: str
    reflected_by: str
    photographed: FloatArray
    photographed_sigma: FloatArray
    rendered: Mapping[str, FloatArray]
    rendered_sigma: Mapping[str, FloatArray]

    def excess(self, name: str) -> FloatArray:
        """Return rendered over photographed ratio − 1, shape (n,)."""
        return np.asarray(self.rendered[name] / self.photographed - 1)

    def in_sigma(self, name: str) -> FloatArray:
        """Return the difference of the two ratios in σ, shape (n,)."""
        sigma = np.hypot(self.photographed_sigma, self.rendered_sigma[name])
        return np.asarray((self.rendered[name] - self.photographed) / sigma)


@dataclass(frozen=True, eq=False)
class RenderedPatch:
    """A patch, photographed and rendered.

    Attributes
    ----------
    each
        Comparison in which every photograph has L* = 50, and its rendering the same factor.
    common
        Comparison in which one factor for all brings the brightest photograph to L* = 50.
    matched
        As `each`, but each channel of a rendering has one factor for all times that brings it
        nearest to the photographs. What is left is noise and the course over time; what it takes
        away is of the measured spectrum and of the curves of the camera.
    ratio
        Glow over reflected light.
    """

    each: GlowComparison
    common: GlowComparison
    matched: GlowComparison
    ratio: GlowRatio


def compare_patch(
    patch: MeasuredPatch,
    measured: SeenPatch,
    fitted: FittedGlow,
    conversion: Viewing,
    room: PhotographedRoom,
    *,
    is_same_camera: bool,
) -> RenderedPatch:
    """Compare photographs of a patch with the renderings, in the photographs' unit."""
    series = patch.series
    if not measured.reflected:
        raise UsageError(
            f"{patch.name}: expected a photograph of reflected light beside the glow, got none; "
            "photograph the sample under the lamp (daylight: true), or behind a door the grey card "
            "(labrig run irradiance)"
        )
    # The channels' ratios are those of the card under the known lamp.
    white, as_rendered = measured.reflected[-1]
    gain = white.values / as_rendered
    rendered = {MEASURED: gain * measured.glow}
    own = glow_sigma(patch.material, series, is_same_camera=is_same_camera)
    if measured.reflected[0][0].name == SAMPLE:
        own = np.hypot(own, _albedo_sigma(patch.material))
    sigma = {MEASURED: own}
    for name, glow in fitted.glow.items():
        values = gain * glow
        rendered[name] = values * (np.sum(values * series.values) / np.sum(values**2))
        sigma[name] = fitted.relative_sigma[name]
    luminance = np.maximum(series.values @ conversion.to_xyz[1], 1e-300)
    target = ((LIGHTNESS + 16) / 116) ** 3
    brightest = np.full_like(luminance, luminance.max())
    factor_each, factor_common = (
        target / factor[:, np.newaxis] for factor in (luminance, brightest)
    )
    matched = {name: _matched(values, series, patch.flicker) for name, values in rendered.items()}
    each, common, by_colour = (
        compare_scaled(series, values, conversion, patch.flicker, factor)
        for values, factor in (
            (rendered, factor_each),
            (rendered, factor_common),
            (matched, factor_each),
        )
    )
    light, lit = measured.reflected[0]
    ratio = _ratio(patch, light, gain * lit, rendered, sigma, room)
    return RenderedPatch(each, common, by_colour, ratio)


def _matched(values: FloatArray, series: Series, flicker: float) -> FloatArray:
    """Return a rendering with a factor of each channel by weighted least squares, shape (n, C)."""
    variance = np.square(np.nan_to_num(series.sigma)) + np.square(flicker * values)
    weight = 1 / (variance + np.finfo(float).eps * np.max(values**2))
    factor = np.sum(weight * values * series.values, axis=0) / np.sum(weight * values**2, axis=0)
    return np.asarray(factor * values)


def _albedo_sigma(material: Material) -> float:
    """Return the relative σ of the light that a material reflects, the mean over its albedo."""
    albedo = material.albedo
    if albedo is None or albedo.sigma is None:
        return 0.0
    return float(np.sum(albedo.sigma) / np.sum(albedo.value))


def _ratio(
    patch: MeasuredPatch,
    light: ReflectedLight,
    reference: FloatArray,
    rendered: Mapping[str, FloatArray],
    sigma: Mapping[str, FloatArray],
    room: PhotographedRoom,
) -> GlowRatio:
    """Return glow over reflected light in the channel in which the glow is brightest."""
    series = patch.series
    channel = int(np.argmax(series.values.sum(axis=0)))
    photographed = series.values[:, channel] / light.values[channel]
    noise = np.nan_to_num(series.sigma[:, channel]) / light.values[channel]
    shutter = np.array([shutter_sigma(room.camera, exposure_s) for exposure_s in series.exposure_s])
    common = np.sqrt(patch.flicker**2 + light.relative_sigma**2 + shutter**2)
    ratios = {name: values[:, channel] / reference[channel] for name, values in rendered.items()}
    return GlowRatio(
        channel=series.channels[channel],
        reflected_by=light.name,
        photographed=photographed,
        photographed_sigma=np.hypot(noise, common * np.abs(photographed)),
        rendered=ratios,
        rendered_sigma={name: sigma[name] * np.abs(ratio) for name, ratio in ratios.items()},
    )


NOTHING_ASSUMED = Assumptions()


@dataclass(frozen=True, eq=False)
class RenderedComparison:
    """The dark room of a run, rendered beside its photographs.

    Attributes
    ----------
    patches
        All patches.
    description
        How it was compared, in paragraphs for people.
    notes
        Warnings about values that were assumed.
    warnings
        Warnings of the run about the charging of the measured material.
    left_out
        Warnings about renderings that are not possible, with the reason.
    scene
        The dark room with the measured materials; None if no patch could be compared.
    """

    patches: tuple[RenderedPatch, ...]
    description: tuple[str, ...]
    notes: tuple[ResultWarning, ...]
    left_out: tuple[ResultWarning, ...]
    scene: DarkRoomScene | None = None
    warnings: tuple[ResultWarning, ...] = ()


def compare_rendered(
    folder: Path,
    refit: Refit,
    materials: Sequence[str] = (),
    assumptions: Assumptions = NOTHING_ASSUMED,
    white: str = DEFAULT_WHITE,
    camera: str | None = None,
) -> RenderedComparison:
    """Render the dark room of a run at its exposures, and compare it with the photographs.

    Parameters
    ----------
    folder
        Run folder with a result.
    refit
        Function that fits a series with a given number of states and a given relative flicker.
    materials
        Materials that take the place of the run's own, as `MATERIAL` or `PATCH=MATERIAL`, by
        shipped name or path: those of a run that measured more than this one.
    assumptions
        Albedo and scale to assume where the material has none.
    white
        CIE illuminant that is the white of CIELAB, such as `D65`.
    camera
        Camera curves that replace those with which the run was processed, by shipped name or path.

    Returns
    -------
    RenderedComparison
        Colours and ratios of all photographs of the glow.

    Raises
    ------
    UsageError
        A measurement is missing without which nothing can be rendered: camera curves, lamp,
        reflected light, emission spectrum, albedo or scale.
    DataError
        There is no result, or it is damaged.

    References
    ----------
    Nalbach, Seidel, Ritschel, "Practical Capture and Reproduction of Phosphorescent Appearance"
    (2017), section 5.

    Examples
    --------
    >>> from pathlib import Path
    >>> import labrig
    >>> from labrig.compare import compare_rendered
    >>> def refit(series, states, flicker):
    ...     return labrig.fit_series(series, states, flicker=flicker)
    >>> compared = compare_rendered(Path("runs/phosphor"), refit)  # doctest: +SKIP
    >>> compared.patches[0].each.mean("measured") < 2  # doctest: +SKIP
    True
    """
    patches = read_patches(folder)
    given = references_by_patch(materials, list(patches))
    patches = {
        name: replace(patch, material=_completed(given.get(name, patch.material)))
        for name, patch in patches.items()
    }
    curves, reasons = measured_camera(folder, camera)
    if curves is None:
        raise UsageError(f"the dark room cannot be rendered: {reasons[0]}")
    rig = with_shipped_camera(read_result_rig(folder), read_run(folder).camera_identity)
    result = read_result(folder)
    room = PhotographedRoom.of(folder, rig, result)
    own = _own_names(patches, room)
    with tempfile.TemporaryDirectory() as place:
        bench = RenderedBench(room, curves, Path(place), assumptions)
        measured = bench.measured({own[name]: patch for name, patch in patches.items()})
        conversion = viewing(curves, white)
        compared = []
        left_out: list[ResultWarning] = []
        for name, patch in patches.items():
            try:
                fits = fits_by_states(patch.series, patch.flicker, refit)
                fitted = bench.fitted(patch, fits)
            except DataError as error:
                left_out.append(
                    Unmeasured("patch-failed", "left out: {reason}", name, reason=str(error))
                )
                continue
            left_out += fitted.left_out
            compared.append(
                compare_patch(
                    patch,
                    measured.patches[own[name]],
                    fitted,
                    conversion,
                    room,
                    is_same_camera=camera is None,
                )
            )
    return RenderedComparison(
        tuple(compared),
        _description(conversion, [each.ratio.reflected_by for each in compared], room, left_out),
        tuple(dict.fromkeys(measured.notes)),
        tuple(left_out),
        measured.scene if compared else None,
        tuple(charging_warnings(result, [name for name in patches if name not in given])),
    )


def charging_warnings(result: RunResult, patches: Sequence[str]) -> Iterator[ResultWarning]:
    """Yield the warnings of a run about the charging of patches.

    Parameters
    ----------
    result
        Result of the run, or of a chain.
    patches
        Names of the patches whose own materials are rendered.
    """
    parts = result.parts.values() if isinstance(result, ChainResult) else (result,)
    for part in parts:
        for name, fit in part.provides().get("excitations", {}).items():
            if name in patches or (not name and patches):
                of = f"{name}, excitation" if name else "excitation"
                yield from (warning.about(of) for warning in fit.warnings)


def _completed(material: Material) -> Material:
    """Return the material with Λ of states whose level, and therefore Λ, its file leaves open.

    Level, rates and Λ of such a state have a common scale that its charge does not tell, and that
    its glow after the same charge does not depend on: Λ k_r r(0)ᵇ is its amplitude.
    """
    emitted = [state.reradiation for state in material.states if state.reradiation is not None]
    if not emitted or material.irradiance_norm is None:
        return material
    spectrum, bands_nm = emission(material), material.bands_nm
    assert spectrum is not None
    shape = np.asarray(spectrum.in_bands(bands_nm or ()))
    states = []
    for state in material.states:
        light = state.k_r_per_s * (state.r0 or 0.0) ** state.kinetic_order
        if state.reradiation is None and state.amplitude is not None and light > 0:
            reradiation = tuple((state.amplitude / light * shape).tolist())
            state = state.model_copy(update={"reradiation": reradiation})
        states.append(state)
    return material.model_copy(update={"states": tuple(states)})


def _own_names(patches: Mapping[str, MeasuredPatch], room: PhotographedRoom) -> dict[str, str]:
    """Return the names that patches have in the decay's result: the only one has its sample's."""
    if len(patches) == 1 and len(room.regions) == 1:
        return dict(zip(patches, room.regions, strict=True))
    if missing := sorted(set(patches) - set(room.regions)):
        raise DataError(f"the region of {missing[0]} is not known; process the run again")
    return {name: name for name in patches}


def _description(
    conversion: Viewing,
    reflected_by: Sequence[str],
    room: PhotographedRoom,
    left_out: Sequence[ResultWarning],
) -> tuple[str, ...]:
    by = " and ".join(dict.fromkeys(reflected_by))
    paragraphs = [
        "The dark room is rendered at the exposures of the photographs, in bands of 10 nm; its "
        f"light is that of the lamp as {by} reflects it in the photographs. '{MEASURED}': the "
        "measured material, charged as the journal says; the others: fits to the decay, whose "
        "brightness is fitted, too. Laws that have no states are shown by their course over time.",
        f"CIELAB: {conversion.source}. ΔE is CIEDE2000 with L* = {LIGHTNESS:g} of every "
        "photograph, and with one exposure for all, the brightest at that; a rendering has the "
        "factor of its photograph.",
        *_unread(room),
    ]
    if left_out:
        paragraphs.append(f"Left out: {'; '.join(map(str, left_out))}.")
    return tuple(paragraphs)


def _unread(room: PhotographedRoom) -> tuple[str, ...]:
    """Return a sentence on the lamp's illuminance, where none was read."""
    if room.is_lux_read:
        return ()
    return (
        f"The illuminance of the lamp was not read; {room.lamp.illuminance_lux:g} lx are taken, on "
        "which absolute luminances of the scene depend, but no ratio.",
    )


Row = tuple[str | float, ...]

#: Columns of both tables: light over reflected light, or over that of the card.
LIGHT = ("photographed", "photographed_sigma", "rendered", "rendered_sigma")
OF_GLOW = (
    "patch",
    "t_s",
    "rendering",
    "channel",
    *LIGHT,
    "delta_e",
    "delta_e_noise",
    "delta_e_matched",
    "delta_e_one_exposure",
)
OF_LAMPS = (
    "lamp",
    "sample",
    "channel",
    "reference",
    *LIGHT,
    "reradiated",
    "reradiated_luminance",
    "delta_e",
    "delta_e_by_errors",
    "delta_e_reflected",
)


def write_rendered(path: Path, comparison: RenderedComparison | LampsComparison) -> None:
    """Write a comparison of photographs and renderings as CSV.

    Parameters
    ----------
    path
        Path of the table: of glow a row for each patch, time and rendering, of samples under lamps
        for each lamp, sample and channel; as of `rendered_numbers` and `lamps_numbers`.
    comparison
        The comparison.

    Raises
    ------
    DiskError
        The file cannot be written.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.compare import RenderedComparison, write_rendered
    >>> write_rendered(Path("rendered.csv"), RenderedComparison((), (), (), ()))
    >>> Path("rendered.csv").read_text().split(",")[:3]
    ['patch', 't_s', 'rendering']
    """
    head: tuple[str, ...] = OF_LAMPS
    if isinstance(comparison, RenderedComparison):
        head, rows = OF_GLOW, _of_glow(comparison)
    else:
        rows = _of_lamps(comparison)
    make_folder(path.parent)
    write_csv(
        path,
        head,
        ([cell if isinstance(cell, str) else f"{cell:.6g}" for cell in row] for row in rows),
    )


def _of_glow(comparison: RenderedComparison) -> Iterator[Row]:
    for patch in comparison.patches:
        ratio = patch.ratio
        for name in patch.each.delta_e:
            columns = zip(
                patch.each.t_s,
                ratio.photographed,
                ratio.photographed_sigma,
                ratio.rendered[name],
                ratio.rendered_sigma[name],
                patch.each.delta_e[name],
                patch.each.noise,
                patch.matched.delta_e[name],
                patch.common.delta_e[name],
                strict=True,
            )
            for t_s, *numbers in columns:
                yield (patch.each.patch, t_s, name, ratio.channel, *numbers)


def _of_lamps(comparison: LampsComparison) -> Iterator[Row]:
    for lamp in comparison.lamps:
        for name, sample in lamp.samples.items():
            for number, channel in enumerate(comparison.channels):
                yield (
                    lamp.name,
                    name,
                    channel,
                    lamp.reference,
                    sample.photographed[number],
                    sample.photographed_sigma[number],
                    sample.rendered[number],
                    sample.rendered_sigma[number],
                    sample.reradiated[number],
                    sample.reradiated_luminance,
                    sample.delta_e,
                    sample.delta_e_by_errors,
                    sample.delta_e_reflected,
                )
