"""Colours of a ColorChecker from its reflectances, against those that were published.

    python -m tests.acceptance.chart_colours

There are several editions of the chart and several tables of each: reflectances, and colours x, y,
Y under the light C (McCamy et al., 1976) or D50 (all later ones), both as colour-science has them.
Published sRGB are the colours under D50, adapted to the screen's D65 by Bradford's transform. Here
the reflectances are lit by the light of the published colours, which is adapted alike, or by D65;
ΔE2000 of the 24 patches is in bands of 1 nm, and in the 20 nm of a rendering.
"""

import numpy as np

from labrig.foundation import colour_science
from labrig.foundation.arrays import FloatArray
from labrig.optics import CIE_1931, Spectrum, delta_e, illuminant, lab, observer, white_xyz
from labrig.reproduce import tristimulus

REFLECTANCES = ("BabelColor Average", "ColorChecker N Ohta")
PUBLISHED = {
    "ColorChecker 1976": "C",
    "ColorChecker 2005": "D50",
    "BabelColor Average": "D50",
    "ColorChecker24 - Before November 2014": "D50",
    "ColorChecker24 - After November 2014": "D50",
}
BANDS_NM = {"1 nm": np.linspace(300, 780, 481), "20 nm": np.linspace(300, 780, 25)}
WHITE = white_xyz("D65", observer(CIE_1931))


def adapted(xyz: FloatArray, white: FloatArray) -> FloatArray:
    """Return CIELAB of colours under a white, adapted to D65 by Bradford's transform."""
    return lab(
        np.asarray(
            colour_science.load().chromatic_adaptation(
                xyz, white, WHITE, method="Von Kries", transform="Bradford"
            )
        ),
        WHITE,
    )


def of_reflectances(name: str, light: str, edges_nm: FloatArray) -> FloatArray:
    """Return CIELAB of the patches under a light, adapted to D65."""
    power = illuminant(light).in_bands(edges_nm)
    reflectances = []
    for patch in colour_science.load().SDS_COLOURCHECKERS[name].values():
        nm, value = np.array(patch.wavelengths), np.array(patch.values)
        # Beyond the measured ends, where the eye sees next to nothing, they are constant.
        whole = Spectrum("", np.r_[299, nm, 831], np.r_[value[0], value, value[-1]])
        reflectances.append(whole.in_bands(edges_nm))
    xyz = tristimulus(np.array(reflectances) * power, edges_nm)
    white = tristimulus(power, edges_nm)
    return adapted(xyz / white[1], white / white[1])


def published(name: str) -> FloatArray:
    """Return CIELAB of the published colours, adapted to D65."""
    colour = colour_science.load()
    chart = colour.CCS_COLOURCHECKERS[name]
    xyz = np.asarray(colour.xyY_to_XYZ(np.array(list(chart.data.values()))))
    return adapted(xyz, np.asarray(colour.xy_to_XYZ(chart.illuminant)))


def main() -> None:
    """Print a line for each pair of reflectances, published colours and light."""
    print("ΔE2000 of 24 patches: mean, largest, in bands of 1 nm and of 20 nm")
    print(f"{'reflectances':22}{'published colours':40}{'lit by':8}{'1 nm':>12}{'20 nm':>12}")
    for reflectances in REFLECTANCES:
        for name, light in PUBLISHED.items():
            for lit_by in (light, "D65"):
                said = ""
                for edges_nm in BANDS_NM.values():
                    found = of_reflectances(reflectances, lit_by, edges_nm)
                    difference = delta_e(found, published(name))
                    said += f"{f'{difference.mean():.2f}, {difference.max():.2f}':>12}"
                print(f"{reflectances:22}{name:40}{lit_by:8}{said}")


if __name__ == "__main__":
    main()
