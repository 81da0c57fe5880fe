"""Arrays that belong together row by row."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True, eq=False)
class Rows:
    """Base of dataclasses whose fields are arrays with one row for each of the same things.

    A field may be None in all of its rows.
    """

    def __len__(self) -> int:
        return len(getattr(self, fields(self)[0].name))

    def arrays(self) -> list[Any]:
        """Return the arrays, or None, in the order of the fields."""
        return [getattr(self, field.name) for field in fields(self)]

    def where(self, chosen: npt.NDArray[np.bool_] | slice) -> Self:
        """Return the rows that a mask or a slice chooses; those of a slice are not copied."""
        return type(self)(*(None if array is None else array[chosen] for array in self.arrays()))

    def without(self, dropped: npt.NDArray[np.integer]) -> Self:
        """Return all rows but some; the last rows take their places, in the arrays themselves.

        So it takes time for what is dropped, and none for what is kept.

        Parameters
        ----------
        dropped : (k,) int
            Rows, in ascending order.
        """
        n_kept = len(self) - len(dropped)
        holes = dropped[dropped < n_kept]
        last = np.arange(n_kept, len(self))
        movers = last[~np.isin(last, dropped, assume_unique=True)]
        for array in self.arrays():
            if array is not None:
                array[holes] = array[movers]
        return self.where(slice(n_kept))

    @classmethod
    def joined(cls, parts: list[Self]) -> Self:
        """Put several of the same kind together, in their order."""
        columns = zip(*(part.arrays() for part in parts), strict=True)
        return cls(*(None if column[0] is None else np.concatenate(column) for column in columns))
