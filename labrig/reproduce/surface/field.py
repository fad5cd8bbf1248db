"""Levels of a material's states on many samples, stepped through a changing light.

A sample is a texel, a point of a mesh or a particle; the field knows neither where it is nor how it
moves, only which light falls on it (Nalbach et al., section 5). A step takes the same time however
long the history.

dr/dt = (1 − r) κ − k rᵇ has no closed form for most b. With p = k Δt, which all samples of a
material have in common, the level after a step depends on the level r before it and on q = κ Δt
only. The table is even in x = r (1 + c)/(1 + c r), c = (b − 1) p, by which a dark step of the
second order is a line, and in u = s/(1 + s), s = q^(1/max(b, 2)), which runs from 0 for darkness to
1 for any light, and in which steady levels r∞ ~ (κ/k)^(1/b) are smooth. Cubic interpolation of
129 × 129 exact values errs by less than 5e-5 for p up to 30; longer steps are divided.
"""

import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from itertools import pairwise
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from labrig.foundation.arrays import Float32Array, FloatArray
from labrig.foundation.errors import UsageError
from labrig.foundation.processors import n_processors
from labrig.material import Material, dark_concentration, lit_concentration, steady_concentration
from labrig.reproduce.compiled import compiled


@dataclass(frozen=True, eq=False)
class FieldParameters:
    """Rates and spectra of states: of one material, or of every sample.

    Attributes
    ----------
    k_r_per_s
        Re-radiation rates in 1/s, shape (states,) or (states, samples).
    k_e_per_s
        Excitation rates in 1/s per unit of irradiance, shape (states, bands) or (states, bands,
        samples).
    reradiation
        Re-radiation Λ, shape (states, bands) or (states, bands, samples).
    order
        Kinetic orders b ≥ 1, shape (states,).
    prompt
        Part η of the captures that find their trap filled and emit at once, 0 to 1: 0 is the law of
        Nalbach et al., 1 the balance of energy.
    """

    k_r_per_s: Float32Array
    k_e_per_s: Float32Array
    reradiation: Float32Array
    order: FloatArray
    prompt: float = 0.0

    @classmethod
    def checked(
        cls,
        k_r_per_s: ArrayLike,
        k_e_per_s: ArrayLike,
        reradiation: ArrayLike,
        order: ArrayLike = 1.0,
        prompt: float = 0.0,
    ) -> Self:
        """Return parameters whose shapes and ranges were checked.

        Raises
        ------
        UsageError
            Shapes disagree, or a value is negative or not finite.
        """
        k_r, k_e, emitted = (
            np.ascontiguousarray(each, dtype=np.float32)
            for each in (k_r_per_s, k_e_per_s, reradiation)
        )
        n_states = k_r.shape[0] if k_r.ndim else 0
        if not n_states or k_r.ndim > 2:
            raise UsageError(
                f"expected k_r of shape (states,) or (states, samples), got {k_r.shape}"
            )
        for name, each in (("k_e", k_e), ("re-radiation", emitted)):
            if each.ndim not in (2, 3) or each.shape[0] != n_states:
                raise UsageError(
                    f"expected {name} of shape ({n_states}, bands) or ({n_states}, bands, "
                    f"samples), got {each.shape}"
                )
        samples = _sizes(k_r, k_e, emitted)
        if len(samples) > 1:
            raise UsageError(
                f"expected textures of one size, got {', '.join(map(str, sorted(samples)))} samples"
            )
        for name, each in (("k_r", k_r), ("k_e", k_e), ("re-radiation", emitted)):
            if not (np.isfinite(each).all() and each.min(initial=0.0) >= 0):
                raise UsageError(f"expected {name} that are finite and ≥ 0; check the material")
        orders = np.broadcast_to(np.asarray(order, dtype=np.float64), n_states)
        if not (np.isfinite(orders).all() and orders.min() >= 1):
            raise UsageError(f"expected kinetic orders ≥ 1, got {orders.tolist()}")
        if k_r.ndim > 1 and (orders > 1).any():
            raise UsageError(
                "expected one k_r of a state whose order is above 1, got one of every sample; "
                "steps of an order are tabulated: give classes of samples a field each"
            )
        if not 0 <= prompt <= 1:
            raise UsageError(f"expected a prompt part from 0 to 1, got {prompt:g}")
        return cls(k_r, k_e, emitted, np.array(orders), prompt)

    @classmethod
    def of(cls, material: Material, prompt: float = 0.0) -> Self:
        """Return the parameters of a measured material.

        Parameters
        ----------
        material
            Material with re-radiation; without excitation rates light does not charge it.
        prompt
            Part η of captures that emit at once.

        Raises
        ------
        UsageError
            The material has no re-radiation in bands.
        """
        bands = 0 if material.bands_nm is None else len(material.bands_nm) - 1
        emitted = [state.reradiation for state in material.states if state.reradiation is not None]
        if not bands or len(emitted) < len(material.states):
            raise UsageError(
                f"{material.name}: expected the re-radiation Λ of all states, got that of "
                f"{len(emitted)} of {len(material.states)}; measure the emission spectrum (labrig "
                "run phosphor)"
            )
        dark = (0.0,) * bands
        k_e = [state.k_e_per_s or dark for state in material.states]
        return cls.checked(
            [state.k_r_per_s for state in material.states],
            k_e,
            emitted,
            [state.kinetic_order for state in material.states],
            prompt,
        )

    def at(self, texels: NDArray[np.int32]) -> Self:
        """Return the parameters of samples, each of which has those of a texel of these textures.

        Parameters
        ----------
        texels
            Number of the texel of each sample, shape (samples,).
        """
        k_r, k_e, emitted = (
            np.ascontiguousarray(each[..., texels]) if each.ndim > plain else each
            for each, plain in (
                (self.k_r_per_s, 1), (self.k_e_per_s, 2), (self.reradiation, 2)
            )
        )  # fmt: skip
        return replace(self, k_r_per_s=k_r, k_e_per_s=k_e, reradiation=emitted)

    @property
    def n_states(self) -> int:
        """Number of states."""
        return len(self.k_r_per_s)

    @property
    def n_bands(self) -> int:
        """Number of bands that excite."""
        return int(self.k_e_per_s.shape[1])

    @property
    def n_samples(self) -> int | None:
        """Number of samples of textures; None if all samples have the same parameters."""
        return next(iter(_sizes(self.k_r_per_s, self.k_e_per_s, self.reradiation)), None)


def _sizes(k_r: Float32Array, k_e: Float32Array, reradiation: Float32Array) -> set[int]:
    """Return the numbers of samples of what is a texture."""
    parameters = ((k_r, 1), (k_e, 2), (reradiation, 2))
    return {each.shape[-1] for each, plain in parameters if each.ndim > plain}


SIZE = 129
#: Longest step in lifetimes 1/k of a full state that a table describes.
LONGEST = 30.0
#: Tables that are kept: animations have few lengths of steps.
KEPT = 32


@dataclass(frozen=True, eq=False)
class OrderTable:
    """Levels after a step, shape (SIZE, SIZE) by x and u, and what tells x and u.

    Attributes
    ----------
    values
        Levels.
    compression
        The c of x.
    root
        The exponent 1/max(b, 2) of s.
    """

    values: Float32Array
    compression: float
    root: float


@lru_cache(KEPT)
def order_table(order: float, phase: float) -> OrderTable:
    """Return the table of a kinetic order b > 1 for steps of p = k Δt ≤ LONGEST.

    Parameters
    ----------
    order
        Kinetic order b.
    phase
        Length p of the step, in lifetimes of a full state.
    """
    even = np.linspace(0, 1, SIZE)
    compression = (order - 1) * phase
    level = even / (1 + compression - compression * even)
    power = max(order, 2.0)
    with np.errstate(divide="ignore"):
        dose = (even / (1 - even)) ** power
    values = np.ones((SIZE, SIZE))
    values[:, 0] = dark_concentration(level, phase, order, 1.0)
    values[:, 1:-1] = lit_concentration(level[:, None], dose[1:-1], phase, order, 1.0)
    return OrderTable(values.astype(np.float32), compression, 1 / power)


IMPROPER = "expected an irradiance that is finite and ≥ 0, got a negative or infinite one, or NaN"
#: Samples below which several threads cost more than they gain.
FEW_SAMPLES = 65_536
#: Samples up to which a solution for each takes less than a table for all steps of one length.
FEW_FOR_TABLES = 64


class Field:
    """Levels of a material's states on samples.

    Parameters
    ----------
    parameters
        Parameters of the states, one for all samples or textures.
    n_samples
        Number of samples; that of the textures if there are any.
    levels
        Levels to begin with, 0 to 1, broadcast to (states, samples). Without it all are empty.

    Raises
    ------
    UsageError
        Sizes disagree, levels lie outside of 0 to 1, or the extra `labrig[render]` is missing.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.material import read_material
    >>> from labrig.reproduce import Field, FieldParameters
    >>> field = Field(FieldParameters.of(read_material("blue-paint")), n_samples=2)
    >>> light = np.zeros((8, 2))
    >>> light[0] = [20.0, 0.0]  # violet light on the first sample only
    >>> field.step(light, duration_s=60.0)
    >>> field.levels.round(2).tolist()
    [[0.9100000262260437, 0.0]]
    """

    def __init__(
        self, parameters: FieldParameters, n_samples: int | None = None, levels: ArrayLike = 0.0
    ) -> None:
        compiled("surface.field_kernels")
        of_textures = parameters.n_samples
        if n_samples is None:
            n_samples = of_textures
        if n_samples is None or n_samples < 1 or of_textures not in (None, n_samples):
            raise UsageError(
                f"expected the number of samples{f', {of_textures}' if of_textures else ''}, got "
                f"{n_samples}"
            )
        self._parameters = parameters
        given = np.asarray(levels, dtype=np.float32)
        if not (given.min(initial=0.0) >= 0 and given.max(initial=0.0) <= 1):
            raise UsageError(f"expected levels from 0 to 1, got {given.min():g} to {given.max():g}")
        try:
            self._levels = np.array(np.broadcast_to(given, (parameters.n_states, n_samples)))
        except ValueError:
            raise UsageError(
                f"expected levels of shape ({parameters.n_states}, {n_samples}), got {given.shape}"
            ) from None
        self._k_e = np.atleast_3d(parameters.k_e_per_s)
        self._k_r = np.atleast_2d(parameters.k_r_per_s.T).T

    @property
    def parameters(self) -> FieldParameters:
        """Parameters of the states."""
        return self._parameters

    @property
    def levels(self) -> Float32Array:
        """Levels from 0 to 1, shape (states, samples); a view that steps change."""
        return self._levels

    @property
    def n_samples(self) -> int:
        """Number of samples."""
        return int(self._levels.shape[1])

    def step(
        self,
        irradiance: ArrayLike,
        duration_s: float,
        method: Literal["exact", "euler"] = "exact",
    ) -> None:
        """Advance all levels through a time of constant light.

        Parameters
        ----------
        irradiance
            Irradiance in the bands of the excitation rates and in their unit, ≥ 0: shape (bands,)
            or (bands, samples).
        duration_s
            Length of the step in seconds, ≥ 0.
        method
            `exact`: the solution of the rate equation, of orders above 1 from a table of it;
            `euler`: one step of Euler's method, which Nalbach et al. take, for comparison.

        Raises
        ------
        UsageError
            The shape does not fit, the duration is negative or not finite, or the light excites a
            sample at a rate that is; levels are then not to be used.
        """
        if not 0 <= duration_s < math.inf:
            raise UsageError(f"expected a duration ≥ 0 s, got {duration_s:g} s")
        light, base = self._light(irradiance)
        if method == "euler":
            self._euler(light, base, duration_s)
            return
        kernels, order = compiled("surface.field_kernels"), self._parameters.order
        if (order == 1).all():
            self._in_threads(
                kernels.step_first_order,
                self._levels, light, self._k_e, base, self._k_r, np.float32(duration_s),
            )  # fmt: skip
            return
        for state in range(self._parameters.n_states):
            if order[state] == 1:
                own = slice(state, state + 1)
                self._in_threads(
                    kernels.step_first_order,
                    self._levels[own], light, self._k_e[own], base[own], self._k_r[own],
                    np.float32(duration_s),
                )  # fmt: skip
                continue
            if self.n_samples <= FEW_FOR_TABLES:
                self._solve(state, self._kappa(light, base, state), duration_s)
                continue
            phase = float(self._k_r[state, 0]) * duration_s
            parts = max(1, math.ceil(phase / LONGEST))
            table = order_table(float(order[state]), phase / parts)
            for _ in range(parts):
                self._in_threads(
                    kernels.step_by_table,
                    self._levels, light, self._k_e, base, state, table.values,
                    np.float32(table.compression), np.float32(table.root),
                    np.float32(duration_s / parts),
                )  # fmt: skip

    def _solve(self, state: int, kappa: Float32Array, duration_s: float) -> None:
        """Advance the levels of a state of an order above 1, each by its own solution."""
        order, k_r = float(self._parameters.order[state]), float(self._k_r[state, 0])
        before, rates = self._levels[state].astype(np.float64), kappa.astype(np.float64)
        if not (np.isfinite(rates).all() and rates.min(initial=0.0) >= 0):
            raise UsageError(IMPROPER)
        after = np.asarray(dark_concentration(before, k_r, order, duration_s))
        is_lit = rates > 0
        if is_lit.any():
            after[is_lit] = lit_concentration(before[is_lit], rates[is_lit], k_r, order, duration_s)
        self._levels[state] = after

    def charge_to_equilibrium(self, irradiance: ArrayLike) -> None:
        """Set all levels to those that the light reaches after a long time.

        Parameters
        ----------
        irradiance
            Irradiance as `step` takes it; without light a level is 0.
        """
        light, base = self._light(irradiance)
        for state, order in enumerate(self._parameters.order):
            kappa = self._kappa(light, base, state).astype(np.float64)
            is_lit = kappa > 0
            k_r = np.broadcast_to(self._k_r[state], kappa.shape)
            self._levels[state] = 0.0
            self._levels[state, is_lit] = steady_concentration(kappa[is_lit], k_r[is_lit], order)

    def radiance(self, irradiance: ArrayLike | None = None) -> Float32Array:
        """Return the radiance that the samples emit, Σ Λ (k rᵇ + η κ r).

        Parameters
        ----------
        irradiance
            Irradiance as `step` takes it, for the captures that emit at once; None is darkness.

        Returns
        -------
        ndarray
            Radiance in the bands and the unit of the re-radiation Λ, shape (bands, samples).
        """
        parameters = self._parameters
        emitted = np.empty_like(self._levels)
        for state, order in enumerate(parameters.order):
            emitted[state] = self._k_r[state] * self._levels[state] ** np.float32(order)
            if irradiance is not None and parameters.prompt:
                kappa = self._kappa(*self._light(irradiance), state)
                emitted[state] += np.float32(parameters.prompt) * kappa * self._levels[state]
        if parameters.reradiation.ndim == 2:
            return np.asarray(parameters.reradiation.T @ emitted)
        return np.asarray(np.einsum("ibs,is->bs", parameters.reradiation, emitted))

    def _light(self, irradiance: ArrayLike) -> tuple[Float32Array, Float32Array]:
        """Return the light (bands, samples) that varies, and κ of that which does not (states,)."""
        light = np.ascontiguousarray(irradiance, dtype=np.float32)
        bands, parameters = self._parameters.n_bands, self._parameters
        if light.shape not in ((bands,), (bands, self.n_samples)):
            raise UsageError(
                f"expected an irradiance of shape ({bands},) or ({bands}, {self.n_samples}), got "
                f"{light.shape}"
            )
        if light.ndim == 2:
            return light, np.zeros(parameters.n_states, np.float32)
        if parameters.k_e_per_s.ndim == 2:
            if not (np.isfinite(light).all() and light.min(initial=0.0) >= 0):
                raise UsageError(IMPROPER)
            none = np.zeros((0, self.n_samples), np.float32)
            return none, np.asarray(parameters.k_e_per_s @ light)
        return np.repeat(light[:, None], self.n_samples, axis=1), np.zeros(
            parameters.n_states, np.float32
        )

    def _kappa(self, light: Float32Array, base: Float32Array, state: int) -> Float32Array:
        """Return κ of a state in 1/s (samples,)."""
        kappa = np.empty(self.n_samples, np.float32)
        self._in_threads(
            compiled("surface.field_kernels").excitation, kappa, light, self._k_e, base, state
        )
        return kappa

    def _euler(self, light: Float32Array, base: Float32Array, duration_s: float) -> None:
        duration = np.float32(duration_s)
        for state, order in enumerate(self._parameters.order):
            level, kappa = self._levels[state], self._kappa(light, base, state)
            emitted = self._k_r[state] * level ** np.float32(order)
            level += duration * ((1 - level) * kappa - emitted)

    def _in_threads(self, kernel: Callable[..., bool], *arguments: Any) -> None:
        """Run a kernel on parts of the samples at the same time."""
        threads = 1 if self.n_samples < FEW_SAMPLES else n_processors()
        edges = np.linspace(0, self.n_samples, threads + 1).astype(int)
        parts = list(pairwise(edges.tolist()))
        run = map if len(parts) == 1 else _pool().map
        if not all(list(run(lambda part: kernel(*arguments, *part), parts))):
            raise UsageError(IMPROPER)


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(n_processors(), thread_name_prefix="field")
