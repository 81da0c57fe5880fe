"""The result of a build: `build.json` for programs, rows to print, and a page of all assets."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from texbake import __version__
from texbake.building.graph import Id
from texbake.building.locations import is_url, location_of
from texbake.building.resolve import BLOCKED, BUILT, CURRENT, ENDED, FAILED, WAITING, StepState
from texbake.building.store import stored_files
from texbake.errors import FileError
from texbake.files import PathLike, make_folder, replacing, scratch_folder
from texbake.parallel import run_bands
from texbake.records import dataclass

if TYPE_CHECKING:
    from texbake.pages.build_page import BuildRow

REPORT = "build.json"
# Folder below that of a build, for what the next build needs to know.
INSIDE = ".texbake"
RUNNING, FINISHED, INTERRUPTED = "running", "finished", "interrupted"


@dataclass(frozen=True, kw_only=True)
class StepResult:
    """The result of one step of one asset."""

    step: str
    kind: str
    # `current`, `built`, `failed` or `blocked`; `waiting` where the build was interrupted
    state: str
    reasons: tuple[str, ...]  # why it ran; what happened on the way
    notes: tuple[str, ...]
    error: str
    trace: str
    seconds: float  # in this build, from giving it to a worker to its answer
    work_seconds: float | None  # that making its result took, in this build or an earlier one
    attempts: int
    # of the worker up to the end of the step, in this build or an earlier one
    peak_memory_bytes: int | None
    figures: Mapping[str, Any]  # figures that its kind reports
    outputs: Mapping[str, str]  # path or URL of each published output
    n_bytes: int  # total size of their files
    key: str


@dataclass(frozen=True, kw_only=True)
class AssetResult:
    """The result of one asset."""

    name: str
    steps: tuple[StepResult, ...]

    @property
    def state(self) -> str:
        """`failed` if a step failed, `waiting` if one was not reached; else `built`, `current`."""
        states = {step.state for step in self.steps}
        for state in (FAILED, BLOCKED):
            if state in states:
                return FAILED
        if states - ENDED:
            return WAITING
        return BUILT if BUILT in states else CURRENT

    @property
    def error(self) -> str:
        """Step and message of the first failure; empty without one."""
        failed = [step for step in self.steps if step.state == FAILED]
        return f"{failed[0].step}: {failed[0].error}" if failed else ""

    @property
    def seconds(self) -> float:
        """Total of all its steps in this build."""
        return sum(step.seconds for step in self.steps)


@dataclass(frozen=True, kw_only=True)
class BuildResult:
    """The result of a build."""

    pipeline: str  # path of its file
    folder: Path
    state: str  # `finished`, or `interrupted`
    started: str  # ISO 8601, UTC
    seconds: float
    options: Mapping[str, Any]
    assets: tuple[AssetResult, ...]

    @property
    def failed(self) -> list[AssetResult]:
        """Assets with a failed step."""
        return [asset for asset in self.assets if asset.state == FAILED]

    @property
    def ok(self) -> bool:
        """Whether every step of every asset has a result."""
        return all(asset.state in (BUILT, CURRENT) for asset in self.assets)

    def count(self, state: str) -> int:
        """Number of assets in a state."""
        return sum(asset.state == state for asset in self.assets)

    def count_steps(self, state: str) -> int:
        """Number of steps in a state."""
        return sum(step.state == state for asset in self.assets for step in asset.steps)

    def table(self) -> list[tuple[str, str]]:
        """Return rows of a label and a figure."""
        work = sum(asset.seconds for asset in self.assets)
        assets = [f"{self.count(BUILT):,} built", f"{self.count(CURRENT):,} current"]
        if self.failed:
            assets.append(f"{len(self.failed):,} failed")
        if n_waiting := self.count(WAITING):
            assets.append(f"{n_waiting:,} not done")
        steps = [
            f"{n:,} {state}"
            for state in (BUILT, CURRENT, FAILED, BLOCKED)
            if (n := self.count_steps(state))
        ]
        return [
            ("assets", ", ".join(assets)),
            ("steps", ", ".join(steps)),
            ("time", f"{self.seconds:.1f} s; workers {work:.1f} s"),
        ]

    def to_json(self) -> dict[str, Any]:
        """Return everything as plain values."""
        return {
            "texbake": __version__,
            "state": self.state,
            "ok": self.ok,
            "pipeline": self.pipeline,
            "started": self.started,
            "seconds": self.seconds,
            "options": dict(self.options),
            "counts": {
                "assets": len(self.assets),
                **{state: self.count(state) for state in (BUILT, CURRENT, FAILED)},
            },
            "assets": [
                {
                    "name": asset.name,
                    "state": asset.state,
                    "error": asset.error,
                    "seconds": asset.seconds,
                    "steps": [_plain(step) for step in asset.steps],
                }
                for asset in self.assets
            ],
        }


def asset_results(
    names: Sequence[str], states: Mapping[Id, StepState], place: str
) -> tuple[AssetResult, ...]:
    """Return the results of assets, their steps in the order of their dependencies."""
    steps: dict[str, list[StepResult]] = {name: [] for name in names}
    for (asset, _), state in states.items():
        steps[asset].append(_step_result(state, place))
    return tuple(AssetResult(name=name, steps=tuple(found)) for name, found in steps.items())


def _step_result(state: StepState, place: str) -> StepResult:
    manifest = state.manifest
    outputs, n_bytes = {}, 0
    if manifest is not None:
        stored = stored_files(manifest)
        outputs = {name: f"{place}/{base}" for name, base in state.node.published.items()}
        n_bytes = sum(file.size for name in outputs for file in stored[name])
    return StepResult(
        step=state.node.id[1],
        kind=state.node.table.kind.name,
        state=state.state,
        reasons=tuple(state.reasons),
        notes=tuple(state.notes),
        error=state.error,
        trace=state.trace,
        seconds=state.seconds,
        work_seconds=None if manifest is None else manifest.get("seconds"),
        attempts=state.attempts,
        peak_memory_bytes=None if manifest is None else manifest.get("peak_memory_bytes"),
        figures={} if manifest is None else manifest.get("figures", {}),
        outputs=outputs,
        n_bytes=n_bytes,
        key=state.key,
    )


def _plain(step: StepResult) -> dict[str, Any]:
    return {
        name: list(value) if isinstance(value, tuple) else value
        for name, value in vars(step).items()
        if value not in ("", (), {}, None)
    }


def write_build_report(path: PathLike, report: Mapping[str, Any]) -> None:
    """Write a report with one line per asset, so that people and programs find theirs."""
    rest = {name: value for name, value in report.items() if name != "assets"}
    head = json.dumps(rest, indent=1)[:-2]
    lines = ",\n  ".join(json.dumps(asset) for asset in report.get("assets", ()))
    with replacing(path) as temporary:
        temporary.write_text(f'{head},\n "assets": [\n  {lines}\n ]\n}}\n', encoding="utf-8")


# How the page calls the states of assets.
_STATUSES = {BUILT: "built", CURRENT: "kept", FAILED: "failed", WAITING: "skipped"}
# Folder for small pictures, named by the key of the step that made the large one.
_THUMBNAILS = "thumbnails"
# Outputs that show an asset, by their kinds of steps, the best first.
_SHOWN = (
    *(("preview", "picture"), ("run", "preview"), ("run", "normal")),
    *(("bake-texture", "texture"), ("bake", "normal")),
)


def write_overview(path: PathLike, result: BuildResult, *, command: str = "") -> None:
    """Write the page of a build: one file, which needs no network."""
    from texbake.pages.build_page import write_build_page

    pictures = _thumbnails(result)
    folder = Path(os.path.realpath(path)).parent
    rows = [_row(asset, folder, pictures.get(asset.name)) for asset in result.assets]
    title = Path(result.pipeline).stem
    write_build_page(path, rows, title=title, command=command, seconds=result.seconds)


def _row(asset: AssetResult, folder: Path, picture: bytes | None) -> BuildRow:
    from texbake.pages.build_page import BuildRow

    page = _output(asset, "page", "page")
    notes = [note for step in asset.steps for note in step.notes]
    return BuildRow(
        name=asset.name,
        status=_STATUSES[asset.state],
        message=asset.error or "; ".join(notes),
        page=None if page is None or is_url(page[1]) else os.path.relpath(page[1], folder),
        thumbnail=picture,
        error_deg=max(_figures(asset, "error_deg", "page", "run"), default=None),
        miss_percent=max(_figures(asset, "miss_percent", "bake", "run"), default=None),
        seconds=asset.seconds or None,
        n_faces=max(_figures(asset, "faces", "bake", "run"), default=None),
        n_bytes=sum(step.n_bytes for step in asset.steps) or None,
    )


def _figures(asset: AssetResult, name: str, *kinds: str) -> Iterator[Any]:
    """Yield the figures of a name that steps of some kinds report."""
    for step in asset.steps:
        if step.kind in kinds and step.figures.get(name) is not None:
            yield step.figures[name]


def _output(asset: AssetResult, kind: str, name: str) -> tuple[StepResult, str] | None:
    """Return the first step of a kind that published an output of a name, and its place."""
    for step in asset.steps:
        if step.kind == kind and name in step.outputs:
            return step, step.outputs[name]
    return None


def _picture_of(asset: AssetResult) -> tuple[StepResult, str] | None:
    """Return the step that made the best picture of an asset, and the place of that."""
    found = (_output(asset, *shown) for shown in _SHOWN)
    return next((each for each in found if each is not None), None)


def _thumbnails(result: BuildResult) -> dict[str, bytes]:
    """Return small pictures of assets, kept from the last page where they have not changed."""
    from texbake.pages.build_page import thumbnail

    sources = {
        asset.name: (found[0].key, found[1])
        for asset in result.assets
        if (found := _picture_of(asset)) is not None
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
                    pictures[name] = thumbnail(location_of(above).fetch(file, copies))
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
