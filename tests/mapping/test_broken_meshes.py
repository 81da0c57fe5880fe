"""A sample of what `tests/fuzz_unwrap.py` runs on a thousand meshes."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))

from broken_meshes import MUTATIONS, broken_mesh
from fuzz_unwrap import wrong_with

N_SAMPLES = 24


@pytest.mark.parametrize("seed", range(N_SAMPLES))
def test_broken_meshes_get_an_atlas(seed: int) -> None:
    quality = ("good", "fast", "best")[seed % 3]
    mesh, _ = broken_mesh(seed)
    assert wrong_with(mesh, quality) == ""


def test_next_to_no_area_at_all_is_no_error_of_its_own() -> None:
    mesh, _ = broken_mesh(613)
    assert wrong_with(mesh, "good") == ""


def test_the_sample_has_every_kind_of_damage() -> None:
    names = {name for seed in range(N_SAMPLES) for name in broken_mesh(seed)[1]}
    assert names == {mutation.__name__ for mutation in MUTATIONS}
