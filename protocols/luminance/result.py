"""Result of a luminance run: luminances of an afterglow, their excitation and their scale."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from labrig.foundation.arrays import FloatArray
from labrig.foundation.notebook_views import CsvTable
from labrig.foundation.output_file import make_folder, write_text
from labrig.results.budget import Budget, named
from labrig.results.luminance import TABLE_S, LuminanceDecay
from labrig.results.measured import Measured
from labrig.results.run_result import RunResult, in_folders

#: Columns of `luminance.csv`, which `labrig fit luminance` reads.
HEAD = ("t_s", "luminance_mcd_per_m2", "luminance_mcd_per_m2_sigma")


@dataclass(frozen=True)
class ScaleFactor:
    """A factor between counts and luminance.

    Attributes
    ----------
    name
        Name of the factor.
    relative_sigma
        Relative standard uncertainty of the luminances by it.
    source
        Origin of factor and σ.
    is_common
        Whether all patches of a run have its error in common.
    """

    name: str
    relative_sigma: float
    source: str
    is_common: bool = True


@dataclass(frozen=True)
class ExcitationState:
    """Excitation of the sample, as it was.

    Attributes
    ----------
    standard
        Standard that it was to accord with; empty for none.
    lamp
        Kind of the lamp; None if it is not stated.
    illuminance
        Illuminance of the sample in lx.
    charged_s
        Measured time of the excitation in seconds.
    rested_s
        Time in the dark before it in seconds; None if it is not stated.
    temperature_c
        Mean temperature over the photographs of the glow in °C; None if unknown.
    deviations
        What was not as the standard prescribes, a clause each.
    """

    standard: str
    lamp: str | None
    illuminance: Measured
    charged_s: float
    rested_s: float | None
    temperature_c: float | None
    deviations: tuple[str, ...]

    @property
    def accordance(self) -> str:
        """Return whether the excitation accords with its standard, and if not, why."""
        if not self.standard:
            return "by no standard"
        if self.deviations:
            return f"not according to {self.standard}: {'; '.join(self.deviations)}"
        return f"according to {self.standard}"


@dataclass(frozen=True, eq=False)
class PatchLuminance:
    """Luminance of one patch.

    Attributes
    ----------
    decay
        Readings, table, time until 0.3 mcd/m² and marking, photopic.
    factors
        Chain of factors from counts to luminances, with their σ.
    wavelength_nm, spectrum
        Emission spectrum on which the luminances rest, of maximum 1, shape (n,).
    emission
        Origin of that spectrum.
    scotopic_ratio
        Scotopic over photopic luminance, S/P.
    mesopic_ratio
        Mesopic over photopic luminance where an adaptation luminance is given; else None.
    relative_to_first
        Luminances over those of the first patch at the times of the table at which both are known;
        None for the first one. What all patches have in common is not in their σ.
    """

    decay: LuminanceDecay
    factors: tuple[ScaleFactor, ...]
    wavelength_nm: FloatArray
    spectrum: FloatArray
    emission: str
    scotopic_ratio: Measured
    mesopic_ratio: Measured | None = None
    relative_to_first: Mapping[float, Measured] | None = None

    def write_files(self, folder: Path) -> None:
        """Write `luminance.json`, as `labrig fit luminance --json` prints it."""
        make_folder(folder)
        write_text(folder / "luminance.json", self.decay.to_json())

    def csv_tables(self) -> dict[str, CsvTable]:
        """Return the readings as `luminance.csv`."""
        decay = self.decay
        columns = (decay.t_s, decay.luminance_mcd_per_m2, decay.luminance_mcd_per_m2_sigma)
        rows = (tuple(f"{number:.8g}" for number in row) for row in zip(*columns, strict=True))
        return {"luminance.csv": CsvTable(HEAD, rows)}


@dataclass(frozen=True, eq=False, kw_only=True)
class LuminanceResult(RunResult):
    """Luminance of the afterglow.

    Attributes
    ----------
    patches
        Luminance of each patch by its name.
    excitation
        Excitation of all patches.
    thickness_mm, mass_per_area_g_per_m2
        Of the sample, as the user states them; None if not given.
    adaptation_mcd_per_m2
        Luminance to which eyes are adapted in mcd/m²; None if not given.

    Examples
    --------
    >>> result = labrig.read_result(run)  # doctest: +SKIP
    >>> for name, patch in result.patches.items():
    ...     print(name, patch.decay.marking, result.excitation.accordance)
    """

    kind: ClassVar[str] = "luminance"

    patches: Mapping[str, PatchLuminance]
    excitation: ExcitationState
    thickness_mm: float | None
    mass_per_area_g_per_m2: float | None
    adaptation_mcd_per_m2: float | None = None

    def ranked(self) -> tuple[str, ...]:
        """Return the names of the patches by falling luminance at 10 min, unknown ones last."""

        def luminance(name: str) -> float:
            at = {entry.t_s: entry.luminance for entry in self.patches[name].decay.at}
            known = at[TABLE_S[1]]
            return 0.0 if known is None else known.value

        return tuple(sorted(self.patches, key=luminance, reverse=True))

    def provides(self) -> Mapping[str, Any]:
        """Return the luminances by patch."""
        return {"luminances": {name: patch.decay for name, patch in self.patches.items()}}

    def budgets(self) -> dict[str, Budget]:
        """Return the budgets of luminances, light sums and times of every patch."""
        several = len(self.patches) > 1
        return {
            named(name if several else "", quantity): budget
            for name, patch in self.patches.items()
            for quantity, budget in patch.decay.budgets().items()
        }

    def csv_tables(self) -> dict[str, CsvTable]:
        """Return the table of each patch; of several patches, each in a folder of its name."""
        tables = {name: patch.csv_tables() for name, patch in self.patches.items()}
        return in_folders(tables) if len(tables) > 1 else next(iter(tables.values()), {})

    def write_files(self, folder: Path) -> None:
        """Write the files of each patch; of several patches, each into a folder of its name."""
        for name, patch in self.patches.items():
            patch.write_files(folder / name if len(self.patches) > 1 else folder)
