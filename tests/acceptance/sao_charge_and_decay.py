"""Rate equations against a real phosphor, charge and decay together: how well, and where not.

    python -m tests.acceptance.sao_charge_and_decay

SrAl2O4:Eu,Dy by Castaing et al. (2024; shared data, `decay/perslqy_sao`): glow at 524 nm while and
after 400 nm shines on it for 300 s. Fitted: n states, each with k_r, κ and amplitude, and prompt
light while the lamp is on; the dark level is that before the charge. Printed: reduced χ², rms of
misfit over glow in the charge, the decay's first minute, and the rest.

The charging curve of this phosphor is convex for its first minute and a half. Under constant light
every state of the rate equation approaches its equilibrium ever more slowly, and so does any sum of
them: no number of states can follow that. States of general order can; they are fitted by
`fit_charge_and_decay`, with the share η of carriers that recombine at once where their trap is
filled held at 0, at 1, or free;
last, what `labrig fit charge` prints of the table.
"""

import io
from contextlib import redirect_stdout
from itertools import pairwise

import numpy as np

from labrig.cli.exit_codes import guarded
from labrig.fit import ChargeFit, LeastSquaresFit, fit_charge_and_decay, least_squares
from labrig.foundation.arrays import FloatArray
from labrig.material.rates import concentration, phi1
from tests.real_data import SHARED

TABLE = SHARED / "decay/perslqy_sao/sample_400_524_300s.txt"
ON_S, OFF_S, DARK_UNTIL_S = 30.0, 330.0, 29.0
#: Every count weighs so much, and readings are that long.
COUNT, READING_S = 1.448, 0.6
#: Steps for the Jacobian, relative: parameters are logarithms and of order 1.
STEP = 1e-5


def measured() -> tuple[FloatArray, FloatArray, float]:
    """Times from switching on, glow over the dark level, and the dark level."""
    t_s, counts = np.genfromtxt(TABLE, skip_header=1, usecols=(0, 1)).T
    dark = float(counts[t_s < DARK_UNTIL_S].mean())
    # the readings during which the lamp switches are left out
    used = ((t_s > ON_S + 1) & (t_s < OFF_S - 1)) | (t_s > OFF_S + 1)
    return t_s[used] - ON_S, counts[used] - dark, dark


def model(theta: FloatArray, t_s: FloatArray) -> FloatArray:
    """Σ A_i r_i, and prompt light while the lamp is on; θ: ln of k_r, of κ, of A, of the prompt."""
    k_r, kappa, amplitude = np.exp(theta[:-1]).reshape(3, -1)
    charge_s = OFF_S - ON_S
    lit = t_s < charge_s
    level = concentration(0.0, kappa, k_r, np.minimum(t_s, charge_s)[:, None])
    after_s = np.maximum(t_s - charge_s, 0.0)[:, None]
    left = np.where(lit[:, None], 1.0, np.exp(-k_r * after_s) * phi1(k_r * READING_S))
    glow: FloatArray = (level * left) @ amplitude + np.where(lit, np.exp(theta[-1]), 0.0)
    return glow


def fitted(states: int, t_s: FloatArray, glow: FloatArray, dark: float) -> LeastSquaresFit:
    """The best of a few starts."""
    sigma = np.sqrt(COUNT * np.maximum(glow + dark, 4 * COUNT))

    def residuals(theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        columns = []
        for place in range(len(theta)):
            up, down = theta.copy(), theta.copy()
            up[place] += STEP
            down[place] -= STEP
            columns.append((model(up, t_s) - model(down, t_s)) / (2 * STEP * sigma))
        return (model(theta, t_s) - glow) / sigma, np.stack(columns, axis=1)

    # κ from where charging is straight to where it is over at once; amplitudes stay finite
    low = np.log([*[1e-4] * states, *[1e-4] * states, *[1.0] * states, 1.0])
    high = np.log([*[1.0] * states, *[1.0] * states, *[1e7] * states, 1e4])
    found = []
    for kappa in (1e-3, 5e-3, 2e-2):
        k_r = np.geomspace(0.02, 0.0015, states) if states > 1 else np.array([0.005])
        start = np.log([*k_r, *[kappa] * states, *[3e4 / states] * states, 500.0])
        found.append(
            least_squares(
                residuals, start, lower=low, upper=high, max_iterations=200, tolerance=1e-8
            )
        )
    return min(found, key=lambda fit: fit.chi2)


def of_general_order(light_stimulated: float | None) -> ChargeFit:
    """One and two states, of first and of general order."""
    t_s, counts = np.genfromtxt(TABLE, skip_header=1, usecols=(0, 1)).T
    return fit_charge_and_decay(
        t_s,
        counts,
        np.sqrt(COUNT * np.maximum(counts, 4 * COUNT)),
        light_on_s=ON_S,
        light_off_s=OFF_S,
        exposure_s=READING_S,
        light_stimulated=light_stimulated,
    )


def convexity(t_s: FloatArray, glow: FloatArray) -> tuple[float, float]:
    """Growth in counts per second: 5 to 25 s and 60 to 90 s after switching on."""
    spans = [(t_s > begin) & (t_s < end) for begin, end in ((5, 25), (60, 90))]
    early, later = (float(np.polyfit(t_s[span], glow[span], 1)[0]) for span in spans)
    return early, later


def misfits(fit: LeastSquaresFit, t_s: FloatArray, glow: FloatArray) -> list[float]:
    """Rms of misfit over rms of glow: first minute of the charge, its rest, decay's begin, tail."""
    off = model(fit.parameters, t_s) - glow
    charge_s = OFF_S - ON_S
    edges = (0.0, 60.0, charge_s, charge_s + 60, np.inf)
    parts = [(t_s > begin) & (t_s < end) for begin, end in pairwise(edges)]
    return [float(np.sqrt((off[part] ** 2).mean() / (glow[part] ** 2).mean())) for part in parts]


def main() -> None:
    """Print the table."""
    t_s, glow, dark = measured()
    early, later = convexity(t_s, glow)
    print(f"growth 5-25 s after lamp-on: {early:.0f} counts/s, 60-90 s: {later:.0f} counts/s")
    print("states  reduced χ²   rms of misfit / %: charge to 60 s, to 300 s, decay to 60 s, later")
    for states in (1, 2, 3):
        fit = fitted(states, t_s, glow, dark)
        said = "".join(f"{100 * part:8.1f}" for part in misfits(fit, t_s, glow))
        print(f"{states:>6}{fit.reduced_chi2:>12.1f}   {said}")
    print("η      model                        χ² per reading: charge, decay")
    fits = {name: of_general_order(eta) for name, eta in (("0", 0.0), ("1", 1.0), ("free", None))}
    for name, fit_of_order in fits.items():
        for candidate in fit_of_order.candidates:
            parts = f"{candidate.chi2_charge:8.2f}{candidate.chi2_decay:8.2f}"
            print(f"{name:<7}{candidate.label:<29}{parts}")
    print()
    with redirect_stdout(io.StringIO()) as shown:
        guarded(["fit", "charge", str(TABLE), "--on", f"{ON_S:g}", "--off", f"{OFF_S:g}"])
    print(shown.getvalue().strip())


if __name__ == "__main__":
    main()
