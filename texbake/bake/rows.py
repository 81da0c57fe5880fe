"""Arrays that belong together row by row."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True, eq=False)
class Rows:
    """Base of dataclasses whose fields are arrays with one row for each of the same things."""

    def __len__(self) -> int:
        return len(getattr(self, fields(self)[0].name))

    def arrays(self) -> list[npt.NDArray[Any]]:
        """Return the arrays, in the order of the fields."""
        return [getattr(self, field.name) for field in fields(self)]

    def where(self, chosen: npt.NDArray[np.bool_]) -> Self:
        """Return the rows that a mask chooses."""
        return type(self)(*(array[chosen] for array in self.arrays()))

    @classmethod
    def joined(cls, parts: list[Self]) -> Self:
        """Put several of the same kind together, in their order."""
        columns = zip(*(part.arrays() for part in parts), strict=True)
        return cls(*(np.concatenate(column) for column in columns))
