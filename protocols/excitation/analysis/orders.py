"""Choice of the kinetic orders of an excitation: 1, as of the rate equation, or one of each state.

The fit of first order tells by its residuals whether another order is worth trying
(`FittedExcitation.order_gain`), and the decay by Becquerel's law. Models are compared by the
Bayesian information criterion with the noise enlarged to the misfit of the best, so that a misfit
of all of them adds no orders.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from labrig.fit.excitation import (
    IntervalChoice,
    RelativeSigmas,
    fit_excitation,
    layer_effect,
)
from labrig.foundation.arrays import FloatArray
from labrig.foundation.detection import RATE_LIMIT_SIGMA, STRONG_EVIDENCE_DELTA_BIC
from labrig.foundation.result_warning import Misfit, ResultWarning
from labrig.protocols.excitation.options import FREE
from labrig.results import (
    AUTO,
    ChargingSeries,
    DensityBasis,
    ExcitationModel,
    FittedDecay,
    FittedExcitation,
)

#: Part of the veil by which it may differ along the filter, in each of some smooth courses.
VEIL_SHAPE = 0.3
#: Largest number of states that are fitted with orders.
MAX_STATES = 2
#: Least part of the glow of a state at the start.
MIN_FRACTION = 1e-3


@dataclass(frozen=True)
class OrderFits:
    """Fits of the charges of one sample by several models.

    Attributes
    ----------
    series
        Charging series.
    decay
        Decay from which the rates start.
    relative_sigmas
        Relative uncertainties of the measurement.
    states_given
        Whether the number of states is given, not chosen.
    """

    series: Sequence[ChargingSeries]
    decay: FittedDecay
    relative_sigmas: RelativeSigmas
    states_given: bool

    def chosen(self, order: str) -> "ChosenOrders":
        """Choose the kinetic orders asked for: `auto`, `free` or a number.

        Models are compared with errors of the light of the sizes given: those that suit a model may
        have grown to make good for its law.
        """
        if order in (AUTO, FREE):
            return ChosenOrders(self._best(order), self.relative_sigmas)
        held = self._fit(self._start(), float(order))
        named = replace(held, models=(_model(held, float(order)),))
        return ChosenOrders(named, self.relative_sigmas, tuple(_doubt(held)))

    def _best(self, order: str) -> FittedExcitation:
        first = self._fit(self._start(), 1.0)
        tried: list[tuple[FittedExcitation, float | None]] = []
        if order == AUTO:
            tried.append((first, 1.0))
        if order == FREE or self._is_worth_while(first):
            tried += [(fit, None) for fit in self._of_general_order(first)]
        tried.sort(key=lambda each: _model(*each).n_parameters)
        enlarged = max(1.0, min(fit.reduced_chi2 for fit, _ in tried))
        models = tuple(_model(fit, orders, enlarged) for fit, orders in tried)
        chosen = 0
        for index, model in enumerate(models):
            if model.bic < models[chosen].bic - STRONG_EVIDENCE_DELTA_BIC:
                chosen = index
        return replace(tried[chosen][0], models=models)

    def _is_worth_while(self, first: FittedExcitation) -> bool:
        """Whether general order may be preferred to first order."""
        penalty = STRONG_EVIDENCE_DELTA_BIC + len(first.states) * np.log(first.dof)
        if first.order_gain > penalty * max(1.0, first.reduced_chi2):
            return True
        becquerel = [law.bic for law in self.decay.laws if law.name == "becquerel"]
        return (
            len(first.states) > 1
            and min(becquerel, default=np.inf) < self.decay.bic - STRONG_EVIDENCE_DELTA_BIC
        )

    def _of_general_order(self, first: FittedExcitation) -> Iterator[FittedExcitation]:
        """Yield fits with an order of each state."""
        k_r, fractions = self._start()
        if len(k_r) <= MAX_STATES:
            yield self._fit((k_r, fractions), None, first)
        else:
            # A slow state that may be none is no start: its rate may be anything.
            slow = [
                number
                for number, state in enumerate(self.decay.states)
                if number == 1 or state.amplitude > RATE_LIMIT_SIGMA * state.amplitude_sigma
            ]
            ends = [0, slow[-1]]
            yield self._fit((k_r[ends], fractions[ends]), None)
        if len(k_r) > 1 and not self.states_given:
            yield self._fit((np.array([fractions @ k_r]), np.ones(1)), None)

    def _start(self) -> tuple[FloatArray, FloatArray]:
        """Return rates in 1/s and fractions of the glow of the decay's states."""
        k_r, amplitude = np.array(
            [(state.k_r_per_s, state.amplitude) for state in self.decay.states]
        ).T
        return k_r, np.maximum(amplitude / amplitude.sum(), MIN_FRACTION)

    def _fit(
        self,
        start: tuple[FloatArray, FloatArray],
        order: float | None,
        near: FittedExcitation | None = None,
    ) -> FittedExcitation:
        as_given = replace(self.relative_sigmas, largest_factor=0.0)
        return fit_excitation(self.series, *start, as_given, near, order)


@dataclass(frozen=True)
class ChosenOrders:
    """Model that was chosen for the charges of one sample.

    Attributes
    ----------
    best
        Its fit with errors of the light of the sizes given.
    relative_sigmas
        Relative uncertainties of the measurement.
    doubt
        Warnings that the data contradict orders that were asked for.
    """

    best: FittedExcitation
    relative_sigmas: RelativeSigmas
    doubt: tuple[ResultWarning, ...] = ()

    def fitted(
        self, series: Sequence[ChargingSeries], intervals: IntervalChoice = "none"
    ) -> FittedExcitation:
        """Fit series of the sample by the model, from its solution, and find the light's errors.

        How far the veil differs from site to site is taken in proportion to the veil found. The
        intervals are those of `fit_excitation`.
        """
        best, sigmas = self.best, self._sigmas
        order = None if best.are_orders_fitted else best.states[0].kinetic_order
        k_r, amplitude = np.array([(state.k_r_per_s, state.amplitude) for state in best.states]).T
        fit = fit_excitation(series, k_r, amplitude, sigmas, best, order, intervals)
        return replace(
            fit,
            models=best.models,
            order_gain=best.order_gain,
            warnings=(*fit.warnings, *self.doubt),
        )

    def in_a_layer(
        self,
        series: Sequence[ChargingSeries],
        fit: FittedExcitation,
        largest_density: FloatArray,
        basis: DensityBasis,
    ) -> FittedExcitation:
        """Return a fit of the series with what the sample's thickness may do to its rates."""
        layer = layer_effect(series, fit, self._sigmas, largest_density, basis)
        return replace(fit, layer=layer)

    @property
    def _sigmas(self) -> RelativeSigmas:
        veil = 0.0 if self.best.veil is None else abs(self.best.veil.value)
        return replace(self.relative_sigmas, veil_shape=VEIL_SHAPE * veil)


def _model(fit: FittedExcitation, order: float | None, enlarged: float = 1.0) -> ExcitationModel:
    states, bands = fit.k_e().shape
    number = states * (2 + bands + (order is None)) + len(fit.channel_weights) - 1
    bic = fit.chi2 / enlarged + number * float(np.log(fit.dof + number))
    return ExcitationModel(states, order, number, fit.reduced_chi2, bic)


def _doubt(fit: FittedExcitation) -> Iterator[ResultWarning]:
    """Yield a warning if orders that are held at 1 contradict the data."""
    penalty = STRONG_EVIDENCE_DELTA_BIC + len(fit.states) * np.log(fit.dof)
    if fit.order_gain > penalty * max(1.0, fit.reduced_chi2):
        yield Misfit(
            "order-contradicted",
            "charges and decays contradict the first order (χ² {chi2:.0f} would fall by {gain:.0f} "
            "or more): fit the kinetic order with --order auto",
            chi2=fit.chi2,
            gain=fit.order_gain,
        )
