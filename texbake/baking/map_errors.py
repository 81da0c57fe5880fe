"""Estimated errors of each map alone, where texels were divided for the worst of several.

The judges that divide texels keep the error of the map that is farthest off, in its own bound, and
so cannot tell how far off the others are. Where there are several, they look once more at what was
cast, for one map after another; what was divided stays as it is. One map alone has its errors from
the first look, at no cost.
"""

from __future__ import annotations

import numpy as np

from texbake.baking.cell_errors import judge_cells
from texbake.baking.cells import NO_CHILD, Cells, FloatArray32
from texbake.baking.coverage import Coverage
from texbake.baking.neighbors import Metric
from texbake.baking.quarter_errors import judge_quarters
from texbake.baking.texel_errors import ONE_SAMPLE, judge_texels


def errors_of_map(
    cells: Cells, coverage: Coverage, shape: tuple[int, int], metric: Metric, threads: int | None
) -> FloatArray32:
    """Estimated errors of texels that have been divided as far as they are.

    Parameters
    ----------
    metric : Metric
        Of one map.

    Returns
    -------
    (n_texels,) float32
        In bounds of the map; 0 where nothing is covered.
    """
    means, steps = judge_texels(cells, coverage, shape, metric, threads)
    errors = ONE_SAMPLE * steps
    if not cells.levels:
        return errors
    quarters = cells.levels[0]
    parents = quarters.texels[::4].copy()
    judged = judge_quarters(cells, coverage, shape, metric, steps, parents, means, threads)
    children = cells.children[quarters.first : quarters.first + len(quarters)]
    is_further = (children.reshape(-1, 4) != NO_CHILD).any(axis=1)
    errors[parents] = np.where(is_further, np.float32(0.0), judged)
    for k, level in enumerate(cells.levels[1:], start=2):
        of_cells = judge_cells(cells, k, shape, metric, threads)
        children = cells.children[level.first : level.first + len(level)]
        kept = np.flatnonzero((children == NO_CHILD) & (level.weights > 0))
        texels = level.texels[kept]
        np.add.at(errors, texels, level.weights[kept] * of_cells[kept] / coverage.counts[texels])
    return errors
