"""Entries and sums of matrices estimated under LEDs, over their σ, of surfaces no basis contains.

    python -m tests.acceptance.led_entries [--surfaces 25] [--seed 0]

Truths are measured matrices, and single and paired dyes of the index of McNamara and Boswell,
narrow and with tails as measured, on measured reflectances. `led_matrices` photographs them. Errors
over σ are printed of all entries above a tenth of the largest one in input bands that an LED lit,
of sums of columns, and of all light. σ of a measured matrix' own noise is added to that of the fit.
Entries have no σ that holds, since their errors are those of assumed shapes; that of all light has
to: its errors over σ, of all surfaces together, must be 0.85 to 1.15 rms.
"""

import argparse
import sys
from collections.abc import Sequence

import numpy as np

from labrig.fit.fluorescence import JointEstimator
from labrig.foundation.arrays import FloatArray
from labrig.material import ReradiationMatrix, corrected, matrix_files, read_reradiation
from labrig.optics import read_camera
from tests.acceptance.led_matrices import (
    CAMERA,
    CASES,
    MIN_FRACTION,
    Photographs,
    told_system,
)
from tests.real_data import SHARED

DYES = SHARED / "fluorophores/mcnamara_boswell_{}.csv"
INPUT_NM, OUTPUT_NM = np.arange(300.0, 781.0, 5.0), np.arange(380.0, 781.0, 5.0)
#: Part of the largest entry, or column, from which one counts.
COUNTS = 0.1
#: Least and largest rms of the errors of all light over their σ.
LIGHT_RMS = 0.85, 1.15
#: Parts of the samples with two dyes, and range of the largest fraction that is re-radiated.
PAIRED, STRENGTH = 0.3, (0.1, 0.5)


def papers(count: int, rng: np.random.Generator) -> list[ReradiationMatrix]:
    """Return some of the measured matrices that re-radiate, with σ."""
    measured = [read_reradiation(path) for path in matrix_files(SHARED / "bispectral/rit_bfc450")]
    strong = [each for each in measured if each.reradiated_fraction.max() > MIN_FRACTION]
    chosen = [corrected(strong[k]) for k in rng.permutation(len(strong))[:count]]
    return [
        ReradiationMatrix(
            each.name, each.input_nm, each.output_nm, each.reflectance,
            np.where(each.is_stokes, np.nan_to_num(each.reradiation), 0.0),
            reradiation_sigma=each.reradiation_sigma,
        )
        for each in chosen
    ]  # fmt: skip


def _index(kind: str) -> tuple[FloatArray, FloatArray]:
    """Return wavelengths in nm (n,) and the index' spectra of one kind, shape (dyes, n)."""
    table = np.genfromtxt(str(DYES).format(kind), delimiter=",", skip_header=1)
    return table[:, 0], np.maximum(np.nan_to_num(table[:, 1:]), 0.0).T


def dyes(count: int, rng: np.random.Generator) -> list[ReradiationMatrix]:
    """Return surfaces with one or two measured dyes that the camera sees."""
    nm, emission = _index("emission")
    _, excitation = _index("excitation")
    peaks, excited = nm[emission.argmax(axis=1)], nm[excitation.argmax(axis=1)]
    seen = emission[:, (nm >= 380) & (nm <= 780)].sum(axis=1)
    usable = np.flatnonzero(
        (peaks >= 410) & (peaks <= 680) & (excited >= 340) & (excited < peaks)
        & (seen > 0.9 * emission.sum(axis=1))
    )  # fmt: skip
    surfaces = []
    for _ in range(count):
        number = 2 if rng.random() < PAIRED else 1
        total = np.zeros((len(OUTPUT_NM), len(INPUT_NM)))
        for dye in rng.choice(usable, number, replace=False):
            emitted = np.interp(OUTPUT_NM, nm, emission[dye])
            absorbed = np.interp(INPUT_NM, nm, excitation[dye])
            shape = np.outer(emitted / (5.0 * emitted.sum()), absorbed / absorbed.max())
            total += rng.uniform(*STRENGTH) / number * shape
        shift_nm = np.maximum(OUTPUT_NM[:, np.newaxis] - INPUT_NM, 0.0)
        total *= 1 - np.exp(-shift_nm / rng.uniform(2.0, 15.0))
        level, slope = rng.uniform(0.2, 0.7), rng.uniform(-0.2, 0.2)
        reflectance = level + slope * np.tanh((OUTPUT_NM - rng.uniform(450, 650)) / 30)
        surfaces.append(ReradiationMatrix("dyes", INPUT_NM, OUTPUT_NM, reflectance, total))
    return surfaces


KINDS = {"papers, textiles": papers, "dyes": dyes}


def pulls(
    case: str, surfaces: Sequence[ReradiationMatrix], rng: np.random.Generator
) -> tuple[list[FloatArray], list[FloatArray], list[float]]:
    """Return errors over σ of each surface's entries and columns, and of all its light."""
    photographs = Photographs(CASES[case], rng)
    fit = JointEstimator(told_system(CASES[case], read_camera(CAMERA), photographs)).fit
    entries, columns, light = [], [], []
    for surface in surfaces:
        found = fit(surface.name, *photographs.of(surface))
        matrix, drawn = found.matrix, found.surfaces
        assert drawn is not None
        assert matrix.reradiation_sigma is not None
        true = surface.rebinned(matrix.input_nm, matrix.output_nm)
        value = true.reradiation * matrix.is_stokes
        noise = np.zeros_like(value)
        if true.reradiation_sigma is not None:
            noise = true.reradiation_sigma * matrix.is_stokes
        lit = ~found.is_extrapolated
        counts = np.maximum(value, matrix.reradiation) > COUNTS * value.max()
        counts &= matrix.is_stokes & lit
        both = np.hypot(matrix.reradiation_sigma, noise)[counts]
        entries.append((matrix.reradiation - value)[counts] / both)
        sums = np.einsum("o,doi->di", matrix.output_width_nm, drawn.reradiation * matrix.is_stokes)
        sums_true = matrix.output_width_nm @ value
        sums_noise = np.sqrt(matrix.output_width_nm**2 @ noise**2)
        sigma = np.hypot(sums.std(axis=0, ddof=1), sums_noise)
        strong = lit & (sums_true > COUNTS * sums_true.max())
        columns.append(((sums.mean(axis=0) - sums_true) / sigma)[strong])
        whole = sums[:, lit].sum(axis=1)
        error = np.hypot(whole.std(ddof=1), np.linalg.norm(sums_noise[lit]))
        light.append(float((whole.mean() - sums_true[lit].sum()) / error))
    return entries, columns, light


def _said(off: FloatArray) -> str:
    return (
        f"rms {np.sqrt(np.mean(off**2)):5.2f}, {np.mean(np.abs(off) < 1):4.0%} within 1 σ, "
        f"{np.mean(np.abs(off) < 2):4.0%} within 2 σ, worst {np.abs(off).max():5.1f}, n {len(off)}"
    )


def main() -> None:
    """Print entries, columns and light of each kind and case."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--surfaces", type=int, default=25)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    every: list[float] = []
    for number, case in enumerate(("exact", "calibrated")):
        for place, (kind, make) in enumerate(KINDS.items()):
            rng = np.random.default_rng([asked.seed, number, place])
            entries, columns, light = pulls(case, make(asked.surfaces, rng), rng)
            rms = [np.sqrt(np.mean(each**2)) for each in entries if len(each)]
            print(f"{case}, {kind}: rms of a surface's entries, median {np.median(rms):.2f}")
            print(f"    entries  {_said(np.concatenate(entries))}")
            print(f"    columns  {_said(np.concatenate(columns))}")
            print(f"    light    {_said(np.array(light))}", flush=True)
            every += light
    rms_light = float(np.sqrt(np.mean(np.square(every))))
    print(f"light of all {len(every)} surfaces: rms {rms_light:.2f}")
    sys.exit(not LIGHT_RMS[0] < rms_light < LIGHT_RMS[1])


if __name__ == "__main__":
    main()
