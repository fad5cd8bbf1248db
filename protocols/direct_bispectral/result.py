"""Result of a directly measured re-radiation matrix: a column for each light."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from labrig.foundation.notebook_views import CsvTable
from labrig.foundation.output_file import make_folder_in
from labrig.material import write_fluorescent, write_reradiation
from labrig.results.budget import Budget, named
from labrig.results.direct_columns import DirectColumns, DirectMeasurement, LightSpectrum
from labrig.results.run_result import RunResult, in_folders


@dataclass(frozen=True, eq=False, kw_only=True)
class DirectBispectralResult(RunResult):
    """Directly measured columns of one or more samples.

    Attributes
    ----------
    lights
        Lights by rising wavelength.
    samples
        Columns of each sample by its name.
    reference_sigma
        Typical relative σ of the white reference's reflectance, which is in that of the columns;
        NaN if its file tells none, and it is taken as exact.
    scale_sigma
        Typical relative σ of the spectrometer's scale, likewise.

    Examples
    --------
    >>> result = labrig.read_result(run)  # doctest: +SKIP
    >>> for name, columns in result.samples.items():
    ...     print(columns.matrix(name).reradiated_fraction)
    """

    kind: ClassVar[str] = "direct_bispectral"

    lights: tuple[LightSpectrum, ...]
    samples: Mapping[str, DirectColumns]
    reference_sigma: float
    scale_sigma: float

    def provides(self) -> Mapping[str, Any]:
        """Return the measurement with which estimates are compared."""
        return {"direct": DirectMeasurement(self.lights, self.samples)}

    def budgets(self) -> dict[str, Budget]:
        """Return the budgets of the re-radiated part of every light's power."""
        scales = np.array([self.reference_sigma, self.scale_sigma])
        known = scales[np.isfinite(scales)]
        scale_sigma = float(np.linalg.norm(known)) if len(known) else np.nan
        several = len(self.samples) > 1
        return {
            named(name if several else "", f"re-radiated of {light}"): columns.reradiated_total(
                number, scale_sigma
            )
            for name, columns in self.samples.items()
            for number, light in enumerate(columns.lights)
            if np.isfinite(columns.reradiated[:, number]).any()
        }

    def csv_tables(self) -> dict[str, CsvTable]:
        """Return the table `columns.csv` of each sample; of several, in a folder of its name."""
        head = (
            "light", "light_nm", "output_nm", "column", "column_sigma", "share_of_light",
            "mixed", "reradiated", "reradiated_sigma",
        )  # fmt: skip
        tables = {
            name: {"columns.csv": CsvTable(head, _rows(columns))}
            for name, columns in self.samples.items()
        }
        return in_folders(tables) if len(tables) > 1 else next(iter(tables.values()), {})

    def write_files(self, folder: Path) -> None:
        """Write the files of each sample, those of the only one into the folder itself.

        They are `matrix.csv` with the lights as input bands, and `material.yaml` with its matrix on
        input bands of 10 nm.
        """
        for name, columns in self.samples.items():
            place = make_folder_in(folder, name) if len(self.samples) > 1 else folder
            if len(columns.lights) > 1:
                write_reradiation(place / "matrix.csv", columns.matrix(name))
                write_fluorescent(place / "material.yaml", columns.interpolated(name)[0])


def _rows(columns: DirectColumns) -> Iterator[tuple[Any, ...]]:
    for light, name in enumerate(columns.lights):
        for band, output_nm in enumerate(columns.output_nm):
            values = (
                columns.column, columns.column_sigma, columns.share, columns.reradiated,
                columns.reradiated_sigma,
            )  # fmt: skip
            value, sigma, share, reradiated, reradiated_sigma = (
                "" if np.isnan(table[band, light]) else f"{table[band, light]:.6g}"
                for table in values
            )
            mixed = "yes" if columns.is_mixed[band, light] else "no"
            yield (
                name, f"{columns.input_nm[light]:.3f}", f"{output_nm:g}", value, sigma, share,
                mixed, reradiated, reradiated_sigma,
            )  # fmt: skip
