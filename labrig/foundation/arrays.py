"""Types of arrays; those of results and files are lists where they are written as JSON."""

from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import PlainSerializer, PlainValidator


def _to_lists(array: NDArray[Any]) -> Any:
    """Return nested lists, in which infinity and NaN, unknown to JSON, are texts."""
    if array.dtype.kind != "f" or np.isfinite(array).all():
        return array.tolist()
    texts = array.astype(object)
    texts[np.isnan(array)] = "NaN"
    texts[array == np.inf] = "Infinity"
    texts[array == -np.inf] = "-Infinity"
    return texts.tolist()


_AS_LISTS = PlainSerializer(_to_lists)

#: Real numbers of any shape.
FloatArray = Annotated[
    NDArray[np.float64], PlainValidator(lambda values: np.asarray(values, np.float64)), _AS_LISTS
]
#: Truth values of any shape.
BoolArray = Annotated[
    NDArray[np.bool_], PlainValidator(lambda values: np.asarray(values, np.bool_)), _AS_LISTS
]
#: Whole numbers of any shape.
IntArray = Annotated[
    NDArray[np.intp], PlainValidator(lambda values: np.asarray(values, np.intp)), _AS_LISTS
]
#: Pixels and texels, as they are stored.
Float32Array = NDArray[np.float32]
#: Indices of vertices, faces and texels, as they are stored.
Int32Array = NDArray[np.int32]
