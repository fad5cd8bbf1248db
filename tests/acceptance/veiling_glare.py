"""What a lens's veiling glare does to the rates of eleven samples in one frame.

    python -m tests.acceptance.veiling_glare

`decay-eleven` on the simulated bench, without glare and with as much as good lenses have, neither
of which the analysis knows. Printed are each sample's rate and its error in σ, or a number of
states that is not the true one.
"""

import tempfile
from pathlib import Path

from tests.acceptance.decays_of_all_materials import (
    fits,
    has_true_number_of_states,
    pulls,
    shipped_rig,
)

GLARES = (0.0, 0.005)
FAR_SIGMAS = 2.0


def main() -> None:
    """Print a line for each sample, and how many are wrong."""
    for glare in GLARES:
        with tempfile.TemporaryDirectory() as folder:
            rig = shipped_rig("sim-eleven", imaging={"glare": glare})
            found = fits(Path(folder), rig, "decay-eleven")
        far, other = 0, 0
        for name, fit in found.items():
            if has_true_number_of_states(fit, name):
                errors = list(pulls(fit, name))
                far += max(map(abs, errors)) > FAR_SIGMAS
                print(f"glare {glare:.1%}  {name:16}" + "".join(f"{e:+7.1f} σ" for e in errors))
            else:
                other += 1
                print(f"glare {glare:.1%}  {name:16}{fit['n_states']:4} states")
        print(
            f"glare {glare:.1%}: of {len(found)} samples {far} off by more than {FAR_SIGMAS:g} σ, "
            f"{other} with a wrong number of states",
            flush=True,
        )


if __name__ == "__main__":
    main()
