"""Arrays as fields of a result: numpy in memory, lists in JSON."""

from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import PlainSerializer, PlainValidator


def _listed(array: NDArray[Any]) -> Any:
    """Nested lists; JSON has no infinity and no NaN, which become texts."""
    if array.dtype.kind != "f" or np.isfinite(array).all():
        return array.tolist()
    texts = array.astype(object)
    texts[np.isnan(array)] = "NaN"
    texts[array == np.inf] = "Infinity"
    texts[array == -np.inf] = "-Infinity"
    return texts.tolist()


_LISTED = PlainSerializer(_listed)

#: Real numbers of any shape.
FloatArray = Annotated[
    NDArray[np.float64], PlainValidator(lambda values: np.asarray(values, np.float64)), _LISTED
]
#: Truth values of any shape.
BoolArray = Annotated[
    NDArray[np.bool_], PlainValidator(lambda values: np.asarray(values, np.bool_)), _LISTED
]
#: Whole numbers of any shape.
IntArray = Annotated[
    NDArray[np.intp], PlainValidator(lambda values: np.asarray(values, np.intp)), _LISTED
]
