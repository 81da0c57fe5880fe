"""What a kind of finding is, and those about texture coordinates and two meshes together.

`kinds.KINDS` lists every kind there is.
"""

from __future__ import annotations

from texbake.records import dataclass

FACES = ("face", "faces")
EDGES = ("edge", "edges")
VERTICES = ("vertex", "vertices")
CHARTS = ("chart", "charts")
MESHES = ("mesh", "meshes")

SEVERITIES = ("error", "warning", "note")  # the worst first


@dataclass(frozen=True, kw_only=True)
class Kind:
    """A kind of problem that a check can find."""

    name: str  # its identifier, for scripts
    title: str  # what a reader sees
    unit: tuple[str, str] = FACES  # what is counted, in the singular and the plural
    severity: str  # one of `SEVERITIES`
    in_high: str | None = None  # severity in a high-poly mesh, where it is another
    # What goes wrong. The check fills in the figures in braces.
    problem: str
    remedy: str  # what to do

    def counted(self, count: int) -> str:
        """Return a count with its unit, such as `2 faces`."""
        return f"{count:,} {self.unit[count != 1]}"


COORDINATE_KINDS = (
    Kind(
        name="no-coordinates",
        title="no texture coordinates",
        unit=MESHES,
        severity="error",
        problem="Without texture coordinates nothing can be baked to this mesh.",
        remedy="Unwrap it: texbake unwrap.",
    ),
    Kind(
        name="nothing-covered",
        title="no texel covered",
        unit=MESHES,
        severity="error",
        problem="Its texture coordinates cover the center of no texel: the faces have no area "
        "there, lie outside the UV tile or are smaller than texels.",
        remedy="Unwrap it again: texbake unwrap.",
    ),
    Kind(
        name="outside-tile",
        title="coordinates outside the UV tile",
        severity="error",
        problem="Only what lies inside the unit square is baked.",
        remedy="Move the charts into the unit square, or unwrap it again: texbake unwrap. "
        "To bake all tiles of a UDIM layout, put the tile into the names of the maps: texbake bake "
        "--name-pattern.",
    ),
    Kind(
        name="overlapping-coordinates",
        title="overlapping coordinates",
        severity="error",
        problem="Faces share texels. Each texel is baked from the first of them, and the others "
        "show detail that is not theirs.{unsure}",
        remedy="Separate the charts: texbake unwrap. Islands that are meant to share texels must "
        "coincide completely. To accept the overlap: texbake check --allow "
        "overlapping-coordinates.",
    ),
    Kind(
        name="shared-coordinates",
        title="groups that share the texture",
        severity="warning",
        problem="Faces share texels with faces of other groups, but with none of their own group. "
        "That is correct where each group has its own texture, and an overlap where all groups "
        "share one.",
        remedy="Bake with `texture_sets`, or separate the groups (texbake unwrap).",
    ),
    Kind(
        name="stacked-coordinates",
        title="stacked islands",
        unit=("island", "islands"),
        severity="note",
        problem="These islands lie exactly on others, as they are, mirrored, or moved by whole "
        "tiles. One of each stack is baked, and the others share its texels. Ambient occlusion, "
        "and normals in object or world space, fit only the one that is baked.",
        remedy="No change is needed if they are alike in the high-poly mesh as well. Choose which "
        "to bake with `bake_island`. If each group has its own texture, bake with `texture_sets`; "
        "if they differ, unwrap them: texbake unwrap.",
    ),
    Kind(
        name="mirrored-coordinates",
        title="mirrored coordinates",
        severity="warning",
        problem="These faces run clockwise in the texture: text reads backward, and programs that "
        "ignore the sign of the bitangent shade the detail as if lit from the wrong side.",
        remedy="Unwrap it again, unless they are mirrored on purpose: texbake unwrap.",
    ),
    Kind(
        name="collapsed-coordinates",
        title="coordinates without area",
        severity="warning",
        problem="These faces have an area in space but none in the texture: they own no texel, and "
        "no tangent can be computed.",
        remedy="Unwrap it again: texbake unwrap.",
    ),
)

TEXEL_KINDS = (
    Kind(
        name="thin-charts",
        title="charts thinner than the padding",
        unit=CHARTS,
        severity="warning",
        problem="At this texture size they are less than {padding} texels wide, the thinnest "
        "{least:.2g}. Filtering reads more padding than chart, and they vanish in the first mip "
        "levels.",
        remedy="Join them to neighboring charts, or unwrap for a larger texture: texbake unwrap "
        "--size.",
    ),
    Kind(
        name="close-charts",
        title="charts closer than the padding",
        unit=("pair", "pairs"),
        severity="warning",
        problem="The padding of two charts meets on {texels:,} texels. In the smaller mip levels, "
        "the color of one chart bleeds into the other.",
        remedy="Pack the charts with more room (texbake unwrap --padding {padding}), or bake with "
        "less padding.",
    ),
    Kind(
        name="faces-without-texel",
        title="faces without a texel",
        severity="note",
        problem="At this texture size they cover the center of no texel, so they show what is "
        "baked for their neighbors.",
        remedy="Use a larger texture, or fewer faces: texbake simplify.",
    ),
    Kind(
        name="low-texel-density",
        title="low texel density",
        severity="warning",
        problem="The worst of them get {least:.3g} texels per model unit, while the mean of the "
        "mesh is {mean:.3g}. Detail is blurred there, in one direction at least.",
        remedy="Unwrap again so that charts keep their size (texbake unwrap --max-stretch 1.2).",
    ),
)

PAIR_KINDS = (
    Kind(
        name="differing-scale",
        title="meshes of different scale",
        unit=MESHES,
        severity="error",
        problem="The high-poly mesh is {ratio:.4g} times as large as the low-poly mesh: rays do "
        "not reach it.",
        remedy="Scale the low-poly mesh by {ratio:.4g}: texbake transform --scale {ratio:.4g}. Or "
        "export both in the same unit.",
    ),
    Kind(
        name="differing-place",
        title="meshes in different places",
        unit=MESHES,
        severity="error",
        problem="The centers of the two meshes are {distance} apart: rays do not reach the "
        "high-poly mesh.",
        remedy="Move the low-poly mesh by {offset}: texbake transform --move. Or export both from "
        "the same scene.",
    ),
    Kind(
        name="differing-axes",
        title="meshes with different axes",
        unit=MESHES,
        severity="error",
        problem="The meshes fit if in the low-poly mesh {axes}: one of them lies on its side or is "
        "rotated.",
        remedy="Export both with the same up axis, or rotate one of them: texbake transform --up "
        "or --rotate.",
    ),
    Kind(
        name="far-from-high",
        title="low-poly faces far from the high-poly mesh",
        severity="warning",
        problem="The high-poly surface is farther from them than {percent:g} % of the size of the "
        "mesh, at most {most:.3g} model units. Rays miss there, or become so long that they hit "
        "other parts.{part}",
        remedy="Delete what the high-poly mesh does not have, or fit the low-poly mesh to it.",
    ),
    Kind(
        name="far-from-low",
        title="high-poly faces far from the low-poly mesh",
        severity="warning",
        problem="The low-poly surface is farther from them than {percent:g} % of the size of the "
        "mesh, at most {most:.3g} model units. This detail is lost, or rays must start beyond "
        "neighboring parts to hit it.{part}",
        remedy="Add faces to the low-poly mesh there, or leave these parts out of the high-poly "
        "mesh.",
    ),
    Kind(
        name="thin-walls",
        title="walls thinner than the ray distance",
        severity="note",
        problem="Rays end up to {reach:.3g} model units behind the surface; the thinnest of these "
        "walls is {least:.3g} thick. A ray that misses its own side goes on through the other: it "
        "hits that side where back faces are not culled, or else what lies beyond.{part}",
        remedy="Bake with `back` below the thickness of the wall, or keep back-face culling on.",
    ),
    Kind(
        name="other-parts",
        title="rays that hit another part",
        severity="warning",
        problem="The rays from the centers of these faces hit the high-poly surface only beyond "
        "another part of the low-poly mesh, which is {least:.3g} model units away where it is "
        "nearest; rays start up to {reach:.3g} outside. The wrong part is baked.{part}",
        remedy="Bake with `front` below that distance, with a cage, or with the parts moved apart "
        "in both meshes.",
    ),
    Kind(
        name="opposite-sides",
        title="meshes that face opposite ways",
        severity="error",
        problem="Most of the low-poly mesh faces against the high-poly surface next to it: rays "
        "pass through what they should hit.",
        remedy="Flip the mesh that is inside out: texbake repair if it is closed, texbake "
        "transform --flip if it is open.",
    ),
    Kind(
        name="high-is-coarser",
        title="high-poly mesh coarser than the low-poly mesh",
        unit=MESHES,
        severity="warning",
        problem="It has {high:,} faces and the low-poly mesh has {low:,}: there is no detail to "
        "bake.",
        remedy="Name the high-poly mesh first: texbake check HIGH LOW.",
    ),
    Kind(
        name="detail-below-texels",
        title="detail finer than texels",
        unit=MESHES,
        severity="warning",
        problem="At this texture size there are {per_texel:.1f} high-poly faces per texel. With "
        "one ray per texel, chance decides which of them is baked.",
        remedy="Bake {size} x {size} texels, or 16 rays per texel (`samples=16`).",
    ),
)
