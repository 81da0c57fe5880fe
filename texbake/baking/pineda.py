"""Units of the fixed-point grid on which faces own samples, as in `core/edge_functions.h`."""

from __future__ import annotations

FRACTION_BITS = 11  # a sample is 2048 units wide
UNIT = 1 << FRACTION_BITS
TILE = 16  # rows and columns of samples cast together; a multiple of the samples per texel side
NO_FACE = -1
