"""Materials of USD files: preview surfaces, and what stands in their place."""

import numpy as np
import pytest

from tests.mesh.test_usd import SUFFIXES, TWO_QUADS
from texbake.mesh.files import read_mesh, write_mesh
from texbake.mesh.materials import ChannelImage, ChannelSource, read_materials
from texbake.mesh.shapes import uv_sphere
from texbake.texture.png_files import write_png

UVS = """
        texCoord2f[] primvars:st = [(0, 0), (1, 0), (2, 0), (0, 1), (1, 1), (2, 1)] (
            interpolation = "vertex"
        )
"""
MATERIAL = """
def Material "{name}"
{{
    float inputs:rough = 0.25
    token outputs:surface.connect = </{name}/surface.outputs:surface>
    def Shader "surface"
    {{
        uniform token info:id = "{kind}"
        {inputs}
        token outputs:surface
    }}
    def Shader "image"
    {{
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @{file}@
        float2 inputs:st.connect = </{name}/{places}.outputs:result>
        {image}
        float outputs:r
        float outputs:a
        float3 outputs:rgb
    }}
    def Shader "moved"
    {{
        uniform token info:id = "UsdTransform2d"
        float2 inputs:in.connect = </{name}/reader.outputs:result>
        float inputs:rotation = 20
        float2 inputs:scale = (2, 4)
        float2 inputs:translation = (0.1, 0.2)
        float2 outputs:result
    }}
    def Shader "reader"
    {{
        uniform token info:id = "UsdPrimvarReader_float2"
        string inputs:varname = "{primvar}"
        float2 outputs:result
    }}
}}
"""
RGB = "</skin/image.outputs:rgb>"


def material_of(name, inputs, image="", **changes):
    """The text of a material: inputs of its surface, and of its image."""
    words = {"kind": "UsdPreviewSurface", "file": "c.png", "places": "reader", "primvar": "st"}
    return MATERIAL.format(name=name, inputs=inputs, image=image, **{**words, **changes})


TWO_MATERIALS = "".join(
    material_of(name, f"float inputs:metallic = {value}")
    for name, value in (("a", 0.25), ("b", 0.75))
)


@pytest.fixture
def read(tmp_path):
    """Read the material `skin` of two quads, given its inputs and those of its image."""
    (tmp_path / "c.png").write_bytes(b"an image")

    def read_one(inputs="", image="", *, head="", **changes):
        material = material_of("skin", inputs, image, **changes)
        body = UVS + head + "\nrel material:binding = </skin>"
        path = tmp_path / "a.usda"
        path.write_text(TWO_QUADS.format(head="", body=body) + material)
        return read_materials(path, read_mesh(path))

    return read_one


def test_values_and_defaults_of_the_specification(read):
    inputs = """
        float inputs:roughness.connect = </skin.inputs:rough>
        color3f inputs:emissiveColor = (0.5, 0, 2)
        float inputs:clearcoat = 0.5
        normal3f inputs:normal = (1, 0, 0)
    """
    found = read(inputs, head="uniform bool doubleSided = 1")
    assert found.face_materials.tolist() == [0] * 4
    (material,) = found.materials
    assert (material.name, material.alpha_mode, material.is_double_sided) == (
        "skin", "opaque", True,
    )  # fmt: skip
    assert {name: source.factor for name, source in material.channels.items()} == {
        "base-color": pytest.approx((0.18, 0.18, 0.18)), "metallic": (0.0,), "roughness": (0.25,),
        "emissive": (0.5, 0.0, 2.0), "clearcoat": (0.5,),
        "clearcoat-roughness": pytest.approx((0.01,)),
    }  # fmt: skip
    assert found.missing == ()


def test_images_with_their_channels_wraps_and_scales(read, tmp_path):
    found = read(
        f"""
        color3f inputs:diffuseColor.connect = {RGB}
        float inputs:opacity.connect = </skin/image.outputs:a>
        float inputs:metallic.connect = </skin/image.outputs:r>
        color3f inputs:emissiveColor.connect = </skin/image.outputs:r>
        """,
        'token inputs:wrapS = "mirror"\ntoken inputs:wrapT = "black"\n'
        "float4 inputs:scale = (0.5, 1, 2, 0.25)",
    )
    image = ChannelImage(
        data=b"an image", name=str(tmp_path / "c.png"), wraps=("mirror", "clamp")
    )  # fmt: skip
    (material,) = found.materials
    assert material.channels["base-color"] == ChannelSource((0.5, 1.0, 2.0), image)
    components = {name: source.image and source.image.components
                  for name, source in material.channels.items()}  # fmt: skip
    assert components == {
        "base-color": (0, 1, 2), "alpha": (3,), "metallic": (0,), "roughness": None,
        "emissive": (0, 0, 0),
    }  # fmt: skip
    assert (material.channels["alpha"].factor, material.alpha_mode) == ((0.25,), "blend")


@pytest.mark.parametrize(("scale", "bias", "factor"), [
    ((2, 2, 2, 1), (-1, -1, -1, 0), (1.0, 1.0, 1.0)),
    ((2, -2, 2, 1), (-1, 1, -1, 0), (1.0, -1.0, 1.0)),  # y downwards
    ((1, 1, 2, 1), (-0.5, -0.5, -1, 0), (0.5, 0.5, 1.0)),
    ((1, 1, 1, 1), (0, 0, 0, 0), (1.0, 1.0, 1.0)),  # forgotten
])  # fmt: skip
def test_the_coding_of_normals_is_undone_once(read, scale, bias, factor):
    image = f"float4 inputs:scale = {scale}\nfloat4 inputs:bias = {bias}"
    source = read(f"normal3f inputs:normal.connect = {RGB}", image).sources("normal")[0]
    assert source.factor == factor


def test_a_threshold_of_opacity_is_a_mask(read):
    inputs = "float inputs:opacityThreshold = 0.75\nfloat inputs:opacity"
    (material,) = read(f"{inputs} = 0.5").materials
    assert (material.alpha_mode, material.alpha_cutoff) == ("mask", 0.75)
    assert material.channels["alpha"].factor == (0.5,)
    assert read(f"{inputs} = 1").materials[0].alpha_mode == "opaque"
    assert read("float inputs:opacity = 0.5").materials[0].alpha_cutoff == 0.5


def test_coordinates_are_moved_as_blender_does(read):
    """What Cycles looks up for this transform, which Blender 5.0 wrote."""
    found = read(f"color3f inputs:diffuseColor.connect = {RGB}", places="moved")
    placing = np.array(found.sources("base-color")[0].image.placing)
    looked_up = {
        (0.390625, 0.265625): (0.470712, 0.465883), (0.171875, 0.640625): (0.546566, 0.725788),
        (0.890625, 0.890625): (0.555354, 0.157135), (0.953125, 0.109375): (0.741629, 0.263348),
    }  # fmt: skip
    for (u, v), expected in looked_up.items():
        x, y = placing @ [u, v, 1.0] % 1.0
        np.testing.assert_allclose([x, y], expected, atol=1e-3)


@pytest.mark.parametrize(("changes", "note"), [
    ({"file": "none.png"}, "its image 'none.png' is missing"),
    ({"file": "folder"}, "its image 'folder' is missing"),
    ({"primvar": "light"}, "its image lies on 'light'"),
    ({"image": "float4 inputs:bias = (0.5, 0, 0, 0)"}, "what is added to the image"),
])  # fmt: skip
def test_what_is_left_out_is_noted(read, tmp_path, changes, note):
    (tmp_path / "folder").mkdir()
    found = read(f"color3f inputs:diffuseColor.connect = {RGB}", **changes)
    (line,) = found.notes()
    assert line.startswith(f"skin: {note}")
    assert (found.sources("base-color")[0].image is None) == ("image" not in changes)


def test_a_missing_image_has_its_fallback(read):
    inputs = f"color3f inputs:diffuseColor.connect = {RGB}"
    found = read(inputs, "float4 inputs:fallback = (1, 0.5, 0, 1)", file="none.png")
    assert found.sources("base-color") == [ChannelSource((1.0, 0.5, 0.0))]


def test_another_shader_is_noted(read):
    found = read(kind="OSL")
    assert found.materials[0].channels == {}
    assert found.notes() == ("skin: its shader OSL is not read",)


@pytest.mark.parametrize("value", ["nan", "inf", "-1", "1e38", '"text"'])
def test_values_that_make_no_sense_are_bounded(read, value):
    kind = "string" if value.startswith('"') else "float"
    found = read(f"{kind} inputs:roughness = {value}\n{kind} inputs:opacityThreshold = {value}")
    (roughness,) = found.sources("roughness")[0].factor
    assert 0.0 <= roughness <= 1.0
    assert 0.0 <= found.materials[0].alpha_cutoff <= 1.0


def test_subsets_have_their_own_materials(tmp_path):
    subset = """
        def GeomSubset "right"
        {
            uniform token elementType = "face"
            int[] indices = [1]
            rel material:binding = </b>
        }
        rel material:binding = </a>
    """
    path = tmp_path / "a.usda"
    path.write_text(TWO_QUADS.format(head="", body=subset) + TWO_MATERIALS)
    found = read_materials(path, read_mesh(path))
    metallic = [source.factor[0] for source in found.sources("metallic")]
    assert [metallic[i] for i in found.face_materials] == [0.25, 0.25, 0.75, 0.75]
    assert set(found.names) == {"a", "b"}


@pytest.mark.parametrize(("strength", "expected"), [("weaker", 0.25), ("stronger", 0.75)])
def test_materials_are_those_of_prims_above(tmp_path, capfd, strength, expected):
    binding = f'''
    rel material:binding = </b> (
        bindMaterialAs = "{strength}ThanDescendants"
    )
    def Mesh'''
    stage = TWO_QUADS.replace("def Mesh", binding.replace("{", "{{").replace("}", "}}"))
    for own in "rel material:binding = </a>", "":
        path = tmp_path / "a.usda"
        path.write_text(stage.format(head="", body=own) + TWO_MATERIALS)
        (source,) = read_materials(path, read_mesh(path)).sources("metallic")
        assert source.factor == (expected if own else 0.75,)
    assert capfd.readouterr().err == ""


def test_without_materials_there_are_none(tmp_path):
    path = tmp_path / "a.usda"
    path.write_text(TWO_QUADS.format(head="", body=""))
    assert read_materials(path, read_mesh(path)) is None


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_what_texbake_writes_comes_back(tmp_path, suffix):
    image = tmp_path / "image.png"
    write_png(image, np.zeros((2, 2, 3), np.uint8))
    path = tmp_path / f"a{suffix}"
    write_mesh(uv_sphere(3, 4), path, normal_map=image, base_color=image, orm=image, emissive=image)
    found = read_materials(path, read_mesh(path))
    channels = found.materials[0].channels
    assert {name: source.image.components for name, source in channels.items()} == {
        "base-color": (0, 1, 2), "metallic": (2,), "roughness": (1,), "occlusion": (0,),
        "emissive": (0, 1, 2), "normal": (0, 1, 2),
    }  # fmt: skip
    assert {source.image.data for source in channels.values()} == {image.read_bytes()}
    assert all(set(source.factor) == {1.0} for source in channels.values())
    assert found.missing == ()
