"""The mesh and the materials of a lightened model, before its images are coded.

Either the mesh keeps its texture coordinates, and each material its images; or it is unwrapped once
more, and every channel is baked into one set of images.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from texbake.baking.parts.high_parts import materials_of_faces
from texbake.errors import OptionError
from texbake.files import PathLike
from texbake.jobs.light_images import Picture, pictures_of
from texbake.jobs.lighten_options import LEAST_SIZE, MOST_SIZE, LightenOptions
from texbake.jobs.low_poly import LowPoly, LowPolyMaker, reaching
from texbake.jobs.mesh_output import MaterialSimplifier
from texbake.mapping.options import DEFAULT_PADDING, UnwrapOptions
from texbake.mapping.overlap import is_atlas, layout_notes
from texbake.mesh.compose import excerpt
from texbake.mesh.files.gltf_write import write_glb
from texbake.mesh.hard_edges import LowNormals, has_hard_edges, with_normals
from texbake.mesh.materials import Materials
from texbake.mesh.mesh import Mesh
from texbake.mesh.objects import joined_objects, one_group_a_node
from texbake.mesh.part_sizes import simplified_once
from texbake.mesh.repeated_parts import RepeatedParts
from texbake.mesh.rig import Rig, with_poses
from texbake.mesh.simplify import SimplifyReport, check_count
from texbake.mesh.triangle_tree import with_nearest_motion, with_source_normals
from texbake.progress import Progress, Stages
from texbake.raycast.orientation import oriented
from texbake.records import dataclass
from texbake.schema import Size

if TYPE_CHECKING:
    from texbake.baking.report import BakeReport
    from texbake.baking.result import BakeResult
    from texbake.mapping.unwrap import UnwrapReport

# Materials with images that `auto` keeps. More are slow to draw.
_MOST_TEXTURED = 8
_MOST_PAIRED = 64  # objects that are baked one by one
_UNSHARED = "none has the shape and look of another", "parts of the model move"
_SHARED = "copies share texels as before in coordinates that stay; for new ones, set `uvs` to new"
_OVERLAP = "has texture coordinates that overlap or leave the unit square"


@dataclass(frozen=True, kw_only=True, eq=False)
class LightModel:
    """A mesh with its materials, and what was done."""

    mesh: Mesh
    materials: Materials  # whose images have no files yet, or those of the source
    pictures: tuple[Picture, ...]  # of the images, by their names
    simplified: SimplifyReport | None
    warnings: tuple[str, ...]
    why_new_uvs: str | None = ""  # as in `LightenReport`
    size: tuple[int, int] | None = None
    unwrapped: UnwrapReport | None = None
    baked: BakeReport | None = None
    n_shared: int = 0  # parts that share the texels of another


@dataclass(frozen=True, eq=False)
class Source:
    """A model that is made lighter."""

    mesh: Mesh
    materials: Materials
    rig: Rig | None
    options: LightenOptions
    stages: Stages
    progress: Progress
    _known: dict[Hashable, Picture] = field(default_factory=dict)

    @property
    def n_faces(self) -> int:
        """Number of triangles to reach."""
        return self.options.target_faces(self.mesh.n_faces)

    def lightened(self, n_faces: int, *, is_trial: bool = False) -> LightModel:
        """Return the model with fewer triangles, as the options ask for texture coordinates.

        Trials may have more triangles; with `auto`, not `stack`, coordinates that overlap stay.
        """
        why = self._why_new_uvs()
        if self.options.uvs == "keep" and why:
            raise OptionError(f"uvs: {self.mesh.name} {why}; use new")
        if self._is_plain and self.mesh.n_faces <= n_faces:
            return self._with_kept_uvs(n_faces)
        if self.options.uvs == "new" or why:
            return replace(self._with_new_uvs(n_faces, is_trial=is_trial), why_new_uvs=why)
        is_auto = self.options.uvs == "auto"
        may_be_new = self.options.stack or not (is_trial or self.materials.variants)
        may_be_new &= is_auto and self.mesh.n_faces > n_faces
        if may_be_new and not is_atlas(self._of_first(self._instances)[1], self.options.threads):
            return replace(self._with_new_uvs(n_faces, is_trial=is_trial), why_new_uvs=_OVERLAP)
        kept = self._with_kept_uvs(n_faces, is_trial=is_trial)
        simplified = kept.simplified
        overlap = may_be_new and kept.baked is None and not self._normals_vary
        if simplified is None or (is_auto and simplified.is_close_to_count and not overlap):
            return kept
        if not is_auto:
            if self.options.n_faces is not None and not is_trial:
                n, more = simplified.n_faces, "request more, or use `uvs` new"
                check_count(n, n_faces, self.mesh.name, more, "texture coordinates, holes")
            return kept
        if self._many_images:
            note = f"{self.mesh.name}: its texture coordinates stay, because of its many variants"
            return replace(kept, warnings=(*kept.warnings, note))
        again = self._with_new_uvs(n_faces, is_trial=is_trial)
        least = f"do not allow fewer than {simplified.n_faces:,}"
        least = "would overlap with so few" if overlap else least
        note = f"{self.mesh.name}: its texture coordinates {least} triangles; it has new ones"
        return replace(again, warnings=(*again.warnings, note))

    def write(self, light_model: LightModel, materials: Materials, path: PathLike) -> Rig | None:
        """Write a lightened model; return the nodes of its file and what moves, if they stay."""
        options, rig, mesh = self.options, self.rig, light_model.mesh
        if options.join:
            mesh = mesh.replace(face_groups=None, group_names=(), group_objects=())
        if rig is not None and (options.join or not rig.fits(mesh)):
            rig = None
        # Programs that compute other tangents would shade the baked normal map differently.
        is_baked = light_model.baked is not None and any(materials.sources("normal"))
        write_glb(
            mesh, path, materials=materials, rig=rig, compress=options.compress,
            quantize=options.quantize, tangents=is_baked or self.mesh.tangents is not None,
            is_coarse=light_model.simplified is not None,
        )  # fmt: skip
        return rig

    @property
    def _is_plain(self) -> bool:
        """Whether the model has no images, and the options ask for none."""
        asked = self.options.uvs != "auto" or self.options.remesh != "never"
        return not (asked or any(item.images for item in self.materials.materials))

    def _why_new_uvs(self) -> str:
        """Why the texture coordinates cannot stay, or with `auto` should not; "" if they can."""
        textured = sum(item.has_images for item in self._shown.materials)
        can_lie = self.mesh.uvs is not None if self.materials.has_images else self._many_images
        if not can_lie:
            return "has no images that lie on its texture coordinates"
        if self.materials.image_uv_sets - {0}:
            return "has images on further texture coordinates"
        if self.options.remesh != "never":
            return "is wrapped in another surface, as `remesh` asks"
        is_auto = self.options.uvs == "auto"
        if is_auto and textured > _MOST_TEXTURED and not self._many_images:
            return f"has more than {_MOST_TEXTURED} materials with images"
        return ""

    @cached_property
    def _shown(self) -> Materials:
        """The materials without those of variants."""
        return self.materials.in_variant(None)

    @cached_property
    def _many_images(self) -> str:
        """Why images cannot be baked for all variants; "" if they can."""
        from texbake.jobs.baked_materials import many_images

        return many_images(self.materials, self.mesh.name)

    @property
    def _normals_vary(self) -> bool:
        """Whether variants have other normal maps."""
        sources = self.materials.sources("normal")
        tables = (table for _, table in self.materials.variants)
        return any([sources[i] for i in table] != sources for table in tables)

    @cached_property
    def _oriented(self) -> tuple[Mesh, LowNormals, tuple[str, ...]]:
        """The model with its poses, facing outwards; how its normals are made, and notes."""
        options = self.options
        source = with_poses(self.mesh, self.rig)
        source = joined_objects(source) if options.join_objects else source
        high, turned = oriented(source, options.orientation, threads=options.threads)
        rule = LowNormals(options.normals, options.angle)
        return rule.of_high(high, threads=options.threads), rule, turned.notes

    def _with_kept_uvs(self, n_faces: int, *, is_trial: bool = False) -> LightModel:
        from texbake.texture.material_images import gltf_images

        options, threads = self.options, self.options.threads
        source, report, repeated = self, None, None
        with self.stages.part("simplify"):
            high, rule, warnings = self._oriented
            low, materials = high, self.materials
            if high.n_faces > n_faces:
                repeated = self._instances
                source, high = self._of_first(repeated)
                once = make = self._simplifier.made
                if repeated is not None:
                    once = partial(simplified_once, repeated, make=make, threads=threads)
                low, report, materials = once(n_faces)
                warnings += (*report.notes, *layout_notes(low, high, threads=threads))
                if rule.choice == "auto" and low.normals is None:
                    if has_hard_edges(high, threads=threads):
                        low = with_normals(low, "angle", angle=rule.angle)
                    else:
                        low = with_source_normals(low, high, threads=threads)
            if rule.choice != "auto":
                low = with_normals(low, rule.choice, angle=rule.angle)
        materials, baked, size = materials.used(), None, None
        if report is not None and is_atlas(low, threads) and not self._normals_vary:
            low_poly, most = reaching(low, report), LEAST_SIZE if is_trial else MOST_SIZE
            with self.stages.part("bake"):
                materials, baked = source._with_baked_normals(high, low, low_poly, materials, most)
            size = baked.options.width_px, baked.options.height_px
            warnings = (*warnings, *baked.warnings)
        if repeated is not None:
            low, faces = repeated.restored(low)
            materials = materials.of_faces(faces)
        with self.stages.part("read images"):
            materials = gltf_images(materials, threads=threads)
            pictures = pictures_of(materials, self._known, threads=threads)
        if options.stack:
            why = _SHARED if pictures else "there are no images"
            warnings = (*warnings, f"{self.mesh.name}: `stack` changes nothing: {why}")
        return LightModel(
            mesh=low, materials=materials, pictures=pictures, simplified=report, why_new_uvs=None,
            warnings=(*warnings, *materials.notes()), size=size, baked=baked,
        )  # fmt: skip

    @cached_property
    def _simplifier(self) -> MaterialSimplifier:
        """Simplifies one part of each kind that is repeated."""
        source, high = self._of_first(self._instances)
        options = self.options
        return MaterialSimplifier(
            high, source.materials, options.quality, options.threads, self.progress
        )

    def _with_baked_normals(
        self, high: Mesh, low: Mesh, low_poly: LowPoly, materials: Materials, most: int
    ) -> tuple[Materials, BakeReport]:
        """Bake the shape that was simplified away onto texture coordinates that stay."""
        from texbake.baking.parts.bake_parts import bake_objects
        from texbake.jobs.baked_materials import with_normals_of
        from texbake.jobs.material_transfer import texture_size

        options = self.options
        size = options.size or texture_size(self._shown, LEAST_SIZE, most)
        chosen = low_poly.aimed(options.bake_options(("normal",), size, DEFAULT_PADDING))
        baked = bake_objects(
            high, low, chosen, pair=len(set(low.group_objects)) <= _MOST_PAIRED,
            materials=self._shown, progress=self.progress,
        )  # fmt: skip
        values, name = baked.maps["normal"].values, f"{Path(self.mesh.name).stem}_normal"
        materials = with_normals_of(materials, values, name, options.threads)
        # What meets there are charts that a person laid out.
        return materials, replace(baked.report, padding_meets=0)

    def _with_new_uvs(self, n_faces: int, *, is_trial: bool = False) -> LightModel:
        from texbake.baking.parts.bake_parts import bake_objects
        from texbake.jobs.baked_materials import MaterialBaker, needs_bake, unbaked_images
        from texbake.jobs.material_transfer import transferred_channels

        materials, options = self.materials, self.options
        if self._many_images:
            raise OptionError(self._many_images)
        with self.stages.part("simplify"):
            high, rule, notes = self._oriented
            repeated = self._repeated
            if options.stack and repeated is None:
                why = _UNSHARED[high.deformation is not None]
                notes = (*notes, f"{self.mesh.name}: no parts share texels: {why}")
            source, high = self._of_first(repeated)  # one of each kind of repeated parts
            low, low_poly = self._low_poly(high, rule, n_faces, is_trial)
            if low_poly is not None and _has_lost_edges(low, low_poly, rule, high):
                rule = replace(rule, choice="angle")
            low = rule.before_unwrap(low)
        simplified = None if low_poly is None else low_poly.report
        maps = transferred_channels(self._shown)
        if simplified is not None or any(materials.sources("normal")) or needs_bake(materials):
            maps = ("normal", *maps)
        made: dict[str, Any] = {}
        if low_poly is not None:
            notes = (*notes, *low_poly.why, *low_poly.report.notes)
        result = None
        if maps:  # else the shape is as it was, and every channel is one number
            low, result, made = source._baked(high, low, low_poly, rule, maps)
            notes = (*notes, *made.pop("warnings"), *result.report.warnings)

        def bake(maps: tuple[str, ...], of: Materials) -> BakeResult:
            assert result is not None
            are_few = len(set(low.group_objects)) <= _MOST_PAIRED
            chosen = replace(result.report.options, maps=maps)
            with self.stages.part("bake"):
                return bake_objects(high, low, chosen, pair=are_few, materials=of)

        baker = MaterialBaker(
            low=low, high=high, materials=source.materials, name=Path(self.mesh.name).stem,
            bake=bake, has_normals=simplified is not None, threads=options.threads,
        )  # fmt: skip
        shared = baker.baked({} if result is None else result.maps)
        notes = (*notes, *unbaked_images(materials))
        if repeated is not None:
            made["n_shared"] = repeated.left_in(low).n_shared
            low, faces = repeated.restored(low)
            shared = shared.of_faces(faces)
        return LightModel(
            mesh=low, materials=shared, pictures=tuple(baker.pictures), simplified=simplified,
            warnings=notes, **made,
        )  # fmt: skip

    @cached_property
    def _instances(self) -> RepeatedParts | None:
        """The objects that are the same in the spaces of their nodes."""
        if self.options.remesh != "never":  # its surface is another one
            return None
        return RepeatedParts.instances(self._oriented[0], self.materials, self.rig)

    @cached_property
    def _repeated(self) -> RepeatedParts | None:
        """The parts that share texels in new coordinates."""
        high, *_ = self._oriented
        found = RepeatedParts.among(high, self.materials) if self.options.stack else None
        return found or self._instances

    def _of_first(self, repeated: RepeatedParts | None) -> tuple[Source, Mesh]:
        """Return the model with one part of each kind that is repeated, and its mesh."""
        if repeated is None:
            return self, self._oriented[0]
        high, is_first = repeated.mesh, repeated.is_first
        materials = materials_of_faces(self.materials, high, is_first)
        return replace(self, materials=materials), excerpt(high, is_first)

    def _baked(
        self, high: Mesh, low: Mesh, low_poly: LowPoly | None, rule: LowNormals,
        maps: Sequence[str],
    ) -> tuple[Mesh, Any, dict[str, Any]]:  # fmt: skip
        """Unwrap a mesh and bake its maps; return both, and fields of what was done."""
        from texbake.baking.parts.bake_parts import bake_objects
        from texbake.baking.result import check_texels
        from texbake.jobs.fit import with_diagnosis
        from texbake.jobs.fitting_atlas import unwrap_to_fit
        from texbake.jobs.material_transfer import texture_size

        options = self.options
        size: Size = options.size or texture_size(self._shown, LEAST_SIZE, MOST_SIZE)
        with self.stages.part("unwrap"):
            chosen = UnwrapOptions(size=size, padding=options.padding, seams_at_hard_edges=True)
            low, unwrapped, notes = unwrap_to_fit(
                low, chosen, may_grow=options.size is None, threads=options.threads,
                progress=self.progress,
            )  # fmt: skip
            low = rule.after_unwrap(low)
        atlas = unwrapped.options
        with self.stages.part("bake"):
            how = options.bake_options(tuple(maps), atlas.size, atlas.padding)
            how = how if low_poly is None else low_poly.aimed(how)
            if rule.choice != options.normals:  # it lost its hard edges
                how = replace(how, rays="vertex")
            # Each object of few is baked from itself; of many, all from all, which takes less time.
            are_few = len(set(low.group_objects)) <= _MOST_PAIRED
            baked = bake_objects(
                high, low, how, pair=are_few, materials=self._shown, progress=self.progress
            )
            if how.front is None and are_few:  # otherwise they miss what fills the tunnels
                baked = with_diagnosis(high, low, baked, join_objects=options.join_objects)
            check_texels(low, baked)
        figures = {
            "size": (how.width_px, how.height_px),
            "unwrapped": unwrapped,
            "baked": baked.report,
            "warnings": notes,
        }
        return low, baked, figures

    def _low_poly(
        self, high: Mesh, rule: LowNormals, n_faces: int, is_trial: bool
    ) -> tuple[Mesh, LowPoly | None]:
        """Return the mesh that gets the maps; and how it was made, if it has fewer triangles."""
        options = self.options
        # Of the attributes only hard edges and objects matter: all others are baked.
        bare = one_group_a_node(high)
        bare = bare.replace(uvs=None, uv_faces=None, tangents=None, colors=None)
        if options.remesh != "always" and self.mesh.n_faces <= n_faces:
            return bare, None
        maker = LowPolyMaker(
            high=bare, rule=rule, n_faces=n_faces, quality=options.quality, by_parts=True,
            repeated=self._repeated, threads=options.threads, progress=self.progress,
        )  # fmt: skip
        must_reach = options.n_faces is not None and not is_trial
        low_poly = maker.make(options.remesh, must_reach=must_reach)
        return with_nearest_motion(low_poly.mesh, high, options.threads), low_poly


def _has_lost_edges(low: Mesh, low_poly: LowPoly, rule: LowNormals, high: Mesh) -> bool:
    """Whether smooth normals of a low-poly mesh would see other sides of thin parts."""
    is_smooth = rule.choice == "auto" and low.normals is None and not low_poly.is_of_wrap
    return is_smooth and has_hard_edges(high)
