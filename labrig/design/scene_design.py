"""A material designed in a scene, and what it looks like there.

It is designed under the light of the lamps, its own glow ignored as in section 6 of Nalbach et al.;
rendered with all light between surfaces; and designed again under the light that this rendering
shows.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from labrig.design.material_file import to_material
from labrig.design.result import Design
from labrig.design.scene_light import SceneLight
from labrig.design.scene_spectra import SceneSpectra
from labrig.design.wish_file import Wish
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.material import Material
from labrig.reproduce import Renderer

#: How often it is designed anew under the rendered light.
AGAIN = 2
#: Largest ΔE2000 that nobody sees, at which it is not.
MET = 0.1
#: Time in s for which the light at a key itself is taken, not the mean of a step.
MOMENT_S = 1e-6


@dataclass(frozen=True, eq=False)
class SceneDesign:
    """The material that best glows as wanted in a scene.

    Attributes
    ----------
    wish
        What was wished for.
    design
        The best design, under the light for which it was found.
    light
        Light in the scene with its albedo.
    spectra
        Spectral light for which it was found.
    material
        The material of it, in the units of the scene.
    rendered_rgb
        Linear sRGB per sr at the keys in the rendered scene, as of `Design.got_rgb`, shape (keys,
        3).
    rounds
        ΔE2000 of all keys in the rendered scene after each round, shape (keys,) each.
    best
        Number of the round that is kept.
    wished, kept
        The designs under the lamps alone: one that need not keep the energy, and one that does.
    """

    wish: Wish
    design: Design
    light: SceneLight
    spectra: SceneSpectra
    material: Material
    rendered_rgb: FloatArray
    rounds: tuple[FloatArray, ...]
    best: int
    wished: Design
    kept: Design

    @property
    def delta_e2000(self) -> FloatArray:
        """ΔE2000 of all keys in the rendered scene, shape (keys,)."""
        return self.rounds[self.best]

    def design_at(self, place: int) -> Design:
        """Return the material of a place of the wish: the same everywhere."""
        return self.design

    def pictures(self, times_s: Sequence[float]) -> FloatArray:
        """Return rendered pictures at rising times in s, not before the programme.

        Returns
        -------
        ndarray
            Linear sRGB over the white, shape (times, height, width, 3).
        """
        renderer = self.light.renderer(self.material)
        return np.array([self.spectra.rgb(renderer.frame(t_s).radiance) for t_s in times_s])


def solve_in_scene(wish: Wish) -> SceneDesign:
    """Find the material that best glows as wanted in a scene, and render it there.

    Parameters
    ----------
    wish
        Wish in a scene.

    Returns
    -------
    SceneDesign
        The best of up to three rounds, with the residuals in the rendered scene.

    Raises
    ------
    UsageError
        The wish is in no scene.

    References
    ----------
    O. Nalbach, H.-P. Seidel, T. Ritschel, *Practical Capture and Reproduction of Phosphorescent
    Appearance* (2017), section 6.

    Examples
    --------
    >>> from labrig.design import SceneWish, WishedKey, WishFile, solve_in_scene, to_wish
    >>> file = WishFile(
    ...     scene=SceneWish(file="cornell-box", material="phosphorescent", width_px=16, paths=8),
    ...     pixels={"wall": (0.1, 0.5)},
    ...     albedo=0.5,
    ...     keys=(
    ...         WishedKey(at="1 s", colour=(0, 2e-3, 2e-3)),
    ...         WishedKey(at="20 s", colour=(0, 1e-3, 1e-3)),
    ...     ),
    ... )
    >>> found = solve_in_scene(to_wish(file, "mine"))
    >>> bool(found.delta_e2000.max() < 2), found.material.scale
    (True, 'absolute')
    """
    if wish.scene is None:
        raise UsageError("expected a wish in a scene, got a light programme; solve it by itself")
    light, spectra = wish.scene, wish.scene.spectra(wish.scene_places)
    wished, kept = wish.solve_kept()
    design = kept
    rounds: list[SceneDesign] = []
    for number in range(1 + AGAIN):
        if number:
            design = wish.solve("kept", spectra.programme, near=design)
        light = light.with_albedo(design.albedo)
        material = to_material(design, wish.file.name, spectra)
        found = SceneDesign(
            wish, design, light, spectra, material, np.zeros((0, 3)), (), number, wished, kept
        )
        rgb, spectra = _rendered(found)
        rounds.append(replace(found, rendered_rgb=rgb, rounds=(design.differences_to(rgb),)))
        if rounds[-1].rounds[0].max() < MET:
            break
    residuals = tuple(each.rounds[0] for each in rounds)
    best = int(np.argmin([float((each**2).sum()) for each in residuals]))
    return replace(rounds[best], rounds=residuals)


def _rendered(found: SceneDesign) -> tuple[FloatArray, SceneSpectra]:
    """Return linear sRGB at the keys (keys, 3), and the light on the places over time."""
    light = found.light
    renderer, albedo = light.renderer(found.material), light.albedo_of(found.material)
    return rendered_at_keys(found.wish, light, renderer, albedo, found.spectra)


def rendered_at_keys(
    wish: Wish, light: SceneLight, renderer: Renderer, albedo: FloatArray, spectra: SceneSpectra
) -> tuple[FloatArray, SceneSpectra]:
    """Return linear sRGB per sr at the keys (keys, 3), and the light on the places over time.

    Parameters
    ----------
    wish, light, spectra
        What was wished for, and the light for which it was designed.
    renderer
        Renderer of the scene with what was designed.
    albedo
        Albedo, one or of each place of the wish, in the bands of the scene.
    """
    keys, own = wish.keys, light.places[list(wish.scene_places)]
    begin: list[float] = []
    fallen: list[FloatArray] = []

    def record(t_s: float, irradiance: FloatArray) -> None:
        begin.append(t_s)
        fallen.append(irradiance)

    rgb = np.zeros((keys.count, 3))
    for t_s in np.unique(keys.time_s).tolist():
        at = np.flatnonzero(keys.time_s == t_s)
        if t_s < renderer.t_s:
            continue
        renderer.advance(t_s, lambda begin_s, light: record(begin_s, light[own]))
        irradiance = renderer.irradiance()[own]
        radiance = renderer.emitted()[own] + irradiance * albedo / np.pi
        rgb[at] = spectra.rgb(radiance)[keys.place[at]] / np.pi
        record(t_s, irradiance)
    return rgb, replace(spectra, begin_s=_apart(np.array(begin)),
                        irradiance=np.stack(fallen, axis=1))  # fmt: skip


def _apart(begin_s: FloatArray) -> FloatArray:
    """Return times of which each step after a key begins a moment later than the key."""
    is_same = np.diff(begin_s, prepend=-np.inf) <= 0
    return np.where(is_same, begin_s + MOMENT_S, begin_s)
