"""The role `spectrometer`: planned, read, recorded in the run folder, resumed, checked."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from labrig.acquire import (
    LEDS,
    LEDS_OFF,
    SPECTROMETER,
    LedSwitch,
    ProtocolModel,
    ReadSpectrum,
    Session,
    Unit,
    at,
    plan,
    read_rig_file,
    run_units,
)
from labrig.analyse import Overrides, verify_frames
from labrig.analyse.frames import require_intact
from labrig.bench import open_bench
from labrig.foundation.errors import DataError, DeviceLostError, ProtocolError
from labrig.optics import read_spectrometer_reading
from labrig.record import FRAMES, RunFolder, damaged_frames, read_run
from tests.conftest import Ended
from tests.quick_yaml import read_quickly, write_quickly
from tests.resealed import reseal

from .fakes import Watching

pytest.importorskip("seabreeze")

Make = Callable[..., Path]
NAMES = ("450 nm", "620 nm")


@pytest.fixture
def make(make_rig: Make) -> Make:
    """Writes a simulated rig with two LEDs and a spectrometer, changed as told."""

    def write(**simulation: object) -> Path:
        path = make_rig(
            leds=[{"relay": 1, "centre": 450}, {"relay": 2, "centre": 620}], **simulation
        )
        content = read_quickly(path.read_text())
        content["simulation"] |= {"epoch": "2026-01-01T00:00:00Z", "initial": {"lamp": "off"}}
        relays = {name: {"relay": n, "settling": "0.5 s"} for n, name in enumerate(NAMES, start=1)}
        content["devices"] |= {
            "leds": {
                "driver": "numato", "address": "sim://room/relays", "channels": relays,
            },
            "spectrometer": {
                "driver": "seabreeze_spectrometer", "address": "sim://room/spectrometer",
            },
        }  # fmt: skip
        path.write_text(write_quickly(content))
        return path

    return write


@dataclass(frozen=True)
class LedUnit:
    """An LED's spectrum, and a dark one."""

    name: str

    def run(self, session: Session) -> None:
        session.perform(ReadSpectrum("dark", 0.1, 4))
        session.perform(LedSwitch(self.name))
        session.wait(session.rig[LEDS].settling_s(self.name), f"{self.name} settles")
        session.run_sequence([at(0.0, ReadSpectrum("led", 0.1, 4)), at(1.0, LEDS_OFF)])
        assert len(session.spectra("led")) <= len(NAMES)


class Spectra(ProtocolModel):
    """The spectrum of each LED."""

    def units(self) -> list[Unit]:
        return [LedUnit(name) for name in NAMES]


@pytest.fixture
def run(make: Make, tmp_path: Path) -> Path:
    """A run folder with the spectra of both LEDs."""
    return measured(make(), tmp_path / "runs")


def measured(rig: Path, runs: Path) -> Path:
    with (
        open_bench(read_rig_file(rig), str(rig)) as bench,
        bench.devices() as devices,
        RunFolder.create(runs, "spectra", bench.clock.wall(), {}, seed=1) as folder,
    ):
        run_units(Spectra(protocol="spectra").units(), devices, folder, Watching(), {})
        assert folder.unknown_files() == []
        return folder.path


def test_what_is_read_is_recorded_raw_and_can_be_corrected(run: Path) -> None:
    record = read_run(run)
    leds = record.spectra("led")
    assert [spectrum.unit for spectrum in leds] == list(NAMES)
    for spectrum, dark, peak_nm in zip(leds, record.spectra("dark"), (450, 620), strict=True):
        assert (spectrum.integration_s, spectrum.repetitions) == (0.1, 4)
        assert spectrum.path.parent.name == FRAMES
        assert spectrum.end_time - spectrum.start_time == pytest.approx(0.5, abs=0.2)
        assert spectrum.start_time > dark.end_time
        reading = read_spectrometer_reading(spectrum.path)
        corrected = reading.corrected(read_spectrometer_reading(dark.path))
        brightest_nm = corrected.wavelength_nm[corrected.counts.argmax()]
        assert brightest_nm == pytest.approx(peak_nm, abs=5)
        assert reading.raw_counts.min() > 1000
    actions = [(action.device, action.action) for action in record.completed()["450 nm"].actions]
    assert actions == [
        ("spectrometer", "dark spectrum, 100 ms x 4"), ("leds", "450 nm on"),
        ("spectrometer", "led spectrum, 100 ms x 4"), ("leds", "off"),
    ]  # fmt: skip


def test_the_same_rig_gives_the_same_bytes(make: Make, run: Path, tmp_path: Path) -> None:
    again = measured(make(), tmp_path / "again")
    for path in sorted((run / FRAMES).iterdir()):
        assert path.read_bytes() == (again / FRAMES / path.name).read_bytes()


def test_a_journal_that_counts_other_spectra_was_changed(run: Path) -> None:
    journal = run / "journal.jsonl"
    lines = journal.read_text().splitlines()
    kept = [line for line in lines if '"role": "led"' not in line]
    assert len(kept) == len(lines) - 2
    journal.write_text("\n".join(kept) + "\n")
    reseal(journal)
    with pytest.raises(DataError, match="it counts 2 spectra, there are 1"):
        read_run(run)


def test_a_spectrum_that_was_changed_is_refused(run: Path) -> None:
    record = read_run(run)
    assert verify_frames(record, Overrides()) == "all 4 frames have the checksums of the journal"
    led = record.spectra("led")[0]
    led.path.write_text(led.path.read_text().replace("450", "451"))
    (damaged,) = damaged_frames(run, [*record.spectra("led"), *record.spectra("dark")]).items()
    assert damaged == (led, "was changed after the run (its checksum differs)")
    require_intact(record, ["dark"], Overrides())
    with pytest.raises(DataError, match=r"000002\.csv was changed after the run"):
        require_intact(record, ["led"], Overrides())
    assert "left out: 000002.csv" in verify_frames(record, Overrides(excluded=frozenset({"2"})))


def test_what_was_measured_before_a_break_is_there_after_it(make: Make, tmp_path: Path) -> None:
    rig = make()
    seen: list[int] = []

    class Counting:
        def __init__(self, name: str) -> None:
            self.name = name

        def run(self, session: Session) -> None:
            seen.append(len(session.spectra("led")))
            session.perform(ReadSpectrum("led", 0.1, 2))
            if len(seen) == 2:
                raise DeviceLostError("pulled")

    units = [Counting("one"), Counting("two"), Counting("three")]
    with open_bench(read_rig_file(rig), str(rig)) as bench, bench.devices() as devices:
        folder = RunFolder.create(tmp_path / "runs", "break", bench.clock.wall(), {}, seed=1)
        with folder:
            with pytest.raises(DeviceLostError):
                run_units(units, devices, folder, Watching(), {})
            folder.close_open_attempts(bench.clock.wall, "fail", "pulled")
        with RunFolder(folder.path, seed=1) as again:
            run_units(units, devices, again, Watching(), {})
        record = read_run(folder.path)
    assert seen == [0, 1, 1, 2]
    assert [spectrum.path.name for spectrum in record.spectra("led")] == [
        "000001.csv", "000003.csv", "000004.csv",
    ]  # fmt: skip


def test_it_is_planned_with_its_time(make: Make) -> None:
    rig = make()
    planned = plan(Spectra(protocol="spectra"), read_rig_file(rig), str(rig))
    lines = [line.split(")  ")[1].split() for line in planned.lines() if " spectrometer " in line]
    assert [" ".join(line) for line in lines] == [
        "spectrometer dark spectrum, 100 ms x 4", "spectrometer led spectrum, 100 ms x 4",
    ] * 2  # fmt: skip
    # Five tenths of a second for each reading, half a second of settling, and up to the LED's end.
    assert planned.unit_ends_s[-1] == pytest.approx(2 * (0.5 + 0.5 + 1.0), abs=0.1)


@pytest.mark.parametrize(
    ("action", "said"),
    [((0.1, 0), "1 to 1000 repetitions"), ((60.0, 1), "integration time of 1 min; 1 ms to 10 s")],
)
def test_what_cannot_be_read_is_refused_in_the_plan(
    action: tuple[float, int], said: str, make: Make
) -> None:
    class Wrong(ProtocolModel):
        def units(self) -> list[Unit]:
            class One:
                name = "one"

                def run(self, session: Session) -> None:
                    session.perform(ReadSpectrum("led", *action))

            return [One()]

    rig = make()
    with pytest.raises(ProtocolError, match=said):
        plan(Wrong(protocol="wrong"), read_rig_file(rig), str(rig))


def test_a_cable_that_is_pulled_ends_the_unit_in_the_dark(make: Make, tmp_path: Path) -> None:
    rig = make(faults=[{"spectrometer_unplugged": {"at": "9 s"}}])

    class Long:
        name = "long"

        def run(self, session: Session) -> None:
            session.perform(LedSwitch("450 nm"))
            session.perform(ReadSpectrum("led", 0.1, 200))

    with open_bench(read_rig_file(rig), str(rig)) as bench:
        folder = RunFolder.create(tmp_path / "runs", "long", bench.clock.wall(), {}, seed=1)
        with folder, pytest.raises(DeviceLostError, match="plug it in again"), bench.devices() as d:
            run_units([Long()], d, folder, Watching(), {})
        assert bench.room is not None
        assert bench.room.room.leds.lit == set()
        assert folder.read().completed() == {}


def test_the_rig_check_reads_it(make: Make, labrig: Callable[..., Ended]) -> None:
    ended = labrig("rig", "check", make(), "--json")
    report: dict[str, Any] = json.loads(ended.out)
    assert (ended.code, report["failures"], report["unsafe"]) == (0, [], None)
    (found,) = [device for device in report["devices"] if device["key"] == "spectrometer"]
    assert "USB2000PLUS, serial USB2P00001" in found["identity"]
    said = {one["what"]: one["value"] for one in found["measured"]}
    assert said["pixels"] == "2048, 270.0 nm to 991.2 nm"
    noise = float(said["10 spectra of 100 ms"].split("noise ")[1].split()[0])
    assert noise == pytest.approx(np.hypot(45.0, 12.0), rel=0.15)
    assert [one["what"] for one in found["findings"]] == [
        "no absolute scale: its counts are relative", "with the lights off it sees none",
    ]  # fmt: skip


def test_light_in_the_room_is_told(make: Make, labrig: Callable[..., Ended]) -> None:
    ended = labrig("rig", "check", make(ambient=0.1), "--json")
    report: dict[str, Any] = json.loads(ended.out)
    (found,) = [device for device in report["devices"] if device["key"] == "spectrometer"]
    assert "with the lights off it sees light" in found["findings"][-1]["what"]


def test_without_a_spectrometer_the_plan_says_so(make_rig: Make) -> None:
    rig = make_rig()

    class Wanting(ProtocolModel):
        def units(self) -> list[Unit]:
            class One:
                name = "one"

                def run(self, session: Session) -> None:
                    session.rig[SPECTROMETER].integration_limits_s()

            return [One()]

    with pytest.raises(ProtocolError, match="needs a spectrometer"):
        plan(Wanting(protocol="wanting"), read_rig_file(rig), str(rig))
