"""Fluorescent samples rendered under lamps from the files of simulated runs, beside photographs.

    python -m tests.acceptance.fluorescent_room [NAME ...] [--keep DIR]

Every case is a `labrig run validate_illuminants` in the simulated room, under lamps whose spectra
are not quite those of the rig file: a halogen lamp of 2880 K for one of 3000 K, a black light 1.5
nm away and broader. The room takes matrices as bilinear between their wavelengths; measured papers
and textiles (RIT, BFC-450) are no sums of a few dyes. `files`: the rendering has the matrices of
the room, the instrument's ones corrected and with σ; `blue`: the same under a narrow blue lamp, 1
nm away and broader than the rig file says; `measured`: those that `led_fluorescence` estimated from
earlier photographs of the same samples, after `led_brightness`.
Of each lamp: ΔE2000 of photograph and rendering, mean over the samples and largest, beside the root
mean square that their errors alone make, and to the reflected light; rendered over photographed
light − 1, mean and furthest of what is brighter than 2 % of the brightest; the furthest value in σ;
share of the luminance that is re-radiated, mean and largest. A case is right where no value is
further than 4 σ away and the mean ΔE of every lamp is at most twice that of errors alone. The last
cases must not be: the brightness of the ultraviolet LED was not measured, one sample is taken for
another, and the card fluoresces.
"""

import argparse
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from labrig.compare import LampsComparison, RenderedLamp, compare_lamps
from labrig.material import corrected, read_reradiation, write_fluorescent
from labrig.process import process_run
from tests.acceptance.mixture_colours import FOLDER
from tests.analyse.led_bench import QUICK, SAMPLES, record

MAX_SIGMAS, MAX_TIMES, DARK = 4.0, 2.0, 0.02
REFLECTED, SHARE = "delta_e_reflected", "reradiated_luminance"
TEXTILES = {"yellow": "TEXTYELL", "red": "HERPICER", "ball": "GOLF", "green": "POLGREE"}
PAPERS = {"red": "PAPRED", "blue": "TEXTBLUE", "yellow": "POLYYELL", "photo": "PFUJIWH"}


@dataclass(frozen=True)
class Case:
    """Samples, and by which matrices they are rendered.

    Attributes
    ----------
    samples
        Material of each patch in the room: a shipped name, or one of the measured matrices.
    is_measured, is_calibrated
        Whether the matrices are those of a run of `led_fluorescence` of the same samples, and
        whether one of `led_brightness` came before it.
    taken_for
        Materials by which patches are rendered instead of their own.
    blue_nm
        Peak of a lamp of 20 nm width in the place of the black light; None leaves that there.
    room
        Further keys of the simulated room.
    """

    name: str
    samples: dict[str, str]
    seed: int
    is_measured: bool = False
    is_calibrated: bool = True
    taken_for: dict[str, str] = field(default_factory=dict)
    blue_nm: float | None = None
    room: dict[str, Any] = field(default_factory=dict)
    is_right: bool = True


CASES = (
    Case("shipped, files", SAMPLES, 161),
    Case("textiles, files", TEXTILES, 162),
    Case("papers, files", PAPERS, 163),
    Case("shipped, blue", SAMPLES, 170, blue_nm=450.0),
    Case("textiles, blue", TEXTILES, 171, blue_nm=465.0),
    Case("papers, blue", PAPERS, 172, blue_nm=440.0),
    Case("shipped, measured", SAMPLES, 164, is_measured=True),
    Case("textiles, measured", TEXTILES, 165, is_measured=True),
    Case("papers, measured", PAPERS, 166, is_measured=True),
    Case(
        "LEDs not calibrated", SAMPLES, 169, is_measured=True, is_calibrated=False, is_right=False
    ),
    Case("felt for paper", SAMPLES, 167, taken_for={"paper": "grey-felt"}, is_right=False),
    Case("card glows", SAMPLES, 168, room={"grey_card_fluorescence": 0.3}, is_right=False),
)


def material(name: str) -> str:
    """Return the file of a measured matrix, or a shipped name as it is."""
    path = FOLDER / f"{name}.BFC"
    return str(path) if path.is_file() else name


def recorded(case: Case, folder: Path) -> Path:
    """Return the run of a case, recorded and processed unless it is there."""
    place = folder / case.name.replace(", ", "-").replace(" ", "-")
    if not (place / "runs").is_dir():
        patches = dict(zip(case.samples, QUICK["patches"].values(), strict=True))
        protocol = {
            "protocol": "validate_illuminants",
            "patches": patches,
            "fluorescence": _fluorescence(case, patches, place),
            "longest": "2 s",
        }
        if case.blue_nm is not None:
            protocol["lamps"] = ["daylight", "blue"]
        process_run(record(place, protocol, _room(case)))
    return next((place / "runs").iterdir())


def _fluorescence(case: Case, patches: dict[str, Any], place: Path) -> str | dict[str, str]:
    """Return the run that measured the samples, or the material file of each."""
    if not case.is_measured:
        return {
            patch: _with_sigma(case.taken_for.get(patch, name), place)
            for patch, name in case.samples.items()
        }
    leds = None
    if case.is_calibrated:
        leds = record(place / "leds", {"protocol": "led_brightness"}, _room(case))
        process_run(leds)
    measured = record(place / "measured", QUICK | {"patches": patches}, _room(case, leds))
    process_run(measured)
    return str(measured.resolve())


def _with_sigma(name: str, place: Path) -> str:
    """Return the file of an instrument's matrix, corrected and with σ, or a shipped name."""
    if not (FOLDER / f"{name}.BFC").is_file():
        return name
    place.mkdir(parents=True, exist_ok=True)
    path = place / f"{name}.yaml"
    write_fluorescent(path, corrected(read_reradiation(material(name))))
    return str(path)


def _room(case: Case, leds: Path | None = None) -> Callable[[dict[str, Any]], None]:
    """Return how the shipped rig becomes that of a case, with a calibration of its LEDs."""

    def change(rig: dict[str, Any]) -> None:
        simulation = rig["simulation"]
        for sample, name in zip(simulation["sample"], case.samples.values(), strict=True):
            sample["material"] = material(name)
        simulation |= {"seed": case.seed, "sensor": {"width": 192, "height": 128}, **case.room}
        if case.blue_nm is not None:
            lamps = rig["devices"]["illuminants"]["channels"]
            lamps["blue"] = lamps.pop("ultraviolet") | {"centre": case.blue_nm, "fwhm": 20}
            simulation["illuminants"][3] |= {"centre": case.blue_nm + 1.0, "fwhm": 22}
        if leds is not None:
            rig["optics"]["leds"] = str(leds.resolve())

    return change


def is_right(compared: LampsComparison) -> bool:
    """Return whether photographs and renderings agree."""
    return all(
        _furthest(lamp) <= MAX_SIGMAS and _mean(lamp, "delta_e") <= MAX_TIMES * _alone(lamp)
        for lamp in compared.lamps
    )


def _furthest(lamp: RenderedLamp) -> float:
    return float(max(np.abs(sample.in_sigma).max() for sample in lamp.samples.values()))


def _mean(lamp: RenderedLamp, name: str) -> float:
    return float(np.mean([getattr(sample, name) for sample in lamp.samples.values()]))


def _most(lamp: RenderedLamp, name: str) -> float:
    return float(max(getattr(sample, name) for sample in lamp.samples.values()))


def _alone(lamp: RenderedLamp) -> float:
    return _mean(lamp, "delta_e_by_errors")


def told(case: Case, folder: Path) -> bool:
    """Print the comparison of a case; return whether it is as it must be."""
    compared = compare_lamps(recorded(case, folder))
    right = is_right(compared)
    said = {True: "right", False: "differs"}[right]
    print(f"{case.name}, seed {case.seed}: {said}{'' if right == case.is_right else ', WRONG'}")
    for line in compared.notes:
        print(f"    {line}")
    for lamp in compared.lamps:
        samples = list(lamp.samples.values())
        bright = max(float(sample.rendered.max()) for sample in samples)
        off = 100 * np.concatenate([each.excess[each.rendered > DARK * bright] for each in samples])
        print(
            f"    {lamp.name:12} ΔE {_mean(lamp, 'delta_e'):5.2f} ({_most(lamp, 'delta_e'):5.2f}), "
            f"errors alone {_alone(lamp):5.2f}, reflected {_mean(lamp, REFLECTED):5.1f}; "
            f"light {off.mean():+6.2f} %, furthest {off[np.abs(off).argmax()]:+7.2f} %, "
            f"{_furthest(lamp):4.1f} σ; re-radiated "
            f"{100 * _mean(lamp, SHARE):3.0f} ({100 * _most(lamp, SHARE):3.0f}) %",
            flush=True,
        )
    return right == case.is_right


def main(arguments: Sequence[str]) -> None:
    """Print all cases."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help="of the cases; all by default")
    parser.add_argument("--keep", type=Path, help="folder of the runs, which are used again")
    asked = parser.parse_args(arguments)
    folder = (asked.keep or Path(tempfile.mkdtemp())).resolve()
    right = [told(case, folder) for case in CASES if not asked.names or case.name in asked.names]
    print(f"{sum(right)} of {len(right)} cases are as they must be")


if __name__ == "__main__":
    main(sys.argv[1:])
