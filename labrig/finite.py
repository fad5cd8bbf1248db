"""Annotated types of numbers in files and results: finite, positive, not negative."""

from typing import Annotated

from pydantic import Field

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
UnitFraction = Annotated[float, Field(ge=0, le=1)]
