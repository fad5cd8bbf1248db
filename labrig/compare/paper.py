"""What Nalbach et al. found, to stand beside one's own figures.

Nalbach, Seidel, Ritschel: *Practical Capture and Reproduction of Phosphorescent Appearance*.
"""

from typing import NamedTuple

#: The materials of Table 1, shipped under these names.
TABLE_1 = (
    "blue-paint",
    "green-paint",
    "orange-paint",
    "pink-paint",
    "purple-paint",
    "red-paint",
    "white-paint",
    "yellow-paint",
    "bottle",
    "gloves",
    "stickers",
)


class DeltaE(NamedTuple):
    """CIEDE2000 over all materials and times."""

    mean: float
    least: float
    most: float


#: By the number of states (caption of fig. 8).
DELTA_E = {1: DeltaE(13.16, 7.24, 19.75), 2: DeltaE(5.46, 1.23, 10.64)}
#: Error with so many states over that with one, median of the materials (sec. 4.4).
RESIDUALS = {2: 0.08, 3: 0.04}
#: The same of the last time sample.
LAST_RESIDUALS = {2: 0.18, 3: 0.03}
