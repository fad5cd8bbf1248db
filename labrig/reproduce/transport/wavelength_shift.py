"""Drawing the wavelengths of paths at surfaces that re-radiate.

A path carries single wavelengths. Where it meets a surface it is reflected or shifts to another
wavelength, which is drawn from the conditional densities of a mixture (Hua et al., *A compact
representation for fluorescent spectral data*, EGSR 2021, section 6). Their algorithm 1 as printed
takes the component before the running sum reaches the random number, and rejects what is beyond the
diagonal without a change of the density; here the component is the one that reaches it, and all
densities are those of what was cut off, so that the mean of the weights is the integral.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from labrig.foundation.arrays import BoolArray, FloatArray
from labrig.foundation.errors import UsageError
from labrig.material import ReradiationMatrix, ReradiationMixture
from labrig.reproduce.compiled import compiled

#: End of a path at which the wavelength is known: the output from the eye, the input from the lamp.
Start: TypeAlias = Literal["eye", "lamp"]
#: Part of uniform draws where the mixture stands for a matrix: what it misses has finite weights.
UNIFORM_PART = 0.1


@dataclass(frozen=True, eq=False)
class ShiftedWavelengths:
    """Wavelengths of paths beyond a surface.

    Attributes
    ----------
    wavelength_nm
        Wavelengths in nm, shape (n,).
    weight
        Factors of the paths' light, shape (n,), whose mean is the reflectance plus the integral of
        the re-radiation.
    is_reflected
        Whether the wavelength was kept, shape (n,).
    """

    wavelength_nm: FloatArray
    weight: FloatArray
    is_reflected: BoolArray


class WavelengthShift:
    """A surface that reflects light or shifts its wavelength, for paths of single wavelengths.

    Parameters
    ----------
    matrix
        Reflectance in bands, and re-radiation, of which the Stokes side λ_o > λ_i counts. What was
        not measured (NaN) gives back nothing, as do wavelengths beyond its bands.
    mixture
        Mixture from which shifts are drawn; None for a surface that only reflects.
    reradiates
        `mixture`: the surface re-radiates as the mixture, cut off at the matrix's outermost
        edges; then all weights at one wavelength are equal. `matrix`: it re-radiates as the matrix
        in its bands, and the mixture, with a tenth of uniform draws, only says where to look.

    Raises
    ------
    UsageError
        The re-radiation is relative, the matrix re-radiates and there is no mixture to draw from,
        or the extra `labrig[render]` is missing.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.material import ReradiationMatrix, ReradiationMixture
    >>> from labrig.reproduce import WavelengthShift
    >>> dye = ReradiationMixture(
    ...     20.0, np.ones(1), np.array([[460.0, 520.0]]), np.array([[[900.0, 100], [100, 400]]])
    ... )
    >>> nm = np.arange(305.0, 780.0, 10.0)
    >>> paper = WavelengthShift(dye.to_matrix(nm, nm, reflectance=np.full(48, 0.4)), dye)
    >>> paper.reflected_part([460.0, 700.0], "lamp").round(4).tolist()
    [0.6009, 1.0]
    >>> drawn = paper.draw([460.0, 460.0], "lamp", np.array([[0.2, 0.8], [0.5, 0.5], [0.5, 0.5]]))
    >>> drawn.wavelength_nm.round(1).tolist(), drawn.weight.round(4).tolist()
    ([460.0, 520.0], [0.6656, 0.6656])
    """

    def __init__(
        self,
        matrix: ReradiationMatrix,
        mixture: ReradiationMixture | None,
        reradiates: Literal["mixture", "matrix"] = "mixture",
    ) -> None:
        compiled("transport.shift_kernels")
        if matrix.unit == "relative":
            raise UsageError(
                f"{matrix.name}: expected re-radiation per nm of the light, got a relative one; "
                "measure its scale"
            )
        stokes = np.where(matrix.is_stokes, np.nan_to_num(matrix.reradiation), 0.0)
        if mixture is None and stokes.any():
            raise UsageError(
                f"{matrix.name}: expected a mixture to draw from, got none; fit one (labrig fit "
                "mixture)"
            )
        self._matrix, self._mixture, self._stokes = matrix, mixture, stokes
        self._is_mixture = mixture is None or reradiates == "mixture"

    def draw(self, given_nm: ArrayLike, start: Start, random: FloatArray) -> ShiftedWavelengths:
        """Draw one wavelength for each given one.

        A path is reflected with the probability `reflected_part`, and shifts else.

        Parameters
        ----------
        given_nm
            Wavelengths of the paths in nm, shape (n,).
        start
            Where the paths began: at the `eye`, and the input is drawn, or at the `lamp`, and the
            output is.
        random
            Uniform random numbers from 0 to below 1, shape (3, n): for the decision, the component
            and the wavelength.

        Returns
        -------
        ShiftedWavelengths
            Wavelengths and factors of the paths' light.

        Raises
        ------
        UsageError
            The shapes disagree.
        """
        given = np.ascontiguousarray(given_nm, dtype=np.float64)
        if given.ndim != 1 or random.shape != (3, len(given)):
            raise UsageError(
                "expected wavelengths of shape (n,) and random numbers of shape (3, n), got "
                f"{given.shape} and {random.shape}"
            )
        drawn = ShiftedWavelengths(
            np.empty_like(given), np.empty_like(given), np.empty(given.shape, np.bool_)
        )
        compiled("transport.shift_kernels").draw(
            self._tables(start), given, np.ascontiguousarray(random, dtype=np.float64),
            drawn.wavelength_nm, drawn.weight, drawn.is_reflected,
        )  # fmt: skip
        return drawn

    def draw_shift(self, given_nm: ArrayLike, start: Start, random: FloatArray) -> FloatArray:
        """Return the wavelengths (n,) in nm of paths that are known to shift, drawn by `density`.

        Takes two random numbers each, shape (2, n). A wavelength without re-radiation is kept.
        """
        decided = np.full(random.shape[1], np.nextafter(1.0, 0.0))
        return self.draw(given_nm, start, np.vstack([decided, random])).wavelength_nm

    def reflected_part(self, given_nm: ArrayLike, start: Start) -> FloatArray:
        """Return the probability that a wavelength is kept, diagonal over total.

        Where the surface gives back nothing it is 1.
        """
        reflected, shifted = np.abs(self._parts(given_nm, start))
        total = reflected + shifted
        return np.asarray(np.divide(reflected, total, out=np.ones_like(total), where=total > 0))

    def reflectance(self, wavelength_nm: ArrayLike) -> FloatArray:
        """Return the reflectance of wavelengths (n,) in nm, 0 where it was not measured."""
        return self._parts(wavelength_nm, "eye")[0]

    def density(self, given_nm: ArrayLike, other_nm: ArrayLike, start: Start) -> FloatArray:
        """Return the density in 1/nm of shifts from given to other wavelengths, both (n,).

        It integrates to 1 over the Stokes side, and counts paths that do shift.
        """
        return self._densities(given_nm, other_nm, start)[0]

    def reradiation(self, input_nm: ArrayLike, output_nm: ArrayLike) -> FloatArray:
        """Return the re-radiation in 1/nm of output, of inputs and outputs (n,)."""
        return self._densities(input_nm, output_nm, "lamp")[1]

    def _parts(self, given_nm: ArrayLike, start: Start) -> tuple[FloatArray, FloatArray]:
        given = np.ascontiguousarray(given_nm, dtype=np.float64)
        reflected, shifted = np.empty_like(given), np.empty_like(given)
        compiled("transport.shift_kernels").parts(self._tables(start), given, reflected, shifted)
        return reflected, shifted

    def _densities(
        self, given_nm: ArrayLike, other_nm: ArrayLike, start: Start
    ) -> tuple[FloatArray, FloatArray]:
        given, other = (
            np.ascontiguousarray(nm)
            for nm in np.broadcast_arrays(
                np.asarray(given_nm, dtype=np.float64), np.asarray(other_nm, dtype=np.float64)
            )
        )
        pdf, value = np.empty_like(given), np.empty_like(given)
        compiled("transport.shift_kernels").densities(self._tables(start), given, other, pdf, value)
        return pdf, value

    def _tables(self, start: Start) -> Any:
        return self._from_eye if start == "eye" else self._from_lamp

    @cached_property
    def _from_eye(self) -> Any:
        return self._made_tables(is_output_given=True)

    @cached_property
    def _from_lamp(self) -> Any:
        return self._made_tables(is_output_given=False)

    def _made_tables(self, *, is_output_given: bool) -> Any:
        matrix, kernels = self._matrix, compiled("transport.shift_kernels")
        edges = (matrix.input_edges_nm, matrix.output_edges_nm)
        given, other = edges[::-1] if is_output_given else edges
        reradiation = self._stokes if is_output_given else self._stokes.T
        return kernels.Tables(
            is_output_given,
            matrix.output_edges_nm,
            np.nan_to_num(matrix.reflectance),
            self._components(given=1 if is_output_given else 0),
            *(float(edge) for edge in (given[0], given[-1], other[0], other[-1])),
            0.0 if self._is_mixture else self._overlap_nm,
            self._is_mixture,
            given,
            other,
            np.ascontiguousarray(reradiation),
            np.abs(reradiation) @ np.diff(other),
            0.0 if self._is_mixture else UNIFORM_PART,
        )

    @property
    def _overlap_nm(self) -> float:
        """How far bands of the Stokes side reach beyond the diagonal."""
        matrix = self._matrix
        reach = matrix.input_edges_nm[1:] - matrix.output_edges_nm[:-1, np.newaxis]
        return float(np.max(reach, initial=0.0, where=self._stokes != 0))

    def _components(self, given: int) -> NDArray[np.void]:
        mixture, dtype = self._mixture, compiled("transport.shift_kernels").COMPONENT
        if mixture is None:
            return np.empty(0, dtype)
        found = np.empty(len(mixture.weights), dtype)
        found["factor"] = mixture.scale * mixture.weights
        found["correlation"] = mixture.correlation
        for name, axis in (("given", given), ("other", 1 - given)):
            found[f"{name}_median"] = mixture.mean_nm[:, axis]
            found[f"{name}_sd"] = np.sqrt(mixture.covariance_nm2[:, axis, axis])
            found[f"{name}_cosh"] = np.cosh(mixture.skews[:, axis])
            found[f"{name}_sinh"] = np.sinh(mixture.skews[:, axis])
        return found


def rotated_wavelengths(
    hero_nm: ArrayLike, number: int, low_nm: float = 300.0, high_nm: float = 780.0
) -> FloatArray:
    """Return the wavelengths that share a path: a hero's, and others rotated through the range.

    Each is uniform over the range if the hero's is (Wilkie et al., *Hero wavelength spectral
    sampling*, EGSR 2014).

    Parameters
    ----------
    hero_nm
        Wavelengths of the heroes in nm, within the range, shape (n,).
    number
        Number of wavelengths on a path, at least 1.
    low_nm, high_nm
        Range in nm.

    Returns
    -------
    ndarray
        Wavelengths in nm, the hero's first, shape (number, n).

    Raises
    ------
    UsageError
        The number is below 1, or the range is empty.

    Examples
    --------
    >>> from labrig.reproduce import rotated_wavelengths
    >>> rotated_wavelengths([500.0], 4).tolist()
    [[500.0], [620.0], [740.0], [380.0]]
    """
    if number < 1 or not high_nm > low_nm:
        raise UsageError(
            f"expected 1 or more wavelengths in a range, got {number} in {low_nm:g}–{high_nm:g} nm"
        )
    span_nm = high_nm - low_nm
    turned = np.arange(number)[:, np.newaxis] * (span_nm / number)
    return low_nm + np.mod(np.asarray(hero_nm, dtype=np.float64) - low_nm + turned, span_nm)


def balance(own: ArrayLike, *others: ArrayLike) -> FloatArray:
    """Return the weight of a sample that several densities could have drawn.

    The balance heuristic: the density by which the sample was drawn, over the sum of all. Equation
    14 of Hua et al. has the same form with densities of all the wavelengths of a path, where the
    direction was sampled for one of them; factors that densities have in common cancel, so that on
    surfaces whose directions do not depend on the wavelength it is one over their number.

    Parameters
    ----------
    own
        Density by which the sample was drawn, of any shape.
    *others
        Densities by which it could have been drawn.

    Returns
    -------
    ndarray
        Weights from 0 to 1; 0 where no density reaches the sample.

    Examples
    --------
    >>> from labrig.reproduce import balance
    >>> balance([0.3, 0.0], [0.1, 0.2]).round(2).tolist()
    [0.75, 0.0]
    """
    density = np.asarray(own, dtype=np.float64)
    total = density + sum(np.asarray(other, dtype=np.float64) for other in others)
    return np.divide(density, total, out=np.zeros_like(total), where=total > 0)


@dataclass(frozen=True, eq=False)
class LampWavelengths:
    """Draws of wavelengths in proportion to a lamp's radiance in bands.

    Parameters
    ----------
    edges_nm
        Rising edges of the bands in nm, shape (n + 1,).
    radiance
        Radiance per nm in each band, ≥ 0 and not 0 everywhere, shape (n,).

    Raises
    ------
    UsageError
        The shapes disagree, edges do not rise, or there is no light.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.reproduce import LampWavelengths
    >>> lamp = LampWavelengths(np.array([300.0, 400.0, 500.0]), np.array([1.0, 3.0]))
    >>> lamp.draw(np.array([0.125, 0.5])).round(1).tolist(), lamp.density([350.0]).tolist()
    ([350.0, 433.3], [0.0025])
    """

    edges_nm: FloatArray
    radiance: FloatArray

    def __post_init__(self) -> None:
        shapes = (self.edges_nm.shape, self.radiance.shape)
        if self.radiance.ndim != 1 or shapes[0] != (len(self.radiance) + 1,):
            raise UsageError(
                f"expected edges (n + 1,) and radiance (n,) of a lamp, got {shapes[0]}, {shapes[1]}"
            )
        if not (np.diff(self.edges_nm) > 0).all():
            raise UsageError("expected edges of a lamp's bands that rise")
        is_proper = np.isfinite(self.radiance).all() and (self.radiance >= 0).all()
        if not (is_proper and self.radiance.any()):
            raise UsageError("expected the radiance of a lamp, ≥ 0 and not 0 in all bands")

    def draw(self, random: FloatArray) -> FloatArray:
        """Return wavelengths in nm of uniform random numbers (n,) from 0 to below 1."""
        light = random * self._cumulated[-1]
        return np.asarray(np.interp(light, self._cumulated, self.edges_nm))

    def density(self, wavelength_nm: ArrayLike) -> FloatArray:
        """Return the density of draws in 1/nm of wavelengths (n,)."""
        return np.asarray(self.radiance_at(wavelength_nm) / self._cumulated[-1])

    def radiance_at(self, wavelength_nm: ArrayLike) -> FloatArray:
        """Return the radiance per nm of wavelengths (n,), 0 outside of the bands."""
        nm = np.asarray(wavelength_nm, dtype=np.float64)
        band = np.searchsorted(self.edges_nm, nm, side="right") - 1
        inside = (band >= 0) & (band < len(self.radiance))
        return np.where(inside, self.radiance[np.where(inside, band, 0)], 0.0)

    @cached_property
    def _cumulated(self) -> FloatArray:
        return np.concatenate([[0.0], np.cumsum(self.radiance * np.diff(self.edges_nm))])


def direct_light(
    surface: WavelengthShift, lamp: LampWavelengths, output_nm: ArrayLike, random: FloatArray
) -> FloatArray:
    """Estimate the light of a lamp that comes back from a surface at some wavelengths.

    Reflected light is exact. Re-radiated light is estimated from one input drawn from the surface's
    conditional density and one drawn from the lamp, weighed by `balance`: the first serves broad
    lamps and narrow dyes, the second narrow lamps.

    Parameters
    ----------
    surface
        The surface.
    lamp
        The lamp.
    output_nm
        Wavelengths of the light that comes back in nm, shape (n,).
    random
        Uniform random numbers from 0 to below 1, shape (3, n).

    Returns
    -------
    ndarray
        Estimates of ρ L(λ_o) + ∫ Φ(λ_i, λ_o) L(λ_i) dλ_i, shape (n,).

    Raises
    ------
    UsageError
        The shapes disagree.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.material import ReradiationMatrix
    >>> from labrig.reproduce import LampWavelengths, WavelengthShift, direct_light
    >>> nm = np.arange(305.0, 780.0, 10.0)
    >>> grey = ReradiationMatrix.from_bands("grey", nm, nm, np.diag(np.full(48, 0.5)))
    >>> lamp = LampWavelengths(np.array([300.0, 500.0]), np.array([2.0]))
    >>> random = np.random.default_rng(1).random((3, 2))
    >>> direct_light(WavelengthShift(grey, None), lamp, [450.0, 550.0], random).tolist()
    [1.0, 0.0]
    """
    output = np.asarray(output_nm, dtype=np.float64)
    if output.ndim != 1 or random.shape != (3, len(output)):
        raise UsageError(
            "expected wavelengths of shape (n,) and random numbers of shape (3, n), got "
            f"{output.shape} and {random.shape}"
        )
    estimate = surface.reflectance(output) * lamp.radiance_at(output)
    drawn = (surface.draw_shift(output, "eye", random[:2]), lamp.draw(random[2]))
    for own, input_nm in enumerate(drawn):
        densities = (surface.density(output, input_nm, "eye"), lamp.density(input_nm))
        given_back = surface.reradiation(input_nm, output) * lamp.radiance_at(input_nm)
        # The balance heuristic over the own density: the sum of both divides.
        total = densities[0] + densities[1]
        estimate += np.divide(given_back, total, out=np.zeros_like(total), where=densities[own] > 0)
    return estimate
