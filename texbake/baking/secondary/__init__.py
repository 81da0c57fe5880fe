"""Rays that start on the dense surface: what it sees of its surroundings, and how thick it is.

From each point that a ray of the bake hit, a fan of rays goes out over the hemisphere of the dense
normal, and, for the thickness alone, one goes in. They are cast once, however many maps they are
for, and what they met is kept beside the hits, in these columns:

- `OPEN`: the share of the outer rays that met nothing, 0 to 1;
- `OPEN_DIRECTION`: the mean of their directions, in model space, not normalized; the dense normal
  where all met something;
- `DEPTH`: how far the inner rays go in the mean, in model units.

A column that no map asked for holds NaN.
"""

OPEN = 0
OPEN_DIRECTION = slice(1, 4)
DEPTH = 4
N_COLUMNS = 5
