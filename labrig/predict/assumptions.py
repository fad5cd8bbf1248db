"""Assumptions of a prediction on camera, noise and brightness, each stated in a line."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self

import numpy as np

from labrig.acquire import CameraCapabilities, ProtocolModel
from labrig.calibration import TYPICAL_FLICKER
from labrig.foundation import resources
from labrig.foundation.errors import UsageError
from labrig.foundation.quantity import TIME_S, parse
from labrig.foundation.yaml_file import did_you_mean
from labrig.material import Material, read_material
from labrig.optics import CameraResponse
from labrig.predict.expectation import Bench, expected_schedule, predictable
from labrig.predict.frames import CameraFigures, typical_camera
from labrig.predict.glow import Glow, check_states, laws, measured_amplitudes, radiated
from labrig.predict.reference import Reference, read_reference, result_places, run_of
from labrig.predict.variants import changed
from labrig.protocols.steps.decays import DecaySettings

#: Range of the bisection in DN/s, and number of its steps.
DIMMEST, BRIGHTEST = 1e-3, 1e9
BISECTIONS = 50
#: Half a step of exposure times, in thirds of a stop: middle of brightnesses metered alike.
HALF_A_THIRD_STOP = 2 ** (1 / 6)


def measured_glow(
    material: Material, protocol: DecaySettings, reference: Reference | None
) -> Glow | None:
    """Return the glow of a material that the reference run measured; None for others."""
    amplitude = measured_amplitudes(material)
    if reference is None or amplitude is None:
        return None
    return Glow(
        *laws(material, _charge_s(protocol)),
        amplitude,
        reference.channel_weights,
        reference.camera.iso,
        reference.f_number,
    )


def relative_glow(
    material: Material,
    protocol: DecaySettings,
    camera: CameraFigures,
    response: CameraResponse | None,
) -> Glow:
    """Return the glow of a material with a total brightness of 1.

    Raises
    ------
    UsageError
        If the relative strengths of its states are not known.
    """
    charge_s = _charge_s(protocol)
    weights: Mapping[str, float] = {}
    amplitude = measured_amplitudes(material)
    if amplitude is None and len(material.states) == 1:
        amplitude = np.ones(1)
    if (radiation := radiated(material, response, charge_s)) is not None:
        amplitude, weights = radiation
    if amplitude is None or not amplitude.sum() > 0:
        raise UsageError(
            f"{material.name}: expected 'amplitude' or 'reradiation' of every state, to know how "
            "strong they are relative to each other, got neither"
        )
    if set(weights) != set(camera.channel_fractions):
        # Of an unknown colour only the channel with most pixels is counted on.
        weights = {
            max(camera.channel_fractions, key=lambda name: camera.channel_fractions[name]): 1.0
        }
    settings = protocol.camera
    return Glow(
        *laws(material, charge_s),
        amplitude / amplitude.sum(),
        weights,
        settings.iso,
        settings.f_number,
    )


def _charge_s(protocol: DecaySettings) -> float:
    """Return the length of the charge in seconds, infinite up to the plateau."""
    return protocol.charge if isinstance(protocol.charge, float) else np.inf


def brightness_metered_as(
    metered: DecaySettings, capabilities: CameraCapabilities, bench: Bench, exposure_s: float
) -> float:
    """Return the factor for the glows with which metering chooses a given first exposure.

    Parameters
    ----------
    classify_ladder
        Protocol with `exposure: auto`.
    capabilities
        Settings that the camera offers.
    bench
        Bench with the glows to be scaled.
    exposure_s
        First exposure time in seconds; if the time between frames does not allow it, the glow is
        dimmer in proportion.
    """
    reached_s = min(exposure_s, metered.longest_exposure_s(capabilities))
    metered_bench = bench.at_settings(metered.camera)
    low, high = np.log(DIMMEST), np.log(BRIGHTEST)
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        brighter = {
            patch: glow.brighter(np.exp(middle)) for patch, glow in metered_bench.glows.items()
        }
        trial_bench = Bench(metered_bench.camera, metered_bench.flicker, brighter)
        schedule = expected_schedule(metered, capabilities, trial_bench, lambda _: None)
        low, high = (
            (middle, high) if schedule.exposures_s[0] >= 0.999 * reached_s else (low, middle)
        )
    return float(np.exp(low)) / HALF_A_THIRD_STOP * reached_s / exposure_s


#: Assumed first exposure as a fraction of the longest, so that it may grow.
FIRST_EXPOSURE_FRACTION = 1 / 8


@dataclass(frozen=True)
class Sources:
    """Sources of a prediction's assumptions.

    Attributes
    ----------
    materials
        Name or path of the material by patch; the patch "" is the only one of the protocol.
    like
        Folder of an earlier run on the same bench.
    first_exposure_s
        Exposure time in seconds that metering chooses for the first frame; None if it is not known.
    response
        Spectral responses of the rig's camera.
    """

    materials: Mapping[str, str]
    like: Path | None = None
    first_exposure_s: float | None = None
    response: CameraResponse | None = None

    @classmethod
    def parse(
        cls,
        materials: Sequence[str],
        like: Path | None,
        metered: str | None,
        response: CameraResponse | None,
    ) -> Self:
        """Parse the arguments of a command line.

        Parameters
        ----------
        materials
            `MATERIAL`, or `PATCH=MATERIAL` for each patch.
        like
            Folder of an earlier run on the same bench.
        classify_ladder
            Exposure time of the first frame, such as `0.5 s`.
        response
            Spectral responses of the rig's camera.

        Raises
        ------
        UsageError
            If a patch has two materials, or `metered` is no duration.
        """
        try:
            first_exposure_s = None if metered is None else parse(metered, TIME_S)
        except ValueError as error:
            raise UsageError(f"--metered: {error}") from None
        by_patch: dict[str, str] = {}
        for text in materials:
            patch, _, material = text.rpartition("=")
            if patch in by_patch:
                raise UsageError(
                    "--predict: expected one material for each patch, got two for "
                    f"{patch or 'the only one'}; write --predict PATCH=MATERIAL"
                )
            by_patch[patch] = material
        return cls(by_patch, like, first_exposure_s, response)


@dataclass(frozen=True, eq=False)
class Assumptions:
    """The bench with its samples.

    Attributes
    ----------
    bench
        Camera, flicker and glow of each patch.
    materials
        Names of the materials by patch.
    brightness_known
        Patches whose amplitudes are measured; those of the others are assumed.
    notes
        Origins of the figures, in lines for people.
    """

    bench: Bench
    materials: Mapping[str, str]
    brightness_known: frozenset[str]
    notes: tuple[str, ...]


def collect_assumptions(
    model: ProtocolModel, capabilities: CameraCapabilities, sources: Sources
) -> Assumptions:
    """Return camera, flicker and glows, from earlier runs or else typical ones.

    Raises
    ------
    UsageError
        If there is no such patch, material or run, or if no decay can be predicted for a material.
    """
    protocol = predictable(model)
    files = _by_patch(protocol, sources.materials)
    materials = {patch: read_material(name) for patch, name in files.items()}
    for material in materials.values():
        check_states(material)
    like = None if sources.like is None else _read_like(sources.like, next(iter(files)))
    own_runs = {patch: _own_run(name, materials[patch], like) for patch, name in files.items()}
    reference = like or next((run for run in own_runs.values() if run is not None), None)
    camera = (
        typical_camera(capabilities, protocol.camera.iso) if reference is None else reference.camera
    )
    flicker = None if reference is None else reference.flicker
    measured = {
        patch: glow
        for patch, material in materials.items()
        if (glow := measured_glow(material, protocol, own_runs[patch])) is not None
    }
    relative = {
        patch: relative_glow(material, protocol, camera, sources.response)
        for patch, material in materials.items()
        if patch not in measured
    }
    bench = Bench(camera, flicker or TYPICAL_FLICKER, {**measured, **relative})
    notes = [_camera_note(camera, reference), _flicker_note(flicker)]
    if relative:
        factor, note = _brightness(model, capabilities, bench, measured, relative, sources)
        brighter = {patch: glow.brighter(factor) for patch, glow in relative.items()}
        bench = replace(bench, glows={**measured, **brighter})
        notes.append(note)
    else:
        notes.append("brightness: measured in that run")
    return Assumptions(
        bench,
        {patch: material.name for patch, material in materials.items()},
        frozenset(measured),
        tuple(notes),
    )


def _by_patch(protocol: DecaySettings, materials: Mapping[str, str]) -> dict[str, str]:
    """Return the materials by the protocol's own patches."""
    patches = list(protocol.patches)
    by_patch = {}
    for name, material in materials.items():
        if not name and len(patches) > 1:
            raise UsageError(
                f"--predict: the protocol has {len(patches)} patches ({', '.join(patches)}); say "
                f"which one: --predict {patches[0]}={material}"
            )
        patch = name or patches[0]
        if patch not in patches:
            raise UsageError(
                f"--predict: no patch is called '{patch}'; {did_you_mean(patch, patches)}"
            )
        by_patch[patch] = material
    return by_patch


def _read_like(run: Path, patch: str) -> Reference:
    places = result_places(run)
    return read_reference(places.get(patch, next(iter(places.values()))))


def _own_run(name: str, material: Material, like: Reference | None) -> Reference | None:
    """Return the run that measured a material: the one around its file, or the one given."""
    place = resources.find("config/materials", "material", name).parent
    if (place / "fit.json").is_file() and run_of(place) is not None:
        return read_reference(place)
    measured_in = None if material.provenance is None else material.provenance.run
    return like if like is not None and like.run == measured_in else None


def _brightness(
    model: ProtocolModel,
    capabilities: CameraCapabilities,
    bench: Bench,
    measured: Mapping[str, Glow],
    relative: Mapping[str, Glow],
    sources: Sources,
) -> tuple[float, str]:
    """Return the factor for glows of unknown brightness, and the reason for it."""
    if measured:
        brightest = max(float(glow.amplitude.sum()) for glow in measured.values())
        return brightest, f"brightness of {', '.join(relative)}: assumed, as the brightest measured"
    protocol = predictable(model)
    exposure_s, reason = sources.first_exposure_s, "as --metered says"
    if exposure_s is None and isinstance(protocol.exposure, float):
        exposure_s, reason = protocol.exposure, "assumed, as suits the protocol's exposure"
    elif exposure_s is None:
        longest_s = protocol.longest_exposure_s(capabilities)
        exposure_s = capabilities.exposure_at_most(longest_s * FIRST_EXPOSURE_FRACTION)
        reason = "assumed; say --metered"
    metered = predictable(changed(model, {"exposure": "auto"}))
    factor = brightness_metered_as(metered, capabilities, bench, exposure_s)
    return factor, f"brightness: metering chooses {exposure_s:.3g} s at first ({reason})"


def _camera_note(camera: CameraFigures, reference: Reference | None) -> str:
    source = "typical; --like RUN knows" if reference is None else f"measured in {reference.run}"
    return (
        f"camera: {camera.width} x {camera.height} pixels, {camera.electrons_per_dn:.3g} electrons "
        f"a DN and {camera.read_noise_electrons:.2g} of read noise at ISO {camera.iso:g} ({source})"
    )


def _flicker_note(measured: float | None) -> str:
    if measured is None:
        return f"flicker from frame to frame: {100 * TYPICAL_FLICKER:.2g} % (typical)"
    return f"flicker from frame to frame: {100 * measured:.2g} % (measured there)"
