"""Samples under lamps: photographed, and predicted from their re-radiation."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from labrig.foundation.arrays import FloatArray
from labrig.foundation.notebook_views import CsvTable
from labrig.foundation.region import Region
from labrig.optics import Spectrum
from labrig.results.budget import Budget
from labrig.results.fluorescent_patch import MatrixOnBands
from labrig.results.measured import Measured
from labrig.results.run_result import RunResult

#: Whether the photographs are as predicted.
Verdict = Literal["agrees", "differs"]


@dataclass(frozen=True, eq=False)
class SeenColour:
    """A colour as the camera sees it.

    Attributes
    ----------
    lab
        L*, a*, b* with the white of the lamp, see `LampComparison.white`, shape (3,).
    xyz
        X, Y, Z for a picture, shape (3,): a white under the lamp `balance` is a screen's, one under
        another lamp has that lamp's colour, and Y = 1.
    """

    lab: FloatArray
    xyz: FloatArray


@dataclass(frozen=True, eq=False)
class LampPatch:
    """A sample under a lamp.

    Attributes
    ----------
    value, sigma
        Values of the channels in DN/s and their σ, shape (k,).
    card, card_sigma
        The same of the grey card in the sample's place.
    predicted, predicted_sigma
        The same by the sample's matrix; σ is that of lamp, curves and card, and of the matrix.
    reflected
        The part of `predicted` that is reflected, shape (k,).
    pull
        `value` less `predicted` over the σ of both, shape (k,).
    reduced_chi2
        χ² of the channels over their number.
    measured, whole, reflected_only, reradiated_only
        Colour as photographed; as predicted; of the reflected and of the re-radiated part.
    delta_e
        ΔE2000 of photograph and prediction, and its σ.
    delta_e_by_errors
        Root mean square of the ΔE2000 that their errors alone would make.
    delta_e_reflected
        ΔE2000 of photograph and what is reflected only: as if the sample did not fluoresce.
    """

    value: FloatArray
    sigma: FloatArray
    card: FloatArray
    card_sigma: FloatArray
    predicted: FloatArray
    predicted_sigma: FloatArray
    reflected: FloatArray
    pull: FloatArray
    reduced_chi2: float
    measured: SeenColour
    whole: SeenColour
    reflected_only: SeenColour
    reradiated_only: SeenColour
    delta_e: Measured
    delta_e_by_errors: float
    delta_e_reflected: Measured


@dataclass(frozen=True, eq=False)
class ValidatedSample:
    """Statements about a sample before it is photographed.

    Attributes
    ----------
    region
        Region of the sample in the frame.
    matrix
        Matrix by which it is predicted.
    """

    region: Region
    matrix: MatrixOnBands


@dataclass(frozen=True, eq=False)
class LampComparison:
    """All samples under a lamp.

    Attributes
    ----------
    spectrum_nm, spectrum
        Wavelengths in nm and power per nm of the lamp behind its filter, relative, by the rig file,
        shape (n,).
    brightness
        Brightness of the lamp in DN/s, as `LedFluorescenceResult.brightness`.
    scale
        What tells it: the `card`, or the `samples` themselves where the camera hardly sees the
        lamp; then one number for all of them is fitted.
    white
        White of the colours: a perfect one under the `lamp`; or, where the lamp shows no white, a
        screen's, `D65`, on a scale on which the brightest predicted sample all but clips.
    reduced_chi2
        Mean of the samples' χ² per channel.
    largest_pull
        Pull of the largest magnitude.
    verdict
        Whether χ² and pulls are as their errors let expect.
    patches
        The samples by name.
    """

    spectrum_nm: FloatArray
    spectrum: FloatArray
    brightness: float
    scale: Literal["card", "samples"]
    white: Literal["lamp", "D65"]
    reduced_chi2: float
    largest_pull: float
    verdict: Verdict
    patches: Mapping[str, LampPatch]

    def light(self, name: str) -> Spectrum:
        """Return the spectrum of the lamp."""
        return Spectrum(name, self.spectrum_nm, self.spectrum)


@dataclass(frozen=True, eq=False, kw_only=True)
class PredictedUnderLamps(RunResult):
    """Base of the results that compare predictions under lamps with photographs.

    Attributes
    ----------
    channels
        Names of the k channels.
    fluorescence
        What the predictions are from: a run, or the materials.
    without_matrix_sigma
        Samples whose matrix has no σ; that of the others is in the σ of their predictions.
    samples
        The samples by name, with what they are predicted from.
    balance
        Lamp under which a white is white in the pictures.
    colours_from
        What turns the camera's values into colours: its `curves`, or the `chart` in a photograph.
    chart_delta_e
        Mean ΔE2000 of the chart's patches, and the largest; None without one.
    lamps
        Lamps that were used, by name.
    """

    channels: tuple[str, ...]
    fluorescence: str
    without_matrix_sigma: tuple[str, ...]
    samples: Mapping[str, ValidatedSample]
    balance: str
    colours_from: Literal["curves", "chart"]
    chart_delta_e: tuple[float, float] | None
    lamps: Mapping[str, LampComparison]

    def budgets(self) -> dict[str, Budget]:
        """Return the budgets of the colour differences between photographs and predictions."""
        return {
            f"{name} under {lamp}: ΔE2000": Budget(
                patch.delta_e.value, undivided=patch.delta_e.sigma
            )
            for lamp, comparison in self.lamps.items()
            for name, patch in comparison.patches.items()
        }

    def csv_tables(self) -> dict[str, CsvTable]:
        """Return a table of values and colours, `illuminants.csv`."""
        head = [f"{what}_{k}" for what in ("value", "predicted", "pull") for k in self.channels]
        labs = [f"{what}_{axis}" for what in ("measured", "predicted") for axis in "Lab"]
        rows = (
            (
                lamp,
                name,
                *(f"{number:.6g}" for number in (*patch.value, *patch.predicted, *patch.pull)),
                *(f"{number:.4f}" for number in (*patch.measured.lab, *patch.whole.lab)),
                f"{patch.delta_e.value:.4f}",
                f"{patch.delta_e.sigma:.4f}",
                f"{patch.delta_e_reflected.value:.4f}",
            )
            for lamp, comparison in self.lamps.items()
            for name, patch in comparison.patches.items()
        )
        names = ("lamp", "patch", *head, *labs, "delta_e", "delta_e_sigma", "delta_e_reflected")
        return {"illuminants.csv": CsvTable(names, rows)}
