"""Columns measured directly, against the true matrix averaged over each light's real spectrum."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from labrig.analyse import AnalysisContext
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError
from labrig.material import read_reradiation
from labrig.optics import SpectrometerReading, read_spectrometer_reading
from labrig.protocols.direct_bispectral.analysis import analyse
from labrig.protocols.direct_bispectral.protocol import DirectSpectra
from labrig.protocols.direct_bispectral.result import DirectBispectralResult
from labrig.record import Attempt, SpectrumRecord
from labrig.results import DirectColumns
from tests.analyse.direct_bench import (
    MATERIALS,
    record,
    true_column,
    true_light,
    true_reflectance,
)
from tests.analyse.recorded import part_of, processed_once
from tests.analyse.small_runs import DIRECT
from tests.results.made import assert_read_back
from tests.warned import codes, of_code

pytest.importorskip("seabreeze")


#: Two that tell one another's reflectance, and one far off.
LEDS = ["430 nm", "455 nm", "625 nm"]


def misfit(columns: DirectColumns, material: str, of_sigma: float = 1.0) -> FloatArray:
    """χ² over the number of entries of each column, with the error that its entries share."""
    chi2 = []
    for number, light in enumerate(columns.lights):
        true, _ = true_column(material, true_light(light), columns.output_nm)
        sigma, common = columns.column_sigma[:, number], columns.common_sigma[:, number]
        of_light = columns.light_sigma[number] * columns.column[:, number]
        covariance = np.diag(sigma**2 - common**2 - of_light**2)
        covariance += np.outer(common, common) + np.outer(of_light, of_light)
        error = columns.column[:, number] - true
        chi2.append(error @ np.linalg.solve(covariance * of_sigma**2, error) / len(error))
    return np.array(chi2)


def are_right(chi2: FloatArray) -> bool:
    return bool(0.9 < np.sqrt(chi2.mean()) < 1.1)


@pytest.fixture(scope="module")
def quick(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of one sample under three LEDs."""
    return record(tmp_path_factory.mktemp("quick"), DIRECT)


def test_columns_are_the_true_matrix_over_the_real_lights_within_sigma(tmp_path: Path) -> None:
    chi2, pulls, sigmas, reflectance, mixed = [], [], [], [], []
    for seed in (1, 2, 3):
        folder = tmp_path / str(seed)
        folder.mkdir()
        samples = MATERIALS[seed - 1 :: 3]
        run = record(folder, {"leds": LEDS, "samples": list(samples), "repetitions": 6}, seed,
                     sample=[{"material": name} for name in samples])  # fmt: skip
        result = analyse(part_of(run))
        assert result.warnings == ()
        for name, columns in result.samples.items():
            chi2.append(misfit(columns, name))
            true = [true_column(name, true_light(light), columns.output_nm) for light in LEDS]
            apart = columns.reradiated - np.array([reradiated for _, reradiated in true]).T
            pulls.append((apart / columns.reradiated_sigma)[~columns.is_mixed])
            mixed.append((apart / columns.reradiated_sigma)[columns.is_mixed])
            sigmas.append(np.median(columns.column_sigma))
            known = columns.reflectance - true_reflectance(name, columns.output_nm)
            reflectance.append(known / columns.reflectance_sigma)
    whole = np.concatenate(chi2)
    assert are_right(whole)
    assert not are_right(whole / 1.2**2)
    assert not are_right(whole * 1.2**2)
    assert 0.8 < np.sqrt(np.mean(np.concatenate(pulls) ** 2)) < 1.2
    # What may be re-radiated where the light itself is has all of its range in σ.
    assert 0.3 < np.sqrt(np.nanmean(np.concatenate(mixed) ** 2)) < 1.2
    assert 0.3 < np.sqrt(np.nanmean(np.concatenate(reflectance) ** 2)) < 1.2
    # A Labsphere BFC-450 repeats its ceramic tiles within 0.001 to 0.006 (shared data).
    assert max(sigmas) < 0.001


@pytest.mark.campaign
@pytest.mark.parametrize("seed", range(10, 16))
def test_all_leds_on_all_shipped_samples(tmp_path: Path, seed: int) -> None:
    result = analyse(part_of(record(tmp_path, {"samples": list(MATERIALS)}, seed)))
    assert result.warnings == ()
    chi2 = [misfit(columns, name) for name, columns in result.samples.items()]
    assert 0.85 < np.sqrt(np.mean(chi2)) < 1.15


def test_what_the_light_itself_covers_is_told_by_another_light_or_not_at_all(quick: Path) -> None:
    (columns,) = analyse(part_of(quick)).samples.values()
    own = np.argmin(np.abs(columns.output_nm[:, np.newaxis] - columns.input_nm), axis=0)
    numbers = np.arange(len(columns.lights))
    assert columns.is_mixed[own[1:], numbers[1:]].all()
    assert np.isnan(columns.reradiated[own, numbers][1:]).all()
    assert np.isnan(columns.reflectance[columns.output_nm > 600]).all()
    matrix, is_extrapolated = columns.interpolated("yellow")
    unlit = (matrix.input_nm < columns.input_nm[0] - 5) | (
        matrix.input_nm > columns.input_nm[-1] + 5
    )
    assert (is_extrapolated == unlit).all()
    stokes = matrix.is_stokes
    assert np.isnan(matrix.reradiation[:, unlit][stokes[:, unlit]]).all()
    between = (matrix.output_nm > 620)[:, np.newaxis] & ~unlit
    assert np.isfinite(matrix.reradiation[between]).all()


def test_the_files_are_read_back_and_the_report_says_what_it_is(quick: Path) -> None:
    processed = processed_once(quick)
    assert isinstance(processed.result, DirectBispectralResult)
    assert_read_back(processed.result)
    (columns,) = processed.result.samples.values()
    folder = processed.report.parent
    matrix = read_reradiation(folder / "matrix.csv")
    assert np.array_equal(matrix.input_nm, columns.input_nm)
    assert np.array_equal(matrix.reradiation, columns.reradiated / 10, equal_nan=True)
    assert matrix.column_correlation is not None
    assert len((folder / "columns.csv").read_text().splitlines()) == 1 + 3 * 41
    assert (folder / "material.yaml").is_file()
    line, *budgets = processed.lines
    assert len(budgets) == 3
    assert line.startswith("yellow-textile: re-radiates up to ")
    page = processed.report.read_text()
    assert "reflected and re-radiated light come together" in page
    assert "Beyond its band" in page


def lit(attempt: Attempt) -> SpectrumRecord:
    """The reading of an attempt with its light on."""
    return [one for one in attempt.spectra if one.role == DirectSpectra.LIT][-1]


def changed(context: AnalysisContext, change: dict[str, Any]) -> AnalysisContext:
    """A part some of whose units have other readings: by unit, the factor and the unit of more."""
    attempts = {attempt.unit: attempt for attempt in context.run.attempts}
    readings: dict[str, SpectrometerReading] = {}
    folder = context.run.folder / "frames"
    for unit, (factor, more) in change.items():
        spectrum = lit(attempts[unit])
        reading = read_spectrometer_reading(spectrum.path)
        stage = unit.removeprefix("again ").partition(":")[0]
        dark = next(
            read_spectrometer_reading(one.path)
            for one in attempts[f"{stage}: dark"].spectra
            if np.isclose(one.integration_s, spectrum.integration_s)
        )
        light = factor * (reading.raw_counts - dark.raw_counts.mean(axis=0))
        counts = dark.raw_counts[: len(light)] + light
        for other, part_of_it in more.items():
            added = read_spectrometer_reading(lit(attempts[other]).path)
            counts = counts + part_of_it * (added.raw_counts - dark.raw_counts.mean(axis=0))
        readings[unit] = replace(reading, raw_counts=np.rint(counts))
    new = []
    for attempt in context.run.attempts:
        if attempt.unit not in readings:
            new.append(attempt)
            continue
        data = readings[attempt.unit].text().encode()
        old = lit(attempt)
        path = folder / f"{old.path.stem}-changed.csv"
        path.write_bytes(data)
        made = replace(old, path=path, **_checks(data))
        spectra = [made if one is old else one for one in attempt.spectra]
        new.append(replace(attempt, spectra=spectra))
    return replace(context, run=replace(context.run, attempts=new))


def _checks(data: bytes) -> dict[str, Any]:
    from hashlib import sha256

    return {"sha256": sha256(data).hexdigest(), "size_bytes": len(data)}


@pytest.mark.parametrize(
    ("change", "subject", "code", "kept"),
    [
        ({"white: 430 nm": (0.0, {})}, "430 nm", "light-unlit", 2),
        (
            {"white: 430 nm": (1.0, {"white: 490 nm": 0.3})},
            "430 nm",
            "two-lights",
            2,
        ),
        ({"white: 365 nm": (1.0, {"white: 490 nm": 0.3})}, "365 nm", "two-lights", 2),
        ({"white: 430 nm": (1000.0, {})}, "white under 430 nm", "spectrometer-saturated", 2),
        ({"yellow-textile: 430 nm": (0.0, {})}, "yellow-textile", "no-light-back", 2),
        (
            {"yellow-textile: 490 nm": (1.0, {"white: 430 nm": 0.3})},
            "yellow-textile",
            "stray-light",
            2,
        ),
        (
            {
                f"{stage}: 430 nm": (0.0, {f"{stage}: 490 nm": 1.0})
                for stage in ("white", "yellow-textile")
            },
            "490 nm",
            "light-is-another",
            2,
        ),
    ],
)
def test_a_wrong_light_is_named_and_the_others_are_kept(
    quick: Path, change: dict[str, Any], subject: str, code: str, kept: int
) -> None:
    result = analyse(changed(part_of(quick), change))
    assert of_code(result.warnings, code).subject == subject
    (columns,) = result.samples.values()
    assert len(columns.lights) == kept


@pytest.mark.campaign
def test_lights_in_another_order_and_a_sample_that_bleaches_are_said(quick: Path) -> None:
    swapped = {
        f"{stage}: {to}": (0.0, {f"{stage}: {by}": 1.0})
        for stage in ("white", "yellow-textile")
        for to, by in (("430 nm", "490 nm"), ("490 nm", "430 nm"))
    }
    result = analyse(changed(part_of(quick), swapped))
    assert codes(result.warnings).count("peak-differs") == 2
    part = part_of(quick)
    first = part.protocol.shuffled()[0]
    result = analyse(changed(part, {f"again yellow-textile: {first}": (0.9, {})}))
    (warning,) = result.warnings
    assert (warning.code, warning.subject) == ("sample-bleached", "yellow-textile")
    assert warning.values["light"] == first
    assert warning.values["ratio"]["value"] == pytest.approx(0.9, abs=0.01)
    (columns,) = result.samples.values()
    assert columns.drift.value == pytest.approx(0.9, abs=0.01)
    steady = next(iter(analyse(part).samples.values()))
    assert (columns.column_sigma >= steady.column_sigma).all()
    assert columns.column_sigma.max() > 5 * steady.column_sigma.max()


def test_a_white_that_fluoresces_is_noticed(tmp_path: Path, quick: Path) -> None:
    """The sample stands for a reference that gives back blue and ultraviolet as green."""
    glow = {"white: 365 nm": (1.0, {"yellow-textile: 365 nm": 0.3})}
    result = analyse(changed(part_of(quick), glow))
    assert of_code(result.warnings, "reference-fluoresces").subject == "365 nm"


def test_what_the_room_adds_is_said_and_subtracted(tmp_path: Path) -> None:
    run = record(tmp_path, DIRECT | {"leds": ["430 nm"]}, ambient=1e-3)
    result = analyse(part_of(run))
    assert codes(result.warnings) == ["light-left"]
    (columns,) = result.samples.values()
    assert np.sqrt(misfit(columns, "yellow-textile").mean()) == pytest.approx(1.0, abs=0.3)


@pytest.mark.campaign
def test_light_that_comes_after_the_dark_is_said_and_subtracted(tmp_path: Path) -> None:
    leak = {"ambient_light": {"level": "0.5 %", "at": "1 min"}}
    run = record(tmp_path, DIRECT | {"leds": ["430 nm"]}, faults=[leak])
    result = analyse(part_of(run))
    (warning,) = result.warnings
    assert (warning.code, warning.subject) == ("light-left", "white")
    (columns,) = result.samples.values()
    assert np.sqrt(misfit(columns, "yellow-textile").mean()) == pytest.approx(1.0, abs=0.3)


def test_an_led_that_stays_lit_is_left_out_and_its_light_subtracted(tmp_path: Path) -> None:
    stuck = {"led_stuck": {"relay": 5}}
    run = record(tmp_path, DIRECT | {"leds": ["490 nm", "430 nm"]}, faults=[stuck])
    result = analyse(part_of(run))
    assert codes(result.warnings).count("light-left") == 1
    (columns,) = result.samples.values()
    assert columns.lights == ("430 nm",)
    assert np.sqrt(misfit(columns, "yellow-textile").mean()) == pytest.approx(1.0, abs=0.3)


@pytest.mark.campaign
def test_filters_before_the_lamp_are_lights_too_and_leaks_are_said(tmp_path: Path) -> None:
    filters = {"filters": ["bandpass-425", "bandpass-475"], "samples": ["yellow-textile"]}
    result = analyse(part_of(record(tmp_path, filters | {"repetitions": 4})))
    assert codes(result.warnings) == ["filter-leaks"] * 2
    assert [round(light.peak_nm, -1) for light in result.lights] == [440, 480]
    (columns,) = result.samples.values()
    blue = columns.reradiated[:, 0]
    strongest = int(np.nanargmax(blue))
    assert columns.output_nm[strongest] == pytest.approx(520, abs=20)
    assert blue[strongest] > 5 * columns.reradiated_sigma[strongest, 0]


def test_an_unfinished_run_gives_what_it_has(quick: Path) -> None:
    part = part_of(quick)
    done = [attempt for attempt in part.run.attempts if attempt.unit != "yellow-textile: 430 nm"]
    result = analyse(replace(part, run=replace(part.run, attempts=done)))
    unread = of_code(result.warnings, "not-read")
    assert (unread.subject, unread.values["light"]) == ("yellow-textile", "430 nm")
    only_white = [a for a in part.run.attempts if not a.unit.startswith("yellow")]
    with pytest.raises(DataError, match="no sample was read under a light"):
        analyse(replace(part, run=replace(part.run, attempts=only_white)))
    with pytest.raises(DataError, match="expected readings of the white reference"):
        analyse(replace(part, run=replace(part.run, attempts=[])))


def test_without_a_scale_there_is_one_clear_line(quick: Path) -> None:
    part = part_of(quick)
    attempts = []
    for attempt in part.run.attempts:
        spectra = []
        for spectrum in attempt.spectra:
            reading = replace(read_spectrometer_reading(spectrum.path), calibration=None)
            data = reading.text().encode()
            path = spectrum.path.with_name(f"{spectrum.path.stem}-relative.csv")
            path.write_bytes(data)
            spectra.append(replace(spectrum, path=path, **_checks(data)))
        attempts.append(replace(attempt, spectra=spectra))
    with pytest.raises(DataError, match="expected a spectrometer with a scale") as caught:
        analyse(replace(part, run=replace(part.run, attempts=attempts)))
    assert "\n" not in str(caught.value)
