"""A pair of meshes from which every map can be baked."""

from dataclasses import replace

import numpy as np
import pytest

from texbake.mesh.materials import CHANNELS, ChannelImage, ChannelSource, Materials, MeshMaterial
from texbake.mesh.shapes import icosphere, uv_sphere
from texbake.texture.image import write_image


@pytest.fixture(scope="package")
def painted(tmp_path_factory):
    """A dented ball of two groups and materials, with colors and an image; a low-poly ball."""
    ball = icosphere(4)
    points = ball.positions * (1.0 + 0.02 * np.sin(9.0 * ball.positions[:, :1]))
    angles = np.arctan2(points[:, 1], points[:, 0])
    groups = (points[ball.faces].mean(axis=1)[:, 2] > 0.0).astype(np.int32)
    high = ball.replace(
        positions=points, colors=(0.5 + 0.4 * points).astype(np.float32),
        uvs=np.stack([angles, points[:, 2]], axis=1), uv_faces=ball.faces, face_groups=groups,
        group_names=("south", "north"), name="dents.ply",
    )  # fmt: skip
    path = tmp_path_factory.mktemp("image") / "noise.png"
    write_image(np.random.default_rng(2).random((8, 8, 3), dtype=np.float32), path, color=True)
    image = ChannelImage(path.read_bytes(), "noise.png", wraps=("mirror", "clamp"))
    every = {name: ChannelSource(channel.default) for name, channel in CHANNELS.items()}
    every |= {
        "base-color": ChannelSource((1.0, 0.5, 1.0), image),
        "normal": ChannelSource((1.0, 1.0, 1.0), image),
        "roughness": ChannelSource((0.5,), replace(image, components=(1,), uv_set=1), 0.25),
    }
    materials = Materials(
        face_materials=1 - groups,
        materials=(MeshMaterial(name="rust", channels=every), MeshMaterial(name="moss")),
        uv_sets={1: 2.0 * high.uvs},
        has_vertex_colors=True,
    )
    return high, uv_sphere(12, 24), materials
