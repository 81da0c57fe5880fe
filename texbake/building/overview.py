"""The page of a build: one row per asset, with its picture and a link to its own page."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from texbake.building.locations import is_url, location_of
from texbake.building.report import INSIDE, AssetResult, BuildResult, StepResult
from texbake.building.resolve import BUILT, CURRENT, FAILED, WAITING
from texbake.errors import FileError
from texbake.files import PathLike, make_folder, replacing, scratch_folder
from texbake.pages.build_page import BuildRow, thumbnail, write_build_page
from texbake.parallel import run_bands

_STATUSES = {
    BUILT: "built",
    CURRENT: "kept",
    FAILED: "failed",
    WAITING: "skipped",
}
# Folder for small pictures, named by the key of the step that made the large one.
_THUMBNAILS = "thumbnails"


def write_overview(path: PathLike, result: BuildResult, *, command: str = "") -> None:
    """Write the page of a build: one file, which needs no network."""
    pictures = _thumbnails(result)
    folder = Path(os.path.realpath(path)).parent
    rows = [_row(asset, folder, pictures.get(asset.name)) for asset in result.assets]
    title = Path(result.pipeline).stem
    write_build_page(path, rows, title=title, command=command, seconds=result.seconds)


def _row(asset: AssetResult, folder: Path, picture: bytes | None) -> BuildRow:
    page = _output(asset, "page", "page")
    notes = [note for step in asset.steps for note in step.notes]
    return BuildRow(
        name=asset.name,
        status=_STATUSES[asset.state],
        message=asset.error or "; ".join(notes),
        page=None if page is None or is_url(page[1]) else os.path.relpath(page[1], folder),
        thumbnail=picture,
        error_deg=max(_figures(asset, "page", "error_deg"), default=None),
        miss_percent=max(_figures(asset, "bake", "miss_percent"), default=None),
        seconds=asset.seconds or None,
        n_faces=max(_figures(asset, "bake", "faces"), default=None),
        n_bytes=sum(step.n_bytes for step in asset.steps) or None,
    )


def _figures(asset: AssetResult, kind: str, name: str) -> Iterator[Any]:
    """Yield the figures of a name that steps of a kind report."""
    for step in asset.steps:
        if step.kind == kind and step.figures.get(name) is not None:
            yield step.figures[name]


def _output(asset: AssetResult, kind: str, name: str) -> tuple[StepResult, str] | None:
    """Return the first step of a kind that published an output of a name, and its place."""
    for step in asset.steps:
        if step.kind == kind and name in step.outputs:
            return step, step.outputs[name]
    return None


def _thumbnails(result: BuildResult) -> dict[str, bytes]:
    """Return small pictures of assets, kept from the last page where they have not changed.

    An asset whose picture cannot be read has none.
    """
    sources = {
        asset.name: (step.key, place)
        for asset in result.assets
        if (found := _output(asset, "preview", "picture")) is not None
        for step, place in (found,)
    }
    folder = make_folder(result.folder / INSIDE / _THUMBNAILS)
    kept = {file.stem: file for file in folder.glob("*.jpg")}
    names = list(sources)
    pictures: dict[str, bytes] = {}

    def make(start: int, stop: int) -> None:
        for name in names[start:stop]:
            key, place = sources[name]
            try:
                if key in kept:
                    pictures[name] = kept[key].read_bytes()
                    continue
                with scratch_folder() as copies:
                    above, _, file = place.rpartition("/")
                    picture = location_of(above).fetch(file, copies)
                    pictures[name] = thumbnail(picture)
            except (FileError, OSError):
                continue
            with replacing(folder / f"{key}.jpg") as temporary:
                temporary.write_bytes(pictures[name])

    run_bands(make, len(names), band=1)
    used = {key for key, _ in sources.values()}
    for file in folder.glob("*.jpg"):
        if file.stem not in used:
            file.unlink(missing_ok=True)
    return pictures
