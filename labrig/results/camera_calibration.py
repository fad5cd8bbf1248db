"""What a body and a lens make of light."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from labrig.calibration import CAMERA_KIND, CameraFile, Noise
from labrig.optics import Flat
from labrig.results.measured import FloatArray, Measured
from labrig.results.run_result import RunResult
from labrig.results.series import Series

#: Standard deviations from which neighbours evidently share noise.
EVIDENT_SIGMAS = 4.0


@dataclass(frozen=True)
class PairScatter:
    """What two frames of the same light differ by, all channels together.

    Attributes
    ----------
    level_dn
        Mean of the two above dark.
    variance_dn2
        Of a pixel in one frame, without what its row shares.
    neighbours_dn2
        Sum of its covariances with the eight next pixels.
    row_variance_dn2
        Of what a row shares.
    pixels
        That were compared.
    """

    level_dn: float
    variance_dn2: float
    neighbours_dn2: float
    row_variance_dn2: float
    pixels: int

    @property
    def light_variance_dn2(self) -> float:
        """Of a pixel's own light, DN²: what it loses to its neighbours is put back."""
        return self.variance_dn2 + self.neighbours_dn2


@dataclass(frozen=True)
class PhotonTransfer:
    """The noise at one ISO, and what it was found from.

    Attributes
    ----------
    noise
        As in the camera file.
    points
        Of the lit frames.
    shared, shared_sigma
        What neighbours share, over the variance of a pixel.
    reduced_chi2
        Of the straight line; more than a few: it is none.
    """

    noise: Noise
    points: tuple[PairScatter, ...]
    shared: float
    shared_sigma: float
    reduced_chi2: float

    @property
    def neighbours_share_noise(self) -> bool:
        """Whether neighbours evidently share noise."""
        return self.shared > EVIDENT_SIGMAS * self.shared_sigma


@dataclass(frozen=True, eq=False)
class FittedFlat:
    """A flat field, and means of blocks of the card: ρ², and light over the fit in the middle.

    Attributes
    ----------
    flat
        As in the camera file.
    rho2
        (channels, blocks) squared distance from the middle over half the diagonal.
    light
        (channels, blocks), the gradient divided out.
    """

    flat: Flat
    rho2: FloatArray
    light: FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class CameraCalibrationResult(RunResult):
    """A camera's noise, linearity, settings and flat fields.

    Attributes
    ----------
    calibration
        For all later runs with this body and lens; the file `camera.yaml`. Its `flicker` is that
        of brackets.
    card
        The card's region in all lit frames, dark subtracted, nothing else put right.
    photon_transfers
        By ISO, in the order of `calibration.noise`.
    repeat_flicker
        Relative scatter of frames of one exposure.
    flats
        By f-number, in the order of `calibration.flats`.

    Examples
    --------
    >>> result = labrig.read_result(run)  # doctest: +SKIP
    >>> for noise in result.calibration.noise:
    ...     print(noise.iso, noise.gain_e_per_dn, noise.read_noise_e)
    """

    kind: ClassVar[str] = "camera_calibration"

    calibration: CameraFile
    card: Series
    photon_transfers: tuple[PhotonTransfer, ...]
    repeat_flicker: Measured
    flats: tuple[FittedFlat, ...]

    def provides(self) -> Mapping[str, Any]:
        """The camera."""
        return {CAMERA_KIND.name: self.calibration}

    def write_files(self, folder: Path) -> None:
        """Write `camera.yaml`."""
        CAMERA_KIND.write_into(folder, self.calibration)
