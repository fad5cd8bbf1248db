"""Runs to export: recorded on a simulated bench and processed, once for all tests."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

from labrig.acquire import PlanClock, RunObserver, read_rig_file, read_run_protocol
from labrig.bench import Recording
from labrig.foundation import resources
from labrig.foundation.clock import Clock
from labrig.process import process_run
from labrig.process.provenance import describe_run
from labrig.protocols.decay.result import DecayResult
from labrig.record import read_run
from labrig.record.history import RunDescription
from labrig.results import read_result
from tests.acquire.fakes import Watching
from tests.quick_yaml import read_quickly, write_quickly

#: The rest of the frame stays dark.
SAMPLE = [{"material": "blue-paint", "region": [0.25, 0.25, 0.5, 0.5]}]


@dataclass(frozen=True)
class Finished:
    """A processed run, its description and its result as read back."""

    folder: Path
    about: RunDescription
    result: DecayResult


@pytest.fixture(scope="session")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Finished:
    """Two decays of one patch called `sample`."""
    return finish(tmp_path_factory.mktemp("one"), repeats=2)


@pytest.fixture(scope="session")
def with_dark_patch(tmp_path_factory: pytest.TempPathFactory) -> Finished:
    """Two patches with names that are none in NeXus; of one there is no fit."""
    patches = {"Öl, 2 %": [0.3, 0.3, 0.4, 0.4], "Öl; 2 %": [0.0, 0.0, 0.2, 0.2]}
    return finish(tmp_path_factory.mktemp("two"), patches=patches)


def finish(folder: Path, **keys: object) -> Finished:
    """A short decay."""
    rig = read_quickly((resources.folder("config") / "sim.yaml").read_text())
    rig["simulation"] |= {"sensor": {"width": 96, "height": 64}, "sample": SAMPLE}
    rig["simulation"] |= {"epoch": "2026-01-01T00:00:00Z", "initial": {"lamp": "off"}}
    protocol = {
        "protocol": "decay",
        "sample": {"name": "Glühfarbe", "batch": "7"},
        "charge": "10 min",
        "for": "40 s",
        "exposure": "1 s",
    }
    paths = {}
    for name, content in (("rig", rig), ("protocol", protocol | keys)):
        paths[name] = folder / f"{name}.yaml"
        paths[name].write_text(write_quickly(content))
    run = Recording.prepare(paths["protocol"], paths["rig"], folder / "runs").record(quietly)
    process_run(run)
    record = read_run(run)
    about = describe_run(record, read_run_protocol(run), read_rig_file(run / "rig.yaml"))
    result = read_result(run)
    assert isinstance(result, DecayResult)
    return Finished(run, about, result)


@contextmanager
def quietly(plan_clock: PlanClock, clock: Clock) -> Iterator[RunObserver]:
    yield Watching()
