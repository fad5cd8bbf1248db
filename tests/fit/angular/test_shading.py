"""Shading of spheres against the formulas, in images with texture and errors."""

from dataclasses import replace

import numpy as np
import pytest

from labrig.fit.angular import NearLight, SphereImage, fit_shading, incidence, oren_nayar
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError

LIGHT = NearLight((-np.sqrt(0.5), 0.0, np.sqrt(0.5)), 10.0)


def normals(count: int = 26) -> FloatArray:
    x, y = np.meshgrid(*[np.linspace(-0.98, 0.98, count)] * 2)
    inside = x**2 + y**2 < 0.96
    x, y = x[inside], y[inside]
    return np.column_stack([x, y, np.sqrt(1 - x**2 - y**2)])


def image(
    rng: np.random.Generator, roughness: float = 0.0, by_view: float = 0.0, shift: float = 0.002
) -> SphereImage:
    """A rough surface, of which some light is lost to the side; the outline is a little off."""
    seen = normals()
    lateral = seen[:, :2] + shift * rng.standard_normal(2)
    lateral *= np.minimum(1, 0.999 / np.linalg.norm(lateral, axis=1))[:, np.newaxis]
    true = np.column_stack([lateral, np.sqrt(1 - (lateral**2).sum(axis=1))])
    cosine, falloff = incidence(true, LIGHT)
    view = true[:, 2]
    sines = np.sqrt(np.maximum((1 - cosine**2) * (1 - view**2), 1e-12))
    azimuth = np.clip((LIGHT.direction[2] - cosine * view) / sines, -1, 1)
    radiance = oren_nayar(cosine, view, azimuth, roughness) * falloff
    radiance *= (1 - by_view * (1 - view)) * (1 + 0.03 * rng.standard_normal(len(view)))
    return SphereImage(seen, 700 * radiance, np.zeros((0, len(view))))


def test_a_rough_surface_is_brighter_towards_the_light_and_less_steep() -> None:
    cosine = np.array([0.3, 0.6, 0.9])
    smooth = oren_nayar(cosine, np.full(3, 0.8), np.ones(3), 0.0)
    assert smooth == pytest.approx(cosine)
    rough = oren_nayar(cosine, np.full(3, 0.8), np.ones(3), 0.5)
    # A and B of the paper for σ = 0.5: 0.7845 and 0.3309.
    sine, tangent = np.sqrt(1 - 0.3**2), np.sqrt(1 - 0.8**2) / 0.8
    assert rough[0] == pytest.approx(0.3 * (0.7845 + 0.3309 * sine * tangent), rel=1e-3)
    assert rough[0] / rough[2] > cosine[0] / cosine[2]
    away = oren_nayar(cosine, np.full(3, 0.8), -np.ones(3), 0.5)
    assert away == pytest.approx(0.7845 * cosine, rel=1e-3)


@pytest.mark.parametrize("roughness_deg", [10.0, 20.0, 35.0])
def test_roughness_is_found(roughness_deg: float) -> None:
    rng = np.random.default_rng(int(roughness_deg))
    fit = fit_shading([image(rng, np.radians(roughness_deg)) for _ in range(4)], LIGHT)
    assert fit.roughness_deg.value == pytest.approx(roughness_deg, rel=0.05)
    assert fit.oren_nayar == pytest.approx(fit.radiance, abs=0.01)
    assert fit.by_incidence.finds_dependence or roughness_deg < 15


@pytest.mark.campaign
def test_level_and_power_over_many_seeds() -> None:
    def tests(by_view: float, seeds: int) -> list[tuple[bool, bool, float, float]]:
        found = []
        for seed in range(seeds):
            rng = np.random.default_rng([11, seed])
            fit = fit_shading([image(rng, by_view=by_view) for _ in range(4)], LIGHT)
            by = fit.by_view
            found.append(
                (
                    by.finds_dependence,
                    fit.by_incidence.finds_dependence,
                    by.amplitude.value,
                    by.detectable,
                )
            )
        return found

    none = np.array(tests(0.0, 80))
    # σ contains what all views share, which these images do not have: fewer than 5 %.
    assert none[:, 0].sum() <= 10
    assert none[:, 1].sum() <= 10
    assert none[:, 2].mean() == pytest.approx(0.0, abs=0.005)
    planted = float(np.median(none[:, 3]))
    assert planted < 0.08
    some = np.array(tests(planted, 40))
    assert some[:, 0].mean() >= 0.9 - 0.1
    # The term is relative to the light at the middle of the used places.
    assert -some[:, 2].mean() == pytest.approx(planted, rel=0.15)


def test_errors_that_all_views_share_make_it_less_certain() -> None:
    rng = np.random.default_rng(2)
    images = [image(rng) for _ in range(4)]
    lens = [
        SphereImage(one.normal, one.radiance, 0.1 * (1 - one.normal[:, 2])[np.newaxis])
        for one in images
    ]
    certain, uncertain = fit_shading(images, LIGHT), fit_shading(lens, LIGHT)
    added = uncertain.by_view.amplitude.sigma**2 - certain.by_view.amplitude.sigma**2
    assert np.sqrt(added) == pytest.approx(0.1, rel=0.02)
    assert uncertain.by_incidence.amplitude.sigma == pytest.approx(
        certain.by_incidence.amplitude.sigma, rel=0.05
    )


def test_too_little_is_one_clear_line() -> None:
    rng = np.random.default_rng(1)
    with pytest.raises(DataError, match="three or more views"):
        fit_shading([image(rng)] * 2, LIGHT)
    behind = NearLight((0.0, 0.0, -1.0), 10.0)
    with pytest.raises(DataError, match="of which much is lit"):
        fit_shading([image(rng)] * 3, behind)


def test_an_outline_that_is_off_is_no_dependence_if_its_error_is_given() -> None:
    views = [image(np.random.default_rng([5, seed])) for seed in range(4)]
    off = [view.on_outline(0.0, 0.0, -0.03) for view in views]
    assert fit_shading(off, LIGHT).by_view.finds_dependence
    known = [replace(view, outline_covariance=np.diag([0.0, 0.0, 0.03**2])) for view in off]
    by_view = fit_shading(known, LIGHT).by_view
    assert not by_view.finds_dependence
    assert 0.5 < abs(by_view.amplitude.value) / by_view.amplitude.sigma < 2


def test_a_flat_disc_is_no_sphere() -> None:
    rng = np.random.default_rng(7)
    views = [image(rng) for _ in range(4)]
    even = [replace(view, radiance=500 + 20 * view.normal[:, 0]) for view in views]
    with pytest.raises(DataError, match="as even as that of a flat sample"):
        fit_shading(even, LIGHT)
