"""Pictures of a mesh, a glTF file or a scene: one, several side by side, or a turntable.

Several filters, interpolations or buffers give pictures of all their combinations, side by side in
one file.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from texbake.files import PathLike, make_folder, scratch_folder
from texbake.jobs.outputs import JobResult
from texbake.jobs.preview_scene import DefaultView
from texbake.progress import Progress, Stages
from texbake.records import dataclass
from texbake.rendering.camera import Camera
from texbake.rendering.draw import prepare
from texbake.rendering.effect import Plan
from texbake.rendering.maps import space_warnings
from texbake.rendering.options import RenderOptions
from texbake.rendering.plan import plan_report, plan_table
from texbake.rendering.render import draw_picture, plan_scene, render_scene
from texbake.rendering.resolve import Frame, expose
from texbake.rendering.results import Costs
from texbake.rendering.scene.scene import Scene, camera_of, turntable_cameras
from texbake.sampling.rounds import BudgetClock, with_actual_time
from texbake.texture.image import FloatImage, write_image

if TYPE_CHECKING:
    from texbake.rendering.compare_models import Contribution


@dataclass(frozen=True, kw_only=True, eq=False)
class PreviewFiles(JobResult[Frame | None]):
    """What `preview_files` drew; `report` is the first picture, or None where only planned."""

    plan: Plan  # which passes were chosen, and why
    contributions: tuple[Contribution, ...] = ()  # what each effect changes, if that was asked for
    # rows of `table` about what was chosen because no option or file set it
    chosen: tuple[tuple[str, str], ...] = ()

    @property
    def costs(self) -> Costs | None:
        """What each pass took; None where nothing was drawn."""
        return None if self.report is None else self.report.costs

    def table(self) -> list[tuple[str, str]]:
        """Return rows of what was chosen, and of what adaptive samples and a budget reached."""
        frame = self.report
        parts = () if frame is None else (frame.sampling, frame.budget, frame.texels)
        reached = [row for part in parts if part is not None for row in part.table()]
        return [*self.chosen, *reached]

    def plan_tables(self) -> tuple[list[tuple[str, ...]], list[tuple[str, ...]]]:
        """Return the passes with their reasons and costs, and what was left out and why."""
        rows, left_out = plan_table(self.plan, self.costs)
        return [*rows], [*left_out]

    def to_json(self) -> dict[str, Any]:
        """Return the plan, its costs, and what samples have reached, as plain values."""
        reached = {} if self.report is None else self.report.sampling_report()
        changes = [item.to_json() for item in self.contributions]
        changed = {"effects": changes} if changes else {}
        return plan_report(self.plan, self.costs) | reached | changed

    def contributions_table(self) -> list[tuple[str, ...]]:
        """Return rows of effects, the pixels that each changed, and what it cost."""
        rows = [("effect", "pixels changed", "%", "largest", "ms", "kB")]
        for item in self.contributions:
            pixels = f"{item.pixels:,}" if item.pixels else "changed nothing"
            rows.append(
                (item.name, pixels, f"{100.0 * item.share:.1f}", str(item.largest),
                 f"{item.milliseconds:,.1f}", f"{item.n_bytes / 1000:,.0f}")
            )  # fmt: skip
        return [*rows]


def draw_preview(
    view: DefaultView,
    variants: Sequence[tuple[str, RenderOptions]],
    output: PathLike | None,
    n_views: int | None,
    *,
    contributions: bool,
    normal_map: PathLike | None,
    space: str | None,
    threads: int | None,
    progress: Progress,
    clock: BudgetClock,
) -> PreviewFiles:
    """Draw a picture, several side by side, or a turntable; only plan it without an output."""
    frame = None
    options = variants[0][1]
    if output is not None and n_views is not None:
        frame = write_turntable(
            view.scene, options, n_views, output, threads=threads, progress=progress
        )
    elif output is not None:
        frame = _write_picture(view, variants, output, threads, progress, clock)
    changes: tuple[Contribution, ...] = ()
    if frame is not None and contributions:
        from texbake.rendering.compare_models import contributions_of

        changes = contributions_of(
            view.scene, options, frame, camera=view.camera, threads=threads, progress=progress
        )
    return PreviewFiles(
        files=(),
        report=frame,
        contributions=changes,
        plan=plan_scene(view.scene, options, camera=view.camera) if frame is None else frame.plan,
        chosen=() if frame is None or n_views is not None else tuple(view.table(frame)),
        warnings=(*space_warnings(normal_map, space), *_warnings(view, frame, n_views)),
    )


def _write_picture(
    view: DefaultView,
    variants: Sequence[tuple[str, RenderOptions]],
    output: PathLike,
    threads: int | None,
    progress: Progress,
    clock: BudgetClock,
) -> Frame:
    """Write one picture, or several side by side; return the first."""
    if len(variants) == 1:
        clock = replace(clock, finish=_WritingPicture(Path(output).suffix, threads))
        frame = render_scene(
            view.scene,
            variants[0][1],
            camera=view.camera,
            threads=threads,
            progress=progress,
            clock=clock,
        )
        frame.write(output, threads=threads)
        if frame.budget is not None:
            frame = replace(frame, budget=with_actual_time(frame.budget, clock))
        return frame
    color, frames = render_side_by_side(
        view.scene, variants, camera=view.camera, threads=threads, progress=progress
    )
    write_image(color, output, color=True, threads=threads)
    return frames[0]


@dataclass(frozen=True)
class _WritingPicture:
    """Writes a picture as it will be written, but to no purpose other than to time it."""

    suffix: str
    threads: int | None

    def __call__(self, color: FloatImage) -> None:
        with scratch_folder() as folder:
            path = folder / f"picture{self.suffix}"
            write_image(color, path, color=True, threads=self.threads)


def _warnings(view: DefaultView, frame: Frame | None, n_views: int | None) -> Iterator[str]:
    if frame is not None:
        yield from (f"{view.path}: {note}" for note in view.scene.notes)
        if n_views is None:
            yield from view.warnings(frame)
        for part in (frame.sampling, frame.budget):
            if part is not None:
                yield from part.warnings


def turntable_files(folder: PathLike, n_views: int) -> list[Path]:
    """Return the files of a turntable's pictures, in their order.

    >>> [file.name for file in turntable_files("frames", 2)]
    ['000.png', '001.png']
    """
    digits = max(3, len(str(n_views - 1)))
    return [Path(folder) / f"{index:0{digits}d}.png" for index in range(n_views)]


def write_turntable(
    scene: Scene,
    options: RenderOptions,
    n_views: int,
    folder: PathLike,
    *,
    threads: int | None = None,
    progress: Progress = None,
) -> Frame:
    """Draw one turn around the scene into a folder, as `000.png`, `001.png` and so on."""
    path = make_folder(folder)
    prepared = prepare(scene, replace(options, exposure="none"), threads=threads)
    cameras = turntable_cameras(scene, options, n_views)
    stages = Stages(progress)
    exposure: float | None = None
    with stages.stage("turn", total=n_views, unit="pictures") as advance:
        for file, camera in zip(turntable_files(path, n_views), cameras, strict=True):
            frame = draw_picture(prepared, camera)
            if options.exposes:  # the exposure of the first picture, so that light does not flicker
                (frame,) = expose([frame], options, exposure=exposure, threads=threads)
                exposure = frame.exposure
            frame.write(file, threads=threads)
            advance(1)
    return frame


def side_by_side_options(
    options: RenderOptions, choices: Mapping[str, Sequence[str]]
) -> list[tuple[str, RenderOptions]]:
    """Return options for every combination of choices by option name, each with a caption."""
    several = {name: tuple(words) for name, words in choices.items() if words}
    combined = []
    for choice in product(*several.values()):
        changes: dict[str, Any] = dict(zip(several, choice, strict=True))
        combined.append((", ".join(choice), replace(options, **changes)))
    return combined


def render_side_by_side(
    scene: Scene,
    variants: Sequence[tuple[str, RenderOptions]],
    *,
    camera: Camera | None = None,
    threads: int | None = None,
    progress: Progress = None,
) -> tuple[FloatImage, list[Frame]]:
    """Linear pictures (H, W, 3) of a scene by options, captioned, with one exposure."""
    frames = []
    for _, options in variants:
        prepared = prepare(scene, replace(options, exposure="none"), threads=threads)
        frames.append(
            draw_picture(prepared, camera or camera_of(scene, options), progress=progress)
        )
    if all(options.exposes for _, options in variants):
        frames = expose(frames, variants[0][1], threads=threads)
    from texbake.rendering.panels import Panel, side_by_side

    panels = [
        Panel(frame.color, caption, "")
        for frame, (caption, _) in zip(frames, variants, strict=True)
    ]
    shown = np.ones(frames[0].coverage.shape, bool)
    return side_by_side(panels, shown), frames
