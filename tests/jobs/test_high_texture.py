"""One image in place of the materials of a high-poly mesh: for one map, and of its kind."""

import numpy as np
import pytest

from texbake import BakeOptions, OptionError, read_image, write_image, write_mesh
from texbake.jobs.maps import BakeFiles, bake_files
from texbake.jobs.parts import bake_parts_files
from texbake.mesh.shapes import plane
from texbake.verbs.step import Job, find_step


@pytest.fixture
def folder(tmp_path):
    write_mesh(plane(4, 4), tmp_path / "high.obj")
    write_mesh(plane(), tmp_path / "low.obj")
    write_image(np.full((4, 4, 3), 0.5), tmp_path / "gray.png", bits=8)
    write_image(np.full((4, 4, 3), (0.1, 0.5, 0.9)), tmp_path / "colored.png", bits=8)
    return tmp_path


def bake_with(folder, image, *maps):
    options = BakeOptions(maps=maps, size=8, front=0.1, back=0.1)
    bake_files(
        folder / "high.obj", folder / "low.obj", folder / "maps", options,
        BakeFiles(high_texture=folder / image),
    )  # fmt: skip
    return folder / "maps"


def test_an_image_without_a_map_that_takes_it(folder):
    with pytest.raises(OptionError, match=r"high_texture, maps: gray\.png is for a map of the mat"):
        bake_with(folder, "gray.png", "normal")
    with pytest.raises(OptionError, match="high_texture, maps"):
        bake_parts_files(
            [folder / "high.obj"], [folder / "low.obj"], folder / "maps",
            BakeOptions(maps=("normal",), size=8),
            files=BakeFiles(high_texture=folder / "gray.png"),
        )  # fmt: skip
    assert not (folder / "maps").exists()


def test_a_map_of_one_number_takes_a_gray_image(folder):
    with pytest.raises(OptionError, match=r"colored\.png: roughness is one number per texel"):
        bake_with(folder, "colored.png", "roughness")
    bake_with(folder, "colored.png", "base-color")
    maps = bake_with(folder, "gray.png", "roughness")
    (written,) = maps.glob("*roughness*")
    assert np.abs(read_image(written, color=False).pixels - 128 / 255).max() < 0.005


@pytest.mark.parametrize("maps, has_image", [(("base-color",), True), (("normal", "ao"), False)])
def test_a_step_with_little_memory_reads_whole_what_must_be_whole(folder, maps, has_image):
    write_mesh(plane(200, 200), folder / "high.ply")
    inputs = {"high": (folder / "high.ply",), "low": (folder / "low.obj",)}
    if has_image:
        inputs["high_texture"] = (folder / "colored.png",)
    outputs = {name: folder / f"{name}.png" for name in (*maps, "misses")}
    step = find_step("bake")
    settings = step.settings({"maps": maps, "size": 8, "front": 0.1, "back": 0.1})
    outputs["report"] = folder / "report.json"
    job = Job(settings=settings, inputs=inputs, outputs=outputs, threads=1, most_memory=1)
    assert step.run(job)["texels_covered"] == 64
