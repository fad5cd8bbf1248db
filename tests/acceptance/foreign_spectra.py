"""Spectra and excitation-emission matrices of real instruments, and 200 writings of each kind.

`python -m tests.acceptance.foreign_spectra [FOLDER]` prints a line for each file and each class of
writings: what it is, what was read, the truth, and whether they agree. FOLDER is that of real
data, beside the checkout unless it is named. Values and ranges of wavelengths are those that stand
in the files. The place of a matrix's maximum is the highest number beside the lines that were left
out: a record of this reader, which would move if a line of scattered light stayed.
"""

import logging
import random
import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np

from labrig.foundation.errors import UsageError
from labrig.material import MatrixLayout, read_reradiation
from labrig.optics import read_curve_file, read_spectrum, read_transmittance
from tests.real_data import REAL, SHARED
from tests.written_spectra import FRACTIONS, LIGHTS, matrix_text, spectrum_text

VARIANTS = 200
EXPORTS = REAL / "wrighttools"
#: File, column or none, wavelength in nm, value there as the file has it after conversion.
FRACTION_FILES = (
    ("cary_absorbance.csv", None, 899.9957886, 10**-0.03348613903),
    ("jasco_v570.txt", None, 2000.0, 10**-0.02884),
)
LIGHT_FILES = (
    ("labspec_spectrum_nm.txt", None, 425.178, 124.32),
    ("oobase32.scope", None, 787.02, 656.6),
    ("shimadzu_uv.txt", None, 340.0, 0.1308),
)
#: File, number of spectra, name of one, wavelength in nm, value.
MANY = (
    ("light_sources/lightlogger/spectral_Jeti_100pct.csv", 41, "380nm", 383.0, 5.51e-4),
    (
        "light_sources/lightlogger/total_irradiance.csv",
        6,
        "Total irradiance - 100%",
        380.0,
        0.010232947,
    ),
)
_EXPORTS = "instrument_exports/eemr/"
_WEBFLUOR = "bispectral/webfluor_eem/"
#: File, ranges of excitation and emission in nm, excitation and emission of the maximum.
MATRICES = (
    (f"{_EXPORTS}fluoromax4_f1.dat", (240, 450), (320, 550), (240, 360)),
    (f"{_EXPORTS}aqualog_sample4.dat", (240, 800), (245.719, 825.471), (275, 308.798)),
    (f"{_EXPORTS}cary_scans_day_1_sample1.csv", (220, 450), (230, 600), (225, 418.0299988)),
    (f"{_EXPORTS}custom_cary.csv", (250, 450), (300, 780), (250, 450)),
    (f"{_EXPORTS}hitachi-f7000-fl_hitachi1.TXT", (200, 450), (250, 600), (200, 558)),
    (f"{_EXPORTS}shimadzu_shimadzu.TXT", (230, 450), (240, 600), (240, 482)),
    (f"{_WEBFLUOR}FAD.txt", (250, 520), (260, 750), (470, 525)),
    ("../cases/tables/eem_rows_emission.txt", (300, 460), (440, 700), (370, 520)),
    ("../cases/tables/eem_rows_excitation.txt", (300, 460), (440, 700), (370, 520)),
)


def line(*cells: object) -> bool:
    """Print a line of the table, whose last two cells are compared for the verdict."""
    *about, read, truth = cells
    verdict = "right" if read == truth else "WRONG"
    print(" | ".join([*map(str, about), str(read), str(truth), verdict]))
    return verdict == "right"


def real_curves(folder: Path) -> list[bool]:
    """Read the spectra of real instruments."""
    verdicts = []
    for files, read in ((FRACTION_FILES, read_transmittance), (LIGHT_FILES, read_spectrum)):
        for name, column, nm, truth in files:
            got = float(read(EXPORTS / name, column).at([nm])[0])
            verdicts.append(
                line(name, f"{read.__name__} at {nm:g} nm", f"{got:.6g}", f"{truth:.6g}")
            )
    for name, count, column, nm, truth in MANY:
        file = read_curve_file(folder / name)
        got = float(read_spectrum(folder / name, column).at([nm])[0])
        about = f"{len(file.curves)} spectra; {column} at {nm:g} nm"
        verdicts.append(
            line(name, about, (len(file.curves), f"{got:.6g}"), (count, f"{truth:.6g}"))
        )
    return verdicts


def real_matrices(folder: Path) -> list[bool]:
    """Read the excitation-emission matrices of real instruments."""
    verdicts = []
    for name, excitation, emission, place in MATRICES:
        is_bare = "shimadzu" in name
        layout = MatrixLayout(excitation_nm=np.arange(230.0, 451, 5)) if is_bare else None
        matrix = read_reradiation(folder / name, layout=layout)
        row, column = np.unravel_index(np.nanargmax(matrix.reradiation), matrix.reradiation.shape)
        got = (
            *matrix.input_nm[[0, -1]].tolist(),
            *matrix.output_nm[[0, -1]].tolist(),
            float(matrix.input_nm[column]),
            float(matrix.output_nm[row]),
        )
        marked = np.isnan(matrix.reradiation).mean()
        about = f"{matrix.reradiation.shape}, {marked:.0%} not measured; ranges, maximum"
        verdicts.append(line(Path(name).name, about, got, (*excitation, *emission, *place)))
    return verdicts


def variants(name: str, one: Callable[[random.Random, Path], bool]) -> bool:
    """Read many writings of one thing: none may be read wrong."""
    counts: Counter[str] = Counter()
    reasons: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(VARIANTS):
            path = Path(folder) / "export.txt"
            try:
                is_right = one(random.Random(f"{name} {seed}"), path)
            except UsageError as error:
                counts["refused"] += 1
                reasons[str(error).removeprefix(f"{path}: ")[:70]] += 1
                continue
            counts["right" if is_right else "wrong"] += 1
            if not is_right:
                print(f"  wrong: {name} {seed}")
    for reason, count in reasons.most_common(4):
        print(f"  {count} times: {reason}")
    return line(f"{VARIANTS} writings of {name}", dict(counts), counts["wrong"], 0)


def one_fraction(rng: random.Random, path: Path) -> bool:
    """Return whether a transmittance is read as it was before it was written."""
    nm = np.linspace(401.5, 699.25, 40)
    values = 0.05 + 0.9 * np.linspace(0, 1, 40) ** 2
    name, of = rng.choice(FRACTIONS)
    path.write_bytes(spectrum_text(rng, nm, [(name, of(values))]))
    curve = read_transmittance(path)
    return len(curve.value) == 40 and np.allclose(curve.value, values, rtol=1e-6)


def one_light(rng: random.Random, path: Path) -> bool:
    """Return whether two spectra of light are read as they were before they were written."""
    nm = np.linspace(401.5, 699.25, 40)
    values = 3 + np.cos(nm / 30) ** 2
    name, of = rng.choice(LIGHTS)
    path.write_bytes(spectrum_text(rng, nm, [(name, of(values))]))
    spectrum = read_spectrum(path)
    return len(spectrum.value) == 40 and np.allclose(spectrum.value, values, rtol=1e-6)


def one_matrix(rng: random.Random, path: Path) -> bool:
    """Return whether a matrix is read as it was before it was written."""
    excitation_nm, emission_nm = np.arange(320.0, 421, 10), np.arange(440.0, 651, 10)
    noise = np.random.default_rng(5).normal(0, 1, (len(emission_nm), len(excitation_nm)))
    emission = np.exp(-(((emission_nm[:, np.newaxis] - 520) / 40) ** 2))
    counts = 1000 * emission * np.exp(-(((excitation_nm - 365) / 40) ** 2)) + noise
    path.write_bytes(matrix_text(rng, excitation_nm, emission_nm, counts))
    matrix = read_reradiation(path)
    return (
        np.array_equal(matrix.input_nm, excitation_nm)
        and np.array_equal(matrix.output_nm, emission_nm)
        and np.allclose(matrix.reradiation, counts, rtol=1e-8)
    )


def main() -> int:
    """Print the table; 1 where anything was read wrong."""
    logging.disable()
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else SHARED
    print("file | read as | read | truth | verdict")
    verdicts = [*real_curves(folder), *real_matrices(folder)]
    verdicts.append(variants("a transmittance", one_fraction))
    verdicts.append(variants("a spectrum of light", one_light))
    verdicts.append(variants("an excitation-emission matrix", one_matrix))
    return int(not all(verdicts))


if __name__ == "__main__":
    sys.exit(main())
