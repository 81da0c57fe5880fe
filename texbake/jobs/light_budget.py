"""The closest lightened model of a number of bytes, and the smallest one that is close enough.

Candidates have a number of triangles of one ladder, each two thirds of the one before, and a number
of bytes. Images get the sides and qualities with the least error in the bytes that are left; see
`Codings`. Pictures of the whole decide between candidates.

For a number of bytes, numbers of triangles are tried from many to few, down to the first with the
finest images, then one between the best and the next larger. For a PSNR, bisection finds the fewest
triangles that reach it with the finest images. What images add to the error then tells which number
of bytes to try.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import field
from functools import cached_property, partial
from pathlib import Path

from texbake.core import portable_math as pm
from texbake.errors import OptionError
from texbake.files import PathLike, scratch_folder
from texbake.jobs.light_codings import Codings
from texbake.jobs.light_images import with_files
from texbake.jobs.light_models import LightModel, Source
from texbake.mesh.materials import Materials
from texbake.records import dataclass
from texbake.rendering.compare_models import (
    ModelComparison,
    ModelToDraw,
    compare_models,
    model_to_draw,
)
from texbake.rendering.options import RenderOptions

# Of the pictures of trials.
_VIEWS, _OPTIONS = 4, RenderOptions(width=256, height=256)
_MOST_LEVELS, _LEAST_FACES = 4, 200
_SURELY = 0.8  # of the bytes of a triangle in the whole model
_UNLIMITED = 1 << 40  # bytes
# Of a search for a PSNR: numbers of bytes that are tried for a number of triangles, the share of
# the bytes that more triangles must get along with, what is close enough, and searches.
_MOST_PROBES, _LESS, _SLACK_DB, _MOST_SEARCHES = 4, 0.97, 0.2, 4
# Surplus that ends the probes, the part of what codings may add to the error that a probe aims at,
# the least share of an error that counts, and the part of the bytes between two sizes, in
# logarithms, in which the next probe lies.
_CLOSE_DB, _AIM, _LEAST_ADDED, _MIDDLE = 0.05, 0.97, 0.01, (0.1, 0.9)


@dataclass(frozen=True, kw_only=True, eq=False)
class Trial:
    """A lightened model that was written and compared."""

    light_model: LightModel
    materials: Materials
    n_bytes: int
    measure: Callable[[], float]  # the PSNR; 0 if it does not fit
    is_finest: bool = False  # whether every picture has the finest coding

    @cached_property
    def db(self) -> float:
        """Mean PSNR in small pictures, which are drawn when it is needed."""
        return self.measure()

    @property
    def error(self) -> float:
        """Mean squared error of the pictures, of values from 0 to 1."""
        return _error(self.db)


@dataclass(frozen=True, eq=False)
class Budget:
    """Tries lightened models of a model."""

    model: PathLike
    source: Source
    _levels: dict[int, LightModel] = field(default_factory=dict)
    _trials: dict[tuple[int, int], Trial] = field(default_factory=dict)

    @cached_property
    def _codings(self) -> Codings:
        options = self.source.options
        return Codings(max(options.sides), options.images, options.threads)

    @cached_property
    def _before(self) -> ModelToDraw:
        """The model in the pictures of trials."""
        threads = self.source.options.threads
        return model_to_draw(self.model, options=_OPTIONS, at_rest=True, threads=threads)

    @cached_property
    def _whole(self) -> ModelToDraw:
        """The model in the views of the result."""
        return model_to_draw(self.model, at_rest=True, threads=self.source.options.threads)

    def within(self, n_bytes: int) -> Trial:
        """Return the closest model found whose file has at most `n_bytes`."""
        best: Trial | None = None
        least, n_fitting, n_before, number = _UNLIMITED, 0, 0, 0
        counts = self._face_counts(n_bytes)
        for i, n_faces in enumerate(counts):
            trial = self._trial(n_faces, n_bytes)
            least = min(least, trial.n_bytes)
            if trial.light_model.mesh.n_faces == n_before:
                break  # it has no fewer triangles
            n_before = trial.light_model.mesh.n_faces
            if trial.n_bytes > n_bytes:
                continue
            if best is not None and trial.db <= best.db:
                break
            best, number = trial, i
            n_fitting += 1
            if n_fitting == _MOST_LEVELS or trial.is_finest:
                break
        if best is not None and number > 0:
            trial = self._trial(math.isqrt(counts[number - 1] * counts[number]), n_bytes)
            best = trial if trial.n_bytes <= n_bytes and trial.db > best.db else best
        if best is None:
            raise OptionError(
                f"target_size: the smallest file of {self.source.mesh.name} has {least:,} bytes; "
                "increase `target_size`, reduce `n_faces`, or set `uvs` to new"
            )
        return best

    def reaching(self, db: float, output: PathLike) -> tuple[Trial, ModelComparison]:
        """Return the smallest model found whose mean PSNR is `db` at least, and its pictures.

        Small pictures choose a model, and large ones of its file decide whether it is close
        enough. The difference of both figures corrects the next search.
        """
        found: tuple[Trial, ModelComparison] | None = None
        trial, before = self._smallest(db), None
        for _ in range(_MOST_SEARCHES):
            before, pictures = trial, self._pictures(trial, output)
            surplus = pictures.mean_db - db
            if surplus >= 0.0 and (found is None or trial.n_bytes < found[0].n_bytes):
                found = trial, pictures
            if 0.0 <= surplus < _SLACK_DB or not math.isfinite(trial.db - surplus):
                break
            trial = self._smallest(trial.db - surplus)
            if trial is before:
                break
        if found is None:
            finest = self._trial(self._ladder()[0], _UNLIMITED)
            pictures = self._pictures(finest, output)
            if pictures.mean_db < db:
                reached = math.floor(10.0 * pictures.mean_db) / 10.0
                raise OptionError(
                    f"min_psnr: the closest result for {self.source.mesh.name} has {reached:.1f} "
                    "dB; reduce `min_psnr`, or increase `n_faces` or `size`"
                )
            found = finest, pictures
        return found

    def _smallest(self, db: float) -> Trial:
        """Return the smallest model found with `db` in small pictures; the finest if none has."""
        counts = self._ladder()
        first, last = -1, len(counts) - 1
        while first < last:
            middle = (first + last + 1) // 2
            if self._trial(counts[middle], _UNLIMITED).db >= db:
                first = middle
            else:
                last = middle - 1
        best = self._trial(counts[max(first, 0)], _UNLIMITED)
        if first < 0:
            return best
        best = self._with_fewer_bytes(counts[first], best, db)
        for n_faces in counts[:first][::-1]:
            trial = self._trial(n_faces, int(_LESS * best.n_bytes))
            if trial.db < db:
                break
            best = self._with_fewer_bytes(n_faces, trial, db)
        return best

    def _with_fewer_bytes(self, n_faces: int, best: Trial, db: float) -> Trial:
        """Return the smallest model found with `db` and so many triangles.

        What codings add to the error of the shape falls about as a power of their bytes.
        """
        n_low = self._trial(n_faces, 0).n_bytes
        low = self._trial(n_faces, n_low)
        if low.db >= db:
            return low
        of_shape = self._trial(n_faces, _UNLIMITED).error
        wanted = max(_AIM * (_error(db) - of_shape), _LEAST_ADDED * of_shape)
        for _ in range(_MOST_PROBES):
            if _LESS * best.n_bytes <= n_low or best.db - db < _CLOSE_DB:
                break
            most, least = (
                max(each.error - of_shape, _LEAST_ADDED * wanted) for each in (low, best)
            )
            share = _MIDDLE[1]
            if most > least > 0.0:
                share = float(pm.log(most / wanted) / pm.log(most / least))
            share = min(max(share, _MIDDLE[0]), _MIDDLE[1])
            n_bytes = int(n_low * pm.exp(share * pm.log(best.n_bytes / n_low)))
            trial = self._trial(n_faces, n_bytes)
            if trial.db >= db:
                best = trial
            else:
                low, n_low = trial, n_bytes
        return best

    def _pictures(self, trial: Trial, output: PathLike) -> ModelComparison:
        """Return pictures of a trial in the views of the result."""
        source = self.source
        with scratch_folder() as folder, source.stages.part("compare"):
            path = folder / Path(output).name
            source.write(trial.light_model, trial.materials, path)
            return compare_models(
                self._whole, path, n_views=source.options.views, at_rest=True,
                threads=source.options.threads, progress=source.progress,
            )  # fmt: skip

    def _ladder(self) -> list[int]:
        """Return numbers of triangles, from many to few."""
        options, n = self.source.options, self.source.mesh.n_faces
        counts = [n if options.n_faces is None else min(options.n_faces, n)]
        while counts[-1] > 2 * _LEAST_FACES:
            counts.append(counts[-1] * 2 // 3)
        return counts

    def _face_counts(self, n_bytes: int) -> list[int]:
        """Numbers of triangles that may fit: a triangle takes more bytes if there are fewer."""
        counts = self._ladder()
        fit = [i for i, n in enumerate(counts) if n * self._least_bytes <= n_bytes]
        return counts[min(fit, default=len(counts) - 1) :]

    @cached_property
    def _least_bytes(self) -> float:
        """Bytes of a triangle, at least."""
        source = self.source
        whole = LightModel(
            mesh=source.mesh, materials=source.materials.without_images(), pictures=(),
            simplified=None, warnings=(),
        )  # fmt: skip
        with scratch_folder() as folder:
            n_bytes = self._write(whole, {}, folder / "whole.glb")
        return _SURELY * n_bytes / source.mesh.n_faces

    def _trial(self, n_faces: int, n_bytes: int) -> Trial:
        key = n_faces, n_bytes
        if key not in self._trials:
            self._trials[key] = self._new_trial(n_faces, n_bytes)
        return self._trials[key]

    def _new_trial(self, n_faces: int, n_bytes: int) -> Trial:
        if n_faces not in self._levels:
            self._levels[n_faces] = self.source.lightened(n_faces, is_trial=True)
        light_model = self._levels[n_faces]
        with scratch_folder() as folder:
            path = folder / "trial.glb"
            is_finest = n_bytes == _UNLIMITED
            files = self._codings.extreme(light_model.pictures, is_finest=is_finest)
            size = self._write(light_model, files, path)
            if size < n_bytes and not is_finest:
                n_others = size - sum(map(len, files.values()))
                files = self._codings.chosen(light_model.pictures, n_bytes - n_others)
                size = self._write(light_model, files, path)
                is_finest = self._codings.are_finest(light_model.pictures, files)
            data = [path.read_bytes()]
        return Trial(
            light_model=light_model, materials=with_files(light_model.materials, files),
            n_bytes=size, measure=partial(self._db, data) if size <= n_bytes else float,
            is_finest=is_finest,
        )  # fmt: skip

    def _db(self, data: list[bytes]) -> float:
        """PSNR of a file in small pictures; `data` gives it up, so that it takes no more memory."""
        with scratch_folder() as folder, self.source.stages.part("compare trials"):
            path = folder / "trial.glb"
            path.write_bytes(data.pop())
            return compare_models(
                self._before, path, n_views=_VIEWS, options=_OPTIONS, at_rest=True,
                threads=self.source.options.threads,
            ).mean_db  # fmt: skip

    def _write(self, light_model: LightModel, files: dict[str, bytes], path: Path) -> int:
        self.source.write(light_model, with_files(light_model.materials, files), path)
        return path.stat().st_size


def _error(db: float) -> float:
    """Mean squared error of a PSNR, of values from 0 to 1."""
    return float(pm.exp(-0.1 * pm.log(10.0) * db))
