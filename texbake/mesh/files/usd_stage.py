"""USD stages, opened with errors of one line, and the files that they are composed of.

usd-core, Pixar's own wheel, is optional: `pip install 'texbake[usd]'`. What opens a stage runs in a
process of its own; see `reader_process`.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from texbake.child import LIMITS
from texbake.errors import FileFormatError, require_library
from texbake.files import PathLike, require_file
from texbake.limits import file_beside, is_within


def require_usd(path: PathLike) -> None:
    """Raise `DependencyError` where USD cannot be read or written."""
    require_library("pxr.Usd", path, '"texbake[usd]"')


def open_stage(path: PathLike) -> Any:
    """Open a .usd, .usda, .usdc or .usdz file with what it refers to."""
    require_file(path)
    require_usd(path)
    from pxr import Sdf, Usd

    if Path(path).stat().st_size == 0:
        raise FileFormatError(f"{path}: the file is empty")
    with reporting_damage(path):
        # Not through the registry of layers, which would give what the file held when it was
        # last opened.
        layer = Sdf.Layer.FindOrOpen(str(path))
        if layer is not None:
            layer.Reload(True)
        stage = Usd.Stage.Open(str(path))
    if stage is None:
        raise FileFormatError(f"{path}: it is not a USD file; export it again")
    for used in stage.GetUsedLayers():
        if used.realPath:
            file_beside(path, used.realPath)
    return stage


@contextmanager
def reporting_damage(path: PathLike) -> Iterator[None]:
    """Turn what the library complains of, even on later reading, into `FileFormatError`."""
    from pxr import Tf

    try:
        yield
    except (Tf.ErrorException, UnicodeDecodeError) as error:
        raise FileFormatError(
            f"{path}: it is not a USD file, or damaged: {_reason(error)}; export it again"
        ) from None


def layers_of_stage(path: str) -> Iterator[Any]:
    """Layers that a file is composed of, and lie in its folder; the limits grow with each."""
    from pxr import Sdf, Tf

    folder = Path(path).parent
    seen = {os.path.realpath(path)}
    waiting = [str(path)]
    while waiting:
        with suppress(Tf.ErrorException, UnicodeDecodeError):  # is reported when it is read
            layer = Sdf.Layer.FindOrOpen(waiting.pop())
            if layer is None:
                continue
            yield layer
            for name in layer.GetCompositionAssetDependencies():
                place = layer.ComputeAbsolutePath(name)
                file = place.partition("[")[0]  # of a package, the package itself
                real = os.path.realpath(file)
                if place and is_within(folder, file) and Path(file).is_file():
                    if real not in seen:
                        LIMITS.allow(Path(file).stat().st_size)
                    if place not in seen:
                        waiting.append(place)
                    seen |= {real, place}


def files_of_stage(path: str) -> list[str]:
    """Files that a USD file is composed of, and those that it names; its own name is left out."""
    from pxr import Tf, UsdUtils

    unheard = UsdUtils.CoalescingDiagnosticDelegate()  # silences warnings of missing files
    try:
        layers, assets, missing = UsdUtils.ComputeAllDependencies(path)
    except Tf.ErrorException:
        return []
    finally:
        del unheard
    names = [*(layer.realPath for layer in layers), *assets, *missing]
    return [str(name) for name in names if name and Path(name) != Path(path)]


_LONGEST = 200  # characters of a reason


def _reason(error: Exception) -> str:
    """Beginning of what the library complained of first."""
    try:
        complaint = str(getattr(error.args[0], "commentary", error))
    except UnicodeDecodeError:  # it repeats what it could not read
        complaint = "it holds text that is not UTF-8"
    return " ".join(complaint[:_LONGEST].split()) or "no reason was given"


def meters_per_unit(stage: Any) -> float | None:
    """Return the length of a stage's unit in meters; None where the file does not state it."""
    from pxr import UsdGeom

    has_unit = UsdGeom.StageHasAuthoredMetersPerUnit(stage)
    meters = float(UsdGeom.GetStageMetersPerUnit(stage)) if has_unit else 0.0
    return meters if 0.0 < meters < math.inf else None
