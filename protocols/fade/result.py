"""Result of a fade run: turn-off, turn-on and warm-up transients of the lamp."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from labrig.calibration import FADE_KIND, FadeFile
from labrig.foundation.arrays import FloatArray, IntArray
from labrig.results.budget import Budget
from labrig.results.measured import Measured
from labrig.results.run_result import RunResult


@dataclass(frozen=True, eq=False)
class SwitchedFrames:
    """n frames after a switch of the lamp in S places or colours.

    Attributes
    ----------
    start_s, exposure_s
        Recorded begins in seconds after the switch, and exposure times in seconds, shape (n,).
    light_s, light_sigma_s
        Integral over the exposure of the light relative to the steady lamp, and its standard
        uncertainty, in seconds, shape (n, S); NaN where it clips. Of frames that were fitted, σ
        has flicker, the shutter's jitter, dark level and steady light besides photon and read
        noise.
    steady_dn_per_s
        Signal of the steady lamp in DN/s, shape (S,).
    dark_dn_per_s_sigma
        σ of the dark level, which all frames share, in DN/s, shape (S,).
    pass_number
        Pass of each frame, counted from 0, shape (n,).
    steady_frames
        Number of frames of the steady lamp in each pass, to whose mean its frames are relative,
        shape (passes,).
    clipped
        Number of frames that clip somewhere; those that clip everywhere are not among the n.
    """

    start_s: FloatArray
    exposure_s: FloatArray
    light_s: FloatArray
    light_sigma_s: FloatArray
    steady_dn_per_s: FloatArray
    dark_dn_per_s_sigma: FloatArray
    pass_number: IntArray
    steady_frames: IntArray
    clipped: int


@dataclass(frozen=True, eq=False)
class FittedShape:
    """One shape of u(t) in ln fraction = −u(t) (550 nm/λ)^p, fitted to the frames.

    Attributes
    ----------
    name
        Name of the shape, such as `filament` or `polynomial of degree 3`.
    parameters, covariance
        Fitted parameters and their covariance, shapes (k,) and (k, k); the last two parameters are
        p and the lag of the shutter in seconds.
    jitter_s
        Scatter of the frames' begins in seconds.
    chi2, dof
        χ² of the frames and its degrees of freedom.
    weight
        Probability of the shape among those fitted; they sum to 1.
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
    """Turn-off or turn-on transient of the lamp; the file has its table by band.

    Attributes
    ----------
    frames
        Frames that it was fitted to.
    shapes
        Shapes that are compatible with the frames.
    exponent
        Exponent p over all shapes; 1 of a black-body emitter.
    lag
        Delay in seconds of the actual against the recorded opening of the shutter, over all shapes.
    """

    frames: SwitchedFrames
    shapes: tuple[FittedShape, ...]
    exponent: Measured
    lag: Measured

    def exponent_budget(self) -> Budget:
        """Return the budget of p: its noise by each shape, and the spread of the shapes."""
        weight = np.array([shape.weight for shape in self.shapes])
        value, variance = np.array(
            [(shape.parameters[-2], shape.covariance[-2, -2]) for shape in self.shapes]
        ).T
        mean = float(weight @ value / weight.sum())
        return Budget(
            self.exponent.value,
            noise=float(np.sqrt(weight @ variance / weight.sum())),
            model=float(np.sqrt(weight @ (value - mean) ** 2 / weight.sum())),
            model_of="the shape of the curve",
        )

    @property
    def best(self) -> FittedShape:
        """Most probable shape."""
        return max(self.shapes, key=lambda shape: shape.weight)


@dataclass(frozen=True, eq=False)
class WarmingLight:
    """Light during the warm-up of the lamp's housing.

    Attributes
    ----------
    t_s
        Begins of the frames in seconds after switching on, shape (n,).
    light
        Light relative to that of the warm lamp, shape (n,).
    """

    t_s: FloatArray
    light: FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class FadeResult(RunResult):
    """Transients of the lamp after it was switched.

    Attributes
    ----------
    calibration
        Calibration for charges on the same bench; the file `fade.yaml`.
    fade, rise
        Turn-off and turn-on transient; None if not measured.
    warming
        Light from which `calibration.warming` was fitted; None if not measured.

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

    def budgets(self) -> dict[str, Budget]:
        """Return the budgets of the exponents of both transients and of the cold lamp's deficit."""
        changes = {"fade": self.fade, "rise": self.rise}
        budgets = {
            f"exponent of the {name}": change.exponent_budget()
            for name, change in changes.items()
            if change is not None
        }
        if (warming := self.calibration.warming) is not None:
            deficit = Measured(100 * warming.deficit, 100 * warming.deficit_sigma, "%")
            budgets["light that the cold lamp lacks"] = Budget.of(
                deficit, left_out=("a warm-up that is not one exponential",)
            )
        return budgets

    def provides(self) -> Mapping[str, Any]:
        """Return the calibration."""
        return {FADE_KIND.name: self.calibration}

    def write_files(self, folder: Path) -> None:
        """Write `fade.yaml`."""
        FADE_KIND.write(folder, self.calibration)
