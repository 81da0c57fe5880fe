"""Materials of FBX files: factors, images in the file and beside it, and none from elsewhere."""

import pytest

from tests.hard_cases.fbx_writer import binary, properties, rich_scene
from texbake.mesh.files import read_mesh
from texbake.mesh.materials import read_materials


@pytest.fixture
def read(tmp_path):
    folder = tmp_path / "model"
    folder.mkdir()

    def write_and_read(texture):
        nodes = rich_scene(7400)
        _, _, objects = nodes[1]
        red = next(i for i, node in enumerate(objects) if node[1][0] == 50)
        color = properties(7400, {"DiffuseColor": [0.25, 0.5, 0.75]})
        objects[red] = ("Material", objects[red][1], [color])
        objects.append(("Texture", [60, "paint\0\1Texture", ""], texture))
        nodes[2][2].append(("C", ["OP", 60, 51, "DiffuseColor"], []))
        path = folder / "a.fbx"
        path.write_bytes(binary(nodes))
        return read_materials(path, read_mesh(path))

    return write_and_read


def test_factors_and_images_in_the_file(read):
    found = read([("Content", [b"picture"], [])])
    assert found.names == ("red", "blue")
    assert found.face_materials.tolist() == [0, 0, 1, 1, 0] * 2
    assert found.sources("base-color")[0].factor == (0.25, 0.5, 0.75)
    assert found.sources("base-color")[1].image.data == b"picture"
    # As text files hold it.
    found = read([("Content", [b"cGljdHVyZQ=="], [])])
    assert found.sources("base-color")[1].image.data == b"picture"


@pytest.mark.parametrize("name", ["b.png", r"C:\work\b.png", "../b.png", "textures/b.png"])
def test_images_lie_in_the_folder_of_the_file(read, tmp_path, name):
    (tmp_path / "b.png").write_bytes(b"outside")
    texture = [("RelativeFilename", [name], [])]
    found = read(texture)
    assert found.sources("base-color")[1] is None
    assert "blue" in found.notes(["base-color"])[0]
    (tmp_path / "model" / "b.png").write_bytes(b"inside")
    assert read(texture).sources("base-color")[1].image.data == b"inside"
