"""What a run's result says of each patch, read back from its files."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from labrig.errors import DataError, UsageError
from labrig.material import Material, read_material
from labrig.results import Series, find_fitted_decays, joined, read_fitted_decay, read_series
from labrig.yaml_file import read_yaml


@dataclass(frozen=True, eq=False)
class MeasuredPatch:
    """What a result folder holds of one patch.

    Attributes
    ----------
    series
        Usable frames by time, the offsets that the fit found subtracted.
    flicker
        As the fit found it.
    material
        Its file: that of all parts, where a chain has made one, else the decay's own.
    """

    series: Series
    flicker: float
    material: Material

    @property
    def name(self) -> str:
        """Of the patch, or of the sample if there is only one."""
        return self.series.region


def read_patches(run: Path) -> dict[str, MeasuredPatch]:
    """By name: every patch with a decay fit in a run's latest result.

    Raises
    ------
    UsageError
        Not a run folder.
    DataError
        There is no result with a fit, or it is damaged.
    """
    if not (run / "protocol.yaml").is_file():
        raise UsageError(f"{run}: expected a run folder with protocol.yaml in it")
    fits = find_fitted_decays(run / "result").values()
    places = [fit.parent for fit in fits if (fit.parent / "series.csv").is_file()]
    if not places:
        raise DataError(
            f"{run}: expected a result with the fit of a decay, got none; make one: "
            f"labrig process {run}"
        )
    sample = read_yaml(run / "protocol.yaml").get("sample")
    only = sample.get("name") if isinstance(sample, dict) and len(places) == 1 else None
    several = len(places) > 1
    patches = [
        _read_patch(place, only, run / "result" / (place.name if several else ""))
        for place in places
    ]
    return {patch.name: patch for patch in patches}


def _read_patch(place: Path, name: str | None, of_chain: Path) -> MeasuredPatch:
    fit = read_fitted_decay(place / "fit.json")
    series = joined(read_series(place / "series.csv"))
    if fit.channels != series.channels:
        raise DataError(
            f"{place}: expected fit.json and series.csv of the same channels, got "
            f"{', '.join(fit.channels)} and {', '.join(series.channels)}; make them again: "
            "labrig process RUN"
        )
    rows = np.flatnonzero(series.usable)
    by_time = rows[np.argsort(series.t_s[rows], kind="stable")]
    usable = series.take(by_time, name)
    whole = of_chain / "material.yaml"
    material = read_material(whole if whole.is_file() else place / "material.yaml")
    return MeasuredPatch(
        replace(usable, values=usable.values - np.array(fit.offsets)), fit.flicker, material
    )
