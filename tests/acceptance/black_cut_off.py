"""Do means and σ of a camera that cuts off at black mean what they say? Over many frames.

    python -m tests.acceptance.black_cut_off [--frames 300]

For frames of 576 x 384 pixels of even light, each with its own noise: mean and root mean square of
(measured − true)/σ over frames and channels, which are 0 and 1 if both are right; and the mean
without the correction. Fails where the root mean square is off by 20 % or the mean by 0.3.
"""

import argparse
import sys

import numpy as np

from labrig.reduce import RawFrame, measure

REGION = (0.2, 0.25, 0.4, 0.4)
#: Read noise in DN, DN per electron, of cameras from fine to coarse numbers.
CAMERAS = ((1.2, 0.3), (5.0, 1.0), (30.0, 8.0))
#: Light in multiples of the read noise.
LIGHTS = (0.0, 0.3, 1.0, 2.0, 5.0)


def main() -> None:
    """Print a line for each camera and light; exit with 1 if one fails."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=300)
    asked = parser.parse_args()
    fails = False
    print("read/DN light/read  plain error/read   mean pull   rms pull")
    for read_dn, gain_dn in CAMERAS:
        for light in LIGHTS:
            pulls, plain = [], []
            for seed in range(asked.frames):
                rng = np.random.default_rng(seed)
                photons = rng.poisson(light * read_dn / gain_dn, (384, 576))
                level = gain_dn * photons + rng.normal(0.0, read_dn, photons.shape)
                mosaic = np.maximum(np.rint(level), 0).astype(np.uint16)
                measured = measure(RawFrame(mosaic, "RGGB", (0.0,) * 4, 15_000.0), REGION)
                pulls += [
                    (channel.mean - light * read_dn) / channel.sigma
                    for channel in measured.channels.values()
                ]
                plain.append(mosaic.mean() / read_dn - light)
            mean, rms = np.mean(pulls), np.sqrt(np.mean(np.square(pulls)))
            failed = abs(rms - 1) > 0.2 or abs(mean) > 0.3
            fails |= bool(failed)
            print(
                f"{read_dn:7} {light:10} {np.mean(plain):17.4f} {mean:+11.2f} {rms:10.2f}"
                f"{'  fails' if failed else ''}",
                flush=True,
            )
    sys.exit(fails)


if __name__ == "__main__":
    main()
