"""Depths of traps, from runs of one sample at several temperatures."""

from collections.abc import Sequence
from pathlib import Path

from labrig.fit import fit_trap_depth
from labrig.foundation.errors import FitError, UsageError
from labrig.record import FrameRole, glow_temperature_c, read_run
from labrig.results import EXPONENTIALS, FittedDecay, StateDepth, read_fitted_decays, state_name

#: σ of the temperature of a run: that of a semiconductor thermometer.
TEMPERATURE_SIGMA_K = 0.3


def trap_depths(
    runs: Sequence[Path],
    temperatures_c: Sequence[float] | None = None,
    temperature_sigma_k: float = TEMPERATURE_SIGMA_K,
) -> tuple[StateDepth, ...]:
    """Fit the depths of traps to decays that were measured at several temperatures.

    Parameters
    ----------
    runs
        Folders of runs with results, at two temperatures or more.
    temperatures_c
        Temperature of each run in °C; None takes that of the rig's thermometer.
    temperature_sigma_k
        Standard uncertainty of each temperature in K.

    Returns
    -------
    tuple of StateDepth
        Depth of every state of every patch that all runs have, states by falling rate.

    Raises
    ------
    UsageError
        A run has no temperature, or there are not as many temperatures as runs.
    FitError
        Runs have different numbers of states, a decay is none of exponentials, or the rates tell no
        depth.
    DataError
        A result cannot be read.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.catalogue import trap_depths
    >>> fast, slow = trap_depths([Path("runs/decay"), Path("runs/decay")], [15, 25])
    >>> fast.depth.warnings[0].code, str(fast.depth.depth_ev)
    ('rates-not-thermal', '0.000(16) eV')
    """
    if temperatures_c is None:
        celsius = [_temperature_c(run) for run in runs]
    elif len(temperatures_c) != len(runs):
        raise UsageError(
            f"--temperatures: expected {len(runs)}, one of each run, got {len(temperatures_c)}"
        )
    else:
        celsius = list(temperatures_c)
    decays = [read_fitted_decays(run / "result") for run in runs]
    depths = []
    for patch in decays[0]:
        of_patch = [each.get(patch) for each in decays]
        if None in of_patch:
            continue
        rates = _rates([fit for fit in of_patch if fit is not None], patch, runs)
        for number, (value, sigma) in enumerate(rates, start=1):
            try:
                depth = fit_trap_depth(
                    celsius, value, sigma, temperature_sigma_k=temperature_sigma_k
                )
            except FitError as error:
                raise FitError(f"{state_name(patch, number)}: {error}") from None
            depths.append(StateDepth(patch, number, depth))
    if not depths:
        raise FitError(
            f"expected a patch that all runs have, got {'; '.join(_patches(decays, runs))}; "
            "give runs of one sample"
        )
    return tuple(depths)


def _temperature_c(run: Path) -> float:
    temperature_c = glow_temperature_c(read_run(run), [FrameRole.DECAY])
    if temperature_c is None:
        raise UsageError(
            f"{run}: expected a temperature of the sample, got none; give those of all runs "
            "(--temperatures '15, 21, 30') or a thermometer in the rig file"
        )
    return temperature_c


def _rates(
    fits: Sequence[FittedDecay], patch: str, runs: Sequence[Path]
) -> list[tuple[list[float], list[float]]]:
    """Return rates and σ of all runs, state by state."""
    for fit, run in zip(fits, runs, strict=True):
        if fit.law != EXPONENTIALS:
            raise FitError(
                f"{run}{f', {patch}' if patch else ''}: expected exponentials, whose rates are "
                f"those of traps, got the law '{fit.law}'; if they do describe it: labrig process "
                "RUN --law exponentials"
            )
    numbers = [fit.n_states for fit in fits]
    if len(set(numbers)) > 1:
        raise FitError(
            f"{patch or 'the sample'}: expected as many states in all runs, got "
            f"{', '.join(str(number) for number in numbers)}; fit all with the same --states"
        )
    return [
        ([rate.value for rate in of_state], [rate.sigma for rate in of_state])
        for of_state in zip(*(fit.rates for fit in fits), strict=True)
    ]


def _patches(decays: Sequence[dict[str, FittedDecay]], runs: Sequence[Path]) -> list[str]:
    return [
        f"{run.name}: {', '.join(each or 'sample' for each in of_run) or 'none'}"
        for run, of_run in zip(runs, decays, strict=True)
    ]
