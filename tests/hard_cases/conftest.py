"""The catalog of hard cases, given to tests by name: `mesh_case`, `image_case` and so on.

A test that names such a fixture runs once for every case of it. With the mark `pairwise`, which
gives values of other arguments, it runs for few combinations, in which every two values meet. The
cases themselves are plain modules in `catalog/`, which `table.py` reads as well.
"""

import sys
from pathlib import Path
from typing import Any

import pytest

from texbake import TexbakeError

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

from catalog.case import only, pairwise  # noqa: E402
from catalog.geometry import GEOMETRY  # noqa: E402
from catalog.images import IMAGES  # noqa: E402
from catalog.mappings import MAPPINGS  # noqa: E402
from catalog.pairs import PAIRS  # noqa: E402
from catalog.rays import RAYS  # noqa: E402
from catalog.scenes import SCENES  # noqa: E402
from catalog.texture_space import TEXTURE_SPACE, in_cells as cells_of  # noqa: E402

MESHES = GEOMETRY + TEXTURE_SPACE
CASES: dict[str, tuple[Any, ...]] = {
    "mesh_case": MESHES, "textured_case": only(MESHES, "uvs"),
    "closed_case": only(MESHES, "closed"), "solid_case": only(MESHES, "solid"),
    "plain_case": only(MESHES, "plain"), "flat_case": only(MESHES, "flat"), "pair_case": PAIRS,
    "ray_case": RAYS, "mapping_case": MAPPINGS, "image_case": IMAGES,
    "color_case": only(IMAGES, "color"), "scene_case": SCENES,
}  # fmt: skip


def pytest_generate_tests(metafunc):
    for fixture, cases in CASES.items():
        if fixture in metafunc.fixturenames:
            mark = metafunc.definition.get_closest_marker("pairwise")
            axes = {fixture: cases, **(mark.kwargs if mark else {})}
            rows = pairwise(*axes.values()) if mark else [(case,) for case in cases]
            ids = ["-".join(str(getattr(x, "name", x)) for x in row) for row in rows]
            metafunc.parametrize(list(axes), rows, ids=ids)


@pytest.fixture(scope="session")
def attempt():
    """Run a stage on a case: its result, or None where the case lists it as refused."""

    def attempt(case, stage, function):
        reason = case.refused.get(stage)
        if reason is None:
            return function()
        with pytest.raises(TexbakeError) as caught:
            function()
        message = str(caught.value)
        assert reason in message and "\n" not in message
        return None

    return attempt


@pytest.fixture(scope="session")
def in_cells():
    """Give a mesh without coordinates a cell of the texture for each face, without any unwrap."""
    return cells_of


@pytest.fixture(scope="session")
def case_named():
    """Find one mesh, pair or mapping of the catalog by its name."""
    return {case.name: case for case in (*PAIRS, *MAPPINGS, *MESHES)}.__getitem__
