"""A run of `excitation`, from its frames to rates and a material of every patch."""

from dataclasses import replace

import numpy as np

from labrig.analyse.excitation.charges import Charged, charged
from labrig.analyse.excitation.light import band_sigma, scale_sigma
from labrig.analyse.excitation.lit import GLOWING
from labrig.analyse.excitation.material import excited_material
from labrig.analyse.excitation.prediction import predicted_charging
from labrig.analyse.excitation.telling import closure_line, fit_json, lines, section
from labrig.analyse.intact import insist_on_intact
from labrig.analyse.part import Part, StageResult
from labrig.analyse.series_fit import TYPICAL_FLICKER, fit_series
from labrig.analyse.strip_patches import StripPatch, of_each
from labrig.analyse.temperature import at_temperature
from labrig.calibration import Warming
from labrig.calibration.irradiance_file import IrradianceFile
from labrig.errors import DataError
from labrig.fit import DecayFit
from labrig.fit.excitation import ExcitationFit, Uncertain, fit_excitation
from labrig.material import write_material

#: Of a lamp's brightness from charge to charge.
LAMP = 0.01
#: What a lamp lacks that was just switched on, where nobody has measured it.
USUAL = Warming(lacks=0.02, lacks_sigma=0.02, warms_s=150.0)
#: No dark level is known better, in DN/s.
LEAST_DARK = 1e-3
#: Names of a result's files.
FIT_FILE, MATERIAL_FILE = "excitation.json", "material.yaml"


def process(part: Part) -> StageResult:
    """Reduce all charges, fit those of every patch together, write their materials.

    Raises
    ------
    DataError
        Nothing is known of the light on the sample, or charges are missing.
    FitError
        Nothing glows, or what glows cannot be fitted.
    """
    irradiance, known = part.inputs.irradiance, part.inputs
    if irradiance is None:
        raise DataError(
            "expected the light on every place of the sample, got none; run irradiance and name "
            "its run in the rig file ('optics: {irradiance: …}') or to labrig process --optics"
        )
    insist_on_intact(part.run, (*GLOWING, "dark"), part.choices)
    warming = USUAL if known.fade is None or known.fade.warming is None else known.fade.warming
    measured, said = charged(part, irradiance, warming)
    found = of_each(
        list(measured),
        known,
        lambda patch, sofar: _of_patch(
            replace(part, inputs=sofar), patch, measured[patch], irradiance, warming
        ),
    )
    unmeasured = [] if known.fade else ["the lamp's fade was not measured: a usual one was taken"]
    leaks = known.blank.leaks() if known.blank else ()
    return replace(found, warnings=(*unmeasured, *leaks, *said, *found.warnings))


def _of_patch(
    part: Part,
    patch: StripPatch,
    measured: Charged,
    irradiance: IrradianceFile,
    warming: Warming,
) -> StageResult:
    known, start = part.inputs, _start(part, patch, measured)
    dark = tuple(np.maximum(np.nan_to_num(measured.whole.dark_sigma), LEAST_DARK).tolist())
    uncertain = Uncertain(
        flicker=_flicker(part, start),
        lamp=LAMP,
        cold=warming.lacks_sigma,
        offset=dark,
        # The sensor warms and cools over hours of long exposures, more than dark frames tell.
        wander=dark,
        scale=scale_sigma(irradiance),
        irradiance=band_sigma(irradiance),
    )
    fit = _fit(measured, start, uncertain)
    test = predicted_charging(
        measured, irradiance, uncertain, lambda without: _fit(without, start, uncertain, fit)
    )
    frames = tuple(frame.path.name for purpose in GLOWING for frame in part.run.frames(purpose))
    spectrum = patch.own(known.spectra)
    material = excited_material(
        fit, irradiance, spectrum, patch.material, part.run.folder.resolve().name, frames
    )
    material = at_temperature(material, part.run)
    place = part.folder / patch.folder
    place.mkdir(exist_ok=True)
    write_material(place / MATERIAL_FILE, material)
    (place / FIT_FILE).write_text(fit_json(fit, irradiance), encoding="utf-8", newline="\n")
    no_spectrum = (
        ["no emission spectrum was found of this patch, so that its material has no Λ"]
        if known.spectra and spectrum is None
        else []
    )
    return StageResult(
        known=replace(known, materials={**known.materials, patch.folder: material}),
        sections=(section(fit, measured, irradiance, test),),
        lines=(*lines(fit, irradiance), f"closure: {closure_line(test)}"),
        warnings=(*start.warnings, *fit.warnings, *no_spectrum),
    )


def _start(part: Part, patch: StripPatch, measured: Charged) -> DecayFit:
    """The decay after the last bare charge; as many states as a decay of this patch had."""
    asked = part.protocol.states
    states = part.choices.states or (None if asked == "auto" else asked)
    if states is None and (known := patch.own(part.inputs.decays)) is not None:
        states = len(known.states)
    return fit_series(measured.whole, states)


def _fit(
    measured: Charged, start: DecayFit, uncertain: Uncertain, near: ExcitationFit | None = None
) -> ExcitationFit:
    rates = [state.k_r_per_s for state in start.states]
    amplitudes = np.array([state.amplitude for state in start.states])
    shares = np.maximum(amplitudes / amplitudes.sum(), 1e-3)
    return fit_excitation([measured.through, measured.bare], rates, shares, uncertain, near)


def _flicker(part: Part, start: DecayFit) -> float:
    if part.inputs.camera is not None:
        return part.inputs.camera.flicker
    return start.flicker if start.flicker > 0 else TYPICAL_FLICKER
