"""Maps that a model looks the same without are told, and others are not."""

from pathlib import Path

import numpy as np
import pytest

from texbake.baking.bake import bake
from texbake.baking.options import BakeOptions
from texbake.baking.result import redundant_maps
from texbake.jobs.maps import bake_files
from texbake.mesh.files import write_mesh
from texbake.mesh.materials import ChannelSource, Materials, MeshMaterial
from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import orange, uv_sphere

BALL = uv_sphere(16, 32)


def sentences(high: Mesh, *maps: str, materials: Materials | None = None, **given: object) -> dict:
    options = BakeOptions(maps=maps, size=32, secondary_rays=16, **given)  # type: ignore[arg-type]
    found = bake(high, BALL, options, materials=materials).maps
    told = dict(line.split(": ", 1) for line in redundant_maps(found, 2.0))
    return {name: words.split(" at ")[0].split(";")[0] for name, words in told.items()}


def test_a_mesh_baked_onto_itself_needs_no_map() -> None:
    same = "it has no effect"
    names = ("normal", "displacement", "ao", "opacity")
    assert sentences(BALL, *names) == dict.fromkeys(names, same)


def test_maps_that_show_something_are_not_told() -> None:
    assert sentences(orange(20_000), "normal", "displacement", "ao") == {}
    # Normals of an object are not those of a material.
    assert sentences(BALL, "normal", space="object") == {}


def test_one_value_everywhere_is_a_factor() -> None:
    gray = MeshMaterial(
        name="gray",
        channels={
            "base-color": ChannelSource(factor=(0.25, 0.5, 1.0)),
            "roughness": ChannelSource(factor=(0.5,)),
        },
    )
    materials = Materials(materials=(gray,), face_materials=np.zeros(BALL.n_faces, np.int32))
    found = sentences(BALL, "base-color", "roughness", materials=materials)
    assert found == {
        "base-color": "every texel is 0.25, 0.5, 1",
        "roughness": "every texel is 0.5",
    }


@pytest.mark.parametrize("high", ["same", "orange"])
def test_the_job_passes_them_on(tmp_path: Path, high: str) -> None:
    write_mesh(BALL, tmp_path / "low.obj")
    write_mesh(BALL if high == "same" else orange(20_000), tmp_path / "high.obj")
    done = bake_files(
        tmp_path / "high.obj", tmp_path / "low.obj", {"normal": tmp_path / "n.png"},
        BakeOptions(size=32),
    )  # fmt: skip
    told = [line for line in done.warnings if line.startswith("normal: it has no effect")]
    assert len(told) == (high == "same")
