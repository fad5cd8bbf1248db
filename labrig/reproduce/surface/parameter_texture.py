"""Parameters of a phosphor that differ from place to place, as a texture over its surface."""

import os
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from labrig.foundation.array_file import read_arrays, write_arrays
from labrig.foundation.arrays import Float32Array, Int32Array
from labrig.foundation.errors import UsageError


@dataclass(frozen=True, eq=False)
class ParameterTexture:
    """Parameters of each texel, top row first; what is None is the material's own.

    Attributes
    ----------
    k_r_per_s
        Re-radiation rates in 1/s, shape (rows, columns, states).
    k_e_per_s
        Excitation rates in 1/s, in the bands and for the light of the material's file, shape (rows,
        columns, states, bands).
    reradiation
        Re-radiation Λ in the bands and on the scale of the material's file, shape (rows, columns,
        states, bands).
    albedo_factor
        Factor of the material's albedo at all wavelengths, shape (rows, columns).

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.reproduce import ParameterTexture
    >>> slower_to_the_right = np.linspace(0.03, 0.01, 64) * np.ones((64, 1))
    >>> ParameterTexture.checked(k_r_per_s=slower_to_the_right[..., np.newaxis]).shape
    (64, 64)
    """

    k_r_per_s: Float32Array | None = None
    k_e_per_s: Float32Array | None = None
    reradiation: Float32Array | None = None
    albedo_factor: Float32Array | None = None

    @classmethod
    def checked(
        cls,
        k_r_per_s: ArrayLike | None = None,
        k_e_per_s: ArrayLike | None = None,
        reradiation: ArrayLike | None = None,
        albedo_factor: ArrayLike | None = None,
    ) -> Self:
        """Return a texture whose shapes and ranges were checked.

        Raises
        ------
        UsageError
            Nothing is given, sizes disagree, or a value is negative or not finite.
        """
        arrays = [
            None if each is None else np.ascontiguousarray(each, dtype=np.float32)
            for each in (k_r_per_s, k_e_per_s, reradiation, albedo_factor)
        ]
        given = [
            (name, array, axes)
            for (name, axes), array in zip(_AXES.items(), arrays, strict=True)
            if array is not None
        ]
        for name, array, axes in given:
            if array.ndim != len(axes) or not array.size:
                raise UsageError(f"expected {name} of shape ({', '.join(axes)}), got {array.shape}")
            if not (np.isfinite(array).all() and array.min() >= 0):
                raise UsageError(f"expected {name} that are finite and ≥ 0 in a texture")
        if len({array.shape[:2] for _, array, _ in given}) != 1:
            sizes = ", ".join(f"{name} of {array.shape}" for name, array, _ in given)
            raise UsageError(
                f"expected {', '.join(_AXES)} of as many rows and columns, one of them at least, "
                f"got {sizes or 'none'}"
            )
        return cls(*arrays)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        arrays = (getattr(self, each.name) for each in fields(self))
        rows, columns = next(array for array in arrays if array is not None).shape[:2]
        return rows, columns

    def texels(self, name: str) -> Float32Array | None:
        """Return a parameter with the texels last, row by row from v = 0 upwards; None if not here.

        Parameters
        ----------
        name
            Name of the attribute.
        """
        array: Float32Array | None = getattr(self, name)
        if array is None:
            return None
        flat = array[::-1].reshape(-1, *array.shape[2:])
        return np.ascontiguousarray(np.moveaxis(flat, 0, -1))

    def texel_at(self, uv: NDArray[np.float64]) -> Int32Array:
        """Return the numbers of the texels, as `texels` has them, in which points lie, shape (n,).

        Parameters
        ----------
        uv
            Texture coordinates from 0 to 1, shape (n, 2).
        """
        rows, columns = self.shape
        column = np.clip(np.floor(uv[:, 0] * columns), 0, columns - 1)
        row = np.clip(np.floor(uv[:, 1] * rows), 0, rows - 1)
        return np.asarray(row * columns + column, dtype=np.int32)


_AXES = {
    "k_r_per_s": ("rows", "columns", "states"),
    "k_e_per_s": ("rows", "columns", "states", "bands"),
    "reradiation": ("rows", "columns", "states", "bands"),
    "albedo_factor": ("rows", "columns"),
}


def write_parameter_texture(path: Path, texture: ParameterTexture) -> None:
    """Write a texture of parameters, with an array for each of those that it has.

    Parameters
    ----------
    path
        Path of the file (.npz), which is replaced at once.
    texture
        The texture.

    Raises
    ------
    DiskError
        The file cannot be written.

    Examples
    --------
    A texture of log rates, such as `labrig.design.propagate` returns, with Λ of two bands:

    >>> from pathlib import Path
    >>> import numpy as np
    >>> from labrig.reproduce import (
    ...     ParameterTexture, read_parameter_texture, write_parameter_texture
    ... )
    >>> edited = np.random.default_rng(1).normal(size=(4, 8, 3))  # log k_r, log Λ in two bands
    >>> texture = ParameterTexture.checked(
    ...     k_r_per_s=np.exp(edited[..., :1]), reradiation=np.exp(edited[..., np.newaxis, 1:])
    ... )
    >>> write_parameter_texture(Path("paint.npz"), texture)
    >>> read_parameter_texture(Path("paint.npz")).reradiation.shape
    (4, 8, 1, 2)
    """
    arrays = {each.name: getattr(texture, each.name) for each in fields(texture)}
    given = {name: array for name, array in arrays.items() if array is not None}
    write_arrays(path, given)


def read_parameter_texture(path: str | os.PathLike[str]) -> ParameterTexture:
    """Read a texture of parameters.

    Parameters
    ----------
    path
        Path of the file (.npz), with arrays named as the attributes of `ParameterTexture`.

    Returns
    -------
    ParameterTexture
        The checked texture.

    Raises
    ------
    UsageError
        The file cannot be read, has arrays of other names, or is refused by
        `ParameterTexture.checked`.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.reproduce import read_parameter_texture
    >>> np.savez("half.npz", albedo_factor=np.tile([1.0, 0.5], (2, 1)))
    >>> read_parameter_texture("half.npz").albedo_factor.tolist()
    [[1.0, 0.5], [1.0, 0.5]]
    """
    file = Path(path)
    arrays = read_arrays(file)
    if unknown := set(arrays) - set(_AXES):
        raise UsageError(f"{file}: expected arrays of {', '.join(_AXES)}, got '{min(unknown)}'")
    try:
        return ParameterTexture.checked(**arrays)
    except (UsageError, ValueError, TypeError) as error:
        raise UsageError(f"{file}: {error}") from None
