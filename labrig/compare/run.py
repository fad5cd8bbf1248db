"""Comparison of a decay run with predictions, other materials and the paper."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from labrig.acquire import read_result_rig
from labrig.bench_optics import calibration, camera_curves, with_shipped_camera
from labrig.calibration import LVF_KIND
from labrig.compare.glow import GlowComparison, compare_glow, glow_of, in_colour, predicted_by
from labrig.compare.nalbach2017 import TABLE_1, emission, emission_grid
from labrig.compare.residuals import (
    Refit,
    Residuals,
    equally_weighted,
    fits_by_states,
    predicted,
    residuals,
)
from labrig.compare.three_channels import ThreeChannels, three_channels
from labrig.compare.viewing import DEFAULT_WHITE, viewing
from labrig.fit import DecayFit
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError, UsageError
from labrig.foundation.result_warning import ResultWarning, Unmeasured
from labrig.foundation.yaml_file import did_you_mean
from labrig.material import Material, MaterialComparison, compare_materials, read_material
from labrig.optics import CameraResponse
from labrig.record import plan_content, read_run
from labrig.results import (
    Series,
    find_fitted_decays,
    join_series,
    read_fitted_decay,
    read_result,
    read_series,
)


@dataclass(frozen=True, eq=False)
class MeasuredPatch:
    """Result of one patch.

    Attributes
    ----------
    series
        Usable frames in order of time, with the fitted offsets subtracted.
    flicker
        Fitted relative common-mode noise.
    material
        Material file: that of the whole chain if there is one, else that of the decay.
    """

    series: Series
    flicker: float
    material: Material

    @property
    def name(self) -> str:
        """Name of the patch, or of the sample if there is one patch only."""
        return self.series.region


def read_patches(run: Path) -> dict[str, MeasuredPatch]:
    """Read every patch with a decay fit in a run's latest result, by name.

    Raises
    ------
    UsageError
        If this is not a run folder.
    DataError
        If there is no result with a fit, or it is damaged.
    """
    if not (run / "protocol.yaml").is_file():
        raise UsageError(f"{run}: expected a run folder with protocol.yaml in it")
    fits = find_fitted_decays(run / "result").values()
    folders = [fit.parent for fit in fits if (fit.parent / "series.csv").is_file()]
    if not folders:
        raise DataError(
            f"{run}: expected a result with the fit of a decay, got none; make one: "
            f"labrig process {run}"
        )
    protocol, result = plan_content(run, "protocol.yaml"), run / "result"
    sample, samples = protocol.get("sample"), _sample_names(protocol)
    only = sample.get("name") if isinstance(sample, dict) and len(folders) == 1 else None
    patches = []
    for folder in folders:
        of_sample = folder.relative_to(result).parts[:1]
        if set(of_sample) & samples:
            patches.append(_read_patch(folder, of_sample[0], result / of_sample[0]))
        else:
            chain_folder = result / (folder.name if len(folders) > 1 else "")
            patches.append(_read_patch(folder, only, chain_folder))
    return {patch.name: patch for patch in patches}


def _sample_names(protocol: Mapping[str, Any]) -> set[str]:
    """Return the names of samples that a changer brought in turn; empty of all other runs."""
    samples = protocol.get("samples")
    if not isinstance(samples, list):
        return set()
    return {str(sample["name"]) for sample in samples if isinstance(sample, dict)}


def _read_patch(folder: Path, name: str | None, chain_folder: Path) -> MeasuredPatch:
    fit = read_fitted_decay(folder / "fit.json")
    series = join_series(read_series(folder / "series.csv"))
    if fit.channels != series.channels:
        raise DataError(
            f"{folder}: expected fit.json and series.csv of the same channels, got "
            f"{', '.join(fit.channels)} and {', '.join(series.channels)}; make them again: "
            "labrig process RUN"
        )
    rows = np.flatnonzero(series.usable)
    rows_by_time = rows[np.argsort(series.t_s[rows], kind="stable")]
    usable = series.take(rows_by_time, name)
    chain_file = chain_folder / "material.yaml"
    material = read_material(chain_file if chain_file.is_file() else folder / "material.yaml")
    return MeasuredPatch(
        replace(usable, values=usable.values - np.array(fit.offsets)), fit.flicker, material
    )


#: Numbers of states for which the glow is predicted, as in fig. 8 of Nalbach et al.
PREDICTED = (1, 2)
#: Name of the prediction from the reference material.
MATERIAL = "material"


@dataclass(frozen=True, eq=False)
class RunComparison:
    """Comparison of one run.

    Attributes
    ----------
    camera
        Spectral responses of the camera; None if they are not known.
    white
        CIE illuminant that is the white of CIELAB.
    description
        Description of white, normalisation and source of the predicted colours.
    glows
        Photographed and predicted glow of each patch.
    residuals
        Residuals of each patch and weighting.
    material_comparisons
        Comparisons of measured with reference materials.
    spectra
        Emission spectra in three channels, each with its resolution: those of the patches where
        known, of the reference materials and of Table 1.
    left_out
        Warnings about comparisons that are not possible, with the reason.
    """

    camera: CameraResponse | None
    white: str
    description: str
    glows: tuple[GlowComparison, ...]
    residuals: tuple[Residuals, ...]
    material_comparisons: tuple[MaterialComparison, ...]
    spectra: tuple[tuple[ThreeChannels, str], ...]
    left_out: tuple[ResultWarning, ...]


def compare_run(
    folder: Path,
    refit: Refit,
    materials: Sequence[str] = (),
    white: str = DEFAULT_WHITE,
    normalisation: str = "all",
    camera: str | None = None,
) -> RunComparison:
    """Compare the latest result of a decay run with predictions, materials and the paper.

    Photographed and predicted glow are compared as in fig. 8 of Nalbach et al., the residuals of
    one, two and three states as in section 4.4, spectra in three channels as in fig. 9.

    Parameters
    ----------
    folder
        Run folder.
    refit
        Function that fits a series with a given number of states and a given relative flicker.
    materials
        Reference materials as `MATERIAL` or `PATCH=MATERIAL`, by shipped name or path.
    white
        CIE illuminant that is the white of CIELAB, such as `D65`.
    normalisation
        Normalisation of the photographs, `all` or `each`; see `Normalisation`.
    camera
        Camera curves that replace those with which the run was processed, by shipped name or path.

    Returns
    -------
    RunComparison
        Glow, residuals, material parameters and spectra.

    Raises
    ------
    UsageError
        If this is not a run folder, or if there is no such patch, material, white or camera.
    DataError
        If there is no result, or it is damaged.

    References
    ----------
    Nalbach, Seidel, Ritschel, "Practical Capture and Reproduction of Phosphorescent Appearance"
    (2017).

    Examples
    --------
    >>> from pathlib import Path
    >>> import labrig
    >>> from labrig.compare import compare_run
    >>> def refit(series, states, flicker):
    ...     return labrig.fit_series(series, states, flicker=flicker)
    >>> comparison = compare_run(Path("runs/decay"), refit)
    >>> [glow.patch for glow in comparison.glows]
    ['sample']
    >>> comparison.glows[0].mean("2 states") < 1
    True
    >>> {states: round(rms, 2) for states, rms in comparison.residuals[0].rms.items()}
    {1: 1.0, 2: 0.01, 3: 0.01}
    """
    patches = read_patches(folder)
    references = references_by_patch(materials, list(patches))
    curves, left_out = measured_camera(folder, camera)
    conversion = viewing(curves, white, normalisation)
    glows: list[GlowComparison] = []
    ratios: list[Residuals] = []
    for patch in patches.values():
        try:
            fits = fits_by_states(patch.series, patch.flicker, refit)
            equal = fits_by_states(patch.series, 0.0, equally_weighted)
            ratios.append(residuals(patch.series, fits, "noise"))
            ratios.append(residuals(patch.series, equal, "equal"))
            predictions = _predictions(patch, fits, references.get(patch.name), curves)
            glows.append(compare_glow(patch.series, predictions, conversion, patch.flicker))
        except DataError as error:
            left_out.append(
                Unmeasured("patch-failed", "left out: {reason}", patch.name, reason=str(error))
            )
    return RunComparison(
        camera=curves,
        white=white,
        description=" ".join(
            [
                conversion.description,
                *_curves_source(list(patches.values()), curves, bool(references)),
            ]
        ),
        glows=tuple(glows),
        residuals=tuple(ratios),
        material_comparisons=tuple(
            compare_materials(patches[name].material, reference)
            for name, reference in references.items()
        ),
        spectra=() if curves is None else _spectra(patches, references, curves, white),
        left_out=tuple(left_out),
    )


def references_by_patch(materials: Sequence[str], patches: Sequence[str]) -> dict[str, Material]:
    """Return the reference materials by patch.

    A material without a patch belongs to the patch of the same name or to the only one.
    """
    by_patch: dict[str, Material] = {}
    for text in materials:
        patch_name, _, name = text.rpartition("=")
        patch = patch_name or (name if name in patches or len(patches) > 1 else patches[0])
        if patch not in patches:
            raise UsageError(
                f"--material: no patch is called '{patch}'; {did_you_mean(patch, patches)}; write "
                f"--material PATCH={name}"
            )
        if patch in by_patch:
            raise UsageError(f"--material: expected one material for {patch}, got two")
        by_patch[patch] = read_material(name)
    return by_patch


def measured_camera(
    folder: Path, replacement: str | None
) -> tuple[CameraResponse | None, list[ResultWarning]]:
    """Return the curves requested, else those of the processing; without any, a warning."""
    rig = with_shipped_camera(read_result_rig(folder), read_run(folder).camera_identity)
    try:
        lvf = read_result(folder).provides().get("lvf") or calibration(rig, LVF_KIND)
        return camera_curves(rig, replacement, lvf), []
    except UsageError as error:
        if replacement is not None:
            raise
        return None, [
            Unmeasured(
                "camera-curves-missing",
                "no camera curves: {reason}; give them with --camera",
                reason=str(error),
            )
        ]


def _predictions(
    patch: MeasuredPatch,
    fits: Mapping[int, DecayFit],
    reference: Material | None,
    camera: CameraResponse | None,
) -> dict[str, FloatArray]:
    """Return the predictions for each photograph by name, shape (n, C)."""
    series, spectrum = patch.series, emission(patch.material)
    predictions = {}
    for number in PREDICTED:
        values = predicted(series, fits[number])
        if spectrum is not None and camera is not None:
            values = in_colour(values, spectrum, camera)
        predictions[predicted_by(number)] = values
    if reference is not None:
        predictions[MATERIAL] = glow_of(reference, series, camera)
    return predictions


def _curves_source(
    patches: Sequence[MeasuredPatch], camera: CameraResponse | None, with_material: bool
) -> Iterator[str]:
    """Yield sentences on the source of the predicted colours."""
    if camera is not None and all(emission(patch.material) for patch in patches):
        yield "The predicted colour is that of the measured spectrum, by the camera's curves."
    else:
        yield "The predicted colour is the one fitted to all photographs: no spectrum was measured."
    if with_material:
        yield (
            f"Prediction '{MATERIAL}': rates, fractions of the states and spectrum as in the file "
            "given, one factor by least squares."
        )


def _spectra(
    patches: Mapping[str, MeasuredPatch],
    references: Mapping[str, Material],
    camera: CameraResponse,
    white: str,
) -> tuple[tuple[ThreeChannels, str], ...]:
    """Return the spectra of all materials, measured ones first; of equal names only the first."""
    by_name: dict[str, Material] = {}
    for material in (
        *(patch.material for patch in patches.values()),
        *references.values(),
        *map(read_material, TABLE_1),
    ):
        if emission(material) is not None:
            by_name.setdefault(material.name, material)
    spectra = []
    for material in by_name.values():
        spectrum = emission(material)
        if spectrum is not None:
            spectra.append((three_channels(spectrum, camera, white), emission_grid(material)))
    return tuple(spectra)
