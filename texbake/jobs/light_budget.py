"""The closest lightened model of a number of bytes, and the smallest one that is close enough.

Candidates have a number of triangles of one ladder, each two thirds of the one before, and a number
of bytes. Images get the sides and qualities with the least error in the bytes that are left.
The error of a picture is measured on its texels, once for a side and once for a quality at that
side; at large sides, only of codings that would be chosen by what small sides predict. Pictures of
the whole decide between candidates.

For a number of bytes, numbers of triangles are tried from many to few, then one between the best
and the next larger. For a PSNR, bisection finds the fewest triangles that reach it with the finest
images, and then the fewest bytes.

Based on: Shoham, Gersho, "Efficient bit allocation for an arbitrary set of quantizers", IEEE
Transactions on Acoustics, Speech, and Signal Processing 36, 1988, for the choice among codings.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import field
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np

from texbake.errors import OptionError
from texbake.files import PathLike, scratch_folder
from texbake.jobs.light_images import Picture, coded_pictures, decoded, squared_errors, with_files
from texbake.jobs.light_models import LightModel, Source
from texbake.mesh.materials import Materials
from texbake.mesh.mesh import AnyArray
from texbake.records import dataclass
from texbake.rendering.compare_models import (
    ModelComparison,
    ModelToDraw,
    compare_models,
    model_to_draw,
)
from texbake.rendering.options import RenderOptions
from texbake.texture.image_files import encode_image
from texbake.texture.pack import resized

# Of the pictures of trials.
_VIEWS, _OPTIONS = 4, RenderOptions(width=256, height=256)
_MOST_LEVELS, _LEAST_FACES = 4, 200
_SURELY = 0.8  # of the bytes of a triangle in the whole model
_QUALITIES = (15, 35, 60, 75, 85, 90)
_LEAST_SIDE, _EXACT_SIDES = 64, 2
_GROWTH = 2.5  # bytes of an image over those of half its side, at least
_LESS_ERROR = 0.5  # error of a coding over that of half its side, at least
# Weights of the squared errors of codes: chosen, not measured.
_COLOR, _NORMAL, _OTHER = 1.0, 0.25, 0.15
_UNLIMITED = 1 << 40  # bytes
# Of a search for a PSNR: numbers of bytes that are tried for a number of triangles, the share of
# the bytes that more triangles must get along with, what is close enough, and searches.
_MOST_PROBES, _LESS, _SLACK_DB, _MOST_SEARCHES = 4, 0.97, 0.2, 4


@dataclass(frozen=True, kw_only=True, eq=False)
class Trial:
    """A lightened model that was written and compared."""

    light_model: LightModel
    materials: Materials
    n_bytes: int
    db: float


class _Coding(NamedTuple):
    """A side and a quality of a picture; without data, its figures are predicted."""

    side: int
    quality: int
    n_bytes: float
    error: float  # of the coding at that side: weighted, mean over the texels
    data: bytes | None = None


@dataclass(frozen=True, eq=False)
class Budget:
    """Tries lightened models of a model."""

    model: PathLike
    source: Source
    _levels: dict[int, LightModel] = field(default_factory=dict)
    _trials: dict[tuple[int, int], Trial] = field(default_factory=dict)
    _codings: dict[tuple[Hashable, int, int], _Coding] = field(default_factory=dict)
    _of_sides: dict[tuple[Hashable, int], float] = field(default_factory=dict)

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
            if n_fitting == _MOST_LEVELS:
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
        counts = self._ladder()
        trial, before = self._trial(counts[(len(counts) - 1) // 2], _UNLIMITED), None
        for n_searches in range(_MOST_SEARCHES):
            before, pictures = trial, self._pictures(trial, output)
            surplus = pictures.mean_db - db
            if surplus >= 0.0 and (found is None or trial.n_bytes < found[0].n_bytes):
                found = trial, pictures
            is_near = n_searches > 0 and 0.0 <= surplus < _SLACK_DB
            if is_near or not math.isfinite(trial.db - surplus):
                break
            trial = self._smallest(trial.db - surplus)
            if trial is before:
                break
        if found is None:
            finest = self._trial(counts[0], _UNLIMITED)
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
        low = self._trial(n_faces, 0).n_bytes
        cheapest = self._trial(n_faces, low)
        if cheapest.db >= db:
            return cheapest
        for _ in range(_MOST_PROBES):
            if _LESS * best.n_bytes <= low:
                break
            middle = math.isqrt(low * best.n_bytes)
            trial = self._trial(n_faces, middle)
            if trial.db >= db:
                best = trial
            else:
                low = middle
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
            files = self._coded(light_model, -1 if is_finest else 0)
            size = self._write(light_model, files, path)
            if size < n_bytes and not is_finest:
                n_others = size - sum(map(len, files.values()))
                files = self._chosen(light_model, n_bytes - n_others)
                size = self._write(light_model, files, path)
            materials = with_files(light_model.materials, files)
            if size > n_bytes:
                return Trial(light_model=light_model, materials=materials, n_bytes=size, db=0.0)
            with self.source.stages.part("compare trials"):
                found = compare_models(
                    self._before, path, n_views=_VIEWS, options=_OPTIONS, at_rest=True,
                    threads=self.source.options.threads,
                )  # fmt: skip
        return Trial(light_model=light_model, materials=materials, n_bytes=size, db=found.mean_db)

    def _write(self, light_model: LightModel, files: dict[str, bytes], path: Path) -> int:
        self.source.write(light_model, with_files(light_model.materials, files), path)
        return path.stat().st_size

    def _sides(self, picture: Picture) -> list[int]:
        side = min(picture.side, max(self.source.options.sides))
        sides = [side]
        while sides[-1] >= 2 * _LEAST_SIDE and len(sides) < _MOST_LEVELS:
            sides.append(sides[-1] // 2)
        return sides[::-1]

    def _coded(self, light_model: LightModel, i: int) -> dict[str, bytes]:
        """Files of pictures of the cheapest coding, 0, or of the finest, -1."""

        def code(picture: Picture) -> bytes:
            return self._coding(picture, self._sides(picture)[i], _QUALITIES[i]).data or b""

        return coded_pictures(light_model.pictures, code, threads=self.source.options.threads)

    def _chosen(self, light_model: LightModel, n_bytes: int) -> dict[str, bytes]:
        """Files of pictures, of the least error in a number of bytes."""
        pictures, threads = light_model.pictures, self.source.options.threads
        tables: dict[str, list[_Coding]] = {}

        def tabulate(picture: Picture) -> bytes:
            tables[picture.name] = self._table(picture, n_bytes)
            return b""

        def complete(picture: Picture) -> bytes:
            codings, coding = tables[picture.name], picked[picture.name]
            exact = self._coding(picture, coding.side, coding.quality)
            codings[codings.index(coding)] = self._with_side_error(picture, exact)
            return b""

        coded_pictures(pictures, tabulate, threads=threads)
        while True:
            # Files begin at multiples of 4 bytes.
            picked = _cheapest(tables, n_bytes - 4 * len(pictures))
            predicted = [each for each in pictures if picked[each.name].data is None]
            if not predicted:
                return {name: coding.data or b"" for name, coding in picked.items()}
            coded_pictures(predicted, complete, threads=threads)

    def _table(self, picture: Picture, n_bytes: int) -> list[_Coding]:
        """Codings of a picture that may fit, measured at small sides, predicted at larger ones."""
        found: list[_Coding] = []
        before: dict[int, list[_Coding]] = {quality: [] for quality in _QUALITIES}
        for number, side in enumerate(self._sides(picture)):
            for quality, smaller in before.items():
                if smaller and _GROWTH * smaller[-1].n_bytes > n_bytes:
                    break
                known = self._codings.get((_identity(picture), side, quality))
                if known is None and number < _EXACT_SIDES:
                    known = self._coding(picture, side, quality)
                if known is None:
                    half = smaller[-1]
                    known = _Coding(side, quality, _GROWTH * half.n_bytes, _LESS_ERROR * half.error)
                smaller.append(known)
                found.append(self._with_side_error(picture, known))
        return found

    def _coding(self, picture: Picture, side: int, quality: int) -> _Coding:
        key = _identity(picture), side, quality
        if key not in self._codings:
            codes = picture.at_side(side)
            encoding = self.source.options.images
            data = encode_image(codes, encoding, quality=quality, is_color=picture.is_color)
            made = decoded(data, codes.shape[2])
            error = _weight(picture) * _squared(made, codes, picture.is_cut)
            self._codings[key] = _Coding(side, quality, len(data), error, data)
        return self._codings[key]

    def _with_side_error(self, picture: Picture, coding: _Coding) -> _Coding:
        error = _weight(picture) * self._error_of(picture, coding.side)
        return coding._replace(error=coding.error + error)

    def _error_of(self, picture: Picture, side: int) -> float:
        """Mean squared error of a picture that is scaled down to a side."""
        key = _identity(picture), side
        if side >= picture.side:
            return 0.0
        if key not in self._of_sides:
            small = picture.at_side(side)
            height, width = picture.codes.shape[:2]
            large = resized(small.astype(np.float32), width, height)
            self._of_sides[key] = _squared(large, picture.codes, picture.is_cut)
        return self._of_sides[key]


def _cheapest(tables: Mapping[str, Sequence[_Coding]], n_bytes: float) -> dict[str, _Coding]:
    """Return the codings of the least error in all that have a number of bytes together."""

    def at(price: float) -> dict[str, _Coding]:
        return {
            name: min(codings, key=lambda each: each.error + price * each.n_bytes)
            for name, codings in tables.items()
        }

    low, high = 1e-12, 1e6
    for _ in range(60):
        price = math.sqrt(low * high)
        if sum(each.n_bytes for each in at(price).values()) <= n_bytes:
            high = price
        else:
            low = price
    return at(high)


def _identity(picture: Picture) -> Hashable:
    """What pictures have in common that are one image of several lightened models."""
    return (picture.name, picture.file) if picture.file else id(picture)


def _weight(picture: Picture) -> float:
    return _COLOR if picture.is_color else _NORMAL if picture.is_normal else _OTHER


def _squared(one: AnyArray, other: AnyArray, is_cut: bool) -> float:
    """Mean of the squares of differences of codes."""
    colors, alpha = squared_errors(one, other, is_cut=is_cut)
    return colors if other.shape[2] == 3 else 0.75 * colors + 0.25 * alpha
