"""Every kind of finding: its name, what it does to a bake, and what to do about it.

One table, read by the checks, the command line and the documentation.
"""

from __future__ import annotations

from texbake.checks.finding import CHARTS, EDGES, MESHES, VERTICES, Kind
from texbake.checks.pair_kinds import PAIR_KINDS

_FILES = (
    Kind(
        name="unreadable",
        title="not a mesh",
        unit=("file", "files"),
        low="error",
        high="error",
        problem="{message}.",
        remedy="Export it again. Nothing else in this file was checked.",
    ),
)

_SURFACE = (
    Kind(
        name="no-surface",
        title="no surface",
        unit=MESHES,
        low="error",
        high="error",
        problem="No face has any area: no ray starts from this mesh, and none hits it.",
        remedy="Export it again. Its points lie on lines, or all in one place.",
    ),
    Kind(
        name="zero-area-faces",
        title="faces without area",
        low="warning",
        high="note",
        problem="They have no normal: rays from them have no direction, and no ray can hit them.",
        remedy="Remove them: texbake repair. Or merge the vertices that make them so thin.",
    ),
    Kind(
        name="duplicate-faces",
        title="duplicate faces",
        low="warning",
        high="note",
        problem="They repeat the three vertices of an earlier face. Which of the two is baked, hit "
        "or drawn depends on the order of the faces.",
        remedy="Remove one of each pair: texbake repair. To draw a surface from both sides, "
        "show back faces.",
    ),
    Kind(
        name="duplicate-vertices",
        title="duplicate vertices",
        unit=VERTICES,
        low="note",
        high="note",
        problem="They repeat an earlier vertex with all its attributes. texbake treats them as one "
        "vertex; other programs may shade a crease there or open a gap.",
        remedy="Merge them: texbake repair. Where groups or materials meet, GLB files repeat "
        "vertices all the same, and programs that read them expect that.",
    ),
    Kind(
        name="unused-vertices",
        title="unused vertices",
        unit=VERTICES,
        low="note",
        high="note",
        problem="No face uses them. texbake ignores them; in other programs they may enlarge the "
        "bounding box.",
        remedy="Remove them: texbake repair.",
    ),
    Kind(
        name="non-manifold-edges",
        title="non-manifold edges",
        unit=EDGES,
        low="warning",
        high="note",
        problem="More than two faces share each of these edges. Normals are averaged over sheets "
        "that do not belong together, so rays lean the wrong way, and charts end there.",
        remedy="Separate the sheets, delete faces inside the model, or wrap it in a new surface: "
        "texbake remesh.",
    ),
    Kind(
        name="pinched-vertices",
        title="pinched vertices",
        unit=VERTICES,
        low="warning",
        high="note",
        problem="Several fans of faces touch in a single vertex (a bow tie). Its normal is the "
        "mean of all of them and fits none.",
        remedy="Split the vertex, and move the parts of the mesh slightly apart; or wrap it in a "
        "new surface: texbake remesh.",
    ),
    Kind(
        name="cracks",
        title="cracks",
        unit=VERTICES,
        low="warning",
        high="warning",
        problem="Vertices of open edges lie almost at the same place, within a millionth of the "
        "size of the mesh, but not exactly. Rays slip through, and the shading shows a crease.",
        remedy="Merge vertices by distance ({distance:.2g} model units), or wrap the mesh in a new "
        "surface: texbake remesh.",
    ),
    Kind(
        name="self-intersections",
        title="self-intersections",
        low="warning",
        high="note",
        problem="Face {one} passes through face {other}, for example. On a low-poly mesh, the part "
        "inside the model takes up texels that nobody sees, and rays that start inside it hit the "
        "surface of the other part. On a high-poly mesh, the part inside is never hit.{unsure}",
        remedy="Cut the parts along their intersection, bake them separately, as groups, or wrap "
        "them in one surface: texbake remesh.",
    ),
    Kind(
        name="undecided-intersections",
        title="possible self-intersections",
        low="note",
        high="note",
        problem="So many other faces lie near these that the search for intersections was stopped. "
        "Everywhere else no face passes through another.",
        remedy="Split long or large faces that span detailed regions, or check the parts of the "
        "mesh one at a time.",
    ),
    Kind(
        name="inconsistent-winding",
        title="inconsistent winding",
        unit=EDGES,
        low="error",
        high="error",
        problem="The two faces at each of these edges disagree about which side is outside. "
        "Flipped faces of a low-poly mesh cast rays the wrong way; rays pass through flipped faces "
        "of a high-poly mesh.",
        remedy="Flip the minority, which are the faces named: texbake repair.",
    ),
    Kind(
        name="inside-out-shells",
        title="inside-out shells",
        unit=("shell", "shells"),
        low="error",
        high="error",
        problem="The faces of a closed shell point inward. Rays from a low-poly mesh go the wrong "
        "way; rays pass through such a shell of a high-poly mesh.",
        remedy="Turn the shell over: texbake repair.",
    ),
    Kind(
        name="far-from-origin",
        title="far from the origin",
        unit=MESHES,
        low="warning",
        high="warning",
        problem="It lies {times:,.0f} times its own size away from the origin. File formats and "
        "programs with 32-bit floats round its vertices to steps of {step:.2g} of its size.",
        remedy="Move both meshes to the origin, by the same offset: texbake transform --move.",
    ),
    Kind(
        name="extreme-size",
        title="extreme size",
        unit=MESHES,
        low="note",
        high="note",
        problem="It is {size:.3g} model units across. texbake works at any size, but programs that "
        "treat lengths below 1e-6 as zero or store distances in 16 bits do not.",
        remedy="Choose a unit of length in which it is about 1 across: texbake transform --scale.",
    ),
    Kind(
        name="unmeasurable-size",
        title="size that cannot be computed with",
        unit=MESHES,
        low="error",
        high="error",
        problem="It is {length:.3g} model units long and extends up to {farthest:.3g} from the "
        "origin, so its areas cannot be computed.",
        remedy="Scale it first: texbake transform --scale.",
    ),
)

_SHADING = (
    Kind(
        name="no-normals",
        title="no normals",
        unit=MESHES,
        low="note",
        high="note",
        problem="The file has no normals, so smooth ones are computed, weighted by angle. A "
        "low-poly mesh that is drawn elsewhere with other normals shows seams; hard edges of a "
        "high-poly mesh become round.",
        remedy="Export the mesh with the normals that it will be drawn with, or make some: texbake "
        "transform --normals angle.",
    ),
    Kind(
        name="zero-normals",
        title="normals of length zero",
        low="warning",
        high="warning",
        problem="A corner has a normal without a direction. texbake replaces it by the smooth "
        "normal; other programs may draw black or NaN.",
        remedy="Recalculate the normals before you export.",
    ),
    Kind(
        name="turned-normals",
        title="normals that point backward",
        low="warning",
        high="warning",
        problem="A corner's normal points to the back of its face. The face is lit from the wrong "
        "side, and rays along vertex normals (`rays=vertex`) go the wrong way.",
        remedy="Recalculate the normals, or flip the face if the normals are right.",
    ),
    Kind(
        name="hard-edges-without-seam",
        title="hard edges without a seam",
        unit=EDGES,
        low="warning",
        problem="The shading has a hard edge here, but the texture continues across it. Filtering "
        "mixes the two sides, and a line shows along the edge.",
        remedy="Cut there (texbake unwrap --seams-at-hard-edges), or make the edges smooth.",
    ),
    Kind(
        name="other-diagonals",
        title="curved polygons that other programs may triangulate differently",
        low="note",
        problem="texbake splits polygons along the shorter diagonal, and bakes maps for these "
        "triangles. Programs that split polygons from the first corner use other triangles, and "
        "their shading with the normal map is wrong there.",
        remedy="Triangulate the mesh: texbake export, or texbake convert to a .glb file.",
    ),
)

_COORDINATES = (
    Kind(
        name="no-coordinates",
        title="no texture coordinates",
        unit=MESHES,
        low="error",
        problem="Without texture coordinates nothing can be baked to this mesh.",
        remedy="Unwrap it: texbake unwrap.",
    ),
    Kind(
        name="nothing-covered",
        title="no texel covered",
        unit=MESHES,
        low="error",
        problem="Its texture coordinates cover the center of no texel: the faces have no area "
        "there, lie outside the UV tile or are smaller than texels.",
        remedy="Unwrap it again: texbake unwrap.",
    ),
    Kind(
        name="outside-tile",
        title="coordinates outside the UV tile",
        low="error",
        problem="Only what lies inside the unit square is baked.",
        remedy="Move the charts into the unit square, or unwrap it again: texbake unwrap. "
        "To bake all tiles of a UDIM layout, put the tile into the names of the maps: texbake bake "
        "--name-pattern.",
    ),
    Kind(
        name="overlapping-coordinates",
        title="overlapping coordinates",
        low="error",
        problem="Faces share texels. Each texel is baked from the first of them, and the others "
        "show detail that is not theirs.{unsure}",
        remedy="Separate the charts: texbake unwrap. Islands that are meant to share texels must "
        "coincide completely. To accept the overlap: texbake check --allow "
        "overlapping-coordinates.",
    ),
    Kind(
        name="shared-coordinates",
        title="groups that share the texture",
        low="warning",
        problem="Faces share texels with faces of other groups, but with none of their own group. "
        "That is correct where each group has its own texture, and an overlap where all groups "
        "share one.",
        remedy="Bake with `texture_sets`, or separate the groups (texbake unwrap).",
    ),
    Kind(
        name="stacked-coordinates",
        title="stacked islands",
        unit=("island", "islands"),
        low="note",
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
        low="warning",
        problem="These faces run clockwise in the texture: text reads backward, and programs that "
        "ignore the sign of the bitangent shade the detail as if lit from the wrong side.",
        remedy="Unwrap it again, unless they are mirrored on purpose: texbake unwrap.",
    ),
    Kind(
        name="collapsed-coordinates",
        title="coordinates without area",
        low="warning",
        problem="These faces have an area in space but none in the texture: they own no texel, and "
        "no tangent can be computed.",
        remedy="Unwrap it again: texbake unwrap.",
    ),
)

_TEXELS = (
    Kind(
        name="thin-charts",
        title="charts thinner than the padding",
        unit=CHARTS,
        low="warning",
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
        low="warning",
        problem="The padding of two charts meets on {texels:,} texels. In the smaller mip levels, "
        "the color of one chart bleeds into the other.",
        remedy="Pack the charts with more room (texbake unwrap --padding {padding}), or bake with "
        "less padding.",
    ),
    Kind(
        name="faces-without-texel",
        title="faces without a texel",
        low="note",
        problem="At this texture size they cover the center of no texel, so they show what is "
        "baked for their neighbors.",
        remedy="Use a larger texture, or fewer faces: texbake simplify.",
    ),
    Kind(
        name="low-texel-density",
        title="low texel density",
        low="warning",
        problem="The worst of them get {least:.3g} texels per model unit, while the mean of the "
        "mesh is {mean:.3g}. Detail is blurred there, in one direction at least.",
        remedy="Unwrap again so that charts keep their size (texbake unwrap --max-stretch 1.2).",
    ),
)

KINDS = {
    kind.name: kind
    for kind in (*_FILES, *_COORDINATES, *_TEXELS, *PAIR_KINDS, *_SURFACE, *_SHADING)
}
