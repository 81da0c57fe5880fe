"""GLB files whose vertices are 8- and 16-bit integers."""

import numpy as np
import pytest
import trimesh

from texbake.mesh.compose import join_meshes
from texbake.mesh.files.gltf import read_gltf
from texbake.mesh.files.gltf_document import read_document
from texbake.mesh.files.gltf_mesh_materials import read_gltf_materials
from texbake.mesh.files.gltf_write import write_glb
from texbake.mesh.materials import ChannelImage, ChannelSource, Materials, MeshMaterial
from texbake.mesh.rig import Rig, RigObject
from texbake.mesh.shapes import cube, plane, uv_sphere
from texbake.texture.png_files import write_png


@pytest.fixture
def path(tmp_path):
    return tmp_path / "a.glb"


@pytest.fixture
def sphere():
    """A sphere far from the origin, with normals, colors and tangents of its own coordinates."""
    ball = uv_sphere(24, 40)
    colors = np.linspace(0, 1, 3 * ball.n_vertices).reshape(-1, 3)
    return ball.replace(positions=3.0 * ball.positions + (100.0, -20.0, 0.3), colors=colors)


def placed_image(png, placing=((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)), uv_set=0):
    image = ChannelImage(data=png, placing=placing, uv_set=uv_set)
    return MeshMaterial(name="m", channels={"base-color": ChannelSource((1.0, 1.0, 1.0), image)})


@pytest.fixture
def png(tmp_path):
    write_png(tmp_path / "i.png", np.full((4, 4, 3), 128, np.uint8))
    return (tmp_path / "i.png").read_bytes()


def step_of(mesh):
    return np.ptp(mesh.bounds, axis=0).max() / 65535


def test_every_attribute_is_within_half_a_step(path, sphere):
    write_glb(sphere, path, quantize=True)
    exact = path.with_name("exact.glb")
    write_glb(sphere, exact)
    back, plain = read_gltf(path), read_gltf(exact)
    assert read_document(path).content["extensionsRequired"] == ["KHR_mesh_quantization"]
    off = np.abs(back.positions[back.faces] - sphere.positions[sphere.faces])
    # 1e-9: rounding of sums of float64 about 100.
    assert off.max() <= 0.5 * step_of(sphere) + 1e-9
    assert np.abs(back.corner_uvs() - sphere.corner_uvs()).max() <= 0.5 / 65535 + 1e-12
    colors = back.colors[back.faces][..., :3] - sphere.colors[sphere.faces]
    assert np.abs(colors).max() <= 0.5 / 255 + 1e-6  # float32
    np.testing.assert_array_equal(back.tangents[..., 3], plain.tangents[..., 3])
    # Half a step along each axis is sqrt(3) / 254 at most.
    for directions in (lambda m: m.normals[m.normal_faces]), (lambda m: m.tangents[..., :3]):
        a, b = (directions(mesh).astype(np.float64) for mesh in (back, plain))
        assert np.linalg.norm(a / np.linalg.norm(a, axis=2)[..., None] - b, axis=2).max() < (
            1.01 * np.sqrt(3) / 254
        )


def test_rows_are_a_multiple_of_four_bytes(path, sphere):
    write_glb(sphere, path, quantize=True)
    content = read_document(path).content
    (primitive,) = content["meshes"][0]["primitives"]
    widths = {
        name: content["bufferViews"][content["accessors"][index]["bufferView"]].get("byteStride")
        for name, index in primitive["attributes"].items()
    }
    assert widths == {"POSITION": 8, "NORMAL": 4, "TEXCOORD_0": None, "TANGENT": None, "COLOR_0": 4}


def test_what_groups_share_stays_shared(path):
    """A sphere in four groups, and a coarser level, lie on one grid."""
    sphere = uv_sphere(16, 24)
    grouped = sphere.replace(
        face_groups=np.arange(sphere.n_faces) % 4, group_names=("a", "b", "c", "d")
    )
    write_glb(grouped, path, quantize=True)
    back = read_gltf(path)
    assert len(np.unique(back.positions, axis=0)) == sphere.n_vertices
    coarse = uv_sphere(4, 6)
    coarse = coarse.replace(positions=0.5 * coarse.positions)
    write_glb(grouped, path, quantize=True, levels=[coarse])
    np.testing.assert_allclose(read_gltf(path).bounds, sphere.bounds, atol=step_of(sphere))
    nodes = [node for node in read_document(path).content["nodes"] if "mesh" in node]
    assert {str((node["scale"], node["translation"])) for node in nodes} == {
        str((nodes[0]["scale"], nodes[0]["translation"]))
    }


def test_trimesh_reads_it(path, sphere):
    write_glb(sphere, path, quantize=True)
    read = trimesh.load_scene(path, process=False).to_mesh()
    np.testing.assert_allclose(read.bounds, sphere.bounds, atol=step_of(sphere))
    assert len(read.faces) == sphere.n_faces


TURNED = ((0.0, -2.0, 0.5), (3.0, 0.0, -0.25))


@pytest.mark.parametrize(
    "size, corner",
    [
        ((2.0, 0.5), (-0.7, -0.1)),
        ((0.5, 0.5), (-0.1, 0.3)),
        ((0.5, 0.5), (0.3, 0.6)),
        ((2.0, 0.5), (-3.0, -2.0)),
    ],
)
@pytest.mark.parametrize("placing", [((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)), TURNED])
def test_coordinates_beyond_the_square_are_put_back_by_the_texture(
    path, png, placing, size, corner
):
    mesh = plane()
    mesh = mesh.replace(uvs=mesh.uvs * size + corner)
    material = placed_image(png, placing)
    materials = Materials(face_materials=np.zeros(mesh.n_faces, np.int32), materials=(material,))
    write_glb(mesh, path, materials=materials, quantize=True)
    back = read_gltf(path)
    assert back.uvs.min() >= 0.0
    assert back.uvs.max() <= 1.0
    image = read_gltf_materials(path, back).materials[0].channels["base-color"].image
    found, given = (
        uvs @ np.array(rows)[:, :2].T + np.array(rows)[:, 2]
        for uvs, rows in ((back.corner_uvs(), image.placing), (mesh.corner_uvs(), placing))
    )
    # Half a step of a square of 2, scaled by 3 at most.
    np.testing.assert_allclose(found, given, atol=3.0 / 65535)


def test_coordinates_that_no_texture_can_put_back_stay_floats(path, png):
    mesh = plane()
    far = mesh.replace(uvs=mesh.uvs * 4.5)
    near = mesh.replace(uvs=mesh.uvs * 2.5)
    ids = np.zeros(mesh.n_faces, np.int32)
    with_image = Materials(face_materials=ids, materials=(placed_image(png),))
    without = Materials(face_materials=ids, materials=(MeshMaterial(name="m"),))
    for given, materials in (far, with_image), (near, without), (near, None):
        write_glb(given, path, materials=materials, quantize=True)
        np.testing.assert_array_equal(read_gltf(path).corner_uvs(), given.corner_uvs())


def test_a_mesh_without_size_is_one_point(path):
    mesh = plane().replace(positions=np.full((plane().n_vertices, 3), 7.25))
    write_glb(mesh, path, quantize=True)
    np.testing.assert_array_equal(read_gltf(path).positions, [[7.25, 7.25, 7.25]])


def test_a_mesh_that_the_grid_would_flatten_keeps_floats(path):
    for length, is_quantized in (500.0, True), (1e6, False):
        mesh = cube()
        mesh = mesh.replace(positions=mesh.positions * [length, 1.0, 1.0])
        write_glb(mesh, path, quantize=True)
        sides = np.ptp(read_gltf(path).bounds, axis=0)
        np.testing.assert_allclose(sides, np.ptp(mesh.bounds, axis=0), rtol=0.01)
        required = read_document(path).content.get("extensionsRequired", [])
        assert ("KHR_mesh_quantization" in required) == is_quantized


@pytest.mark.usefixtures("meshoptimizer")
def test_a_compressed_file_is_quantized_unless_told_otherwise(path, sphere):
    sizes = []
    for quantize in None, False:
        write_glb(sphere, path, compress=True, quantize=quantize)
        required = read_document(path).content["extensionsRequired"]
        assert ("KHR_mesh_quantization" in required) == (quantize is None)
        sizes.append(path.stat().st_size)
    assert sizes[0] < 0.7 * sizes[1]


def test_glass_stays_as_thick_in_steps_of_the_file(path, sphere):
    volume = {"KHR_materials_volume": {"thicknessFactor": 0.5, "attenuationDistance": 2.0}}
    materials = Materials(
        face_materials=np.zeros(sphere.n_faces, np.int32),
        materials=(MeshMaterial(name="glass", extensions=volume),),
    )
    write_glb(sphere, path, materials=materials, quantize=True)
    content = read_document(path).content
    made = content["materials"][0]["extensions"]["KHR_materials_volume"]
    thickness = made["thicknessFactor"] * content["nodes"][0]["scale"][0]
    assert thickness == pytest.approx(0.5, rel=1e-12)  # rounding of a product
    assert made["attenuationDistance"] == 2.0


def test_glass_of_one_material_stays_as_thick_in_nodes_of_other_scales(path, sphere):
    volume = {"KHR_materials_volume": {"thicknessFactor": 0.5}}
    balls = join_meshes([sphere, sphere])
    balls = balls.replace(group_names=("a", "b"), group_objects=(0, 1))
    materials = Materials(
        face_materials=np.zeros(balls.n_faces, np.int32),
        materials=(MeshMaterial(name="glass", extensions=volume),),
    )
    scales = 1.0, 10.0
    rig = Rig(
        content={"nodes": [{"scale": [k] * 3} for k in scales], "scenes": [{"nodes": [0, 1]}]},
        objects={
            i: RigObject(node=i, matrix=np.diag([k, k, k, 1.0])) for i, k in enumerate(scales)
        },
    )
    write_glb(balls, path, materials=materials, quantize=True, rig=rig)
    content = read_document(path).content
    for mesh, node in zip(content["meshes"], content["nodes"][2:], strict=True):
        glass = content["materials"][mesh["primitives"][0]["material"]]
        made = glass["extensions"]["KHR_materials_volume"]["thicknessFactor"]
        assert made * node["matrix"][0] == pytest.approx(0.5, rel=1e-9)


def in_order(mesh):
    """Corners (F, 3, 12) of a mesh, whatever the order of its faces and of the corners of each."""
    corners = np.concatenate(
        [
            mesh.positions[mesh.faces],
            mesh.corner_uvs(),
            mesh.normals[mesh.normal_faces],
            mesh.tangents,
        ],
        axis=2,
    )
    first = np.array([np.lexsort(face[:, :3].T)[0] for face in corners])
    turned = (first[:, None] + np.arange(3)) % 3
    corners = np.take_along_axis(corners, turned[:, :, None], axis=1)
    return corners[np.lexsort(corners[:, :, :3].reshape(len(corners), 9).T)]


@pytest.mark.usefixtures("meshoptimizer")
@pytest.mark.parametrize("repeats", [1.0, 40.0])
def test_coarse_coordinates_and_normals_take_fewer_bytes_and_stay_close(path, png, repeats):
    ball = uv_sphere(24, 40)
    placing = ((repeats, 0.0, 0.0), (0.0, 1.0, 0.0))
    images = {"base-color": placed_image(png, placing).channels["base-color"]}
    images["normal"] = ChannelSource((1.0, 1.0, 1.0), ChannelImage(data=png, placing=placing))
    material = MeshMaterial(name="m", channels=images)
    materials = Materials(face_materials=np.zeros(ball.n_faces, np.int32), materials=(material,))
    sizes, corners, places = [], [], []
    for is_coarse in (False, True):
        write_glb(ball, path, materials=materials, compress=True, is_coarse=is_coarse)
        back = read_gltf(path)
        image = read_gltf_materials(path, back).materials[0].channels["base-color"].image
        corners.append(in_order(back))
        rows = np.array(image.placing)
        places.append(corners[-1][..., 3:5] @ rows[:, :2].T + rows[:, 2])
        sizes.append(path.stat().st_size)
    assert sizes[1] < 0.95 * sizes[0]
    fine, coarse = corners
    np.testing.assert_array_equal(fine[..., :3], coarse[..., :3])
    # Half a step of a 4,096th of an image, or of a 1,024th where it repeats, and of a fine step.
    assert 1e-5 < np.abs(places[0] - places[1]).max() < 0.51 * min(repeats, 4.0) / 4096
    for directions in (np.s_[..., 5:8], np.s_[..., 8:11]):
        cosines = (fine[directions] * coarse[directions]).sum(axis=-1)
        lengths = (np.linalg.norm(each[directions], axis=-1) for each in (fine, coarse))
        assert (
            np.degrees(np.arccos(np.clip(cosines / np.prod(list(lengths), axis=0), -1, 1))).max()
            < 1.5
        )
    np.testing.assert_array_equal(fine[..., 11], coarse[..., 11])
