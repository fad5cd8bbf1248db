"""How the lamp goes dark after switching off, comes on, and warms."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from labrig.calibration import FADE_KIND, FadeFile
from labrig.results.measured import FloatArray, Measured
from labrig.results.run_result import RunResult


@dataclass(frozen=True, eq=False)
class SwitchedFrames:
    """n frames after a switch of the lamp, seen in S places or colours.

    Attributes
    ----------
    start_s, exposure_s
        (n,) begins after the switch as recorded, and shutter times.
    light_s, light_sigma_s
        (n, S) ∫ of the fraction of the steady lamp over the exposure, in s; NaN where it clips.
    steady_dn_per_s
        (S,) signal of the steady lamp.
    clipped
        How many frames clip somewhere; those that clip everywhere are not among the n.
    """

    start_s: FloatArray
    exposure_s: FloatArray
    light_s: FloatArray
    light_sigma_s: FloatArray
    steady_dn_per_s: FloatArray
    clipped: int


@dataclass(frozen=True, eq=False)
class FittedShape:
    """One course of u(t) in ln fraction = −u(t) (550 nm/λ)^p that may explain the frames.

    Attributes
    ----------
    name
        `filament`, or `polynomial of degree 3` and the like.
    parameters, covariance
        (k,) and (k, k); the last two parameters are p and the lag of the shutter in s.
    jitter_s
        Scatter of the frames' begins.
    chi2, dof
        Of the frames, and its degrees of freedom.
    weight
        How likely the shape is among those fitted; they sum to 1.
    """

    name: str
    parameters: FloatArray
    covariance: FloatArray
    jitter_s: float
    chi2: float
    dof: int
    weight: float

    @property
    def reduced_chi2(self) -> float:
        """χ² per degree of freedom."""
        return self.chi2 / self.dof


@dataclass(frozen=True, eq=False)
class LampChange:
    """The lamp's fade or rise; what it is band by band is in the file's table.

    Attributes
    ----------
    frames
        What it was found from.
    shapes
        Those that explain it.
    exponent
        p, over all shapes; 1 of a glowing body.
    lag
        By how much shutters opened later than recorded, over all shapes.
    """

    frames: SwitchedFrames
    shapes: tuple[FittedShape, ...]
    exponent: Measured
    lag: Measured

    @property
    def best(self) -> FittedShape:
        """The likeliest shape."""
        return max(self.shapes, key=lambda shape: shape.weight)


@dataclass(frozen=True, eq=False)
class WarmingLight:
    """Light while the lamp's housing warms.

    Attributes
    ----------
    t_s, light
        (n,) begins of the frames after switching on, and light over that of the warm lamp.
    """

    t_s: FloatArray
    light: FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class FadeResult(RunResult):
    """The lamp after its switch.

    Attributes
    ----------
    calibration
        For charges on the same bench; the file `fade.yaml`.
    fade, rise
        After switching off and on; None: not measured.
    warming
        The light with which `calibration.warming` was found; None: not measured.

    Examples
    --------
    >>> result = labrig.read_result(run)  # doctest: +SKIP
    >>> print(result.fade.best.name, result.fade.exponent.value, result.fade.lag.value)
    """

    kind: ClassVar[str] = "fade"

    calibration: FadeFile
    fade: LampChange
    rise: LampChange | None = None
    warming: WarmingLight | None = None

    def provides(self) -> Mapping[str, Any]:
        """The fade."""
        return {FADE_KIND.name: self.calibration}

    def write_files(self, folder: Path) -> None:
        """Write `fade.yaml`."""
        FADE_KIND.write_into(folder, self.calibration)
