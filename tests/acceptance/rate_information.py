"""How well rates, amplitudes and concentrations can be known at best, and how far paints charge.

    python -m tests.acceptance.rate_information

Three tables. Cramér-Rao bounds of the amplitude at full charge A and of κ from nine charges of 8 s
to 2048 s with noise of 1 % each, k_r known; of two rates from 36 frames, by what noise the frames
have; and the concentration that Table 1's paints approach under the shipped lamp of 3000 K, E
of length 1.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from labrig.foundation import resources
from labrig.material import read_material
from labrig.optics import read_spectrum

Floats = NDArray[np.float64]

CHARGES_S, CHARGE_NOISE, K_R = 8.0 * 2.0 ** np.arange(9), 0.01, 0.032
CONCENTRATIONS = (0.06, 0.23, 0.5)
FRAMES_S, SLOWER, SNR, FLICKER = 0.5 + 5.0 * np.arange(36), 0.015, 300.0, 0.007
RATIOS = (2, 3, 5, 10)
PAINTS = ("blue", "green", "orange", "pink", "purple", "red", "white", "yellow")
STEP = 1e-5


def covariance(model: Callable[[Floats], Floats], at: Floats, noise: Floats) -> Floats:
    """Return the least covariance of the logarithms of parameters; `noise` is that of values."""
    steps = STEP * np.eye(len(at))
    jacobian = np.stack(
        [(model(at * np.exp(s)) - model(at * np.exp(-s))) / (2 * STEP) for s in steps], axis=1
    )
    inverse: Floats = np.linalg.inv(jacobian.T @ np.linalg.solve(noise, jacobian))
    return inverse


def charging(concentration: float) -> tuple[float, float, float]:
    """Return relative σ of A, of κ and of their product."""

    def model(theta: Floats) -> Floats:
        full, kappa = theta
        rate = kappa + K_R
        return np.asarray(full * kappa / rate * -np.expm1(-rate * CHARGES_S))

    truth = np.array([1.0, K_R * concentration / (1 - concentration)])
    bound = covariance(model, truth, np.diag((CHARGE_NOISE * model(truth)) ** 2))
    product = float(np.sqrt(bound.sum()))
    return float(np.sqrt(bound[0, 0])), float(np.sqrt(bound[1, 1])), product


def two_rates(ratio: float, noise: str) -> tuple[float, float]:
    """Return relative σ of the faster and of the slower of two rates of equal amplitude."""
    offset = 2.0

    def model(theta: Floats) -> Floats:
        fast, slow, first, second = theta[:4]
        glow = first * np.exp(-fast * FRAMES_S) + second * np.exp(-slow * FRAMES_S)
        return np.asarray(glow + (theta[4] - offset if len(theta) > 4 else 0.0))

    truth = np.array([ratio * SLOWER, SLOWER, 0.5, 0.5])
    glow = model(truth)
    constant = np.ones(len(glow)) / SNR**2
    variance = {
        "root": glow / SNR**2,
        "flicker": glow / SNR**2 + (FLICKER * glow) ** 2,
    }.get(noise, constant)
    if noise == "constant, free offset":
        # The offset is the parameter less a number, since parameters vary by their logarithms.
        truth = np.append(truth, offset)
    bound = covariance(model, truth, np.diag(variance))
    return float(np.sqrt(bound[0, 0])), float(np.sqrt(bound[1, 1]))


def lamp_in_bands(edges_nm: Floats) -> Floats:
    """Return the shipped lamp's light in bands, as a vector of length 1."""
    lamp = read_spectrum(resources.curve_path("halogen_3000k"))
    light = lamp.in_bands(edges_nm)
    return np.asarray(light / np.linalg.norm(light))


def main() -> None:
    """Print the tables."""
    print("r∞     σ(A)/A   σ(κ)/κ  σ(Aκ)/Aκ")
    for concentration in CONCENTRATIONS:
        print(f"{concentration:<6}" + "".join(f"{s:10.3%}" for s in charging(concentration)))
    noises = ("root", "flicker", "constant", "constant, free offset")
    print("\nratio: relative σ of the faster and the slower rate; " + "; ".join(noises))
    for ratio in RATIOS:
        pairs = (two_rates(ratio, noise) for noise in noises)
        print(f"{ratio:<5}" + "".join(f"{fast:9.3%}{slow:9.3%}  " for fast, slow in pairs))
    print("\npaint     r∞")
    for name in PAINTS:
        material = read_material(f"{name}-paint")
        (state,) = material.states
        assert material.bands_nm is not None
        assert state.k_e_per_s is not None
        kappa = float(np.dot(state.k_e_per_s, lamp_in_bands(np.array(material.bands_nm))))
        print(f"{name:8}{kappa / (kappa + state.k_r_per_s):6.3f}")


if __name__ == "__main__":
    main()
