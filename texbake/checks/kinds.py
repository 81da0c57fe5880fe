"""Everything that a check can find: what it is called, what it does to a bake, what to do.

One table, read by the checks, the command line and the documentation.
"""

from __future__ import annotations

from texbake.checks.kind import (
    CHARTS,
    EDGES,
    MESHES,
    VERTICES,
    Kind,
)

_FILES = (
    Kind(
        name="unreadable",
        title="not a mesh",
        unit=("file", "files"),
        light="error",
        dense="error",
        problem="{message}.",
        remedy="Export it again; nothing else was looked at in this file.",
    ),
)

_SURFACE = (
    Kind(
        name="no-surface",
        title="no surface",
        unit=MESHES,
        light="error",
        dense="error",
        problem="No face has any area: no ray starts from the mesh, and none hits it.",
        remedy="Export it again; its points lie on lines, or all in one place.",
    ),
    Kind(
        name="zero-area-faces",
        title="faces without area",
        light="warning",
        dense="note",
        problem="They have no normal: rays from them have no direction, and none can hit them.",
        remedy="Remove them, or merge the vertices that make them thin.",
    ),
    Kind(
        name="duplicate-faces",
        title="duplicate faces",
        light="warning",
        dense="note",
        problem="They repeat the three vertices of an earlier face: it depends on the order of the "
        "faces which of the two is baked, hit or seen.",
        remedy="Remove one of each pair; draw two-sided faces with --back-faces show instead.",
    ),
    Kind(
        name="duplicate-vertices",
        title="duplicate vertices",
        unit=VERTICES,
        light="note",
        dense="note",
        problem="They repeat an earlier vertex with all that it carries. texbake takes them as "
        "one; programs that do not shade a crease there or open a gap.",
        remedy="Merge vertices at equal places, or use a format that shares them (OBJ, PLY, GLB).",
    ),
    Kind(
        name="unused-vertices",
        title="unused vertices",
        unit=VERTICES,
        light="note",
        dense="note",
        problem="No face uses them. texbake ignores them; other programs let them enlarge the "
        "bounding box.",
        remedy="Remove loose vertices.",
    ),
    Kind(
        name="non-manifold-edges",
        title="non-manifold edges",
        unit=EDGES,
        light="warning",
        dense="note",
        problem="More than two faces meet there: normals are averaged over sheets that have "
        "nothing to do with one another, rays lean the wrong way, and charts end.",
        remedy="Separate the sheets, or remove faces inside the model.",
    ),
    Kind(
        name="pinched-vertices",
        title="pinched vertices",
        unit=VERTICES,
        light="warning",
        dense="note",
        problem="Several fans of faces meet in one point only (a bow tie): its normal is the "
        "mean of all, and right for none.",
        remedy="Give each fan a vertex at a place of its own.",
    ),
    Kind(
        name="cracks",
        title="cracks",
        unit=VERTICES,
        light="warning",
        dense="warning",
        problem="Vertices of open edges lie within a millionth of the mesh's size of one another "
        "and not at one place: rays slip through, normals crease.",
        remedy="Merge vertices by distance ({distance:.2g} model units).",
    ),
    Kind(
        name="self-intersections",
        title="faces through one another",
        light="warning",
        dense="note",
        problem="Face {one} passes through face {other}, for one. What of a light face lies within "
        "the model takes texels that nobody sees, and rays that start inside take the other part's "
        "surface; of a dense one it is never hit.{unsure}",
        remedy="Cut the parts along their intersection, or give them groups and bake them apart.",
    ),
    Kind(
        name="undecided-intersections",
        title="faces with too many others near them",
        light="note",
        dense="note",
        problem="Whether they pass through another face was not found out, for the many faces near "
        "them; no other face passes through one.",
        remedy="Remove long or large faces that span what is dense, or look at the parts one by "
        "one.",
    ),
    Kind(
        name="inconsistent-winding",
        title="inconsistent winding",
        unit=EDGES,
        light="error",
        dense="error",
        problem="The two faces of such an edge do not agree on which side is outside. The faces "
        "turned over cast rays the wrong way in a light mesh, and are passed through in a dense "
        "one.",
        remedy="Recalculate the normals to the outside; the faces named are those in the minority.",
    ),
    Kind(
        name="inside-out-shells",
        title="shells inside out",
        unit=("shell", "shells"),
        light="error",
        dense="error",
        problem="A closed shell has its outside within: rays go the wrong way in a light mesh, and "
        "pass through it in a dense one.",
        remedy="Flip the faces of the shell.",
    ),
    Kind(
        name="far-from-origin",
        title="far from the origin",
        unit=MESHES,
        light="warning",
        dense="warning",
        problem="It lies {times:,.0f} times its size from the origin: formats and programs of "
        "32-bit floats round its vertices to steps of {step:.2g} of its size.",
        remedy="Move both meshes to the origin by the same way.",
    ),
    Kind(
        name="extreme-size",
        title="extreme size",
        unit=MESHES,
        light="note",
        dense="note",
        problem="It is {size:.3g} model units across. texbake works at any size; programs that "
        "take lengths below 1e-6 for nothing, or store distances in 16 bits, do not.",
        remedy="Choose a unit of length in which it is about 1 across.",
    ),
)

_SHADING = (
    Kind(
        name="no-normals",
        title="no normals",
        unit=MESHES,
        light="note",
        dense="note",
        problem="The file has no normals, so that they are averaged by angle. A light mesh drawn "
        "elsewhere with other normals shows seams; hard edges of a dense one become round.",
        remedy="Export the normals that the asset is drawn with.",
    ),
    Kind(
        name="zero-normals",
        title="normals of length zero",
        light="warning",
        dense="warning",
        problem="A corner has a normal without a direction; texbake puts the smooth one in its "
        "place, other programs draw black or NaN.",
        remedy="Recalculate the normals before the export.",
    ),
    Kind(
        name="turned-normals",
        title="normals on the far side",
        light="warning",
        dense="warning",
        problem="A corner's normal points to the back of its face: light comes from the wrong "
        "side, and rays along normals (--rays vertex) go the wrong way.",
        remedy="Recalculate the normals, or flip the winding if the normals are right.",
    ),
    Kind(
        name="hard-edges-without-seam",
        title="hard edges without a seam",
        unit=EDGES,
        light="warning",
        problem="Normals jump across the edge and the texture does not: filtering mixes the two "
        "sides, and a line shows along it.",
        remedy="Cut the coordinates along hard edges, or make the edges smooth.",
    ),
)

_COORDINATES = (
    Kind(
        name="no-coordinates",
        title="no texture coordinates",
        unit=MESHES,
        light="error",
        problem="There is nothing to bake to.",
        remedy="Make some with: texbake unwrap.",
    ),
    Kind(
        name="nothing-covered",
        title="no texel covered",
        unit=MESHES,
        light="error",
        problem="Its coordinates cover the center of no texel: all have no area, lie outside the "
        "tile or are smaller than texels.",
        remedy="Make new ones with: texbake unwrap.",
    ),
    Kind(
        name="outside-tile",
        title="coordinates outside the tile",
        light="error",
        problem="What lies outside the unit square is not baked.",
        remedy="Move the charts into the square; bake tiles one by one, each moved to it.",
    ),
    Kind(
        name="overlapping-coordinates",
        title="overlapping coordinates",
        light="error",
        problem="Faces share texels, and each texel keeps what the first of them bakes; the others "
        "show its detail.{unsure}",
        remedy="Lay the charts apart (texbake unwrap), or move copies that are meant to share by a "
        "whole tile before the bake.",
    ),
    Kind(
        name="shared-coordinates",
        title="groups that share the texture",
        light="warning",
        problem="Faces share texels with faces of other groups, and with none of their own. That "
        "is as it should be where each group has a texture of its own, and an overlap where all "
        "are in one.",
        remedy="Bake with --texture-sets, or lay the groups apart (texbake unwrap).",
    ),
    Kind(
        name="mirrored-coordinates",
        title="mirrored coordinates",
        light="warning",
        problem="They run clockwise in the texture: text reads backwards, and programs that leave "
        "out the sign of the bitangent light the detail from the wrong side.",
        remedy="Flip the charts, if mirroring is not meant.",
    ),
    Kind(
        name="collapsed-coordinates",
        title="coordinates without area",
        light="warning",
        problem="They have area in space and none in the texture: no texel is theirs, and no "
        "tangent can be computed.",
        remedy="Unwrap these faces again.",
    ),
)

_TEXELS = (
    Kind(
        name="thin-charts",
        title="charts thinner than the padding",
        unit=CHARTS,
        light="warning",
        problem="They are less than {padding} texels wide at this size, {least:.2g} the thinnest: "
        "more of what filtering reads of them is padding than chart, and they vanish in the first "
        "mip levels.",
        remedy="Join them to their neighbors, or use a larger texture.",
    ),
    Kind(
        name="close-charts",
        title="charts closer than the padding",
        unit=("pair", "pairs"),
        light="warning",
        problem="The padding of two charts meets on {texels:,} texels: one chart's color bleeds "
        "into the other in the smaller mip levels.",
        remedy="Pack with more room (texbake unwrap --padding {padding}), or bake with less.",
    ),
    Kind(
        name="faces-without-texel",
        title="faces without a texel",
        light="note",
        problem="They cover the center of no texel at this size, so that they show what their "
        "neighbors bake.",
        remedy="Use a larger texture, or fewer faces where they are this small.",
    ),
    Kind(
        name="low-texel-density",
        title="low texel density",
        light="warning",
        problem="They get {least:.3g} texels a model unit where it is worst, and the mesh "
        "{mean:.3g} in the mean: detail is blurred there, along one direction at least.",
        remedy="Unwrap again so that charts keep their size (texbake unwrap --max-stretch 1.2).",
    ),
)

_PAIR = (
    Kind(
        name="differing-scale",
        title="meshes of differing scale",
        unit=MESHES,
        light="error",
        problem="The dense mesh is {ratio:.4g} times as large as the light one: rays do not reach "
        "it.",
        remedy="Scale the light mesh by {ratio:.4g}, or export both in one unit.",
    ),
    Kind(
        name="differing-place",
        title="meshes in differing places",
        unit=MESHES,
        light="error",
        problem="The middles of the two meshes lie {way} apart: rays do not reach the dense one.",
        remedy="Move the light mesh by {offset}, or export both from one scene.",
    ),
    Kind(
        name="differing-axes",
        title="meshes turned apart",
        unit=MESHES,
        light="error",
        problem="They agree if in the light mesh {axes}: one of them is lying down or turned.",
        remedy="Export both with the same axis up.",
    ),
    Kind(
        name="far-from-dense",
        title="light faces far from the dense mesh",
        light="warning",
        problem="No dense surface lies within {percent:g} % of the size, the farthest {most:.3g} "
        "model units away: rays miss there, or are made so long that they hit other parts.{part}",
        remedy="Remove what the dense mesh does not have, or fit the light mesh to it.",
    ),
    Kind(
        name="far-from-light",
        title="dense faces far from the light mesh",
        dense="warning",
        problem="No light surface lies within {percent:g} % of the size, the farthest {most:.3g} "
        "model units away: this detail is lost, or rays must start beyond neighboring parts to "
        "reach it.{part}",
        remedy="Give the light mesh a face there, or leave these parts out of the dense one.",
    ),
    Kind(
        name="thin-walls",
        title="walls thinner than rays reach",
        light="note",
        problem="Rays end {reach:.3g} model units behind the surface, and the thinnest of these "
        "walls is {least:.3g} thick: a ray that misses its own side goes on through the other, and "
        "takes that where back faces are not culled, or what lies beyond.{part}",
        remedy="Bake with a --back below the thickness, or leave back faces culled.",
    ),
    Kind(
        name="other-parts",
        title="rays that find another part",
        light="warning",
        problem="At the middle of these faces the ray finds the dense surface beyond another part "
        "of the light mesh, {least:.3g} model units away where it is nearest; it starts "
        "{reach:.3g} outside: the wrong part is baked.{part}",
        remedy="Bake with a --front below that distance, with a cage, or with the parts moved "
        "apart in both meshes.",
    ),
    Kind(
        name="opposite-sides",
        title="meshes that face opposite ways",
        light="error",
        problem="Most of the light mesh faces against the dense surface next to it: rays pass "
        "through what they should hit.",
        remedy="Flip the faces of the mesh that is inside out.",
    ),
    Kind(
        name="dense-is-coarser",
        title="dense mesh coarser than the light one",
        unit=MESHES,
        dense="warning",
        problem="It has {dense:,} faces and the light one {light:,}: there is no detail to carry "
        "over.",
        remedy="Name the dense mesh first: texbake check HIGH LOW.",
    ),
    Kind(
        name="detail-below-texels",
        title="detail finer than texels",
        unit=MESHES,
        dense="warning",
        problem="There are {per_texel:.1f} dense faces to a texel at this size: one ray a texel "
        "takes one of them by chance.",
        remedy="Bake at {size} texels a side, or with --samples 16.",
    ),
)

KINDS = {
    kind.name: kind for kind in (*_FILES, *_COORDINATES, *_TEXELS, *_PAIR, *_SURFACE, *_SHADING)
}
