"""The result folder: made beside the old one, which is kept if the new one is any different."""

import shutil
from importlib.metadata import version
from pathlib import Path

from labrig.fit import DecayFit
from labrig.material import Material, Provenance, State, write_material
from labrig.process.changes import changes
from labrig.process.provenance import StageProvenance
from labrig.results import Series, write_fitted_decay, write_series
from labrig.yaml_file import write_yaml

_EARLIER = "result-"


def new_result(run: Path) -> Path:
    """An empty folder in `run` for `put_in_place`."""
    made = run / "result.part"
    if made.exists():
        shutil.rmtree(made)
    made.mkdir()
    return made


def put_in_place(made: Path) -> tuple[str, ...]:
    """Make the folder `made` the run's `result`; returns what changed, in lines for people.

    The result before it becomes `result-1`, `result-2`, …, from old to new. One that is the same
    to the byte stays where it is, and `made` goes.
    """
    final = made.with_name("result")
    if not final.exists():
        made.rename(final)
        return ()
    told = changes(final, made)
    if not told:
        shutil.rmtree(made)
        return ("the same result as before",)
    numbers = [int(path.name[len(_EARLIER) :]) for path in _earlier(made.parent)]
    earlier = made.with_name(f"{_EARLIER}{max(numbers, default=0) + 1}")
    final.rename(earlier)
    made.rename(final)
    return (f"changed since the result before, which is kept as {earlier.name}:", *told)


def _earlier(run: Path) -> list[Path]:
    return [path for path in run.glob(f"{_EARLIER}*") if path.name[len(_EARLIER) :].isdecimal()]


def write_provenance(made: Path, provenance: StageProvenance) -> None:
    """Write provenance.yaml into `made`."""
    write_yaml(made / "provenance.yaml", provenance)


def write_patch(
    place: Path,
    series: Series,
    fit: DecayFit | str,
    material: str,
    run: str,
    temperature_c: float | None = None,
) -> None:
    """Write series.csv and, where there is a fit, fit.json and material.yaml into `place`.

    Parameters
    ----------
    material, run
        Names.
    temperature_c
        At which it decayed, if somebody knows.
    """
    place.mkdir(exist_ok=True)
    write_series(place / "series.csv", [series])
    if isinstance(fit, DecayFit):
        write_fitted_decay(place / "fit.json", fit)
        made = _material(series, fit, material, run, temperature_c)
        write_material(place / "material.yaml", made)


def _material(
    series: Series, fit: DecayFit, name: str, run: str, temperature_c: float | None
) -> Material:
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
            temperature_c=temperature_c,
        ),
    )
