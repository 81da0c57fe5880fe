"""A model made smaller: fewer triangles and bytes of images, all channels of its materials.

Texture coordinates that are an atlas stay, and so do the images; a model without one is unwrapped:

    model ─ simplify ─┬──────────► bake normals ───────┬─ encode images ─► one GLB file
                      └─ unwrap ─► bake every channel ─┘

With a target size or a least PSNR, this is repeated for several numbers of triangles; see `Budget`.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from texbake.baking.report import BakeReport
from texbake.errors import FileFormatError, OptionError, counted
from texbake.files import PathLike, written_file
from texbake.jobs.light_budget import Budget
from texbake.jobs.light_images import Picture, coded, coded_pictures, with_files
from texbake.jobs.light_models import LightModel, Source
from texbake.jobs.lighten_options import LightenOptions
from texbake.jobs.material_transfer import compared_without, left_out
from texbake.jobs.mesh_output import MeshFileMaterials, bare_materials
from texbake.jobs.outputs import JobResult, present_paths
from texbake.mapping.unwrap import UnwrapReport
from texbake.mesh.files import read_mesh
from texbake.mesh.files.contents import model_bytes
from texbake.mesh.files.gltf_compression import require_compression
from texbake.mesh.files.source import parsed_once
from texbake.mesh.materials import Materials
from texbake.mesh.mesh import Mesh
from texbake.mesh.rig import read_rig
from texbake.mesh.simplify import SimplifyReport
from texbake.progress import Progress, StageRecord, Stages
from texbake.records import dataclass
from texbake.rendering.compare_models import LARGE_PX, ModelComparison, compare_models, decibels
from texbake.rendering.options import RenderOptions
from texbake.texture.model_materials import model_materials

# Parts of a model, each drawn by itself: 12 large views of as many take about ten seconds.
_MOST_PARTS = 1000
# Triangles over the default number, and over all, above which the mesh stays.
_MOST_OF_DEFAULT, _MOST_OF_ALL = 2.0, 0.3
_NOT_COMPARED = (
    f"it has more than {_MOST_PARTS:,} parts, so its pictures are not compared with those of the "
    "result; use `html` to compare them anyway"
)


@dataclass(frozen=True, kw_only=True)
class LightenReport:
    """What `lighten` made of a model."""

    n_faces_before: int  # triangles
    n_faces: int
    n_bytes_before: int  # of the files: of the model with its buffers and images, and of the result
    n_bytes: int
    # what of the model led to new texture coordinates: "" if the options or the number of triangles
    # did, None if its own stay
    why_new_uvs: str | None
    has_uvs: bool  # whether the result has texture coordinates
    n_materials_before: int
    n_materials: int
    # width and height of the images that were baked; None without any
    size: tuple[int, int] | None
    images: tuple[str, ...]  # names of the images in the result
    simplified: SimplifyReport | None  # None if the model had few enough triangles
    unwrapped: UnwrapReport | None
    baked: BakeReport | None
    n_shared: int  # parts that share the texels of another
    stages: tuple[StageRecord, ...]
    comparison: ModelComparison | None = None  # in pictures; None without views
    # images of the model that are missing, and so left out of the pictures
    missing_images: tuple[str, ...] = ()

    @property
    def keeps_uvs(self) -> bool:
        """Whether the texture coordinates are those of the model."""
        return self.why_new_uvs is None

    def table(self) -> list[tuple[str, str]]:
        """Return rows of a label and a figure."""
        uvs = "of the model" if self.has_uvs else "none"
        if not self.keeps_uvs:
            uvs = f"new, because the model {self.why_new_uvs}" if self.why_new_uvs else "new"
        rows = [
            ("triangles", f"{self.n_faces_before:,} to {self.n_faces:,}"),
            ("materials", f"{self.n_materials_before:,} to {self.n_materials:,}"),
            (
                "size",
                f"{self.n_bytes_before:,} bytes to {self.n_bytes:,}, "
                f"{100.0 * self.n_bytes / max(self.n_bytes_before, 1):.1f} %",
            ),
            ("texture coordinates", uvs),
            ("images", ", ".join(self.images) or "none"),
        ]
        if self.size is not None:
            rows.append(("texels", "{} x {}".format(*self.size)))
        if (atlas := self.unwrapped) is not None:
            rows.append(("charts", f"{atlas.n_charts:,}, padding {atlas.options.padding}"))
        if self.n_shared:
            rows.append(("parts that share texels of others", f"{self.n_shared:,}"))
        if self.simplified is not None:
            distance = self.simplified.distance
            apart = (
                f"RMS {100 * distance.rms_relative:.3f} %, "
                f"greatest {100 * distance.max_relative:.3f} % of the diagonal"
            )
            rows.append(("distance of the surfaces", apart))
        if self.comparison is not None:
            mean, worst = decibels(self.comparison.mean_db), decibels(self.comparison.worst_db)
            without = " without missing images" if self.missing_images else ""
            label = f"PSNR in {counted(len(self.comparison.views), 'view')}{without}"
            rows.append((label, f"{mean}, worst {worst}"))
        return rows

    def to_json(self) -> dict[str, Any]:
        """Return every figure as plain values, for `json.dump`."""
        plain = ("n_faces", "n_bytes", "n_materials")
        return {
            **{name: getattr(self, name) for name in (*(f"{n}_before" for n in plain), *plain)},
            "keeps_uvs": self.keeps_uvs,
            "why_new_uvs": self.why_new_uvs,
            "size": None if self.size is None else list(self.size),
            "images": list(self.images),
            "n_shared": self.n_shared,
            "simplify": None if self.simplified is None else self.simplified.to_json(),
            "unwrap": None if self.unwrapped is None else self.unwrapped.to_json(),
            "bake": None if self.baked is None else self.baked.to_json(),
            "compare": None if self.comparison is None else _pictures(self.comparison),
            "missing_images": list(self.missing_images),
            "stages": [asdict(stage) for stage in self.stages],
        }


def _pictures(comparison: ModelComparison) -> dict[str, Any]:
    """Return the figures of pictures as plain values; null for equal ones."""
    return {
        "mean_db": comparison.mean_db,
        "worst_db": comparison.worst_db,
        "psnr_db": list(comparison.psnr_db),
        "views_deg": [list(view) for view in comparison.views],
        "notes": list(comparison.notes),
    }


def lighten(
    model: PathLike,
    output: PathLike,
    options: LightenOptions,
    html: PathLike | None,
    command: str,
    progress: Progress,
) -> JobResult[LightenReport]:
    """Write a lightened model, and a page of both if `html` is given."""
    if Path(output).suffix.lower() != ".glb":
        raise FileFormatError(f"{output}: a lightened model is one file with its images; use .glb")
    if html is not None and options.views == 0:
        raise OptionError("html, views: the page shows the views; ask for one view or more")
    if options.compress:
        require_compression()
    stages = Stages()
    with stages.part("read"), parsed_once():
        source = read_mesh(model, progress=progress)
        materials = _materials(model, source)
        rig = read_rig(model)
    seen = source
    notes: tuple[str, ...] = ()
    file = MeshFileMaterials(path=Path(model), materials=materials, rig=rig)
    if options.drop_hidden:
        with stages.part("find hidden parts"):
            seen, file, notes = file.without_hidden(source, threads=options.threads)
    whole = Source(seen, file.materials or materials, rig, options, stages, progress)
    n_bytes_before = model_bytes(model, _images(materials))
    light_model, written, comparison = _lightened(model, whole, output)
    with stages.part("write"):
        rig = whole.write(light_model, written, output)
    warnings = [*left_out(model, rig), *notes]
    n_parts = max(len(materials.materials), len(source.group_names))
    if comparison is not None:
        warnings += compared_without(model, materials)
    elif options.views and html is None and n_parts > _MOST_PARTS:
        warnings.append(f"{Path(model).name}: {_NOT_COMPARED}")
    elif options.views:
        warnings += compared_without(model, materials)
        with stages.part("compare"):
            comparison = compare_models(
                model, output, n_views=options.views, at_rest=True, threads=options.threads,
                progress=progress,
            )  # fmt: skip
    figures = LightenReport(
        n_faces_before=source.n_faces,
        n_faces=light_model.mesh.n_faces,
        n_bytes_before=n_bytes_before,
        n_bytes=written_file(output).stat().st_size,
        why_new_uvs=light_model.why_new_uvs,
        has_uvs=light_model.mesh.uvs is not None,
        n_materials_before=len(materials.materials),
        n_materials=len(written.materials),
        size=light_model.size,
        images=_image_names(written),
        simplified=light_model.simplified,
        unwrapped=light_model.unwrapped,
        baked=light_model.baked,
        n_shared=light_model.n_shared,
        comparison=comparison,
        missing_images=materials.missing_images,
        stages=tuple(stages.records),
    )
    lines = _once([*warnings, *_growth(model, output, figures), *light_model.warnings], comparison)
    done = JobResult(files=present_paths(output, html), report=figures, warnings=lines)
    if html is not None and comparison is not None:
        shown = _in_large_pictures(comparison, model, output, options, progress)
        _write_page(html, shown, done, command)
    return done


def _in_large_pictures(
    comparison: ModelComparison,
    model: PathLike,
    output: PathLike,
    options: LightenOptions,
    progress: Progress,
) -> ModelComparison:
    """Return a comparison with pictures for a page; those that are measured are smaller."""
    size = RenderOptions(width=LARGE_PX, height=LARGE_PX)
    large = compare_models(
        model, output, n_views=options.views, options=size,
        at_rest=True, threads=options.threads, progress=progress,
    )  # fmt: skip
    return replace(comparison, before=large.before, after=large.after)


def _growth(model: PathLike, output: PathLike, figures: LightenReport) -> list[str]:
    n, n_before = figures.n_bytes, figures.n_bytes_before
    line = f"{output}: {n:,} bytes, more than the {n_before:,} of {Path(model).name}"
    return [line] if n > n_before else []


def _lightened(
    model: PathLike, whole: Source, output: PathLike
) -> tuple[LightModel, Materials, ModelComparison | None]:
    """Return what `output` gets, with the files of its images; and its pictures, if drawn."""
    options = whole.options
    if options.target_bytes is not None:
        trial = Budget(model, whole, output).within(options.target_bytes)
    elif options.min_psnr is not None:
        trial = Budget(model, whole, output).reaching(options.min_psnr)
    else:
        light_model = _of_count(whole)
        with whole.stages.part("encode images"):
            return light_model, _coded(light_model, options), None
    return trial.light_model, trial.materials, trial.comparison if options.views else None


def _of_count(whole: Source) -> LightModel:
    """Return the model with as many triangles as asked for; with all if the default is too few."""
    made = whole.lightened(whole.n_faces)
    options, n, mesh = whole.options, whole.n_faces, whole.mesh
    if options.n_faces is not None or options.remesh != "never" or made.simplified is None:
        return made
    least = made.simplified.n_faces
    if least <= max(_MOST_OF_DEFAULT * n, _MOST_OF_ALL * mesh.n_faces):
        return made
    whole_model = whole.lightened(mesh.n_faces)
    why = f"the topology allows no fewer than {least:,}; `remesh` may allow {n:,}"
    note = f"{mesh.name}: all {mesh.n_faces:,} triangles stay, because {why}"
    return replace(whole_model, warnings=(*whole_model.warnings, note))


def _coded(light_model: LightModel, options: LightenOptions) -> Materials:
    """Return the materials of a model with the files of their images."""
    side = max(options.sides)

    def code(picture: Picture) -> bytes:
        return coded(picture, options.images, quality=options.image_quality, side=side)

    files = coded_pictures(light_model.pictures, code, threads=options.threads)
    return with_files(light_model.materials, files)


def _image_names(materials: Materials) -> tuple[str, ...]:
    images = (image for each in materials.materials for image in each.images)
    return tuple(dict.fromkeys(image.name.rpartition(": ")[2] for image in images))


def _images(materials: Materials) -> Iterable[bytes]:
    """Return the contents of the images of materials, each once."""
    images = (image for each in materials.materials for image in each.images)
    return {image.name: image.data for image in images}.values()


def _once(lines: list[str], comparison: ModelComparison | None) -> tuple[str, ...]:
    return tuple(dict.fromkeys([*lines, *(() if comparison is None else comparison.notes)]))


def _write_page(
    html: PathLike, comparison: ModelComparison, done: JobResult[LightenReport], command: str
) -> None:
    from texbake.pages.picture_pages import write_slider_page

    report = done.report
    write_slider_page(
        html,
        comparison,
        n_bytes=(report.n_bytes_before, report.n_bytes),
        figures=[*report.table(), ("time", f"{sum(s.seconds for s in report.stages):.2f} s")],
        warnings=done.warnings,
        command=command,
    )


def _materials(model: PathLike, mesh: Mesh) -> Materials:
    """Return the materials of a model; where it has none, what its format shows then."""
    found = model_materials(model, mesh, variants=True)
    return bare_materials(model, mesh) if found is None else found
