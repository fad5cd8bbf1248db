"""Base of the models of files: frozen, and strict about their keys."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
UnitFraction = Annotated[float, Field(ge=0, le=1)]


class FrozenModel(BaseModel):
    """Content of a file or of a part of it; unknown keys are refused, and nothing changes it."""

    model_config = ConfigDict(frozen=True, extra="forbid")
