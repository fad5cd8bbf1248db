"""The result folder: made beside the old one, which is kept."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path

from labrig.fit import DecayFit
from labrig.material import Material, Provenance, State, write_material
from labrig.reduce import Series, write_series


@contextmanager
def replaced_result(run: Path) -> Iterator[Path]:
    """An empty folder that becomes `result` when all in it is written.

    The result before it becomes `result-1`, `result-2`, …; after an error it stays as it was.
    """
    made, final = run / "result.part", run / "result"
    if made.exists():
        shutil.rmtree(made)
    made.mkdir()
    yield made
    if final.exists():
        number = 1
        while (earlier := run / f"result-{number}").exists():
            number += 1
        final.rename(earlier)
    made.rename(final)


def write_patch(place: Path, series: Series, fit: DecayFit | str, material: str, run: str) -> None:
    """Write series.csv and, where there is a fit, fit.json and material.yaml into `place`."""
    place.mkdir(exist_ok=True)
    write_series(place / "series.csv", [series])
    if isinstance(fit, DecayFit):
        (place / "fit.json").write_text(fit.to_json(), encoding="utf-8", newline="\n")
        write_material(place / "material.yaml", _material(series, fit, material, run))


def _material(series: Series, fit: DecayFit, name: str, run: str) -> Material:
    """What the decay alone says: rates and amplitudes; r0, k_e and Λ stay unknown."""
    return Material(
        name=name,
        kind="phosphor",
        states=tuple(
            State(
                k_r_per_s=state.k_r_per_s,
                k_r_per_s_sigma=state.k_r_sigma_per_s,
                amplitude=state.amplitude,
                amplitude_sigma=state.amplitude_sigma,
            )
            for state in fit.states
        ),
        provenance=Provenance(
            source="decay measured with labrig; amplitudes in DN/s of the brightest channel",
            run=run,
            frames=series.frame,
            version=version("labrig"),
        ),
    )
