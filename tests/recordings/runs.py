"""Which runs are recorded: their protocols, and what of the shipped rig is otherwise."""

import shutil
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from labrig.calibration import IRRADIANCE_KIND, LVF_KIND
from labrig.process import process_run
from tests.analyse.excitation.test_excitation_run import QUICK, true_irradiance
from tests.analyse.recorded import record
from tests.analyse.spectral_bench import true_lvf_file

from .numbers import Difference, differences, keep_numbers

HERE = Path(__file__).parent
RUN, RESULT = "run", "result"
WIDTH, HEIGHT = 96, 64
#: Of the decays: dark and metering frames, then one frame every 5 s.
DECAY: dict[str, Any] = {
    "protocol": "decay", "charge": "10 min", "first": "1 s", "every": "5 s", "for": "90 s",
    "daylight": False,
}  # fmt: skip
CHAIN: dict[str, Any] = {
    "protocol": "phosphor",
    "sample": {"name": "blue-paint"},
    "parts": [
        {
            "protocol": "emission_spectrum", "charge": "2 min", "times": ["2 s", "12 s"],
            "longest": "8 s", "white": False,
        },
        DECAY,
        {key: value for key, value in QUICK.items() if key != "sample"} | {
            "first_charge": "20 s", "at_most": 2, "refine": 0, "direct": ["5 min"], "for": "10 s",
            "last_decay": "90 s",
        },
    ],
}  # fmt: skip


@dataclass(frozen=True)
class Recorded:
    """A run to record.

    Parameters
    ----------
    name
        Of its folder.
    protocol
        What is measured.
    simulation
        Keys of the room that differ from those of the shipped rig for phosphors.
    calibrations
        Writes the files that the rig names under `optics:` into the run's folder, and names them.
    """

    name: str
    protocol: dict[str, Any]
    simulation: dict[str, Any] = field(default_factory=dict)
    calibrations: Callable[[Path], tuple[str, ...]] = lambda folder: ()

    @property
    def folder(self) -> Path:
        """Where the run, `run/`, and the files of numbers of its result, `result/`, are kept."""
        return HERE / self.name

    def record(self, into: Path) -> Path:
        """Record the run in the simulated room, below `into`; its folder is returned."""

        def change(rig: dict[str, Any]) -> None:
            rig["simulation"] |= {"sensor": {"width": WIDTH, "height": HEIGHT}} | self.simulation
            rig["devices"]["lamp"]["warm_up"] = "0 s"
            rig["optics"] |= {name: str(into / f"{name}.yaml") for name in self.calibrations(into)}

        into.mkdir(parents=True, exist_ok=True)
        return record(into, self.protocol, change)

    def keep(self, run: Path) -> None:
        """Keep a run that was recorded, with its calibrations beside it."""
        kept = self.folder / RUN
        shutil.rmtree(kept, ignore_errors=True)
        shutil.copytree(run, kept)
        # A rig file names them relative to itself, wherever it lies.
        rig = (kept / "rig.yaml").read_text(encoding="utf-8")
        for name in self.calibrations(kept):
            rig = rig.replace(str(run.parents[1] / f"{name}.yaml"), f"{name}.yaml")
        (kept / "rig.yaml").write_text(rig, encoding="utf-8")

    def processed(self, into: Path) -> Path:
        """The result folder of a copy of the kept run below `into`, made by this labrig."""
        run = Path(shutil.copytree(self.folder / RUN, into / self.name))
        process_run(run)
        return run / "result"

    def keep_numbers(self, result: Path) -> None:
        """Keep the numbers of a result as what later ones are held against."""
        keep_numbers(result, self.folder / RESULT)

    def differences(self, result: Path) -> list[Difference]:
        """In what numbers `result` differs from those kept."""
        return differences(self.folder / RESULT, result)


def _calibrations(folder: Path) -> tuple[str, ...]:
    IRRADIANCE_KIND.write(folder, true_irradiance(WIDTH, HEIGHT))
    LVF_KIND.write(folder, true_lvf_file(WIDTH, HEIGHT))
    return "irradiance", "lvf"


RUNS = (
    Recorded("decay", DECAY, {"sample": "double-wide"}),
    Recorded(
        "patches",
        DECAY
        | {
            "repeats": 2,
            "patches": {"left": [0.05, 0.1, 0.4, 0.8], "right": [0.55, 0.1, 0.4, 0.8]},
        },
        {
            "sample": [
                {"material": "green-paint", "region": [0.0, 0.0, 0.5, 1.0]},
                {"material": "double-medium-bright", "region": [0.5, 0.0, 0.5, 1.0]},
            ]
        },
    ),
    Recorded("chain", CHAIN, {}, _calibrations),
    Recorded(
        "camera-unplugged",
        DECAY,
        {
            "sample": "orange-paint",
            "faults": [{"camera_unplugged": {"at": "11 min", "for": "20 s"}}],
        },
    ),
    Recorded(
        "ambient-light",
        DECAY,
        {"sample": "power-law", "faults": [{"ambient_light": {"at": "12 min"}}]},
    ),
)
