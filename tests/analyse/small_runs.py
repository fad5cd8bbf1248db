"""One small run of each protocol on a simulated bench, as tests record it.

The dictionary `RECORD` has them by the protocol's name; each records into a folder of its own.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from labrig.calibration import LVF_KIND, LvfFile
from labrig.optics import Strip
from labrig.process import process_run
from tests.analyse import (
    angular_bench,
    chart_bench,
    direct_bench,
    led_bench,
    luminance_bench,
    spectral_bench,
)
from tests.analyse.led_brightness import led_bench as led_brightness_bench
from tests.analyse.recorded import record
from tests.analyse.spectral_bench import true_lvf_file

Rig = dict[str, Any]
Protocol = dict[str, Any]

BLANK: Protocol = {
    "protocol": "blank", "sample": {"name": "blank"}, "charge": "30 s", "for": "40 s",
    "later_by": ["0 s", "400 ms"],
}  # fmt: skip
FADE: Protocol = {
    "protocol": "fade", "sample": {"name": "lamp"}, "every": "80 ms", "until": "400 ms",
    "passes": 2,
}  # fmt: skip
CAMERA_CALIBRATION: Protocol = {
    "protocol": "camera_calibration", "sample": {"name": "camera"}, "isos": [100, 400],
    "f_numbers": [4, 11], "card": [0.05, 0.05, 0.9, 0.9], "levels": 4, "repeats": 12, "cycles": 2,
    "every_nth_shutter_time": 5,
}  # fmt: skip
LVF_CALIBRATION: Protocol = {
    "protocol": "lvf_calibration", "stripes": "none", "longest": "4 s", "repeats": 1,
    "filters": ["longpass-440", "longpass-490", "longpass-540", "longpass-600",
                "shortpass-430", "shortpass-520"],
}  # fmt: skip
IRRADIANCE: Protocol = {"protocol": "irradiance", "longest": "4 s", "repeats": 1, "rounds": 1}
ISOTROPY: Protocol = {
    "protocol": "isotropy", "charge": "2 min", "frames": 2, "angles": [40, 80], "first": "30 s",
}  # fmt: skip
SATURATION: Protocol = {
    "protocol": "saturation", "charges": ["30 s", "10 min", "20 min"], "first": "800 ms",
    "for": "60 s",
}  # fmt: skip
#: Neutral filter that lets half of the light through.
HALF: Protocol = {"weaker": {"filter": "neutral-50", "fraction": "50 %"}}
EMISSION: Protocol = {
    "protocol": "emission_spectrum", "charge": "2 min", "times": ["2 s", "20 s"], "longest": "8 s",
}  # fmt: skip
#: Green and white.
COLOUR_CHECK: Protocol = {"protocol": "colour_check", "through": [14, 19], "repeats": 1}
#: The curves that labrig has of the room's camera, as its own body calls itself.
CAMERA = "canon_eos_5d_mark_ii"
#: In the room's camera, and in no family from which its curves are concluded.
UNKNOWN_CAMERA = "nikon_d850"
ANGULAR: Protocol = {
    "angles": [30, 60, 90, 120], "directions": ["vertical"], "region": [0.2, 0.2, 0.5, 0.5],
}  # fmt: skip
DIRECT: Protocol = {
    "leds": ["365 nm", "430 nm", "490 nm"], "samples": ["yellow-textile"], "order_seed": 4,
    "repetitions": 4,
}  # fmt: skip
#: One exposure under one lamp takes less time.
VALIDATE_ONE: Protocol = {
    "protocol": "validate_illuminants", "patches": led_bench.QUICK["patches"],
    "fluorescence": led_bench.SAMPLES, "lamps": ["halogen"], "exposures": 1, "repeats": 1,
    "longest": "1 s",
}  # fmt: skip
#: Size in pixels of the sensor of runs that calibrate a whole bench.
BENCH_WIDTH, BENCH_HEIGHT = 128, 48


def with_known_camera(rig: Rig) -> None:
    """Name the curves of the room's camera."""
    rig["optics"]["camera"] = CAMERA


def curves_protocol(name: str, **changes: Any) -> Protocol:
    """Return a protocol for a camera that is left out of the family."""
    return {"protocol": "camera_curves", "repeats": 2, "leave_out": [name]} | changes


def placed_lvf(width: int, height: int) -> LvfFile:
    """Return the room's filter as if calibrated without error, and placed on the sample."""
    on_sample = Strip(left=(0.08, 0.5), right=(0.92, 0.5), height=0.25, rising=False)
    return true_lvf_file(width, height).model_copy(update={"on_sample": on_sample})


def irradiance(folder: Path) -> Path:
    """Record an irradiance run through a filter that is calibrated without error."""
    width, height = 128, 64
    LVF_KIND.write(folder, placed_lvf(width, height))

    def change(rig: Rig) -> None:
        rig["optics"]["lvf"] = str(folder / "lvf.yaml")
        rig["simulation"]["sensor"] = {"width": width, "height": height}

    protocol = {
        "protocol": "irradiance", "sample": {"name": "lamp"}, "longest": "4 s", "repeats": 1,
    }  # fmt: skip
    return record(folder, protocol, change)


def _reflectance(folder: Path) -> Path:
    width, height = 160, 64
    LVF_KIND.write(folder, placed_lvf(width, height))

    def change(rig: Rig) -> None:
        rig["optics"] |= {"lvf": str(folder / "lvf.yaml")}
        rig["simulation"]["sensor"] = {"width": width, "height": height}

    protocol = {
        "protocol": "reflectance", "sample": {"name": "blue-paint"}, "longest": "4 s",
        "repeats": 1, "charge": "5 min",
    }  # fmt: skip
    return record(folder, protocol, change)


def small_bench(rig: Rig) -> None:
    """Take a small sensor."""
    rig["simulation"]["sensor"] = {"width": BENCH_WIDTH, "height": BENCH_HEIGHT}


def calibration(folder: Path) -> Path:
    """Record the calibration of a bench: its filter and its light."""
    parts = [LVF_CALIBRATION, IRRADIANCE]
    keys = {"protocol": "calibration", "sample": {"name": "bench"}, "parts": parts}
    return record(folder, keys, small_bench)


def _calibration_check(folder: Path) -> Path:
    process_run(calibration(folder))
    keys = {"protocol": "calibration_check", "sample": {"name": "bench"}, "longest": "4 s"}
    return record(folder, keys, small_bench)


def _lvf_calibration(folder: Path) -> Path:
    return record(folder, LVF_CALIBRATION | {"sample": {"name": "bench"}}, small_bench)


def _luminance(folder: Path) -> Path:
    glow = luminance_bench.write_glow(folder, 12.0)
    sample = [{"material": str(glow), "region": [0.0, 0.0, 1.0, 1.0]}]
    keys = luminance_bench.QUICK | {"emission": str(glow), "colours": "K-W"}
    return luminance_bench.record(folder, keys, sample=sample)


def unlike_the_model(rig: Rig) -> None:
    """Let pixels and rows of the sensor share noise, and the lamp drift."""
    rig["simulation"]["sensor"] |= {"crosstalk": 0.02, "row_noise": 0.5}
    rig["simulation"]["lamp"] = {"drift_per_hour": 0.1}


RECORD: dict[str, Callable[[Path], Path]] = {
    "angular_fluorescence": lambda folder: angular_bench.record_angular(folder, ANGULAR),
    "blank": lambda folder: record(folder, BLANK),
    "calibration": calibration,
    "calibration_check": _calibration_check,
    "camera_calibration": lambda folder: record(folder, CAMERA_CALIBRATION, unlike_the_model),
    "camera_curves": lambda folder: chart_bench.record(
        folder,
        curves_protocol(UNKNOWN_CAMERA, through=True),
        chart_bench.with_camera(UNKNOWN_CAMERA),
    ),
    "colour_check": lambda folder: chart_bench.record(folder, COLOUR_CHECK, with_known_camera),
    "direct_bispectral": lambda folder: direct_bench.record(folder, DIRECT),
    "emission_spectrum": lambda folder: spectral_bench.record(folder, EMISSION),
    "fade": lambda folder: record(folder, FADE),
    "irradiance": irradiance,
    "isotropy": lambda folder: spectral_bench.record(folder, ISOTROPY),
    "led_brightness": led_brightness_bench.recorded,
    "led_fluorescence": lambda folder: led_bench.record(folder, led_bench.QUICK),
    "luminance": _luminance,
    "lvf_calibration": _lvf_calibration,
    "reflectance": _reflectance,
    "saturation": lambda folder: spectral_bench.record(folder, SATURATION | HALF, seed=2),
    "validate_illuminants": lambda folder: led_bench.record(folder, VALIDATE_ONE),
}
