"""Scripts, presets and materials of exports, each read by its own library where one exists."""

import ast
import configparser
import re
from pathlib import Path

import MaterialX as mx  # noqa: N813
import numpy as np
import pytest
from pxr import Usd, UsdShade

from texbake import OptionError, RunOptions, run, write_image
from texbake.jobs.export.export import export_asset
from texbake.jobs.export.imports import write_imports
from texbake.jobs.export.programs import ExportedMap, ExportOptions
from texbake.mesh.files.openpbr import materialx_document, openpbr_nodes
from texbake.mesh.shapes import uv_sphere
from texbake.targets import PROGRAMS
from texbake.texture.image_files import write_heights, write_normals

KINDS = ("ao", "roughness", "metalness", "opacity")


@pytest.fixture(scope="module")
def library():
    document = mx.createDocument()
    mx.loadLibraries(mx.getDefaultDataLibraryFolders(), mx.getDefaultDataSearchPath(), document)
    return document


@pytest.fixture
def export(tmp_path):
    """Export a ball with a map of each kind."""
    flat, gray = np.full((4, 4, 3), (0.0, 0.0, 1.0)), np.full((4, 4, 1), 0.5)
    maps = {kind: tmp_path / f"{kind}.png" for kind in ("normal", "base-color", "emissive", *KINDS)}
    write_normals(flat, maps["normal"])
    for kind in "base-color", "emissive":
        write_image(flat, maps[kind], color=True)
    for kind in KINDS:
        write_image(gray, maps[kind], color=False)
    maps["displacement"] = tmp_path / "displacement.exr"
    write_heights(np.linspace(-0.2, 0.3, 16).reshape(4, 4), maps["displacement"])

    def run(target, name="rock", **options):
        ball = uv_sphere(6, 8).replace(name="rock.obj")
        return export_asset(
            ball, maps, tmp_path / "out", ExportOptions(to=target, name=name, **options)
        )

    return run


def read_materialx(path, library):
    document = mx.createDocument()
    mx.readFromXmlFile(document, str(path))
    document.importLibrary(library)
    valid, message = document.validate()
    assert valid, message
    return document


@pytest.mark.parametrize("target", PROGRAMS)
def test_materialx_reads_the_document(export, library, target):
    result = export(target, materialx=True)
    (path,) = [file for file in result.imports if file.suffix == ".mtlx"]
    document = read_materialx(path, library)
    own = document.getNodes()
    assert all(node.getNodeDef() is not None for node in own)
    (material,) = document.getMaterialNodes()
    (shader,) = mx.getShaderNodes(material)
    assert shader.getCategory() == "open_pbr_surface"
    assert {item.getName() for item in shader.getInputs()} == {
        *("base_color", "emission_color", "emission_luminance", "geometry_normal"),
        *("specular_roughness", "base_metalness", "geometry_opacity"),
    }  # fmt: skip
    files = {node.getInputValue("file") for node in own if node.getCategory() == "image"}
    assert files <= {written.path.name for written in result.maps}
    assert len(files) == 7 - (PROGRAMS[target].packing is not None)
    mirrored = any(node.getCategory() == "multiply" for node in own)
    assert mirrored == (PROGRAMS[target].convention == "directx")
    (heights,) = [node for node in own if node.getCategory() == "displacement"]
    (written,) = [each for each in result.maps if each.kind == "displacement"]
    assert heights.getInputValue("scale") == pytest.approx(written.scale)


def test_usd_has_the_same_surface(export):
    result = export("blender", mesh_format="usda", materialx=True)
    stage = Usd.Stage.Open(str(result.mesh))
    material = UsdShade.Material.Get(stage, "/asset/material")
    source, _, _ = material.ComputeSurfaceSource("mtlx")
    assert source.GetShaderId() == "ND_open_pbr_surface_surfaceshader"
    plain, _, _ = material.ComputeSurfaceSource()
    assert plain.GetShaderId() == "UsdPreviewSurface"
    fed = {each.GetBaseName() for each in source.GetInputs() if each.HasConnectedSource()}
    assert {"base_color", "geometry_normal", "specular_roughness", "base_metalness"} <= fed
    shaders = [UsdShade.Shader(prim) for prim in stage.Traverse() if prim.IsA(UsdShade.Shader)]
    files = {
        shader.GetInput("file").Get().resolvedPath
        for shader in shaders if (shader.GetShaderId() or "").startswith("ND_image")
    }  # fmt: skip
    assert len(files) == 4 and all(Path(file).is_file() for file in files)


def test_nodes_of_usd_are_defined_by_materialx(export, library):
    result = export("blender", mesh_format="usda", materialx=True)
    stage = Usd.Stage.Open(str(result.mesh))
    for prim in stage.Traverse():
        shader = UsdShade.Shader(prim)
        name = shader.GetShaderId() if shader else None
        if name is not None and name.startswith("ND_"):
            definition = library.getNodeDef(name)
            assert definition is not None, name
            for item in shader.GetInputs():
                declared = definition.getActiveInput(item.GetBaseName())
                assert declared is not None, (name, item.GetBaseName())


NAMES = ("rock", 'a "quoted" name', "1st", "münze", "$x")


@pytest.mark.parametrize("name", NAMES)
def test_the_script_for_unreal_compiles_and_names_the_files(export, name):
    result = export("unreal", name)
    (script,) = result.imports
    tree = ast.parse(script.read_text(encoding="utf-8"))
    assigned = [node for node in tree.body if isinstance(node, ast.Assign)]
    values = {ast.unparse(node.targets[0]): node.value for node in assigned}
    assert ast.literal_eval(values["MESH"]) == result.mesh.name
    textures = ast.literal_eval(values["TEXTURES"])
    assert set(textures) == {written.path.name for written in result.maps}
    srgb = {file for file, (is_srgb, *_) in textures.items() if is_srgb}
    assert srgb == {w.path.name for w in result.maps if w.kind in ("base-color", "emissive")}


@pytest.mark.parametrize("name", NAMES)
def test_the_script_for_unity_is_balanced_and_names_the_files(export, name):
    result = export("unity", name)
    (script,) = result.imports
    assert script.parent.name == "Editor" and script.stem.isidentifier()
    text = script.read_text(encoding="utf-8")
    code = re.sub(r'"(?:[^"\\]|\\.)*"|\'(?:[^\'\\]|\\.)*\'|//[^\n]*', "", text)
    for opening, closing in ("{}", "()", "[]"):
        assert code.count(opening) == code.count(closing) > 0
    assert '"' not in code and "$" not in code
    assert f"class {script.stem} : AssetPostprocessor" in code
    found = re.findall(r'"((?:[^"\\]|\\.)*)"', text)
    decoded = {each.encode().decode("unicode_escape") for each in found}
    assert decoded >= {
        result.mesh.name,
        *(
            written.path.name
            for written in result.maps
            if written.kind not in ("base-color", "emissive")
        ),
    }


@pytest.mark.parametrize("mode", ["opaque", "mask", "blend"])
def test_scripts_connect_the_alpha_of_a_base_color(tmp_path, mode):
    maps = [ExportedMap(kind="base-color", tile="", path=tmp_path / "a.png", alpha=mode)]
    texts = [
        write_imports(tmp_path, ExportOptions(to=to), tmp_path / "a.obj", maps)[0].read_text()
        for to in ("unreal", "unity")
    ]
    place = {"opaque": None, "mask": "MP_OPACITY_MASK", "blend": "MP_OPACITY"}[mode]
    assert ("{'RGB': 'MP_BASE_COLOR'}" if place is None else f"'A': '{place}'") in texts[0]
    assert ('"_AlphaClip"' in texts[1]) == ('{ "_ALPHATEST_ON" }' in texts[1]) == (mode == "mask")


def test_presets_for_godot(export):
    result = export("godot")
    assert len(result.imports) == len(result.maps)
    for preset, written in zip(result.imports, result.maps, strict=True):
        assert preset.name == f"{written.path.name}.import"
        parser = configparser.ConfigParser()
        parser.optionxform = str
        parser.read(preset, encoding="utf-8")
        assert parser["remap"]["importer"] == '"texture"'
        params = parser["params"]
        assert params["compress/normal_map"] == ("1" if written.kind == "normal" else "2")
        assert params["compress/mode"] == ("0" if written.kind == "displacement" else "2")


@pytest.mark.parametrize("name", ["a\x01b", "a\udcff", "a\n"])
def test_names_that_no_file_can_hold_are_refused(tmp_path, name):
    ball = uv_sphere(6, 8).replace(name=f"{name}.obj")
    with pytest.raises(OptionError, match="give another name"):
        export_asset(ball, {}, tmp_path, ExportOptions(to="unity"))
    with pytest.raises(OptionError, match="give another name"):
        run(ball, tmp_path, RunOptions(n_faces=20, preset="unreal"))
    assert not list(tmp_path.iterdir())


def test_names_without_ascii_letters_stay_apart(export):
    scripts = [export("unity", name).imports[0].name for name in ("日本", "中国", "a b", "a-b")]
    assert len(set(scripts)) == 4 and all(Path(name).stem.isidentifier() for name in scripts)


def test_materialx_names_all_tiles(tmp_path, library):
    write_normals(np.full((4, 4, 3), (0.0, 0.0, 1.0)), tmp_path / "n.png")
    tiles = {f"normal:{tile}": tmp_path / "n.png" for tile in (1002, 1011)}
    ball = uv_sphere(6, 8).replace(name="rock.obj")
    result = export_asset(
        ball, tiles, tmp_path / "out", ExportOptions(to="blender", materialx=True)
    )
    (path,) = [file for file in result.imports if file.suffix == ".mtlx"]
    document = read_materialx(path, library)
    nodes = document.getNodes()
    files = [node.getInputValue("file") for node in nodes if node.getCategory() == "image"]
    assert files == ["rock_normal.<UDIM>.png"]


def test_a_material_without_maps_has_the_defaults_of_openpbr(tmp_path, library):
    (tmp_path / "a.mtlx").write_text(materialx_document(openpbr_nodes({}), "a"))
    document = read_materialx(tmp_path / "a.mtlx", library)
    (material,) = document.getMaterialNodes()
    (surface,) = mx.getShaderNodes(material)
    assert len(document.getNodes()) == 2 and surface.getCategory() == "open_pbr_surface"
    assert not surface.getInputs() and material.getName() == "a_material"
    defaults = surface.getNodeDef()
    names = "base_metalness", "emission_luminance"
    assert [defaults.getInputValue(name) for name in names] == [0.0, 0.0]
    assert tuple(defaults.getInputValue("base_color")) == pytest.approx((0.8,) * 3)
