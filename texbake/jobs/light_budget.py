"""The closest lightened model of a number of bytes.

Numbers of triangles are tried from many to few. For each, images get the sides and qualities with
the least error in the bytes that are left: the error of a picture is measured on its texels, once
for a side and once for a quality at that side. Pictures of the whole then decide which number of
triangles is best.

Based on: Shoham, Gersho, "Efficient bit allocation for an arbitrary set of quantizers", IEEE
Transactions on Acoustics, Speech, and Signal Processing 36, 1988, for the choice among codings.
"""

from __future__ import annotations

import math
from dataclasses import field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from texbake.errors import OptionError
from texbake.files import PathLike, scratch_folder
from texbake.jobs.light_images import (
    Picture,
    coded_pictures,
    decoded,
    squared_errors,
    with_files,
)
from texbake.jobs.light_models import LightModel, Source
from texbake.mesh.materials import Materials
from texbake.records import dataclass
from texbake.rendering.compare_models import compare_models
from texbake.rendering.options import RenderOptions
from texbake.texture.image_files import encode_image
from texbake.texture.pack import resized

_VIEWS, _PICTURE_PX = 4, 256
_MOST_LEVELS, _LEAST_FACES = 4, 200
# Bytes of a triangle in a file, at least: with integers, and coded as well.
_BYTES, _CODED_BYTES = 9, 3
_QUALITIES = (15, 35, 60, 75, 85, 90)
_LEAST_SIDE = 64
_GROWTH = 2.5  # bytes of an image over those of half its side, at least
# Weights of the squared errors of codes: chosen, not measured.
_COLOR, _NORMAL, _OTHER = 1.0, 0.25, 0.15
_MOST_BYTES = 1 << 40


@dataclass(frozen=True, kw_only=True, eq=False)
class Trial:
    """A lightened model that was written and compared."""

    light_model: LightModel
    materials: Materials
    n_bytes: int
    db: float


class _Coding(NamedTuple):
    data: bytes
    error: float  # weighted, mean over the texels


@dataclass(frozen=True, eq=False)
class Budget:
    """Tries lightened models of a model."""

    model: PathLike
    source: Source
    _levels: dict[int, LightModel] = field(default_factory=dict)
    _codings: dict[tuple[int, int, int], _Coding] = field(default_factory=dict)
    _of_sides: dict[tuple[int, int], float] = field(default_factory=dict)

    def within(self, n_bytes: int) -> Trial:
        """Return the closest model found whose file has at most `n_bytes`."""
        best: Trial | None = None
        least = _MOST_BYTES
        for n_faces in self._face_counts(n_bytes):
            trial = self._trial(n_faces, n_bytes)
            least = min(least, trial.n_bytes)
            if trial.n_bytes > n_bytes:
                continue
            if best is not None and trial.db <= best.db:
                break
            best = trial
        if best is None:
            raise OptionError(
                f"target_size: {self.source.mesh.name} does not get smaller than {least:,} bytes; "
                "give more, fewer `faces`, or `uvs` new"
            )
        return best

    def _face_counts(self, n_bytes: int) -> list[int]:
        options, n = self.source.options, self.source.mesh.n_faces
        n = n if options.n_faces is None else min(options.n_faces, n)
        each = _CODED_BYTES if options.compress else _BYTES
        while n > 2 * _LEAST_FACES and n * each > n_bytes:
            n = n * 2 // 3
        found = [n]
        while found[-1] > 2 * _LEAST_FACES and len(found) < _MOST_LEVELS:
            found.append(found[-1] * 2 // 3)
        return found

    def _trial(self, n_faces: int, n_bytes: int) -> Trial:
        if n_faces not in self._levels:
            self._levels[n_faces] = self.source.lightened(n_faces, is_trial=True)
        light_model = self._levels[n_faces]
        with scratch_folder() as folder:
            path = folder / "trial.glb"
            files = self._cheapest(light_model)
            size = self._write(light_model, files, path)
            if size <= n_bytes:
                n_others = size - sum(map(len, files.values()))
                files = self._chosen(light_model, n_bytes - n_others)
                size = self._write(light_model, files, path)
            materials = with_files(light_model.materials, files)
            if size > n_bytes:
                return Trial(light_model=light_model, materials=materials, n_bytes=size, db=0.0)
            options = RenderOptions(width=_PICTURE_PX, height=_PICTURE_PX)
            with self.source.stages.part("compare trials"):
                found = compare_models(
                    self.model, path, n_views=_VIEWS, options=options, at_rest=True,
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

    def _cheapest(self, light_model: LightModel) -> dict[str, bytes]:
        def code(picture: Picture) -> bytes:
            return self._coding(picture, self._sides(picture)[0], _QUALITIES[0]).data

        return coded_pictures(light_model.pictures, code, threads=self.source.options.threads)

    def _chosen(self, light_model: LightModel, n_bytes: int) -> dict[str, bytes]:
        """Files of pictures, of the least error in a number of bytes."""
        tables: dict[str, list[_Coding]] = {}

        def tabulate(picture: Picture) -> bytes:
            tables[picture.name] = self._table(picture, n_bytes)
            return b""

        coded_pictures(light_model.pictures, tabulate, threads=self.source.options.threads)

        def at(price: float) -> dict[str, bytes]:
            return {
                picture.name: min(
                    tables[picture.name], key=lambda item: item.error + price * len(item.data)
                ).data
                for picture in light_model.pictures
            }

        # Files begin at multiples of 4 bytes.
        room = n_bytes - 4 * len(light_model.pictures)
        low, high = 1e-12, 1e6
        for _ in range(60):
            price = math.sqrt(low * high)
            if sum(map(len, at(price).values())) <= room:
                high = price
            else:
                low = price
        return at(high)

    def _table(self, picture: Picture, n_bytes: int) -> list[_Coding]:
        """Codings of a picture that may fit."""
        found: list[_Coding] = []
        before: dict[int, int] = {}
        for side in self._sides(picture):
            for quality in _QUALITIES:
                if _GROWTH * before.get(quality, 0) > n_bytes:
                    break
                coding = self._coding(picture, side, quality)
                before[quality] = len(coding.data)
                found.append(coding)
        return found

    def _coding(self, picture: Picture, side: int, quality: int) -> _Coding:
        key = id(picture), side, quality
        if key not in self._codings:
            codes = picture.at_side(side)
            encoding = self.source.options.images
            data = encode_image(codes, encoding, quality=quality, is_color=picture.is_color)
            made = decoded(data, codes.shape[2])
            error = _squared(made, codes, picture.is_cut) + self._error_of(picture, side)
            self._codings[key] = _Coding(data, _weight(picture) * error)
        return self._codings[key]

    def _error_of(self, picture: Picture, side: int) -> float:
        """Mean squared error of a picture that is scaled down to a side."""
        key = id(picture), side
        if key not in self._of_sides:
            small = picture.at_side(side)
            height, width = picture.codes.shape[:2]
            large = resized(small.astype(np.float32), width, height)
            self._of_sides[key] = _squared(large, picture.codes, picture.is_cut)
        return self._of_sides[key]


def _weight(picture: Picture) -> float:
    return _COLOR if picture.is_color else _NORMAL if picture.is_normal else _OTHER


def _squared(one: npt.NDArray[Any], other: npt.NDArray[Any], is_cut: bool) -> float:
    """Mean of the squares of differences of codes."""
    colors, alpha = squared_errors(one, other, is_cut=is_cut)
    return colors if other.shape[2] == 3 else 0.75 * colors + 0.25 * alpha
