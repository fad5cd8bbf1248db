"""labrig's fits on other people's reference data: certified results, lines of a real lamp.

    python -m tests.acceptance.reference_data

Two tables. Digits to which the least-squares fit agrees with the certified parameters of NIST's
nonlinear regression sets, from the harder start (1) and the easier one (2), weakest parameter. And
the root mean square of what is left of the wavelengths of a real germicidal lamp's mercury lines
after a straight line through the positions that were found.
"""

import numpy as np

from labrig.fit.lvf import MERCURY, Line, locate_lines
from labrig.fit.nonlinear_least_squares import least_squares
from labrig.optics import read_spectrum
from tests.fit import strd
from tests.real_data import REAL, SHARED

STRD = REAL / "nist_strd"
LAMP = SHARED / "light_sources/photobiology/lamps.csv"
#: Of these lines the ultraviolet ones are strong enough to be found.
ULTRAVIOLET = (Line((253.6517,)), Line((365.0158,)))


def digits(name: str, start: int) -> float:
    """Return the number of digits to which all parameters of a set agree."""
    reference = strd.read(STRD / f"{name}.dat")
    fit = least_squares(reference.residuals, reference.starts[start])
    return float(reference.certified_digits(fit.parameters))


def rms_nm(lines: tuple[Line, ...], low_nm: float) -> tuple[int, float]:
    """Return the number of lines above `low_nm`, and the residual of a straight line."""
    lamp = read_spectrum(LAMP, "Generic.germicidal")
    part = (lamp.wavelength_nm > low_nm) & (lamp.wavelength_nm < 590)
    found = locate_lines(lamp.wavelength_nm[part], lamp.value[part], lines=lines, fwhm_nm=1.2)
    straight = np.polyfit(found.position, found.wavelength_nm, 1)
    left_nm = np.polyval(straight, found.position) - found.wavelength_nm
    return len(left_nm), float(np.std(left_nm))


def main() -> None:
    """Print both tables."""
    print(f"{'NIST set':14}{'start 1':>9}{'start 2':>9}   digits")
    for name in strd.MODELS:
        print(f"{name:14}{digits(name, 0):9.1f}{digits(name, 1):9.1f}")
    print(f"\n{'mercury lines':22}{'found':>6}{'rms / nm':>10}")
    for what, lines, low_nm in (
        ("visible", MERCURY, 395.0),
        ("ultraviolet, visible", (*ULTRAVIOLET, *MERCURY), 250.0),
    ):
        count, left_nm = rms_nm(lines, low_nm)
        print(f"{what:22}{count:6}{left_nm:10.4f}")


if __name__ == "__main__":
    main()
