"""Atlases of broken meshes: none may hang, crash, or get charts that overlap or are mirrored.

`TEXBAKE_FUZZ=1` unwraps a thousand.
"""

import os
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))

from broken_meshes import MUTATIONS, broken_mesh

from texbake.errors import UnwrapError
from texbake.mapping.corner_uvs import signed_areas
from texbake.mapping.overlap import find_overlaps
from texbake.mapping.unwrap import unwrap

N_SAMPLES = 24 if "TEXBAKE_FUZZ" not in os.environ else 1000
# All faces without area, or next to none beside a spike; and too many charts for the texels.
EXCUSES = "has an area", "narrower than", "do not fit"


def wrong_with(mesh, quality):
    """What is wrong with the coordinates that a mesh gets on few texels; empty if nothing is."""
    try:
        unwrapped = unwrap(mesh, quality=quality, size=512, padding=0, threads=1)
    except UnwrapError as error:
        return "" if any(words in str(error) for words in EXCUSES) else f"UnwrapError: {error}"
    corners = unwrapped.corner_uvs()
    if not np.isfinite(corners).all():
        return "coordinates that are not finite"
    if (signed_areas(corners) < -1e-12).any():
        return "mirrored faces"
    if corners.min() < 0.0 or corners.max() > 1.0:
        return "coordinates outside the square"
    overlapping = find_overlaps(corners).overlapping
    return f"{int(overlapping.sum())} faces overlap" if overlapping.any() else ""


@pytest.mark.parametrize("seed", range(N_SAMPLES))
def test_broken_meshes_get_an_atlas(seed):
    quality = ("good", "fast", "best")[seed % 3]
    mesh, _ = broken_mesh(seed)
    assert wrong_with(mesh, quality) == ""


def test_next_to_no_area_at_all_is_no_error_of_its_own():
    mesh, _ = broken_mesh(613)
    assert wrong_with(mesh, "good") == ""


def test_the_sample_has_every_kind_of_damage():
    names = {name for seed in range(N_SAMPLES) for name in broken_mesh(seed)[1]}
    assert names == {mutation.__name__ for mutation in MUTATIONS}
