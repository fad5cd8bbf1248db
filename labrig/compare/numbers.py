"""Conversion of a comparison to plain numbers."""

import math
from collections.abc import Mapping
from typing import Any

from labrig.compare.rendered import RenderedComparison
from labrig.compare.rendered_lamps import LampsComparison
from labrig.compare.run import RunComparison
from labrig.foundation.arrays import FloatArray


def numbers(comparison: RunComparison) -> dict[str, Any]:
    """Convert a comparison to plain numbers for programs.

    Parameters
    ----------
    comparison
        Comparison of a run.

    Returns
    -------
    dict
        Lists, dictionaries, strings and finite numbers, ready for JSON; unknown values are None.

    Examples
    --------
    >>> from pathlib import Path
    >>> import labrig
    >>> from labrig.compare import compare_run, numbers
    >>> def refit(series, states, flicker):
    ...     return labrig.fit_series(series, states, flicker=flicker)
    >>> glow = numbers(compare_run(Path("runs/decay"), refit))["glow"]["sample"]
    >>> sorted(glow["delta_e"])
    ['1 state', '2 states']
    """
    plain: dict[str, Any] = _plain(
        {
            "description": comparison.description,
            "camera": comparison.camera.name if comparison.camera else None,
            "white": comparison.white,
            "left_out": [each.to_dict() for each in comparison.left_out],
            "glow": {
                glow.patch: {
                    "t_s": glow.t_s.tolist(),
                    "noise": glow.mean_noise,
                    "delta_e": {name: values.tolist() for name, values in glow.delta_e.items()},
                    "mean": {name: glow.mean(name) for name in glow.delta_e},
                    "max": {name: glow.most(name) for name in glow.delta_e},
                }
                for glow in comparison.glows
            },
            "residuals": [
                {
                    "patch": residuals.patch,
                    "weights": residuals.weighted,
                    "rms": residuals.rms,
                    "last": residuals.last,
                }
                for residuals in comparison.residuals
            ],
            "material_comparisons": [
                {
                    "measured": materials.names[0],
                    "reference": materials.names[1],
                    "k_e_factor": materials.k_e_factor,
                    "reradiation_factor": materials.reradiation_factor,
                    "rows": [
                        {
                            "quantity": pair.quantity,
                            "unit": pair.unit,
                            "measured": pair.measured,
                            "sigma": pair.sigma,
                            "reference": pair.reference,
                            "percent": pair.percent,
                            "in_sigma": pair.in_sigma,
                        }
                        for pair in materials.pairs
                    ],
                    "notes": list(materials.notes),
                }
                for materials in comparison.material_comparisons
            ],
            "spectra": {
                spectrum.name: {
                    "delta_e": spectrum.delta_e,
                    "missed": spectrum.missed,
                    "known_on": grid,
                }
                for spectrum, grid in comparison.spectra
            },
        }
    )
    return plain


def rendered_numbers(comparison: RenderedComparison) -> dict[str, Any]:
    """Convert a rendered dark room to plain numbers for programs.

    Parameters
    ----------
    comparison
        The dark room of a run, rendered beside its photographs.

    Returns
    -------
    dict
        As of `numbers`.

    Examples
    --------
    >>> from labrig.compare import RenderedComparison, rendered_numbers
    >>> rendered_numbers(RenderedComparison((), ("one exposure",), (), ()))["description"]
    'one exposure'
    """
    plain: dict[str, Any] = _plain(
        {
            "description": " ".join(comparison.description),
            "notes": [each.to_dict() for each in comparison.notes],
            "warnings": [each.to_dict() for each in comparison.warnings],
            "left_out": [each.to_dict() for each in comparison.left_out],
            "patches": {
                patch.each.patch: {
                    "t_s": patch.each.t_s.tolist(),
                    "noise": patch.each.mean_noise,
                    "delta_e_noise": patch.each.noise.tolist(),
                    "delta_e": _lists(patch.each.delta_e),
                    "delta_e_matched": _lists(patch.matched.delta_e),
                    "delta_e_one_exposure": _lists(patch.common.delta_e),
                    "mean": {name: patch.each.mean(name) for name in patch.each.delta_e},
                    "mean_matched": {
                        name: patch.matched.mean(name) for name in patch.matched.delta_e
                    },
                    "mean_one_exposure": {
                        name: patch.common.mean(name) for name in patch.common.delta_e
                    },
                    "glow_over_reflected": {
                        "channel": patch.ratio.channel,
                        "reflected_by": patch.ratio.reflected_by,
                        "photographed": patch.ratio.photographed.tolist(),
                        "photographed_sigma": patch.ratio.photographed_sigma.tolist(),
                        "rendered": _lists(patch.ratio.rendered),
                        "rendered_sigma": _lists(patch.ratio.rendered_sigma),
                    },
                }
                for patch in comparison.patches
            },
        }
    )
    return plain


def lamps_numbers(comparison: LampsComparison) -> dict[str, Any]:
    """Convert fluorescent samples under lamps to plain numbers for programs.

    Parameters
    ----------
    comparison
        The samples of a run under its lamps, rendered beside their photographs.

    Returns
    -------
    dict
        As of `numbers`.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.compare import compare_lamps, lamps_numbers
    >>> said = lamps_numbers(compare_lamps(Path("runs/validation")))  # doctest: +SKIP
    >>> said["lamps"]["daylight"]["samples"]["yellow"]["delta_e"]  # doctest: +SKIP
    2.4
    """
    plain: dict[str, Any] = _plain(
        {
            "description": " ".join(comparison.description),
            "notes": [each.to_dict() for each in comparison.notes],
            "channels": list(comparison.channels),
            "lamps": {
                lamp.name: {
                    "reference": lamp.reference,
                    "samples": {
                        name: {
                            "photographed": sample.photographed.tolist(),
                            "photographed_sigma": sample.photographed_sigma.tolist(),
                            "rendered": sample.rendered.tolist(),
                            "rendered_sigma": sample.rendered_sigma.tolist(),
                            "reradiated": sample.reradiated.tolist(),
                            "reradiated_luminance": sample.reradiated_luminance,
                            "delta_e": sample.delta_e,
                            "delta_e_by_errors": sample.delta_e_by_errors,
                            "delta_e_reflected": sample.delta_e_reflected,
                        }
                        for name, sample in lamp.samples.items()
                    },
                }
                for lamp in comparison.lamps
            },
        }
    )
    return plain


def _lists(by_name: Mapping[str, FloatArray]) -> dict[str, list[float]]:
    return {name: values.tolist() for name, values in by_name.items()}


def _plain(item: Any) -> Any:
    """Replace infinity and NaN, which JSON does not have, by None, and keys by text."""
    if isinstance(item, dict):
        return {str(key): _plain(value) for key, value in item.items()}
    if isinstance(item, list):
        return [_plain(value) for value in item]
    if isinstance(item, float) and not math.isfinite(item):
        return None
    return item
