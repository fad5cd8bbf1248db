"""Whether what charges through the filter tell predicts charging by the lamp itself."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from labrig.calibration.irradiance_file import IrradianceFile
from labrig.compare.closure import Closure, closure
from labrig.fit.excitation import ExcitationFit, Uncertain
from labrig.process.excitation.charges import Charged


def predicted_charging(
    measured: Charged,
    irradiance: IrradianceFile,
    uncertain: Uncertain,
    fit_of: Callable[[Charged], ExcitationFit],
) -> Closure | None:
    """Charging by the lamp itself as predicted from charges through the filter.

    The longest bare charge stays in the fit, since it tells how far the sample is charged; the
    shorter ones are predicted. With fewer than two of those there is no test.

    Parameters
    ----------
    fit_of
        Fits what is left without the charges that are predicted.
    """
    bare = measured.bare
    lengths = [charge.off_s - charge.on_s for charge in bare.charges]
    longest = int(np.argmax(lengths))
    ends = np.cumsum([0, *(len(charge.start_s) for charge in bare.charges)])
    kept = np.zeros(ends[-1], dtype=bool)
    kept[ends[longest] : ends[longest + 1]] = True
    if len(lengths) < 3:
        return None
    alone = replace(
        measured,
        bare=replace(bare, values=np.where(kept[:, None, None], bare.values, np.nan)),
    )
    fit = fit_of(alone)
    channel = int(np.argmax(fit.channel_weights))
    rows, charges = [], []
    for number, charge in enumerate(bare.charges):
        for row in range(ends[number], ends[number + 1]):
            if np.isfinite(bare.values[row, :, channel]).all():
                rows.append(row)
                charges.append((lengths[number], charge, row - ends[number]))
                break
    values, sigma = bare.values[rows, :, channel], bare.sigma[rows, :, channel]
    level = values.mean(axis=1)
    noise = np.hypot(np.sqrt((sigma**2).sum(axis=1)) / sigma.shape[1], uncertain.flicker * level)
    return closure(
        [length for length, _, _ in charges],
        level,
        np.hypot(noise, uncertain.lamp * level),
        irradiance=irradiance.direct,
        k_e_per_s=fit.k_e(),
        k_r_per_s=[state.k_r_per_s for state in fit.states],
        full_level=[state.amplitude for state in fit.states],
        dark_s=[charge.start_s[place] - charge.off_s for _, charge, place in charges],
        exposure_s=[charge.exposure_s[place] for _, charge, place in charges],
    )
