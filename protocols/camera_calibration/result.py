"""Result of a camera calibration: noise, linearity, settings and flat fields."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from labrig.calibration import CAMERA_KIND, CameraFile, Noise
from labrig.foundation.arrays import FloatArray
from labrig.optics import Flat
from labrig.results.budget import Budget
from labrig.results.measured import Measured
from labrig.results.run_result import RunResult
from labrig.results.series import Series

#: Significance in σ of correlated noise of neighbouring pixels.
EVIDENT_SIGMAS = 4.0


@dataclass(frozen=True)
class PairScatter:
    """Scatter between two frames of the same light, all channels together.

    Attributes
    ----------
    level_dn
        Mean of the two frames above dark in DN.
    levels_dn
        That of each position of the colour filter.
    variance_dn2
        Variance of a pixel in one frame without the common-mode noise of its row, in DN².
    neighbours_dn2
        Sum of the covariances of a pixel with its eight neighbours in DN².
    row_variance_dn2
        Variance of the common-mode noise of a row in DN².
    kurtosis
        Mean fourth power over the squared variance: 3 of normal noise.
    pixels
        Number of pixels that were compared.
    step_dn
        Step of the camera's numbers in DN.
    """

    level_dn: float
    levels_dn: tuple[float, ...]
    variance_dn2: float
    neighbours_dn2: float
    row_variance_dn2: float
    kurtosis: float
    pixels: int
    step_dn: int = 1

    @property
    def total_variance_dn2(self) -> float:
        """Variance of a pixel in one frame in DN², that of its row included."""
        return self.variance_dn2 + self.row_variance_dn2

    @property
    def light_variance_dn2(self) -> float:
        """Variance of a pixel's own light in DN², the part shared with neighbours put back."""
        return self.variance_dn2 + self.neighbours_dn2


@dataclass(frozen=True)
class PhotonTransfer:
    """Photon transfer at one ISO.

    Attributes
    ----------
    noise
        Gain and read noise, as in the camera file.
    points
        Scatter of the pairs of lit frames.
    photon_variance_dn2
        Variance by photons alone at each of `points` in DN², that of reading and rounding
        subtracted; None where the numbers do not resolve it.
    shared, shared_sigma
        Covariance with the neighbours relative to the variance of a pixel, and its σ.
    reduced_chi2
        Reduced χ² of the photon-transfer curve; more than a few if the variance does not follow it.
    bend
        ln of the signal at white over that of a linear sensor, by the ratios of channels and the
        photon transfer together.
    """

    noise: Noise
    points: tuple[PairScatter, ...]
    photon_variance_dn2: tuple[float | None, ...]
    shared: float
    shared_sigma: float
    reduced_chi2: float
    bend: Measured

    @property
    def neighbours_share_noise(self) -> bool:
        """Whether the noise of neighbouring pixels is significantly correlated."""
        return self.shared > EVIDENT_SIGMAS * self.shared_sigma


@dataclass(frozen=True, eq=False)
class FittedFlat:
    """A flat field, and the block means of the card that it was fitted to.

    Attributes
    ----------
    flat
        Flat field, as in the camera file.
    rho2
        Squared distance of each block from the centre in units of half the diagonal, shape
        (channels, blocks).
    light
        Light of each block relative to the fit in the centre, the gradient divided out, shape
        (channels, blocks).
    """

    flat: Flat
    rho2: FloatArray
    light: FloatArray

    @property
    def measured_to(self) -> float:
        """Distance of the outermost block from the centre, relative to half the diagonal."""
        return float(np.sqrt(self.rho2.max()))

    def sigma_at(self, rho2: FloatArray) -> FloatArray:
        """Return σ of the relative illumination by the scatter of the blocks about the fit.

        One more power of the distance than the curve has is left free, since beyond the card its
        form is not known.

        Parameters
        ----------
        rho2
            Squared distances from the centre in units of half the diagonal, shape (n,).

        Returns
        -------
        FloatArray
            Standard uncertainties, shape (n, channels).
        """
        powers = np.arange(len(self.flat.falloff[0]) + 2)
        sigmas = []
        for channel, (block_rho2, light) in enumerate(zip(self.rho2, self.light, strict=True)):
            design = block_rho2[:, np.newaxis] ** powers
            residual = light - self.flat.at(block_rho2)[:, channel]
            variance = residual @ residual / max(len(light) - len(powers) - 2, 1)
            covariance = variance * np.linalg.inv(design.T @ design)
            # Relative to the centre, whose own value is fitted too.
            relative = np.atleast_1d(rho2)[:, np.newaxis] ** powers
            relative[:, 0] = 1 - self.flat.at(np.atleast_1d(rho2))[:, channel]
            sigmas.append(np.sqrt(np.einsum("ni,ij,nj->n", relative, covariance, relative)))
        return np.stack(sigmas, axis=1)


@dataclass(frozen=True, eq=False, kw_only=True)
class CameraCalibrationResult(RunResult):
    """A camera's noise, linearity, settings and flat fields.

    Attributes
    ----------
    calibration
        Calibration for all later runs with this body and lens; the file `camera.yaml`. Its
        `flicker` is that of brackets.
    card
        Signal of the card's region in all lit frames in DN/s, dark subtracted, otherwise
        uncorrected.
    photon_transfers
        Photon transfer by ISO, in the order of `calibration.noise`.
    repeat_flicker
        Relative scatter of frames of one exposure.
    flats
        Flat fields by f-number, in the order of `calibration.flats`.

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

    def budgets(self) -> dict[str, Budget]:
        """Return the budgets of gain and read noise of every ISO, and of the flicker.

        A read noise that is only a limit has none.
        """
        budgets = {}
        for noise in self.calibration.noise:
            at = f"at ISO {noise.iso:g}"
            gain = Measured(noise.gain_e_per_dn, noise.gain_e_per_dn_sigma, "e/DN")
            budgets[f"gain {at}"] = Budget.of(gain, left_out=("light in the frame that moves",))
            if not noise.read_noise_is_limit:
                read = Measured(noise.read_noise_e, noise.read_noise_e_sigma, "e")
                gain_part = read.value * gain.sigma / gain.value
                budgets[f"read noise {at}"] = Budget.of(read, gain_part)
        budgets["flicker of frames alike"] = Budget.of(self.repeat_flicker)
        return budgets

    def provides(self) -> Mapping[str, Any]:
        """Return the calibration."""
        return {CAMERA_KIND.name: self.calibration}

    def write_files(self, folder: Path) -> None:
        """Write `camera.yaml`."""
        CAMERA_KIND.write(folder, self.calibration)
