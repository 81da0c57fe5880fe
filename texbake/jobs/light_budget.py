"""The closest lightened model of a number of bytes, and the smallest one that is close enough.

Candidates have a number of triangles of one ladder, each two thirds of the one before, and a number
of bytes. Images get the sides and qualities with the least error in the bytes that are left; see
`Codings`. Pictures of the whole decide between candidates.

For a number of bytes, numbers of triangles are tried from many to few, down to the first with the
finest images, then one between the best and the next larger. For a PSNR, bisection finds the fewest
triangles that reach it with the finest images. What images add to the error then tells which number
of bytes to try. Last comes a number of triangles between that of the result and the next lower one.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import field, replace
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
    LARGE_PX,
    N_VIEWS,
    ModelComparison,
    ModelToDraw,
    compare_models,
    model_to_draw,
)

_MOST_LEVELS, _LEAST_FACES = 4, 200
_UNLIMITED = 1 << 40  # bytes
# Of a search for a PSNR: numbers of bytes that are tried for a number of triangles, and the share
# of the bytes that more triangles must get along with.
_MOST_PROBES, _LESS = 4, 0.97
_MOST_AIMS = 4  # searches by small pictures until large ones confirm the result
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
    compare: Callable[[], ModelComparison] | None  # None if it does not fit
    is_finest: bool = False  # whether every picture has the finest coding

    @cached_property
    def comparison(self) -> ModelComparison | None:
        """How it differs in pictures, which are drawn when they are needed."""
        return None if self.compare is None else self.compare()

    @property
    def db(self) -> float:
        """Mean PSNR of the pictures; 0 if it does not fit."""
        return 0.0 if self.comparison is None else self.comparison.mean_db

    @property
    def error(self) -> float:
        """Mean squared error of the pictures, of values from 0 to 1."""
        return _error(self.db)


@dataclass(frozen=True, eq=False)
class Budget:
    """Tries lightened models of a model."""

    model: PathLike
    source: Source
    output: PathLike  # named in the comparisons
    _levels: dict[int, LightModel] = field(default_factory=dict)
    _trials: dict[tuple[int, int], Trial] = field(default_factory=dict)

    @cached_property
    def _codings(self) -> Codings:
        options = self.source.options
        return Codings(max(options.sides), options.images, options.threads)

    @cached_property
    def _before(self) -> ModelToDraw:
        """The model in the pictures of trials."""
        return model_to_draw(self.model, at_rest=True, threads=self.source.options.threads)

    def within(self, n_bytes: int) -> Trial:
        """Return the closest model found whose file has at most `n_bytes`."""
        best: Trial | None = None
        least, n_fitting, n_before, number = _UNLIMITED, 0, 0, 0
        counts = self._ladder()
        for i, n_faces in list(enumerate(counts))[self._first_to_try(counts, n_bytes) :]:
            trial = self._trial(n_faces, n_bytes, best.db if best else 0.0)
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
            between = math.isqrt(counts[number - 1] * counts[number])
            trial = self._trial(between, n_bytes, best.db)
            best = trial if trial.n_bytes <= n_bytes and trial.db > best.db else best
        if best is None:
            raise OptionError(
                f"target_size: the smallest file of {self.source.mesh.name} has {least:,} bytes; "
                "increase `target_size`, reduce `n_faces`, or set `uvs` to new"
            )
        return best

    def reaching(self, db: float) -> Trial:
        """Return the smallest model found whose mean PSNR is `db` at least, in large pictures.

        A search by small pictures aims higher by what its result lacks in large ones.
        """
        aim = db
        for number in range(_MOST_AIMS):
            trial = self._smallest(aim)
            large = self._in_large_pictures(trial)
            if large.db >= db:
                return large
            if trial.db < aim:  # it is the finest
                break
            aim = trial.db + (number + 1) * (db - large.db) + _CLOSE_DB
        else:
            large = self._in_large_pictures(self._trial(self._ladder()[0], _UNLIMITED))
        if large.db < db:
            reached = math.floor(10.0 * large.db) / 10.0
            raise OptionError(
                f"min_psnr: the closest result for {self.source.mesh.name} has {reached:.1f} dB; "
                "reduce `min_psnr`, or increase `n_faces` or `size`"
            )
        return large

    def _in_large_pictures(self, trial: Trial) -> Trial:
        """Return a model with the comparison of large pictures."""
        before, data = self._before.in_size(LARGE_PX), []
        with scratch_folder() as folder:
            path = folder / "trial.glb"
            self.source.write(trial.light_model, trial.materials, path)
            data.append(path.read_bytes())
        return replace(trial, compare=partial(self._compare, data, 0.0, before))

    def _smallest(self, db: float) -> Trial:
        """Return the smallest model found with `db`; the finest if none has."""
        counts = self._ladder()
        first, last = -1, len(counts) - 1
        while first < last:
            middle = (first + last + 1) // 2
            # An error names the PSNR of all views of the first.
            if self._trial(counts[middle], _UNLIMITED, db if middle else 0.0).db >= db:
                first = middle
            else:
                last = middle - 1
        best = self._trial(counts[max(first, 0)], _UNLIMITED)
        if first < 0:
            return best
        best = self._with_fewer_bytes(counts[first], best, db)
        while first > 0 and (smaller := self._smaller(counts[first - 1], best, db)) is not None:
            first, best = first - 1, smaller
        if first < len(counts) - 1:
            between = math.isqrt(counts[first] * counts[first + 1])
            best = self._smaller(between, best, db) or best
        return best

    def _smaller(self, n_faces: int, best: Trial, db: float) -> Trial | None:
        """Return a smaller model than `best` with `db` and so many triangles, if there is one."""
        trial = self._trial(n_faces, int(_LESS * best.n_bytes), db)
        return self._with_fewer_bytes(n_faces, trial, db) if trial.db >= db else None

    def _with_fewer_bytes(self, n_faces: int, best: Trial, db: float) -> Trial:
        """Return the smallest model found with `db` and so many triangles.

        What codings add to the error of the shape falls about as a power of their bytes.
        """
        n_low = self._trial(n_faces, 0).n_bytes
        low = self._trial(n_faces, n_low)
        if low.db >= db:
            return low
        for (n, _), known in sorted(self._trials.items()):  # of searches that aimed lower
            if n != n_faces or known.comparison is None:
                continue
            if known.db < db and known.n_bytes > n_low:
                low, n_low = known, known.n_bytes
            elif known.db >= db and known.n_bytes < best.n_bytes:
                best = known
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

    def _ladder(self) -> list[int]:
        """Return numbers of triangles, from many to few."""
        options, n = self.source.options, self.source.mesh.n_faces
        counts = [n if options.n_faces is None else min(options.n_faces, n)]
        while counts[-1] > 2 * _LEAST_FACES:
            counts.append(counts[-1] * 2 // 3)
        return counts

    def _first_to_try(self, counts: list[int], n_bytes: int) -> int:
        """Place of the first that may fit: a triangle takes more bytes if there are fewer."""
        fit = (i for i, n in enumerate(counts) if n * self._least_bytes <= n_bytes)
        return next(fit, len(counts) - 1)

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
        return n_bytes / source.mesh.n_faces

    def _trial(self, n_faces: int, n_bytes: int, least_db: float = 0.0) -> Trial:
        """Return what fits `n_bytes`; below `least_db`, its PSNR is of fewer views."""
        key = n_faces, n_bytes
        if key not in self._trials:
            self._trials[key] = self._new_trial(n_faces, n_bytes, least_db)
        return self._trials[key]

    def _new_trial(self, n_faces: int, n_bytes: int, least_db: float) -> Trial:
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
            n_bytes=size, is_finest=is_finest,
            compare=partial(self._compare, data, least_db) if size <= n_bytes else None,
        )  # fmt: skip

    def _compare(
        self, data: list[bytes], least_db: float, before: ModelToDraw | None = None
    ) -> ModelComparison:
        """Draw a file; `data` gives it up, so that it takes no more memory."""
        options = self.source.options
        with scratch_folder() as folder, self.source.stages.part("compare"):
            path = folder / Path(self.output).name
            path.write_bytes(data.pop())
            return compare_models(
                before or self._before, path, n_views=options.views or N_VIEWS, at_rest=True,
                options=None if before is None else before.prepared.options,
                least_db=least_db, threads=options.threads, progress=self.source.progress,
            )  # fmt: skip

    def _write(self, light_model: LightModel, files: dict[str, bytes], path: Path) -> int:
        self.source.write(light_model, with_files(light_model.materials, files), path)
        return path.stat().st_size


def _error(db: float) -> float:
    """Mean squared error of a PSNR, of values from 0 to 1."""
    return float(pm.exp(-0.1 * pm.log(10.0) * db))
