"""Result of an angular run: whether re-radiation depends on angle, and how sure that is."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar

from labrig.foundation.arrays import FloatArray
from labrig.foundation.notebook_views import CsvTable
from labrig.results.angular_dependence import AngleMeans, DependenceTest, ShadingFit
from labrig.results.budget import Budget
from labrig.results.run_result import RunResult


@dataclass(frozen=True, eq=False)
class YarnViews:
    """Views of a yarn in one direction under one LED.

    Attributes
    ----------
    led, direction
        Name of the LED and direction of the yarn.
    channels
        Channels of the camera whose sum is the signal.
    reflected_at_most
        Upper limit of the reflected light as a fraction of the signal; NaN if unknown.
    angle_deg
        Angle between light and camera of each view in degrees, shape (n,).
    signal, signal_sigma
        Signal of each view in DN/s and its σ by the camera's noise, shape (n,).
    means
        Means by angle, with the test.
    """

    led: str
    direction: str
    channels: tuple[str, ...]
    reflected_at_most: float
    angle_deg: FloatArray
    signal: FloatArray
    signal_sigma: FloatArray
    means: AngleMeans


@dataclass(frozen=True, eq=False)
class SphereViews:
    """Views of a sphere under one LED.

    Attributes
    ----------
    led
        Name of the LED.
    part
        Part of the light: `re-radiated` or `reflected`.
    channels
        Channels of the camera whose sum is the signal.
    reflected_at_most
        Upper limit of the reflected light as a fraction of the signal; NaN if unknown.
    is_lens_known
        Whether the fall-off of the lens was calibrated and divided out.
    circles
        x, y and radius in pixels of the outline in each view, shape (views, 3).
    shading
        Shading, with the tests.
    """

    led: str
    part: str
    channels: tuple[str, ...]
    reflected_at_most: float
    is_lens_known: bool
    circles: FloatArray
    shading: ShadingFit


@dataclass(frozen=True, eq=False, kw_only=True)
class AngularFluorescenceResult(RunResult):
    """Test of whether re-radiation depends on angle.

    Attributes
    ----------
    yarns
        Views of a yarn by LED and direction; empty for a sphere.
    spheres
        Views of a sphere by LED; empty for a yarn.

    Examples
    --------
    >>> result = labrig.read_result(run)  # doctest: +SKIP
    >>> print(result.finds_dependence, result.p, result.detectable)
    """

    kind: ClassVar[str] = "angular_fluorescence"

    yarns: tuple[YarnViews, ...] = ()
    spheres: tuple[SphereViews, ...] = ()

    @property
    def tests(self) -> tuple[DependenceTest, ...]:
        """Tests of the re-radiated light, which share the level `LEVEL`."""
        shadings = [view.shading for view in self.spheres if view.part == "re-radiated"]
        return (
            *(views.means.test for views in self.yarns),
            *(test for shading in shadings for test in (shading.by_view, shading.by_incidence)),
        )

    @property
    def p(self) -> float:
        """Probability of so small a p among all tests where there is no dependence (Bonferroni)."""
        return min(1.0, len(self.tests) * min(test.p for test in self.tests))

    @property
    def finds_dependence(self) -> bool:
        """Whether re-radiation depends on angle, at the level of 5 % for all tests together."""
        return any(test.finds_dependence for test in self.tests)

    @property
    def detectable(self) -> float:
        """Smallest amplitude that each of the tests would have found with 90 % power."""
        return max(test.detectable for test in self.tests)

    def budgets(self) -> dict[str, Budget]:
        """Return the budgets of the dependences on angle, by the scatter of views."""
        tests = {f"{view.led}, {view.direction}: by angle": view.means.test for view in self.yarns}
        for view in self.spheres:
            if view.part == "re-radiated":
                tests[f"{view.led}: by view"] = view.shading.by_view
                tests[f"{view.led}: by incidence"] = view.shading.by_incidence
        return {name: Budget.of(test.amplitude) for name, test in tests.items()}

    def csv_tables(self) -> dict[str, CsvTable]:
        """Return the table `angular.csv`."""
        head = (
            *("led", "sample", "part", "angle_deg", "cos_incidence"),
            *("ratio", "ratio_sigma", "oren_nayar"),
        )
        return {"angular.csv": CsvTable(head, self._rows())}

    def _rows(self) -> Iterator[tuple[Any, ...]]:
        for yarn in self.yarns:
            means = yarn.means
            for angle_deg, ratio, sigma in zip(
                means.angle_deg, means.mean, means.mean_sigma, strict=True
            ):
                name = f"{yarn.direction} yarn"
                measured = f"{ratio:.6g}", f"{sigma:.6g}"
                yield yarn.led, name, "re-radiated", f"{angle_deg:g}", "", *measured, ""
        for sphere in self.spheres:
            shading = sphere.shading
            for cosine, ratio, sigma, model in zip(
                shading.cos_incidence,
                shading.radiance,
                shading.radiance_sigma,
                shading.oren_nayar,
                strict=True,
            ):
                numbers = (f"{number:.6g}" for number in (cosine, ratio, sigma, model))
                yield sphere.led, "sphere", sphere.part, "", *numbers
