"""What can be amiss with LEDs, each on the simulated bench through `labrig run`.

    python -m tests.acceptance.led_faults [--seeds 1] [PROTOCOL ...]

Of every protocol of LEDs: exit code, whether one line says it, in the words that are looked for,
and whether there is a result. Runs without a fault come first: they say nothing of these.
"""

import argparse
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from labrig.foundation import resources
from labrig.foundation.yaml_file import read_yaml, yaml_text

Content = dict[str, Any]
#: Outputs of the shipped rig's LEDs that are behind relays here, where no head tells its colour.
OUTPUTS = {"405 nm": 2, "455 nm": 4, "530 nm": 6, "590 nm": 8, "625 nm": 9}
PROTOCOLS: dict[str, Content] = {
    "led_fluorescence": {
        "longest": "2 s", "exposures": 2, "repeats": 1, "patches": {"felt": [0.6, 0.58, 0.3, 0.3]},
    },
    "led_brightness": {
        "exposures": 1, "repeats": 1, "repetitions": 3, "integration": "0.2 s", "longest": "4 s",
    },
    "direct_bispectral": {"samples": ["yellow-textile"], "repetitions": 4},
}  # fmt: skip
#: What no run without a fault may say.
ALARMS = (
    "left out|LEDs off|alight|two LEDs|at the same time|another order|order of their names|clip|"
    "saturated|did not light|stays lit|no light"
)


@dataclass(frozen=True)
class Case:
    """A fault; what is said of it by protocol, and the exit code where there is no result."""

    name: str
    change: Callable[[Content, Content], None]
    said: Mapping[str, str]
    code: int = 0


def _faults(*faults: Content) -> Callable[[Content, Content], None]:
    def change(rig: Content, protocol: Content) -> None:
        rig["simulation"]["faults"] = list(faults)

    return change


def _swapped(rig: Content, protocol: Content) -> None:
    leds = rig["devices"]["leds"]["channels"]
    leds["455 nm"]["relay"], leds["530 nm"]["relay"] = 3, 2


def _too_bright(rig: Content, protocol: Content) -> None:
    rig["simulation"]["leds"][2]["level"] = "100 %"
    rig["simulation"]["lamp"] = {"irradiance": 20.0}
    protocol["camera"] = {"iso": 1600}


def _file_without_a_column(rig: Content, protocol: Content) -> None:
    path = Path(rig["folder"]) / "led.csv"
    path.write_text("wavelength_nm\n400\n500\n")
    rig["devices"]["leds"]["channels"]["455 nm"] = {"relay": 2, "spectrum": str(path)}


def _calibration_without_a_key(rig: Content, protocol: Content) -> None:
    folder = Path(rig["folder"]) / "calibration"
    folder.mkdir()
    (folder / "leds.yaml").write_text("leds: {455 nm: {wavelength_nm: [400, 500]}}\n")
    rig["optics"]["leds"] = str(folder / "leds.yaml")


def _card_without_a_column(rig: Content, protocol: Content) -> None:
    path = Path(rig["folder"]) / "card.csv"
    path.write_text("wavelength_nm\n400\n500\n")
    rig["optics"]["grey_card"] = str(path)


def _everywhere(said: str) -> dict[str, str]:
    return dict.fromkeys(PROTOCOLS, said)


CASES = (
    Case("none", lambda rig, protocol: None, {}),
    Case(
        "an LED stays dark",
        _faults({"led_dark": {"relay": 3}}),
        {
            "led_fluorescence": "530 nm: left out, frames of the card are dark",
            "led_brightness": "LED '530 nm' did not light",
            "direct_bispectral": "530 nm: gave no light on the white reference",
        },
    ),
    Case("all LEDs stay dark", _faults({"led_dark": {}}), _everywhere("light"), code=4),
    Case(
        "an LED stays lit",
        _faults({"led_stuck": {"relay": 4, "at": "1 min"}}),
        {
            "led_brightness": "with all LEDs off there was light",
            "direct_bispectral": "white: with all LEDs off the light was another",
        },
    ),
    Case(
        "light of the room",
        _faults({"ambient_light": {"level": "0.5 %", "at": "1 min"}}),
        {
            "led_fluorescence": "card: with all LEDs off there was light",
            "led_brightness": "with all LEDs off there was light",
            "direct_bispectral": "with all lights off the spectrometer sees light",
        },
    ),
    Case(
        "LEDs in another order",
        _swapped,
        {
            "led_fluorescence": "455 nm, 530 nm: expected LEDs in the order of their names",
            "led_brightness": "LED '455 nm' shines like '530 nm'",
            "direct_bispectral": r"455 nm: its light has its peak at 5\d\d nm",
        },
    ),
    Case(
        "an LED clips",
        _too_bright,
        {
            "led_fluorescence": "530 nm: left out, frames of the card clip at the shortest",
            "led_brightness": "frames of 530 nm are clipped even at the shortest exposure",
        },
    ),
    Case(
        "an LED's file lacks a column",
        _file_without_a_column,
        _everywhere("led.csv.*expected a header"),
        code=2,
    ),
    Case("leds.yaml lacks keys", _calibration_without_a_key, _everywhere("leds.yaml"), code=2),
    Case(
        "the card's file lacks a column",
        _card_without_a_column,
        _everywhere("card.csv.*expected a header"),
        code=2,
    ),
)


def main() -> None:
    """Print a line for each run, and what went wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("protocols", nargs="*", metavar="PROTOCOL", default=list(PROTOCOLS))
    parser.add_argument("--seeds", type=int, default=1)
    asked = parser.parse_args()
    print(f"{'protocol':19}{'fault':32}{'seed':>5}{'code':>5}  said")
    wrong: list[str] = []
    for name in asked.protocols:
        for case in CASES:
            if case.said and name not in case.said:
                continue
            for seed in range(1, asked.seeds + 1):
                code, lines = _run(name, case, seed)
                said = [line for line in lines if re.search(case.said.get(name, ALARMS), line)]
                is_right = code == case.code and len(said) == bool(case.said)
                told = said[0] if said else ""
                print(f"{name:19}{case.name:32}{seed:5}{code:5}  {told[:90]}", flush=True)
                if not is_right or (code and len(lines) != 1):
                    wrong.append(f"{name}, {case.name}, seed {seed}: code {code}, {lines}")
    print(f"{len(wrong)} went wrong", *wrong, sep="\n")
    sys.exit(bool(wrong))


def _run(name: str, case: Case, seed: int) -> tuple[int, list[str]]:
    """Return the exit code and all lines but those of progress."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        protocol = {"protocol": name, "leds": list(OUTPUTS)} | PROTOCOLS[name]
        rig = _rig(seed) | {"folder": scratch}
        case.change(rig, protocol)
        del rig["folder"]
        (folder / "protocol.yaml").write_text(yaml_text(protocol))
        (folder / "rig.yaml").write_text(yaml_text(rig))
        files = ["protocol.yaml", "--rig", "rig.yaml", "--runs", "runs", "--yes"]
        ended = subprocess.run(
            [sys.executable, "-m", "labrig", "run", *files],
            cwd=folder,
            capture_output=True,
            text=True,
        )
    return ended.returncode, [line for line in ended.stderr.splitlines() if line[:1] != "["]


def _rig(seed: int) -> Content:
    """The shipped rig, some of its LEDs behind a relay board."""
    rig: Content = read_yaml(resources.find("config", "rig", "sim-fluorescent"))
    channels = rig["devices"]["leds"]["channels"]
    rig["devices"]["leds"] = {
        "driver": "numato",
        "address": "sim://room/relays",
        "channels": {
            led: {"relay": relay}
            | {key: channels[led][key] for key in ("centre", "fwhm", "settling")}
            for relay, led in enumerate(OUTPUTS, start=1)
        },
    }
    del rig["devices"]["camera"]["warm_up"]
    simulation = rig["simulation"]
    leds = {led["relay"]: led for led in simulation["leds"]}
    simulation |= {
        "seed": seed,
        "sensor": {"width": 96, "height": 64},
        "led_board": "relays",
        "leds": [
            leds[output] | {"relay": relay}
            for relay, output in enumerate(OUTPUTS.values(), start=1)
        ],
    }
    return rig


if __name__ == "__main__":
    main()
