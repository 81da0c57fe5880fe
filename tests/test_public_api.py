"""The names that a script imports, and the cost of importing them."""

import inspect
import re
import subprocess
import sys
from pathlib import Path

import pytest

import texbake
import texbake.errors
from texbake.errors import TexbakeError
from texbake.mesh.normals import vertex_curvatures
from texbake.mesh.shapes import plane

# Each takes 0.1 s or more to import; none may be paid for before it is used.
HEAVY = {
    "meshoptimizer", "numpy", "OpenImageIO", "pymeshlab", "rich", "scipy", "skimage", "trimesh",
    "xatlas",
}  # fmt: skip


def modules_after(statement):
    """Top-level names of the modules that a fresh process has loaded after a statement."""
    code = f"{statement}\nimport sys\nprint(*sys.modules)"
    done = subprocess.run(
        [sys.executable, "-P", "-c", code], capture_output=True, text=True, check=True, timeout=60
    )
    return {name.split(".")[0] for name in done.stdout.splitlines()[-1].split()}


def test_names_resolve():
    assert [name for name in texbake.__all__ if getattr(texbake, name) is None] == []


def test_no_public_name_is_the_name_of_a_package():
    # The import system would put the subpackage in the function's place.
    packages = {path.parent.name for path in Path(texbake.__file__).parent.glob("*/__init__.py")}
    assert not packages & set(texbake.__all__)


def test_dir_lists_the_public_names():
    assert dir(texbake) == sorted(texbake.__all__)


def test_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no_such_name"):
        texbake.no_such_name  # noqa: B018


def test_errors_form_one_tree():
    errors = [
        value
        for value in vars(texbake.errors).values()
        if isinstance(value, type)
        and issubclass(value, Exception)
        and not issubclass(value, Warning)
    ]
    assert len(errors) > 5
    assert all(issubclass(error, TexbakeError) for error in errors)


def test_import_loads_nothing_heavy():
    assert not modules_after("import texbake") & HEAVY


def test_options_load_nothing_heavy():
    loaded = modules_after("from texbake import BakeOptions, RenderOptions, RunOptions")
    assert not loaded & HEAVY


def test_every_help_page_loads_nothing_heavy():
    statement = (
        "from click.testing import CliRunner\n"
        "from texbake_cli.main import COMMANDS, texbake\n"
        "for words in [], *([name] for name in COMMANDS):\n"
        "    result = CliRunner().invoke(texbake, [*words, '--help'])\n"
        "    assert result.exit_code == 0, result.output\n"
    )
    assert not modules_after(statement) & HEAVY


def test_every_public_function_takes_a_path_and_a_mesh_of_trimesh():
    """Parameters are annotated `MeshLike` where they are meshes."""
    functions = {name: getattr(texbake, name) for name in texbake.__all__}
    strict = [
        f"{name}: {parameter}"
        for name, function in functions.items()
        if inspect.isfunction(function)
        for parameter, annotation in inspect.get_annotations(function).items()
        if parameter != "return" and re.search(r"^Mesh\b", str(annotation))
    ]
    assert strict == []


def test_the_main_job_runs_on_paths_and_on_meshes_of_trimesh(tmp_path):
    low = plane(2, 2)
    high = plane(8, 8, lambda x, y: 0.02 * x * y).replace(uvs=None, uv_faces=None)
    texbake.write_mesh(low, tmp_path / "low.obj")
    texbake.write_mesh(high, tmp_path / "high.ply")
    options = texbake.BakeOptions(size=16)
    expected = texbake.bake(high, low, options).maps["normal"].values
    for a, b in (
        (tmp_path / "high.ply", str(tmp_path / "low.obj")),
        (texbake.to_trimesh(high), texbake.to_trimesh(low)),
    ):
        assert (texbake.bake(a, b, options).maps["normal"].values == expected).all()
        assert texbake.fit_cage(a, b).mesh.n_faces == low.n_faces
        assert "differing-scale" not in {item.name for item in texbake.check(a, b).findings}
        assert texbake.unwrap(a).corner_uvs().shape == (high.n_faces, 3, 2)
        assert texbake.distortion(b).n_charts == 1
        assert texbake.draw_layout(b, 16).shape[:2] == (16, 16)
        picture = texbake.render(b, options=texbake.RenderOptions(width=16, height=16))
        assert picture.coverage.max() == 1.0
        assert vertex_curvatures(a).shape == (high.n_vertices,)
