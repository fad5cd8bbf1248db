"""Budget of σ of a luminance at 10 min, and what lowers it: camera filters, a second meter.

    python -m tests.acceptance.luminance_budget [--seeds 6]

Each seed is a green glow as of `tests.acceptance.luminance_pulls`, measured by the protocol
`luminance` with its emission estimated from three channels, taken from a run of `emission_spectrum`
with ten filters before the camera, and known exactly. Printed are the relative σ in per cent, least
to greatest, of its factors and of the luminance at 10 min; the last column is the latter with the
mean of two meters as the reading.
"""

import argparse
import math
import tempfile
from pathlib import Path

import numpy as np

from labrig.acquire import read_rig_file
from labrig.process import process_run
from labrig.protocols.luminance.analysis import analyse
from tests.acceptance.luminance_pulls import AT_60_MIN, EVERYWHERE, HOUR_S
from tests.acceptance.printed import span
from tests.analyse.camera_filters_bench import PLACE, recorded as through_filters
from tests.analyse.luminance_bench import QUICK, luminance_after, record, write_glow, write_rig
from tests.analyse.recorded import part_of

#: Names of the factors by the start of those of a result.
FACTORS = {
    "luxmeter": "reading",
    "colour": "colour",
    "shutter": "shutter",
    "reflectance": "card",
    "dark level": "dark level",
    "sensitivity": "sensitivity",
}
WAYS = "three channels", "camera filters", "known"


def budgets(seed: int, folder: Path) -> dict[str, dict[str, float]]:
    """Return relative σ in per cent by factor, for each way of knowing the emission."""
    rng = np.random.default_rng([seed, 77])
    band_nm = (rng.uniform(490, 550), rng.uniform(60, 100))
    glow = write_glow(folder, 1.0, band_nm)
    patch = {"region": EVERYWHERE, "material": str(glow)}
    rig = write_rig(folder, sample=[patch])
    unit = luminance_after(read_rig_file(rig), [HOUR_S], 0.0, 600.0, 300.0)[0, 0]
    write_glow(folder, AT_60_MIN / unit, band_nm)
    spectrum = through_filters(
        folder / "spectrum",
        seed=seed,
        sample=[{"material": str(glow), "region": list(PLACE)}],
        filters_bent=0.01,
    )
    process_run(spectrum)
    found = {}
    for way, emission in zip(WAYS, (None, spectrum, glow), strict=True):
        keys = (
            QUICK | {"longest": "30 s"} | ({} if emission is None else {"emission": str(emission)})
        )
        (folder / way).mkdir()
        run = record(folder / way, keys, sample=[patch], seed=seed)
        (measured,) = analyse(part_of(run)).patches.values()
        own = {
            name: 100 * factor.relative_sigma
            for factor in measured.factors
            for begin, name in FACTORS.items()
            if factor.name.startswith(begin)
        }
        light = next(entry.luminance for entry in measured.decay.at if entry.t_s == 600.0)
        assert light is not None
        own["L10"] = 100 * light.sigma / light.value
        # Of the mean of two readings half of the variance.
        own["with a second meter"] = math.sqrt(own["L10"] ** 2 - own["reading"] ** 2 / 2)
        found[way] = own
    return found


def main() -> None:
    """Print a line for each way of knowing the emission."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seeds", type=int, default=6)
    seeds = parser.parse_args().seeds
    every = []
    for seed in range(1, 1 + seeds):
        with tempfile.TemporaryDirectory() as folder:
            every.append(budgets(seed, Path(folder)))
    names = list(every[0][WAYS[0]])
    print(f"{'emission':16}{''.join(f'{name:>21}' for name in names)}")
    for way in WAYS:
        cells = (span((one[way][name] for one in every), 1) for name in names)
        print(f"{way:16}{''.join(f'{cell:>21}' for cell in cells)}")


if __name__ == "__main__":
    main()
