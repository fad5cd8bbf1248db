"""Which runs are recorded: their protocols, and what of the shipped rig is otherwise."""

import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from labrig.calibration import IRRADIANCE_KIND, LVF_KIND
from labrig.record import JOURNAL
from tests.analyse.excitation.bench import QUICK, true_irradiance
from tests.analyse.recorded import processed_once, record
from tests.analyse.small_runs import RECORD
from tests.analyse.spectral_bench import true_lvf_file
from tests.resealed import reseal

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
    """A run whose numbers are kept.

    Attributes
    ----------
    name
        Name of its folder.
    record
        Function that records the run in the simulated room, below a folder.
    has_frames
        Whether the run itself is kept, too, so that what records it may change.
    beside
        Function that writes the calibrations that the rig names into a folder, and names them.
    """

    name: str
    record: Callable[[Path], Path]
    has_frames: bool = False
    beside: Callable[[Path], tuple[str, ...]] = lambda folder: ()

    @property
    def folder(self) -> Path:
        """Folder of the kept run, `run/`, and of the files of numbers of its result, `result/`."""
        return HERE / self.name

    def keep(self, run: Path) -> None:
        """Keep a run that was recorded, with its calibrations beside it."""
        kept = self.folder / RUN
        shutil.rmtree(kept, ignore_errors=True)
        shutil.copytree(run, kept)
        # A rig file names them relative to itself, wherever it lies; so it does in the journal.
        for file in (kept / "rig.yaml", kept / JOURNAL):
            text = file.read_text(encoding="utf-8")
            for name in self.beside(kept):
                text = text.replace(str(run.parents[1] / f"{name}.yaml"), f"{name}.yaml")
            file.write_text(text, encoding="utf-8")
        reseal(kept / JOURNAL)

    def processed(self, into: Path) -> Path:
        """The result folder of a copy of the kept run, or of it recorded anew, below `into`."""
        if self.has_frames:
            run = Path(shutil.copytree(self.folder / RUN, into / self.name))
        else:
            into.mkdir(exist_ok=True)
            run = self.record(into)
        processed_once(run)
        return run / "result"

    def keep_numbers(self, result: Path) -> None:
        """Keep the numbers of a result as what later ones are held against."""
        keep_numbers(result, self.folder / RESULT)

    def differences(self, result: Path) -> list[Difference]:
        """In what numbers `result` differs from those kept."""
        return differences(self.folder / RESULT, result)


def _kept(
    name: str,
    protocol: dict[str, Any],
    simulation: dict[str, Any],
    beside: Callable[[Path], tuple[str, ...]] = lambda folder: (),
) -> Recorded:
    """A run on the shipped rig for phosphors, its room changed, kept with its frames."""

    def recorded(into: Path) -> Path:
        def change(rig: dict[str, Any]) -> None:
            rig["simulation"] |= simulation
            rig["devices"]["lamp"]["warm_up"] = "0 s"
            rig["optics"] |= {name: str(into / f"{name}.yaml") for name in beside(into)}

        into.mkdir(parents=True, exist_ok=True)
        return record(into, protocol, change)

    return Recorded(name, recorded, has_frames=True, beside=beside)


def _calibrations(folder: Path) -> tuple[str, ...]:
    IRRADIANCE_KIND.write(folder, true_irradiance(WIDTH, HEIGHT))
    LVF_KIND.write(folder, true_lvf_file(WIDTH, HEIGHT))
    return "irradiance", "lvf"


RUNS = (
    _kept("decay", DECAY, {"sample": "double-wide"}),
    _kept(
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
    _kept("chain", CHAIN, {}, _calibrations),
    _kept(
        "camera-unplugged",
        DECAY,
        {
            "sample": "orange-paint",
            "faults": [{"camera_unplugged": {"at": "11 min", "for": "20 s"}}],
        },
    ),
    _kept(
        "ambient-light",
        DECAY,
        {"sample": "power-law", "faults": [{"ambient_light": {"at": "12 min"}}]},
    ),
    *(Recorded(name, record) for name, record in RECORD.items()),
)

#: Their numbers take several seconds each, and are compared by `python -m tests.recordings`.
SLOW = {"led_fluorescence", "calibration", "calibration_check", "reflectance"}
