"""labrig's mixtures against other ways to hold measured re-radiation in few numbers, in one run.

    python -m tests.acceptance.mixture_peers [--folder FOLDER] [--out DIR]

For each fluorescent matrix of a folder of Labsphere BFC-450 files and for two Post-It notes:
mixtures by labrig and by pomegranate (which is not a dependency), truncated singular value
decomposition and non-negative factorisation, all fitted to the same thresholded entries on one
thread. The tables have quantiles of the masked error, of ΔE2000 and of the relative XYZ error
against the corrected matrix, and the noise floor from repeated measurements of tiles; then come
speed, draws of wavelengths, memory of textures, and the worst cases. --out writes two figures.
"""

import argparse
import os
import time
import tracemalloc
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import numpy.typing as npt

from labrig.fit import fit_mixture, fit_mixture_texture
from labrig.material import ReradiationMatrix, read_reradiation
from tests.acceptance.mixture_colours import LIGHTS
from tests.acceptance.mixture_errors_figure import draw_errors
from tests.acceptance.mixture_judgement import (
    BISPECTRAL,
    POSTITS,
    Tried,
    fluorescent,
    noise_floors,
    quantiles,
    repeats,
    with_values,
)
from tests.acceptance.mixture_peer_methods import (
    Pomegranate,
    Target,
    factor_numbers,
    knots,
    likelihood_only,
    mixture_values,
    plain_nmf,
    stokes_nmf,
    stokes_svd,
    texture_values,
    truncated_svd,
)
from tests.acceptance.mixture_worst_cases import (
    draw_worst_cases,
    print_worst_cases,
    worst_cases,
)

Floats = npt.NDArray[np.float64]

#: Threshold that is usual for them, per band.
POSTIT_THRESHOLD = 0.004
COMPONENTS = (1, 2, 3, 4, 6)
#: Components whose numbers are those of one row and one column of these matrices: 41 + 49 = 90.
AS_RANK_1 = 15
RANKS = (1, 2, 3, 4, 6)
PER_COMPONENT = 6
#: Ratio up to which two errors count as equal: single precision, another end.
SAME_ERROR = 1.001
BYTES_PER_NUMBER = 4
DRAWS = 1_000_000
TEXELS = 65_536
#: The paper's texture: pixels, fluorescent ones, and bands of input and of output.
PAPER_PIXELS, PAPER_FLUORESCENT, PAPER_BANDS = 32 * 32, 255, 500
#: Numbers of 8 bytes that the paper stores for two components: scale, and weight, mean, covariance.
PAPER_NUMBERS = 1 + 2 * (1 + 2 + 4)


@dataclass(frozen=True, eq=False)
class Method:
    """A way to hold a matrix: from the target and a size to values per band."""

    name: str
    sizes: Sequence[int]
    fit: Callable[[Target, int], Floats]
    numbers: Callable[[Target, int], int]


def main() -> None:
    """Print all tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path, default=BISPECTRAL)
    parser.add_argument("--out", type=Path)
    asked = parser.parse_args()
    pomegranate = Pomegranate()
    versions = pomegranate.require()
    if os.environ.get("OPENBLAS_NUM_THREADS") != "1":
        raise SystemExit("set OPENBLAS_NUM_THREADS=1: times are those of one thread")
    targets = [Target.of(whole) for whole in fluorescent(asked.folder)]
    pairs = list(repeats(asked.folder))
    print(f"{len(targets)} matrices, {len(pairs)} pairs of repeats; {versions}", flush=True)

    floors = noise_floors(targets, pairs)
    tried = [one for method in methods(pomegranate) for one in apply(method, targets)]
    print_errors([*tried, *floors])
    print_colours([*tried, *floors])
    print(f"\npomegranate: {pomegranate.failed} of {pomegranate.tried} starts failed")
    print_kept_light(targets)
    print_speed(tried)
    print_postits(asked.folder, pomegranate)
    print_draws(targets)
    print_memory()
    print_large_textures(targets)
    cases = worst_cases(targets, pairs)
    print_worst_cases(cases)
    if asked.out is not None:
        asked.out.mkdir(parents=True, exist_ok=True)
        draw_errors(tried, floors, asked.out / "mixture_peers.png")
        draw_worst_cases(cases, asked.out / "mixture_worst_cases.png")


def methods(pomegranate: Pomegranate) -> Iterator[Method]:
    """Yield all methods with the sizes to try."""

    def six_each(_: Target, components: int) -> int:
        return PER_COMPONENT * components

    yield Method("labrig", (*COMPONENTS, AS_RANK_1), mixture_values, six_each)
    yield Method("labrig, likelihood only", COMPONENTS, likelihood_only, six_each)
    yield Method("labrig, texture", COMPONENTS, texture_values, six_each)
    yield Method("pomegranate, defaults", COMPONENTS, pomegranate.defaults, six_each)
    yield Method("pomegranate, 1 start", COMPONENTS, pomegranate.one_start, six_each)
    yield Method("pomegranate, 8 starts", COMPONENTS, pomegranate.several_starts, six_each)
    yield Method("product on knots", (*COMPONENTS, 8, 10), knots, six_each)
    yield Method("SVD", RANKS, truncated_svd, factor_numbers)
    yield Method("SVD, Stokes side", RANKS, stokes_svd, factor_numbers)
    yield Method("NMF", RANKS, plain_nmf, factor_numbers)
    yield Method("NMF, Stokes side", RANKS, stokes_nmf, factor_numbers)


def apply(method: Method, targets: Sequence[Target]) -> Iterator[Tried]:
    """Yield what a method makes of all targets, for each size."""
    for size in method.sizes:
        tried = Tried(method.name, size)
        method.fit(targets[0], size)  # loads what is loaded once
        for target in targets:
            before = time.process_time()
            values = method.fit(target, size)
            tried.seconds.append(time.process_time() - before)
            tried.numbers.append(method.numbers(target, size))
            if np.isfinite(values).all():
                surface = with_values(target.matrix, values)
                tried.judge(surface, target.matrix, target.mse(values))
            else:
                tried.judge_none()
        yield tried


def print_errors(all_tried: Sequence[Tried]) -> None:
    """Print storage, masked error and time of each method."""
    print(f"\n{'masked MSE per band² / 1e-6':31}{'numbers':>8}{'bytes':>7}{'median':>9}{'90 %':>9}"
          f"{'time / ms':>11}")  # fmt: skip
    for one in all_tried:
        middle, high = quantiles(one.mse, 0.5, 0.9)
        stored = timed = ""
        if one.numbers:
            count = np.median(one.numbers)
            stored = f"{count:8.0f}{BYTES_PER_NUMBER * count:7.0f}"
            timed = f"{1e3 * np.median(one.seconds):11.1f}"
        print(f"{one.label:31}{stored:15}{1e6 * middle:9.3f}{1e6 * high:9.3f}{timed}")


def print_colours(all_tried: Sequence[Tried]) -> None:
    """Print colour differences and XYZ errors of each method."""
    head = "".join(f"{name:>15}" for name in LIGHTS)
    judged = [one for one in all_tried if one.delta_e]
    print(f"\n{'ΔE2000, median and 90 %':31}{head}")
    for one in judged:
        found = [quantiles(column, 0.5, 0.9) for column in np.array(one.delta_e).T]
        print(f"{one.label:31}" + "".join(f"{low:8.2f}{high:7.2f}" for low, high in found))
    print(f"\n{'XYZ error, median and 90 %':31}{head}")
    for one in judged:
        found = [quantiles(column, 0.5, 0.9) for column in np.array(one.xyz_error).T]
        print(f"{one.label:31}" + "".join(f"{low:8.1%}{high:7.1%}" for low, high in found))


def print_kept_light(targets: Sequence[Target]) -> None:
    """Print how much of the light of the excited columns is above the threshold."""
    parts = []
    for target in targets:
        matrix, excited = target.matrix, target.values.any(axis=0)
        kept = with_values(matrix, target.values).reradiated_fraction[excited].sum()
        parts.append(float(kept / matrix.reradiated_fraction[excited].sum()))
    low, middle = quantiles(parts, 0.1, 0.5)
    print(f"light above the threshold, of that in the same columns: median {middle:.1%}, "
          f"10 % {low:.1%}")  # fmt: skip


def print_speed(all_tried: Sequence[Tried]) -> None:
    """Print how much faster labrig is, matrix by matrix, and how often its error is no larger."""
    by_name = {(one.name, one.components): one for one in all_tried}
    print(f"\n{'times as fast as':52}{'median':>8}{'10 %':>8}{'90 %':>8}  error ratio, no larger")
    same = [
        (ours, size, theirs, size)
        for ours, theirs in (
            ("labrig", "pomegranate, defaults"),
            ("labrig", "pomegranate, 1 start"),
            ("labrig", "pomegranate, 8 starts"),
            ("labrig, likelihood only", "pomegranate, 8 starts"),
        )
        for size in COMPONENTS[1:]
    ]
    fewer = [("labrig", size, "pomegranate, 8 starts", COMPONENTS[-1]) for size in COMPONENTS[1:3]]
    for ours, our_size, theirs, their_size in (*same, *fewer):
        one, other = by_name[ours, our_size], by_name[theirs, their_size]
        low, middle, high = quantiles(np.array(other.seconds) / one.seconds, 0.1, 0.5, 0.9)
        errors = np.array(one.mse) / other.mse
        known = errors[np.isfinite(errors)]
        print(f"{f'{one.label} : {other.label}':52}{middle:8.1f}{low:8.1f}{high:8.1f}"
              f"{np.median(known):9.2f}{(known <= SAME_ERROR).mean():10.0%}")  # fmt: skip


def print_postits(folder: Path, pomegranate: Pomegranate) -> None:
    """Print masked errors of the paper's Post-It notes as measured, with its threshold."""
    print(f"\nPost-It as measured, threshold {POSTIT_THRESHOLD}; masked MSE / 1e-6")
    print(f"{'':10}{'components':>11}{'pomegranate':>13}{'likelihood':>12}{'refined':>9}")
    for colour in POSTITS:
        measured = read_reradiation(folder / f"art_postit/fluorescent_{colour}.csv")
        target = Target.of(measured, POSTIT_THRESHOLD)
        for components in COMPONENTS:
            theirs = target.mse(pomegranate.several_starts(target, components))
            fit = fit_mixture(measured, components, threshold=POSTIT_THRESHOLD)
            likely = target.mse(likelihood_only(target, components))
            print(f"{colour:10}{components:11}{1e6 * theirs:13.2f}{1e6 * likely:12.2f}"
                  f"{1e6 * fit.masked_mse:9.2f}")  # fmt: skip


def print_draws(targets: Sequence[Target]) -> None:
    """Print what it costs to draw output wavelengths from a mixture and from a table."""
    print(
        f"\n{DRAWS} draws of the output{'':14}{'time / s':>9}{'memory / MB':>13}{'stored / B':>12}"
    )
    target = targets[len(targets) // 2]
    matrix = target.matrix
    rng, edges_nm = np.random.default_rng(1), matrix.input_edges_nm
    lit = np.flatnonzero(target.values.any(axis=0))
    input_nm = rng.uniform(edges_nm[lit[0]], edges_nm[lit[-1] + 1], DRAWS)
    drawn: list[tuple[str, Callable[[], Floats], int]] = []
    for components in (2, 4, AS_RANK_1):
        mixture = fit_mixture(matrix, components).mixture
        conditional = mixture.output_given_input
        drawn.append((
            f"mixture {components}",
            partial(conditional.sample, input_nm, rng),
            BYTES_PER_NUMBER * PER_COMPONENT * components,
        ))  # fmt: skip
    table = OutputTable.of(matrix, target.values)
    drawn.append(("table of the distribution", partial(table.sample, input_nm, rng),
                  BYTES_PER_NUMBER * table.cumulative.size))  # fmt: skip
    for name, draw, stored in drawn:
        seconds = min(timed(draw) for _ in range(3))
        tracemalloc.start()
        draw()
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        print(f"{name:35}{seconds:9.2f}{peak / 1e6:13.0f}{stored:12}")


def timed(run: Callable[[], object]) -> float:
    """Return the processor time of a call in seconds."""
    before = time.process_time()
    run()
    return time.process_time() - before


@dataclass(frozen=True, eq=False)
class OutputTable:
    """Distribution of the output for each input band, for inversion."""

    input_edges_nm: Floats
    output_edges_nm: Floats
    cumulative: Floats

    @classmethod
    def of(cls, matrix: ReradiationMatrix, values: Floats) -> "OutputTable":
        """Return the table of values per band; dark columns draw evenly."""
        chance = np.maximum(values, 0.0).T
        chance = np.where(chance.any(axis=1, keepdims=True), chance, 1.0)
        cumulative = np.cumsum(chance, axis=1)
        return cls(
            matrix.input_edges_nm, matrix.output_edges_nm, cumulative / cumulative[:, -1:]
        )  # fmt: skip

    def sample(self, input_nm: Floats, rng: np.random.Generator) -> Floats:
        """Draw an output for each input, evenly within its band."""
        bands = self.cumulative.shape[1]
        column = np.searchsorted(self.input_edges_nm, input_nm, side="right") - 1
        # One search in all columns: those of higher index have a higher sum.
        ends = (self.cumulative + np.arange(len(self.cumulative))[:, np.newaxis]).ravel()
        found = np.searchsorted(ends, column + rng.random(len(input_nm)), side="right")
        row = np.minimum(found - column * bands, bands - 1)
        width = np.diff(self.output_edges_nm)[row]
        return np.asarray(self.output_edges_nm[row] + width * rng.random(len(input_nm)))


def print_memory() -> None:
    """Print the memory of the paper's texture, as the paper counts and as labrig stores it."""
    grid = np.linspace(300.0, 800.0, PAPER_BANDS)
    texels = np.ones((PAPER_FLUORESCENT, 8, 8), dtype=np.float32)
    texture = fit_mixture_texture(texels, np.linspace(300, 600, 8), np.linspace(380, 700, 8))
    off_diagonal = PAPER_FLUORESCENT * (len(grid) ** 2 - len(grid))
    stokes = off_diagonal // 2
    diagonal = PAPER_PIXELS * len(grid)
    print(f"\n{PAPER_PIXELS} texels, {PAPER_FLUORESCENT} of them fluorescent, "
          f"{PAPER_BANDS} × {PAPER_BANDS} bands, K = 2")  # fmt: skip
    print(f"{'bytes':31}{'table':>13}{'mixture':>11}{'diagonal':>11}{'ratio':>9}{'with it':>9}")
    for name, tables, mixtures, diagonals in (
        ("as in the paper", 4 * off_diagonal, 8 * PAPER_NUMBERS * PAPER_FLUORESCENT, 8 * diagonal),
        ("all in single precision", 4 * off_diagonal, texture.stored_bytes, 4 * diagonal),
        ("the Stokes side only", 4 * stokes, texture.stored_bytes, 4 * diagonal),
    ):
        with_it = (tables + diagonals) / (mixtures + diagonals)
        print(f"{name:31}{tables:13}{mixtures:11}{diagonals:11}{tables / mixtures:9.1f}"
              f"{with_it:9.2f}")  # fmt: skip


def print_large_textures(targets: Sequence[Target]) -> None:
    """Print time, error and memory of many texels, blends of three materials each."""
    rng = np.random.default_rng(TEXELS)
    matrix = targets[0].matrix
    width_nm = matrix.output_width_nm[:, np.newaxis]
    shown = np.stack([target.values / width_nm for target in targets]).astype(np.float32)
    parts = rng.dirichlet(np.ones(3), TEXELS).astype(np.float32)
    tables = BYTES_PER_NUMBER * int(matrix.is_stokes.sum()) * TEXELS
    diagonals = BYTES_PER_NUMBER * len(matrix.output_nm) * TEXELS
    print(f"\n{f'{TEXELS} texels, K = 2, blends of':40}{'time / s':>9}{'processor / s':>15}"
          f"{'median MSE':>12}{'bytes':>10}{'table':>11}{'ratio':>7}"
          f"{'with diagonal':>15}")  # fmt: skip
    same = np.broadcast_to(rng.choice(len(shown), 3, replace=False), (TEXELS, 3))
    for name, which in (
        ("three materials, the same everywhere", same),
        ("three of all materials, anew in each", rng.integers(0, len(shown), (TEXELS, 3))),
    ):
        texels = np.zeros((TEXELS, *shown.shape[1:]), dtype=np.float32)
        for part, index in zip(parts.T, which.T, strict=True):
            texels += part[:, np.newaxis, np.newaxis] * shown[index]
        before, used = time.perf_counter(), time.process_time()
        texture = fit_mixture_texture(texels, matrix.input_nm, matrix.output_nm, components=2)
        seconds, used = time.perf_counter() - before, time.process_time() - used
        stored = texture.stored_bytes
        print(f"{name:40}{seconds:9.1f}{used:15.1f}"
              f"{1e6 * np.median(texture.masked_mse):10.2f}e-6{stored:10}{tables:11}"
              f"{tables / stored:7.1f}"
              f"{(tables + diagonals) / (stored + diagonals):15.1f}")  # fmt: skip


if __name__ == "__main__":
    main()
