"""Which LEDs estimate the measured matrices best: a search over their wavelengths.

    python -m tests.acceptance.led_placement 6 [--camera canon_eos_5d_mark_ii] [--sweeps 2]

LEDs are Gaussians as wide as LEDs of their colour are. From an even spacing each LED is moved by
10 nm as long as that lowers the mean of the median and the 90 % quantile of ΔE2000 under D65 and A
(`study_leds`, over some of the surfaces). The last lines are for all surfaces.
"""

import argparse
from collections.abc import Sequence

import numpy as np

from labrig.fit.fluorescence import LedStudy, gaussian_led, study_leds
from labrig.material import ReradiationMatrix
from labrig.optics import CameraResponse, read_camera, read_light
from tests.acceptance.led_matrices import CAMERA, reradiating

LIGHTS = ("D65", "A")
FIRST_NM, LAST_NM, STEP_NM = 380.0, 640.0, 10.0
LIMITS_NM = (360.0, 690.0)
#: Every so many surfaces are used in the search.
STRIDE = 3


def width_nm(centre_nm: float) -> float:
    """Return the usual full width at half maximum of an LED."""
    return float(np.interp(centre_nm, [365, 460, 520, 560, 590, 660], [12, 22, 33, 38, 18, 20]))


def study(
    centres_nm: Sequence[float], camera: CameraResponse, surfaces: Sequence[ReradiationMatrix]
) -> LedStudy:
    """Return the study of LEDs at some wavelengths."""
    leds = [gaussian_led(centre, width_nm(centre)) for centre in centres_nm]
    return study_leds(leds, camera, surfaces, [read_light(light) for light in LIGHTS])


def cost(found: LedStudy) -> float:
    """Return what the search lowers."""
    return float(np.mean([found.quantile(0.5), found.quantile(0.9)]))


def main() -> None:
    """Search, and print what was found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("leds", type=int)
    parser.add_argument("--camera", default=CAMERA)
    parser.add_argument("--sweeps", type=int, default=2)
    asked = parser.parse_args()
    camera, surfaces = read_camera(asked.camera), reradiating()
    some = surfaces[::STRIDE]
    even = np.linspace(FIRST_NM, LAST_NM, asked.leds)
    centres = (STEP_NM * np.round(even / STEP_NM)).tolist()
    start, best = list(centres), cost(study(centres, camera, some))
    for _ in range(asked.sweeps):
        before = best
        for number in range(asked.leds):
            for step in (-STEP_NM, STEP_NM):
                moved = list(centres)
                moved[number] += step
                if len(set(moved)) < len(moved) or not (
                    LIMITS_NM[0] <= moved[number] <= LIMITS_NM[1]
                ):
                    continue
                found = cost(study(moved, camera, some))
                if found < best:
                    centres, best = moved, found
                    break
        print(f"{best:.3f}  {' '.join(f'{nm:g}' for nm in sorted(centres))} nm", flush=True)
        if best == before:
            break
    for label, those in (("even", start), ("found", centres)):
        whole = study(those, camera, surfaces)
        told = "  ".join(
            f"{fraction:.0%} {' '.join(f'{value:.2f}' for value in whole.quantile(fraction))}"
            for fraction in (0.5, 0.9)
        )
        print(f"{label}: {' '.join(f'{nm:g}' for nm in sorted(those))} nm; D65 A: {told}")


if __name__ == "__main__":
    main()
