"""σ and errors of albedos that `reflectance` measures in the simulated room.

    python -m tests.acceptance.reflectance_pulls [--seeds 8] [--case NAME ...]

Every seed has another camera, noise, filter calibration and card curve, drawn from the σ that their
files state. Per case, over 430 to 680 nm: rms of error over σ of the albedo (1 if σ is right), its
largest, the largest error of any run in albedo and in % of it, the same of the radiance factor
under the lamp, the amount of luminescence over that of the glow, and how many runs warn.
"""

import argparse
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from labrig.calibration import LVF_KIND, LvfFile
from labrig.foundation.arrays import FloatArray
from labrig.material import Albedo, Material, read_material, write_material
from labrig.optics import Strip
from labrig.optics.piecewise import band_means, edges_from_centres
from labrig.protocols.reflectance.analysis import analyse
from labrig.protocols.reflectance.result import MeasuredReflectance, ReflectanceResult
from labrig.sim.cards import GREY, GREY_NM
from labrig.sim.lamp import WAVELENGTH_NM as ROOM_NM
from tests.analyse.recorded import part_of, record
from tests.analyse.spectral_bench import true_lvf_file
from tests.warned import codes

WIDTH, HEIGHT = 384, 64
NM = np.arange(400.0, 701.0, 10.0)
JUDGED = (NM >= 430) & (NM <= 680)
#: σ of the card's curve that its file states: common to all wavelengths, and of its course.
CARD_COMMON, CARD_COURSE = 0.004, 0.003


@dataclass(frozen=True)
class Case:
    """A sample and its room."""

    name: str
    albedo: Mapping[int, float]
    room: Mapping[str, Any] = field(default_factory=dict)
    patch: Mapping[str, Any] = field(default_factory=dict)
    sensor: Mapping[str, Any] = field(default_factory=dict)
    without: tuple[str, ...] = ()


EDGE = {300: 0.08, 540: 0.08, 580: 0.75, 780: 0.8}
STEEP = {300: 0.1, 500: 0.1, 515: 0.7, 780: 0.75}
BLUE = {300: 0.35, 420: 0.45, 460: 0.6, 500: 0.35, 560: 0.15, 620: 0.12, 680: 0.2, 780: 0.4}
WHITE = {300: 0.6, 400: 0.85, 450: 0.9, 780: 0.92}
#: Smooth everywhere, with no straight piece: a dye's two bands below a pigment's edge.
SMOOTH = {
    nm: 0.12
    + 0.55 / (1 + float(np.exp(-(nm - 585) / 9)))
    + 0.2 * float(np.exp(-(((nm - 455) / 22) ** 2)))
    for nm in range(300, 781, 2)
}
CASES = (
    Case("blue", BLUE),
    Case("orange edge", EDGE),
    Case("orange edge, known camera", EDGE, sensor={"curves": "canon_eos_5d_mark_ii"}),
    Case("step of 15 nm", STEEP),
    Case("white", WHITE),
    Case("blue, prompt 20 %", BLUE, patch={"prompt": 0.2}),
    Case("orange edge, prompt 20 %", EDGE, patch={"prompt": 0.2}),
    Case("blue, prompt 5 %", BLUE, patch={"prompt": 0.05}),
    Case("smooth", SMOOTH),
    Case("smooth, prompt 20 %", SMOOTH, patch={"prompt": 0.2}),
    Case("gloss and inter-reflection", BLUE, {"gloss": 0.04, "inter_reflection": 0.02}),
    Case("no door, prompt 20 %", BLUE, patch={"prompt": 0.2}, without=("door", "shield", "servo")),
    Case("fluorescent card", BLUE, {"grey_card_fluorescence": 0.05}),
)


def coloured(albedo: Mapping[int, float]) -> Material:
    """Blue paint on a ground of that albedo."""
    known = Albedo(wavelength_nm=tuple(map(float, albedo)), value=tuple(albedo.values()))
    return read_material("blue-paint").model_copy(update={"albedo": known})


def true_albedo(albedo: Mapping[int, float]) -> FloatArray:
    """Means about `NM`, as the room has it."""
    in_room = np.interp(ROOM_NM, list(albedo), list(albedo.values()))
    return np.asarray(band_means(ROOM_NM, in_room, edges_from_centres(NM)))


def drawn_lvf(rng: np.random.Generator) -> LvfFile:
    """A calibration of the filter that is off by its own σ."""
    on_sample = Strip(left=(0.08, 0.5), right=(0.92, 0.5), height=0.25, rising=False)
    file = true_lvf_file(WIDTH, HEIGHT).model_copy(update={"on_sample": on_sample})
    drawn = {
        name: tuple((np.array(getattr(file.bands, name)) + error).tolist())
        for name in ("centre_nm", "fwhm_nm")
        for error in [np.array(getattr(file.sigma, name)) * rng.standard_normal(31)]
    }
    return file.model_copy(update={"bands": file.bands.model_copy(update=drawn)})


def card_file(rng: np.random.Generator) -> str:
    """A curve of the room's card that is off by the σ that it states."""
    nm = np.arange(350.0, 801.0, 10.0)
    course = np.interp(nm, nm[::9], rng.standard_normal(len(nm[::9])))
    error = 1 + CARD_COMMON * rng.standard_normal() + CARD_COURSE * course
    value = 0.18 * np.interp(nm, GREY_NM, GREY) * error
    sigma = float(np.hypot(CARD_COMMON, CARD_COURSE)) * value
    rows = (f"{a:g},{b:.6f},{c:.6f}" for a, b, c in zip(nm, value, sigma, strict=True))
    return "\n".join(["wavelength_nm,value,sigma", *rows, ""])


def measured(folder: Path, case: Case, seed: int, **protocol: Any) -> ReflectanceResult:
    """The result of a run in the room of a case."""
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng([seed, len(case.name)])
    write_material(folder / "sample.yaml", coloured(case.albedo))
    LVF_KIND.write(folder, drawn_lvf(rng))
    (folder / "card.csv").write_text(card_file(rng))

    def change(rig: dict[str, Any]) -> None:
        rig["optics"] |= {"lvf": str(folder / "lvf.yaml"), "grey_card": str(folder / "card.csv")}
        region = [0.03, 0.1, 0.94, 0.8]
        sample = {"material": str(folder / "sample.yaml"), "region": region} | dict(case.patch)
        rig["simulation"] |= {"sample": [sample], "seed": seed} | dict(case.room)
        rig["simulation"]["sensor"] = dict(case.sensor) | {"width": WIDTH, "height": HEIGHT}

        for name in case.without:
            rig["devices"].pop(name, None)
            rig["simulation"].pop(name, None)

    content = {"protocol": "reflectance", "sample": {"name": "sample"}, **protocol}
    return analyse(part_of(record(folder, content, change)))


def pulls(patch: MeasuredReflectance, albedo: Mapping[int, float]) -> tuple[FloatArray, ...]:
    """Error over σ, and error, of the albedo at the wavelengths that are judged."""
    error = (patch.albedo - true_albedo(albedo))[JUDGED]
    return error / patch.albedo_sigma[JUDGED], error


def judge(case: Case, seeds: Sequence[int]) -> str:
    """Measure with every seed; return the line of a case."""
    found, off, relative, amount, warned = [], [], [], [], 0
    for seed in seeds:
        with tempfile.TemporaryDirectory() as folder:
            result = measured(Path(folder), case, seed)
        patch = result.patches[""]
        pull, error = pulls(patch, case.albedo)
        found.append(pull)
        off.append(np.abs(error).max())
        relative.append(np.abs(error / true_albedo(case.albedo)[JUDGED]).max())
        amount.append((patch.luminescence.value, patch.luminescence.sigma))
        warned += bool(result.warnings)
        last = result.warnings
    each = np.array(found)
    mean_amount, mean_sigma = np.mean(amount, axis=0)
    return (
        f"{case.name:28} rms {np.sqrt(np.mean(each**2)):5.2f}  largest {np.abs(each).max():5.2f}  "
        f"off {max(off):.4f}  {max(relative):6.1%}  luminescence {mean_amount:6.2f} ± "
        f"{mean_sigma:.2f}  warned {warned}/{len(seeds)}  {', '.join(codes(last))}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=8)
    parser.add_argument("--case", nargs="*", default=[case.name for case in CASES])
    asked = parser.parse_args()
    for case in CASES:
        if case.name in asked.case:
            print(judge(case, range(1, asked.seeds + 1)), flush=True)


if __name__ == "__main__":
    main()
