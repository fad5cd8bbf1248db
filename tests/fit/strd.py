"""NIST's Statistical Reference Datasets for nonlinear regression: models, certified values."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.arrays import FloatArray

ComplexArray = NDArray[np.complex128]


def _gauss(b: ComplexArray, x: FloatArray) -> ComplexArray:
    peaks = b[2] * np.exp(-(((x - b[3]) / b[4]) ** 2)) + b[5] * np.exp(-(((x - b[6]) / b[7]) ** 2))
    return np.asarray(b[0] * np.exp(-b[1] * x) + peaks)


def _lanczos(b: ComplexArray, x: FloatArray) -> ComplexArray:
    return np.asarray(
        b[0] * np.exp(-b[1] * x) + b[2] * np.exp(-b[3] * x) + b[4] * np.exp(-b[5] * x)
    )


def _cubic_over_cubic(b: ComplexArray, x: FloatArray) -> ComplexArray:
    above = b[0] + x * (b[1] + x * (b[2] + x * b[3]))
    return np.asarray(above / (1 + x * (b[4] + x * (b[5] + x * b[6]))))


def _enso(b: ComplexArray, x: FloatArray) -> ComplexArray:
    def wave(cosine: complex, sine: complex, period: complex) -> ComplexArray:
        phase = 2 * np.pi * x / period
        return np.asarray(cosine * np.cos(phase) + sine * np.sin(phase))

    waves = wave(b[1], b[2], 12) + wave(b[4], b[5], b[3]) + wave(b[7], b[8], b[6])
    return np.asarray(b[0] + waves)


#: Name → y(parameters, x), analytic in the parameters, as printed in the file's header.
MODELS: dict[str, Callable[[ComplexArray, FloatArray], ComplexArray]] = {
    "Bennett5": lambda b, x: b[0] * (b[1] + x) ** (-1 / b[2]),
    "Chwirut1": lambda b, x: np.exp(-b[0] * x) / (b[1] + b[2] * x),
    "Chwirut2": lambda b, x: np.exp(-b[0] * x) / (b[1] + b[2] * x),
    "DanWood": lambda b, x: b[0] * x ** b[1],
    "ENSO": _enso,
    "Eckerle4": lambda b, x: b[0] / b[1] * np.exp(-0.5 * ((x - b[2]) / b[1]) ** 2),
    "Gauss1": _gauss,
    "Gauss2": _gauss,
    "Hahn1": _cubic_over_cubic,
    "Kirby2": lambda b, x: (b[0] + x * (b[1] + x * b[2])) / (1 + x * (b[3] + x * b[4])),
    "Lanczos1": _lanczos,
    "Lanczos3": _lanczos,
    "MGH09": lambda b, x: b[0] * (x**2 + x * b[1]) / (x**2 + x * b[2] + b[3]),
    "MGH10": lambda b, x: b[0] * np.exp(b[1] / (x + b[2])),
    "Misra1a": lambda b, x: -b[0] * np.expm1(-b[1] * x),
    "Misra1c": lambda b, x: b[0] * (1 - (1 + 2 * b[1] * x) ** -0.5),
    "Misra1d": lambda b, x: b[0] * b[1] * x / (1 + b[1] * x),
    "Nelson": lambda b, x: b[0] - b[1] * x[0] * np.exp(-b[2] * x[1]),
    "Rat42": lambda b, x: b[0] / (1 + np.exp(b[1] - b[2] * x)),
    "Rat43": lambda b, x: b[0] / (1 + np.exp(b[1] - b[2] * x)) ** (1 / b[3]),
    "Roszman1": lambda b, x: b[0] - b[1] * x - np.arctan(b[2] / (x - b[3])) / np.pi,
    "Thurber": _cubic_over_cubic,
}


@dataclass(frozen=True)
class ReferenceSet:
    """One certified regression: two starts, the certified answer, the data."""

    name: str
    starts: tuple[FloatArray, FloatArray]
    certified: FloatArray
    certified_sigma: FloatArray
    x: FloatArray
    y: FloatArray

    def residuals(self, b: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Model − data, and its Jacobian by a complex step, exact to rounding."""
        model = MODELS[self.name]
        jacobian = np.empty((len(self.y), len(b)))
        for j in range(len(b)):
            shifted = b.astype(np.complex128)
            shifted[j] += 1e-200j
            jacobian[:, j] = model(shifted, self.x).imag / 1e-200
        return model(b.astype(np.complex128), self.x).real - self.y, jacobian

    def certified_digits(self, parameters: FloatArray) -> float:
        """Fewest significant digits in which a parameter agrees (11 are certified)."""
        error = np.abs(parameters / self.certified - 1)
        return float(-np.log10(np.maximum(error, 1e-11)).min())


def read(path: Path) -> ReferenceSet:
    """A set as NIST distributes it."""
    text = path.read_text(encoding="utf-8")
    lines = text.splitlines()
    number = r"[-+]?[\d.]+(?:[eE][-+]?\d+)?"
    parameters = [line.split("=")[1] for line in lines if re.match(r"\s*b\d+ =", line)]
    rows = [re.findall(number, parameter) for parameter in parameters]
    table = np.array([[float(cell) for cell in row] for row in rows])
    where = re.search(r"Data\s+\(lines (\d+) to (\d+)\)", text)
    assert where is not None
    first, last = map(int, where.groups())
    data = np.array([[float(cell) for cell in line.split()] for line in lines[first - 1 : last]])
    y = np.log(data[:, 0]) if path.stem == "Nelson" else data[:, 0]
    x = data[:, 1:].T if path.stem == "Nelson" else data[:, 1]
    return ReferenceSet(path.stem, (table[:, 0], table[:, 1]), table[:, 2], table[:, 3], x, y)
