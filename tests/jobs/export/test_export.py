"""Asset folders for other programs: the content of their files."""

import numpy as np
import OpenImageIO as oiio  # noqa: N813
import pytest

from texbake import FileError, OptionError, read_image, read_mesh, simplify, write_image
from texbake.errors import UvError
from texbake.jobs.export.export import export_asset
from texbake.jobs.export.maps import find_maps, kind_of, source_maps
from texbake.jobs.export.programs import PROGRAMS, ExportOptions
from texbake.mesh.files.gltf_document import read_document
from texbake.mesh.normals import shading_normals
from texbake.mesh.shapes import grid_sphere, uv_sphere
from texbake.metadata import CONVENTION
from texbake.targets import SETTINGS
from texbake.texture.image_files import write_heights, write_normals

SIZE = 32


@pytest.fixture(scope="module")
def maps(tmp_path_factory):
    """A map of each kind, with values that no two have in common."""
    folder = tmp_path_factory.mktemp("maps")
    rng = np.random.default_rng(0)
    normals = rng.normal(size=(SIZE, SIZE, 3)).astype(np.float32)
    normals[..., 2] = np.abs(normals[..., 2]) + 0.2
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    normals[:4] = (0, 0, 1)
    write_normals(normals, folder / "rock_normal.png")
    heights = rng.uniform(-0.3, 0.1, (SIZE, SIZE)).astype(np.float32)
    write_heights(heights, folder / "rock_displacement.exr")
    for kind in "ao", "roughness", "metalness":
        codes = rng.integers(0, 256, (SIZE, SIZE, 1), np.uint8)
        write_image(codes, folder / f"rock_{kind}.png")
    colors = rng.integers(0, 256, (SIZE, SIZE, 3), np.uint8)
    write_image(colors, folder / "rock_albedo.png", color=True)
    write_image(colors, folder / "rock_curvature.png")
    return folder


@pytest.fixture(scope="module")
def mesh():
    return uv_sphere(8, 12).replace(name="rock.obj")


@pytest.fixture
def export(tmp_path, mesh, maps):
    def run(target, **options):
        files = find_maps(maps)
        return export_asset(mesh, files, tmp_path / target, ExportOptions(to=target, **options))

    return run


def codes_of(path):
    image = read_image(path, color=False)
    return np.rint(image.pixels * (2**image.bits - 1)).astype(int)


@pytest.mark.parametrize("target", PROGRAMS)
def test_green_follows_the_convention_of_the_program(export, maps, target):
    result = export(target)
    (normal,) = [written.path for written in result.maps if written.kind == "normal"]
    image, source = (read_image(path, color=False) for path in (normal, maps / "rock_normal.png"))
    assert image.metadata[CONVENTION] == PROGRAMS[target].convention
    sign = 1 if PROGRAMS[target].convention == "opengl" else -1
    # Half a step of either file.
    found, given = (2.0 * pixels.pixels - 1.0 for pixels in (image, source))
    assert np.abs(found * [1, sign, 1] - given).max() < 2.0 / (2**image.bits - 1)
    middle = 2 ** (image.bits - 1)
    assert (codes_of(normal)[:4] == (middle, middle, 2 * middle - 1)).all()


def test_a_directx_map_is_turned_for_an_opengl_program_and_back(tmp_path, mesh, maps):
    normals = maps / "rock_normal.png"
    there, back = tmp_path / "there", tmp_path / "back"
    unreal = export_asset(mesh, {"normal": normals}, there, ExportOptions(to="unreal"))
    turned = unreal.maps[0].path
    blender = export_asset(mesh, {"normal": turned}, back, ExportOptions(to="blender"))
    np.testing.assert_array_equal(codes_of(blender.maps[0].path), codes_of(normals))
    green = codes_of(turned)[..., 1]
    given = codes_of(normals)[..., 1]
    np.testing.assert_array_equal(green[given != 32768], 65535 - given[given != 32768])
    assert (green[given == 32768] == 32768).all()


def test_maps_without_a_convention_use_the_option(tmp_path, mesh):
    codes = np.full((4, 4, 3), (128, 200, 220), np.uint8)
    write_image(codes, tmp_path / "n.png")
    for convention, green in ("opengl", 200), ("directx", 55):
        options = ExportOptions(to="godot", convention=convention)
        result = export_asset(mesh, {"normal": tmp_path / "n.png"}, tmp_path / "out", options)
        assert (codes_of(result.maps[0].path) == (128, green, 220)).all()


@pytest.mark.parametrize("suffix", ["exr", "png"])
@pytest.mark.parametrize("target", PROGRAMS)
def test_heights_follow_the_settings(mesh, maps, tmp_path, target, suffix):
    heights = read_image(maps / "rock_displacement.exr", color=False).pixels[..., 0]
    source = tmp_path / f"rock.{suffix}"
    write_heights(heights, source)
    options = ExportOptions(to=target, meters_per_unit=0.01)
    result = export_asset(mesh, {"displacement": source}, tmp_path / "out", options)
    (written,) = result.maps
    levels = read_image(written.path, color=False).pixels[..., 0].astype(float)
    meters = (levels - written.mid) * written.scale
    # Half a step of 16 bits of each file, and the rounding of float32.
    step = 0.01 * np.ptp(heights) / 65535
    assert np.abs(meters - 0.01 * heights).max() < 1.1 * step + 1e-9
    text = result.settings.read_text(encoding="utf-8")
    if target == "blender":
        assert written.path.suffix == ".exr"
        assert "Midlevel 0, Scale 1" in " ".join(text.split())
    elif target == "threejs":
        assert f"displacementScale = {written.scale:.9g}" in " ".join(text.split())
    else:
        assert f"{100 * written.scale:.6g}" in text


def test_channels_are_packed_as_each_program_reads_them(export, maps):
    given = {kind: codes_of(maps / f"rock_{kind}.png")[..., 0]
             for kind in ("ao", "roughness", "metalness")}  # fmt: skip
    for target in "unreal", "godot", "threejs":
        (orm,) = [written.path for written in export(target).maps if written.kind == "orm"]
        expected = np.stack([given["ao"], given["roughness"], given["metalness"]], axis=2)
        np.testing.assert_array_equal(codes_of(orm), expected)
    (mask,) = [written.path for written in export("unity").maps if written.kind == "mask-map"]
    opaque = np.full((SIZE, SIZE), 255)
    expected = [given["metalness"], given["ao"], opaque, 255 - given["roughness"]]
    np.testing.assert_array_equal(codes_of(mask), np.stack(expected, axis=2))


@pytest.fixture
def orm(tmp_path, maps):
    """The three gray maps as channels of one image, and their codes."""
    kinds = "ao", "roughness", "metalness"
    codes = np.stack([codes_of(maps / f"rock_{kind}.png")[..., 0] for kind in kinds], axis=2)
    (tmp_path / "maps").mkdir()
    path = tmp_path / "maps" / "rock_occlusion_roughness_metallic.png"
    write_image(codes.astype(np.uint8), path)
    return path, codes


@pytest.mark.parametrize("target", PROGRAMS)
def test_a_packed_map_is_what_its_channels_are(tmp_path, mesh, maps, orm, export, target):
    """The files, the material and the text are those of three maps."""
    path, _ = orm
    parts = {kind: maps / f"rock_{kind}.png" for kind in ("ao", "roughness", "metalness")}
    results = [
        export_asset(mesh, given, tmp_path / folder, ExportOptions(to=target, layers=True))
        for given, folder in ((find_maps(path.parent), "packed"), (parts, "parts"))
    ]
    folders = [result.settings.parent for result in results]
    names = [sorted(str(file.relative_to(folder)) for file in folder.rglob("*.*"))
             for folder in folders]  # fmt: skip
    assert names[0] == names[1]
    for name in names[0]:
        one, other = ((folder / name).read_bytes() for folder in folders)
        assert one == other, name


def test_a_map_of_its_own_takes_the_place_of_a_channel(tmp_path, mesh, maps, orm):
    path, codes = orm
    given = {"orm": path, "roughness": maps / "rock_ao.png"}
    result = export_asset(mesh, given, tmp_path / "out", ExportOptions(to="unreal"))
    np.testing.assert_array_equal(codes_of(result.maps[0].path), codes[..., [0, 0, 2]])


def test_a_packed_map_of_one_channel_is_refused(tmp_path, mesh, maps):
    with pytest.raises(OptionError, match="an ORM map has three channels, and this has 1"):
        given = {"orm": maps / "rock_ao.png"}
        export_asset(mesh, given, tmp_path / "out", ExportOptions(to="godot"))


def test_missing_maps_are_constant_and_reported(tmp_path, mesh, maps):
    given = {"roughness": maps / "rock_roughness.png"}
    result = export_asset(mesh, given, tmp_path, ExportOptions(to="unreal"))
    assert result.warnings == (
        "T_rock_ORM.png: no ao and no metalness was given; the channel is constant",
    )
    codes = codes_of(result.maps[0].path)
    assert (codes[..., 0] == 255).all() and (codes[..., 2] == 0).all()
    assert result.warnings[0] in " ".join(result.settings.read_text(encoding="utf-8").split())


NAMES = {
    "blender": "rock.glb rock_ao.png rock_base-color.png rock_curvature.png rock_displacement.exr "
    "rock_metalness.png rock_normal.png rock_roughness.png",
    "unreal": "SM_rock.glb T_rock_BC.png T_rock_H.png T_rock_N.png T_rock_ORM.png "
    "T_rock_curvature.png",
    "unity": "rock.obj rock_BaseMap.png rock_Height.png rock_MaskMap.png rock_Normal.png "
    "rock_curvature.png",
    "godot": "rock.glb rock_albedo.png rock_curvature.png rock_height.png rock_normal.png "
    "rock_orm.png",
    "threejs": "rock.glb rock_base-color.png rock_curvature.png rock_displacement.png "
    "rock_normal.png rock_orm.png",
}
NAMES["gltf-web"] = NAMES["threejs"]
# What imports these.
IMPORTS = {
    "unreal": ["import_rock.py"],
    "unity": ["Editor/rockImport.cs"],
    "godot": [f"{name}.import" for name in NAMES["godot"].split()[1:]],
}


@pytest.mark.parametrize("target", PROGRAMS)
def test_files_have_the_names_that_the_program_expects(export, target):
    result = export(target)
    folder = result.mesh.parent
    found = {file.relative_to(folder).as_posix() for file in folder.rglob("*") if file.is_file()}
    assert found == {*NAMES[target].split(), *IMPORTS.get(target, ()), SETTINGS}
    assert {path.relative_to(folder).as_posix() for path in result.files} == found
    text = result.settings.read_text(encoding="utf-8")
    assert all(name in text for name in NAMES[target].split())
    assert "{" not in text


@pytest.mark.parametrize("target", PROGRAMS)
def test_an_obj_file_is_distinguished_from_gltf(export, target):
    name = "a-long-name-of-many-words-that-no-line-has-room-for-beside-anything-else"
    result = export(target, mesh_format="obj", name=name)
    text = result.settings.read_text(encoding="utf-8")
    ours = {result.settings, *result.imports}
    assert all(path.name in text for path in result.files if path not in ours)
    of_mesh = text.partition("\nMesh\n")[2].partition("\nMaps\n")[0]
    assert "gltf" not in of_mesh.lower() or target == "gltf-web"
    assert "already" not in of_mesh


def coarser(mesh):
    return simplify(mesh, mesh.n_faces // 2, seams="keep")


@pytest.mark.parametrize(("up", "scale"), [("z", 0.01), ("z", 1.0), ("y", 0.01), ("y", 1.0)])
def test_the_mesh_is_turned_and_scaled(tmp_path, mesh, up, scale):
    options = ExportOptions(to="blender", up=up, meters_per_unit=scale)
    result = export_asset(mesh, {}, tmp_path, options, levels=[coarser(mesh)])
    x, y, z = mesh.positions.T
    expected = scale * np.stack([x, z, -y] if up == "z" else [x, y, z], axis=1)
    found = read_mesh(result.mesh)
    order, given = (np.lexsort(points.round(6).T) for points in (found.positions, expected))
    np.testing.assert_allclose(found.positions[order], expected[given], atol=1e-8)


def test_the_files_material_has_the_maps(export):
    for target, images in (("blender", 3), ("godot", 3), ("threejs", 3), ("unreal", 0)):
        content = read_document(export(target).mesh).content
        assert len(content.get("images", ())) == images
        assert ("normalTexture" in content["materials"][0]) == bool(images)


def test_usd_refers_to_images_beside_it(export, maps):
    result = export("blender", mesh_format="usda")
    assert len(result.textures) == 3
    text = result.mesh.read_text(encoding="utf-8")
    assert all(f"@{path.name}@" in text and path.is_file() for path in result.textures)
    packed = export("blender", mesh_format="usdz", name="other")
    assert (packed.textures, packed.mesh.name) == ((), "other.usdz")


def test_unity_gets_normals_in_the_mesh(tmp_path):
    ball = uv_sphere(8, 12).replace(normals=None, normal_faces=None)
    result = export_asset(ball, {}, tmp_path, ExportOptions(to="unity", name="ball"))
    back, (normals, normal_faces) = read_mesh(result.mesh), shading_normals(ball)
    np.testing.assert_allclose(
        back.normals[back.normal_faces], normals[normal_faces], rtol=0.0, atol=1e-6
    )


def test_dds_textures_have_their_blocks(export):
    result = export("godot", textures="dds")
    kinds = {written.kind: written.path.suffix for written in result.maps}
    assert kinds == {"normal": ".dds", "base-color": ".dds", "orm": ".dds", "displacement": ".png",
                     "curvature": ".png"}  # fmt: skip
    with pytest.raises(OptionError, match="Unreal Engine takes png files"):
        export("unreal", textures="dds")


def test_all_maps_come_as_layers_where_asked_for(export, maps):
    result = export("blender", layers=True)
    source = oiio.ImageInput.open(str(result.layers))
    names, kinds = source.spec().channelnames, list(map(str, source.spec().channelformats))
    pixels = source.read_image(0, 0, 0, len(names), oiio.FLOAT)
    layers = [name.rpartition(".")[0] for name in names]
    assert set(layers) == {"normal", "displacement", "ao", "roughness", "metalness", "base-color",
                           "curvature"}  # fmt: skip
    for layer in set(layers):
        name = "albedo" if layer == "base-color" else layer
        (file,) = maps.glob(f"rock_{name}.*")
        expected = read_image(file, color=layer == "base-color").pixels
        places = [names.index(f"{layer}.{c}") for c in ("Y" if expected.shape[2] == 1 else "RGB")]
        # A half has 11 bits, one of 8-bit codes more than enough.
        most = 5e-4 if kinds[places[0]] == "half" else 0.0
        assert np.abs(pixels[..., places] - expected).max() <= most


def test_tiles_keep_their_numbers(tmp_path, mesh, maps):
    tiles = {f"normal:{tile}": maps / "rock_normal.png" for tile in (1001, 1002)}
    for target, name in (("unreal", "T_rock_N.1002.png"), ("godot", "rock_normal_1002.png")):
        result = export_asset(mesh, tiles, tmp_path / target, ExportOptions(to=target))
        assert (tmp_path / target / name).is_file()
        assert "UDIM" in result.settings.read_text(encoding="utf-8")
        assert "images" not in read_document(result.mesh).content
        assert any("does not support UDIM" in note for note in result.warnings) == (
            target == "godot"
        )


@pytest.mark.parametrize(("name", "expected"), [
    ("normal", ("normal", "")), ("Albedo", ("base-color", "")), ("texture", ("base-color", "")),
    ("height_1011", ("displacement", "1011")), ("ao:1001", ("ao", "1001")),
    ("curvature", ("curvature", "")), ("scan1001", ("scan1001", "")),
    ("rock_normal_1024", ("rock_normal", "")), ("ao.4096", ("ao", "")),
    ("ao:1024", ("ao", "1024")), ("ao:2048", ("ao:2048", "")), ("ao_1000", ("ao_1000", "")),
    ("ao_999", ("ao_999", "")),
])  # fmt: skip
def test_names_of_maps(name, expected):
    assert kind_of(name) == expected


def test_folders_are_searched_by_the_ends_of_names(tmp_path):
    for name in "a_bent-normal.png", "a_normal.1002.exr", "notes.txt", "a_preview.png", "ao.tif":
        (tmp_path / name).touch()
    found = {kind: path.name for kind, path in find_maps(tmp_path).items()}
    assert found == {"bent-normal": "a_bent-normal.png", "normal:1002": "a_normal.1002.exr",
                     "ao": "ao.tif"}  # fmt: skip
    named = find_maps(tmp_path, {"occlusion": "other.png"})
    assert named["occlusion"] == "other.png"
    assert "ao" not in named
    (tmp_path / "b_ao.png").touch()
    with pytest.raises(OptionError, match=r"ao\.tif and b_ao\.png are both ao"):
        find_maps(tmp_path)
    with pytest.raises(FileError, match="no such folder"):
        find_maps(tmp_path / "nowhere")
    (tmp_path / "empty").mkdir()
    with pytest.raises(OptionError, match="no image in it is named after a map"):
        find_maps(tmp_path / "empty")


def test_a_number_that_is_a_size_or_a_tile(tmp_path):
    for name in "rock_normal_1024.png", "rock_ao_512.png":
        (tmp_path / name).touch()
    assert set(find_maps(tmp_path)) == {"normal", "ao"}
    (tmp_path / "rock_normal_1001.png").touch()
    assert set(find_maps(tmp_path)) == {"normal:1024", "normal:1001", "ao"}
    assert [source.tile for source in source_maps({"normal_1024": "a", "ao": "b"})] == ["", ""]


def settings_of(result):
    return " ".join(result.settings.read_text(encoding="utf-8").split())


@pytest.mark.parametrize("target", ["threejs", "godot", "blender"])
def test_only_a_glb_without_tiles_is_reported_to_hold_maps(target, export, mesh, maps, tmp_path):
    packed = "occlusion, roughness, metalness" if target == "blender" else "ORM"
    held = f"Its material already has: base color, normal map, {packed}."
    assert held in settings_of(export(target))
    tiled = {f"{kind}:{tile}": maps / f"rock_{kind}.png" for kind in ("normal", "ao")
             for tile in (1001, 1002)}  # fmt: skip
    options = ExportOptions(to=target)
    others = [export_asset(mesh, tiled, tmp_path / "tiled", options)]
    others += [export(target, mesh_format="obj")]
    others += [export_asset(mesh, {}, tmp_path / "bare", options)]
    for result in others:
        text = settings_of(result)
        assert "already has" not in text and "in the GLB" not in text


def test_rows_of_images_are_turned_where_the_mesh_is_no_gltf_file(export):
    assert "flipY = true" not in settings_of(export("threejs"))
    assert "flipY = false" not in settings_of(export("threejs", mesh_format="obj"))


def test_one_map_cannot_be_two_files():
    with pytest.raises(OptionError, match=r"both a\.png and b\.png are this map"):
        source_maps({"ao": "a.png", "occlusion": "b.png"})


def test_wrong_input_is_one_clear_line(tmp_path, mesh, maps):
    def fail(error, message, files, options=None, of=mesh, **more):
        with pytest.raises(error, match=message) as caught:
            export_asset(of, files, tmp_path, options or ExportOptions(to="godot"), **more)
        assert "\n" not in str(caught.value)

    write_image(np.zeros((4, 4, 1), np.uint8), tmp_path / "small.png")
    write_image(np.zeros((4, 4, 3), np.uint8), tmp_path / "object.png",
                metadata={"texbake:space": "object"})  # fmt: skip
    fail(FileError, "no.png", {"normal": tmp_path / "no.png"})
    fail(OptionError, "it is in object space", {"normal": tmp_path / "object.png"})
    fail(OptionError, "a normal map has three channels", {"normal": tmp_path / "small.png"})
    sizes = {"ao": tmp_path / "small.png", "roughness": maps / "rock_roughness.png"}
    fail(OptionError, r"differ in size \(ao 4 x 4, roughness 32 x 32\)", sizes)
    slip = {"nromal": maps / "rock_normal.png"}
    fail(OptionError, "'nromal' is not the name of a map; did you mean 'normal'", slip)
    for kind in ("roughness", "ao", "displacement"):
        colored = {kind: maps / "rock_normal.png"}
        fail(OptionError, f"{kind} is one number per texel, and red, green and blue", colored)
    bare = grid_sphere(4, 6)
    fail(UvError, "no texture coordinates", {"normal": maps / "rock_normal.png"}, of=bare)
    fail(UvError, "levels of detail share one set", {}, levels=[mesh, bare])
    fail(UvError, "levels of detail share one set", {}, of=bare, levels=[mesh])
    for name in ("a/b", " "):
        with pytest.raises(OptionError, match="is not a file name"):
            ExportOptions(to="godot", name=name)
    compressed = ExportOptions(to="blender", compress=True)
    fail(OptionError, "Blender does not read compressed", {}, compressed)
    fail(OptionError, "levels: a obj file has none", {}, ExportOptions(to="unity"),
         levels=[mesh])  # fmt: skip


def test_maps_of_levels_of_detail_are_those_of_the_mesh_that_is_exported(tmp_path):
    for name in ("a_ao", "a_normal", "a_lod1_ao", "a_lod1_normal", "a_lod12_ao"):
        write_image(np.zeros((4, 4, 3), np.float32), tmp_path / f"{name}.png", color=False)
    for mesh, stem in (("a.glb", "a"), ("", "a"), ("x/a_lod1.glb", "a_lod1")):
        found = {kind: path.name for kind, path in find_maps(tmp_path, mesh=mesh).items()}
        assert found == {"ao": f"{stem}_ao.png", "normal": f"{stem}_normal.png"}
