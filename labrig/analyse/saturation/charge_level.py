"""How far a state is charged, from how much less it glows after a weaker light.

Under a constant light r(t) = κ/s (1 − e^(−s t)), s = κ + k. A light weaker by the factor q gives
q κ: where r is small the glow falls by q, where it is near 1 hardly at all. Amplitudes are only
compared, so that neither Λ nor the camera's scale matter.
"""

import numpy as np
from scipy.optimize import brentq

from labrig.results import ChargeLevel

#: Lights searched, in multiples of the rate of re-radiation: r∞ of 1e-4 to 0.9999.
FAINTEST, STRONGEST = 1e-4, 1e4
#: Relative step of the derivatives.
STEP = 1e-3


def charged(kappa_per_s: float, k_per_s: float, charge_s: float) -> float:
    """The level r after a charge from the dark (physics: exact for constant light)."""
    s = kappa_per_s + k_per_s
    return float(kappa_per_s / s * -np.expm1(-s * charge_s))


def charge_level(
    ratio: float,
    ratio_sigma: float,
    share: float,
    share_sigma: float,
    k_per_s: float,
    charges_s: tuple[float, float],
) -> ChargeLevel:
    """The level under the full light.

    Parameters
    ----------
    ratio, ratio_sigma
        Amplitude after the weaker light over that after the full one.
    share, share_sigma
        What is left of the light, q; its σ relative.
    charges_s
        Under the weaker and under the full light.
    """
    r = _level(ratio, share, k_per_s, charges_s)
    by_ratio = (_level(ratio * (1 + STEP), share, k_per_s, charges_s) - r) / STEP
    by_share = (_level(ratio, share * (1 + STEP), k_per_s, charges_s) - r) / STEP
    sigma = np.hypot(by_ratio * ratio_sigma / ratio, by_share * share_sigma)
    # At an end of the range, where nothing changes any more, the σ is that just inside.
    least = ratio_sigma / ratio * share / (1 - share)
    return ChargeLevel(r, float(max(sigma, least)))


def _level(ratio: float, share: float, k_per_s: float, charges_s: tuple[float, float]) -> float:
    def excess(log_kappa: float) -> float:
        kappa = float(np.exp(log_kappa))
        weaker, full = charges_s
        return charged(share * kappa, k_per_s, weaker) / charged(kappa, k_per_s, full) - ratio

    low, high = np.log(FAINTEST * k_per_s), np.log(STRONGEST * k_per_s)
    if excess(low) >= 0:
        return 0.0
    if excess(high) <= 0:
        return 1.0
    return charged(float(np.exp(brentq(excess, low, high))), k_per_s, charges_s[1])
