"""Every kind of finding: its name, what it does to a bake, what to do about it; options of a check.

One table, read by the checks, the command line and the documentation.
"""

from __future__ import annotations

from dataclasses import replace

from texbake.baking.options import PADDING_OPTION, BakeOptions
from texbake.checks.bake_kinds import (
    COORDINATE_KINDS,
    EDGES,
    MESHES,
    PAIR_KINDS,
    TEXEL_KINDS,
    VERTICES,
    Kind,
)
from texbake.errors import OptionError, quoted, similar
from texbake.mapping.options.shared import TextureOptions
from texbake.records import dataclass
from texbake.schema import THREADS_OPTION, Size, option, option_of
from texbake.targets import PROGRAMS

_FILES = (
    Kind(
        name="unreadable",
        title="not a mesh",
        unit=("file", "files"),
        severity="error",
        problem="{message}.",
        remedy="Export it again. Nothing else in this file was checked.",
    ),
)

_SURFACE = (
    Kind(
        name="no-surface",
        title="no surface",
        unit=MESHES,
        severity="error",
        problem="No face has any area: no ray starts from this mesh, and none hits it.",
        remedy="Export it again. Its points lie on lines, or all in one place.",
    ),
    Kind(
        name="zero-area-faces",
        title="faces without area",
        severity="warning",
        in_high="note",
        problem="They have no normal: rays from them have no direction, and no ray can hit them.",
        remedy="Remove them: texbake repair. Or merge the vertices that make them so thin.",
    ),
    Kind(
        name="duplicate-faces",
        title="duplicate faces",
        severity="warning",
        in_high="note",
        problem="They repeat the three vertices of an earlier face. Which of the two is baked, hit "
        "or drawn depends on the order of the faces.",
        remedy="Remove one of each pair: texbake repair. To draw a surface from both sides, "
        "show back faces.",
    ),
    Kind(
        name="duplicate-vertices",
        title="duplicate vertices",
        unit=VERTICES,
        severity="note",
        problem="They repeat an earlier vertex with all its attributes. texbake treats them as one "
        "vertex; other programs may shade a crease there or open a gap.",
        remedy="Merge them: texbake repair. Where groups or materials meet, GLB files repeat "
        "vertices all the same, and programs that read them expect that.",
    ),
    Kind(
        name="unused-vertices",
        title="unused vertices",
        unit=VERTICES,
        severity="note",
        problem="No face uses them. texbake ignores them; in other programs they may enlarge the "
        "bounding box.",
        remedy="Remove them: texbake repair.",
    ),
    Kind(
        name="non-manifold-edges",
        title="non-manifold edges",
        unit=EDGES,
        severity="warning",
        in_high="note",
        problem="More than two faces share each of these edges. Normals are averaged over sheets "
        "that do not belong together, so rays lean the wrong way, and charts end there.",
        remedy="Separate the sheets, delete faces inside the model, or wrap it in a new surface: "
        "texbake remesh.",
    ),
    Kind(
        name="pinched-vertices",
        title="pinched vertices",
        unit=VERTICES,
        severity="warning",
        in_high="note",
        problem="Several fans of faces touch in a single vertex (a bow tie). Its normal is the "
        "mean of all of them and fits none.",
        remedy="Split the vertex, and move the parts of the mesh slightly apart; or wrap it in a "
        "new surface: texbake remesh.",
    ),
    Kind(
        name="cracks",
        title="cracks",
        unit=VERTICES,
        severity="warning",
        problem="Vertices of open edges lie almost at the same place, within a millionth of the "
        "size of the mesh, but not exactly. Rays slip through, and the shading shows a crease.",
        remedy="Merge vertices by distance ({distance:.2g} model units), or wrap the mesh in a new "
        "surface: texbake remesh.",
    ),
    Kind(
        name="self-intersections",
        title="self-intersections",
        severity="warning",
        in_high="note",
        problem="Face {one} passes through face {other}, for example. On a low-poly mesh, the part "
        "inside the model takes up texels that nobody sees, and rays that start inside it hit the "
        "surface of the other part. On a high-poly mesh, the part inside is never hit.{unsure}",
        remedy="Cut the parts along their intersection, bake them separately, as groups, or wrap "
        "them in one surface: texbake remesh.",
    ),
    Kind(
        name="undecided-intersections",
        title="possible self-intersections",
        severity="note",
        problem="So many other faces lie near these that the search for intersections was stopped. "
        "Everywhere else no face passes through another.",
        remedy="Split long or large faces that span detailed regions, or check the parts of the "
        "mesh one at a time.",
    ),
    Kind(
        name="inconsistent-winding",
        title="inconsistent winding",
        unit=EDGES,
        severity="error",
        problem="The two faces at each of these edges disagree about which side is outside. "
        "Flipped faces of a low-poly mesh cast rays the wrong way; rays pass through flipped faces "
        "of a high-poly mesh.",
        remedy="Flip the minority, which are the faces named: texbake repair.",
    ),
    Kind(
        name="inside-out-shells",
        title="inside-out shells",
        unit=("shell", "shells"),
        severity="error",
        problem="The faces of a closed shell point inward. Rays from a low-poly mesh go the wrong "
        "way; rays pass through such a shell of a high-poly mesh.",
        remedy="Flip the shell: texbake repair.",
    ),
    Kind(
        name="far-from-origin",
        title="far from the origin",
        unit=MESHES,
        severity="warning",
        problem="It lies {times:,.0f} times its own size away from the origin. File formats and "
        "programs with 32-bit floats round its vertices to steps of {step:.2g} of its size.",
        remedy="Move both meshes to the origin, by the same offset: texbake transform --move.",
    ),
    Kind(
        name="extreme-size",
        title="extreme size",
        unit=MESHES,
        severity="note",
        problem="It is {size:.3g} model units across. texbake works at any size, but programs that "
        "treat lengths below 1e-6 as zero or store distances in 16 bits do not.",
        remedy="Choose a unit of length in which it is about 1 across: texbake transform --scale.",
    ),
    Kind(
        name="unmeasurable-size",
        title="size that cannot be computed with",
        unit=MESHES,
        severity="error",
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
        severity="note",
        problem="The file has no normals, so smooth ones are computed, weighted by angle. A "
        "low-poly mesh that is drawn elsewhere with other normals shows seams; hard edges of a "
        "high-poly mesh become round.",
        remedy="Export the mesh with the normals that it will be drawn with, or make some: texbake "
        "transform --normals angle.",
    ),
    Kind(
        name="zero-normals",
        title="normals of length zero",
        severity="warning",
        problem="A corner has a normal without a direction. texbake replaces it by the smooth "
        "normal; other programs may draw black or NaN.",
        remedy="Recalculate the normals before you export.",
    ),
    Kind(
        name="turned-normals",
        title="normals that point backward",
        severity="warning",
        problem="A corner's normal points to the back of its face. The face is lit from the wrong "
        "side, and rays along vertex normals (`rays=vertex`) go the wrong way.",
        remedy="Recalculate the normals, or flip the face if the normals are right.",
    ),
    Kind(
        name="hard-edges-without-seam",
        title="hard edges without a seam",
        unit=EDGES,
        severity="warning",
        problem="The shading has a hard edge here, but the texture continues across it. Filtering "
        "mixes the two sides, and a line shows along the edge.",
        remedy="Cut there (texbake unwrap --seams-at-hard-edges), or make the edges smooth.",
    ),
    Kind(
        name="other-diagonals",
        title="curved polygons that other programs may triangulate differently",
        severity="note",
        problem="texbake splits polygons along the shorter diagonal, and bakes maps for these "
        "triangles. Programs that split polygons from the first corner use other triangles, and "
        "their shading with the normal map is wrong there.",
        remedy="Triangulate the mesh: texbake export, or texbake convert to a .glb file.",
    ),
)

# With a profile only.
BUDGET_KINDS = (
    Kind(
        name="too-many-triangles",
        title="too many triangles",
        unit=("triangle", "triangles"),
        severity="error",
        problem="An asset for {title} should have at most {most:,} triangles.",
        remedy="Simplify it: texbake simplify --faces {most}. Or make an asset of it: texbake run.",
    ),
    Kind(
        name="unreadable-images",
        title="missing or unreadable images",
        unit=("image", "images"),
        severity="error",
        problem="{reasons}.",
        remedy="Export the mesh again with its images. Their size was not checked.",
    ),
    Kind(
        name="large-images",
        title="large images",
        unit=("image", "images"),
        severity="error",
        problem="Images are more than {most:,} texels wide or high: {names}.",
        remedy="Bake them smaller: texbake lighten --size {most}.",
    ),
    Kind(
        name="large-file",
        title="large file",
        unit=("file", "files"),
        severity="error",
        problem="With its images, the file has {size:.1f} MB. An asset for {title} should have at "
        "most {most:.1f} MB.",
        remedy="Make it smaller: texbake lighten.",
    ),
    Kind(
        name="few-texels-per-meter",
        title="few texels per meter",
        unit=MESHES,
        severity="warning",
        problem="With a texture of {width} x {height}, the surface has {density:.3g} texels per "
        "meter on average; fewer than {least:g} look blurred.",
        remedy="Bake a larger texture, or scale a mesh whose unit is not the meter: texbake "
        "transform --scale.",
    ),
)

KINDS = {
    kind.name: kind
    for kind in (
        *(*_FILES, *COORDINATE_KINDS, *TEXEL_KINDS, *PAIR_KINDS, *_SURFACE, *_SHADING),
        *BUDGET_KINDS,
    )
}


@dataclass(frozen=True, kw_only=True)
class CheckOptions(TextureOptions):
    """The bake that a check is made for.

    A profile sets `size` and `padding` when the object is made; to change the profile in a copy,
    make these fields None: ``replace(options, profile="unreal", size=None, padding=None)``.
    """

    profile: str | None = option(
        None,
        "Also check the limits of this program: triangles, image size, texels per meter and file "
        "size. The program also sets the defaults of size and padding.",
        choices=tuple(PROGRAMS),
        default="none",
    )
    size: Size = option(  # type: ignore[assignment]
        None,
        replace(
            option_of(TextureOptions, "size"), default=f"{TextureOptions.size}, or of the profile"
        ),
    )
    padding: int = option(  # type: ignore[assignment]
        None, replace(PADDING_OPTION, default=f"{BakeOptions.padding}, or of the profile")
    )
    min_texel_density: float | None = option(
        None,
        "Texels per model unit that every face must have in its most stretched direction.",
        metavar="D",
        above=0,
        unit="texels per model unit",
        default="a quarter of the mesh's mean",
    )
    allow: tuple[str, ...] = option(
        (),
        "Accept findings of this kind, such as mirrored-coordinates; they are listed, but do "
        "not fail the check; repeatable.",
        metavar="KIND",
        many=True,
    )
    threads: int | None = option(None, THREADS_OPTION)

    def __post_init__(self) -> None:
        super().__post_init__()
        target = None if self.profile is None else PROGRAMS[self.profile]
        size = TextureOptions.size if target is None else target.size
        padding = BakeOptions.padding if target is None else target.padding
        for name, value in (("size", size), ("padding", padding)):
            if getattr(self, name) is None:
                object.__setattr__(self, name, value)
        for name in self.allow:
            if name not in KINDS:
                known = similar(name, KINDS) or f"it is one of {', '.join(KINDS)}"
                raise OptionError(f"allow: {quoted(name)} is not a kind of finding; {known}")
