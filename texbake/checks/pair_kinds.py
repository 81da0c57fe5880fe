"""The kinds of findings about a high-poly and a low-poly mesh together."""

from __future__ import annotations

from texbake.checks.finding import MESHES, Kind

PAIR_KINDS = (
    Kind(
        name="differing-scale",
        title="meshes of different scale",
        unit=MESHES,
        low="error",
        problem="The high-poly mesh is {ratio:.4g} times as large as the low-poly mesh: rays do "
        "not reach it.",
        remedy="Scale the low-poly mesh by {ratio:.4g}: texbake transform --scale {ratio:.4g}. Or "
        "export both in the same unit.",
    ),
    Kind(
        name="differing-place",
        title="meshes in different places",
        unit=MESHES,
        low="error",
        problem="The centers of the two meshes are {distance} apart: rays do not reach the "
        "high-poly mesh.",
        remedy="Move the low-poly mesh by {offset}: texbake transform --move. Or export both from "
        "the same scene.",
    ),
    Kind(
        name="differing-axes",
        title="meshes with different axes",
        unit=MESHES,
        low="error",
        problem="The meshes fit if in the low-poly mesh {axes}: one of them lies on its side or is "
        "rotated.",
        remedy="Export both with the same up axis, or turn one of them: texbake transform --up or "
        "--rotate.",
    ),
    Kind(
        name="far-from-high",
        title="low-poly faces far from the high-poly mesh",
        low="warning",
        problem="The high-poly surface is farther from them than {percent:g} % of the size of the "
        "mesh, at most {most:.3g} model units. Rays miss there, or become so long that they hit "
        "other parts.{part}",
        remedy="Delete what the high-poly mesh does not have, or fit the low-poly mesh to it.",
    ),
    Kind(
        name="far-from-low",
        title="high-poly faces far from the low-poly mesh",
        high="warning",
        problem="The low-poly surface is farther from them than {percent:g} % of the size of the "
        "mesh, at most {most:.3g} model units. This detail is lost, or rays must start beyond "
        "neighboring parts to hit it.{part}",
        remedy="Add faces to the low-poly mesh there, or leave these parts out of the high-poly "
        "mesh.",
    ),
    Kind(
        name="thin-walls",
        title="walls thinner than the ray distance",
        low="note",
        problem="Rays end up to {reach:.3g} model units behind the surface; the thinnest of these "
        "walls is {least:.3g} thick. A ray that misses its own side goes on through the other: it "
        "hits that side where back faces are not culled, or else what lies beyond.{part}",
        remedy="Bake with `back` below the thickness of the wall, or keep back-face culling on.",
    ),
    Kind(
        name="other-parts",
        title="rays that hit another part",
        low="warning",
        problem="The rays from the centers of these faces hit the high-poly surface only beyond "
        "another part of the low-poly mesh, which is {least:.3g} model units away where it is "
        "nearest; rays start up to {reach:.3g} outside. The wrong part is baked.{part}",
        remedy="Bake with `front` below that distance, with a cage, or with the parts moved apart "
        "in both meshes.",
    ),
    Kind(
        name="opposite-sides",
        title="meshes that face opposite ways",
        low="error",
        problem="Most of the low-poly mesh faces against the high-poly surface next to it: rays "
        "pass through what they should hit.",
        remedy="Flip the mesh that is inside out: texbake repair if it is closed, texbake "
        "transform --flip if it is open.",
    ),
    Kind(
        name="high-is-coarser",
        title="high-poly mesh coarser than the low-poly mesh",
        unit=MESHES,
        high="warning",
        problem="It has {high:,} faces and the low-poly mesh has {low:,}: there is no detail to "
        "bake.",
        remedy="Name the high-poly mesh first: texbake check HIGH LOW.",
    ),
    Kind(
        name="detail-below-texels",
        title="detail finer than texels",
        unit=MESHES,
        high="warning",
        problem="At this texture size there are {per_texel:.1f} high-poly faces per texel. With "
        "one ray per texel, chance decides which of them is baked.",
        remedy="Bake {size} x {size} texels, or 16 rays per texel (`samples=16`).",
    ),
)
