"""One law of all that is computed in bands: the same bytes for any number of threads."""

import numpy as np
import pytest

from texbake.texture.cube_map import (
    CubeMap,
    cube_chain,
    from_latitude_longitude,
    sample_cube,
    to_latitude_longitude,
)
from texbake.texture.dds import write_dds
from texbake.texture.encoding import (
    channel_ranges,
    count_clipped,
    decode_normals,
    encode_normals,
    height_range,
    quantize_srgb,
    size_at_percentile,
)
from texbake.texture.lookup import lookup, ramp_lookup, volume_lookup
from texbake.texture.mipmaps import MIP_FILTERS, mip_chain
from texbake.texture.padding import nearest_owner, push_pull
from texbake.texture.prefilter import irradiance, specular_levels
from texbake.texture.procedures import evaluate
from texbake.texture.procedures.options import PROCEDURE_NAMES
from texbake.texture.sample import FILTERS, mip_levels, sample

RNG = np.random.default_rng(0)
N = 600_000  # several bands of each kernel
IMAGE = RNG.random((300, 700, 3)).astype(np.float32)
POINTS = RNG.uniform(-1, 2, (N, 3))
STEPS = RNG.normal(0, 0.02, (70_000, 4)).astype(np.float32)
DIRECTIONS = RNG.normal(size=(N, 3)).astype(np.float32)
CUBE = CubeMap(RNG.random((6, 90, 90, 3)).astype(np.float32))
CHARTS = np.where(RNG.random((300, 700)) < 0.002, RNG.integers(0, 9, (300, 700)), -1)
HEIGHTS = RNG.normal(size=(1100, 1000)).astype(np.float32)
COVERED = HEIGHTS > -1.0
CHAIN = mip_chain(IMAGE[:64, :64])


def dds_bytes(path, threads):
    write_dds(np.tile(IMAGE[:256, :256], (8, 1, 1)), path, block_format="bc1", threads=threads)
    return np.frombuffer(path.read_bytes(), np.uint8)


COMPUTED = {
    "lookup": lambda n: lookup(IMAGE, POINTS[:, :2], threads=n),
    "ramp": lambda n: ramp_lookup(IMAGE[0, :4], POINTS[:, 0].astype(np.float32), threads=n),
    "volume": lambda n: volume_lookup(IMAGE.reshape(30, 10, 700, 3), POINTS, threads=n),
    "cube": lambda n: sample_cube(
        cube_chain(CUBE), DIRECTIONS, POINTS[:, 0], filter="trilinear", threads=n
    ),
    "cube levels": lambda n: cube_chain(CUBE, threads=n).texels,
    "to a cube": lambda n: from_latitude_longitude(IMAGE, threads=n).faces,
    "to a panorama": lambda n: to_latitude_longitude(CUBE, threads=n),
    "irradiance": lambda n: irradiance(CUBE, size=16, threads=n).faces,
    "reflections": lambda n: specular_levels(CUBE, size=32, samples=64, threads=n).texels,
    "normals": lambda n: encode_normals(DIRECTIONS, bits=16, threads=n),
    "decoded": lambda n: decode_normals(DIRECTIONS, threads=n),
    "colors": lambda n: quantize_srgb(POINTS, 8, threads=n),
    "owners": lambda n: nearest_owner(CHARTS, 16, threads=n).indices,
    "meeting": lambda n: nearest_owner(CHARTS, 16, threads=n).n_meeting,
    "push-pull": lambda n: push_pull(IMAGE, CHARTS >= 0, threads=n),
    "ranges": lambda n: channel_ranges(HEIGHTS, COVERED, threads=n),
    "height range": lambda n: height_range(HEIGHTS, COVERED, threads=n),
    "clipped": lambda n: count_clipped(HEIGHTS, COVERED, mid=0.5, scale=1.0, threads=n),
    "percentile": lambda n: size_at_percentile(HEIGHTS, COVERED, 99.0, threads=n),
    "levels": lambda n: mip_levels(np.tile(STEPS, (3, 1)), 64, 64, threads=n),
    **{
        f"mips, {name}": lambda n, name=name: (
            mip_chain(np.tile(IMAGE[..., :1], (4, 3, 1)), filter=name, threads=n).texels
        )
        for name in MIP_FILTERS
    },
    **{
        name: lambda n, name=name: evaluate(name, 30 * POINTS[:70_000], STEPS[:, :3], threads=n)
        for name in PROCEDURE_NAMES
    },
    **{
        name: lambda n, name=name: sample(CHAIN, POINTS[:70_000, :2], STEPS, filter=name, threads=n)
        for name in FILTERS
    },
}


@pytest.mark.parametrize("name", COMPUTED)
def test_the_same_bytes_for_any_number_of_threads(name):
    one, three = (np.asarray(COMPUTED[name](threads)) for threads in (1, 3))
    assert one.size > 0
    assert one.tobytes() == three.tobytes()


def test_the_same_blocks_for_any_number_of_threads(tmp_path):
    one, three = (dds_bytes(tmp_path / f"{threads}.dds", threads) for threads in (1, 3))
    assert one.tobytes() == three.tobytes()
