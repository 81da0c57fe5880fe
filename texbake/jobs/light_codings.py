"""Sides and qualities of the images of lightened models: the least error in a number of bytes.

The error of a picture is measured on its texels, once for a side and once for a quality at that
side; at large sides, only of codings that would be chosen by what small sides predict.

Based on: Shoham, Gersho, "Efficient bit allocation for an arbitrary set of quantizers", IEEE
Transactions on Acoustics, Speech, and Signal Processing 36, 1988.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import field
from typing import NamedTuple

from texbake.jobs.light_images import Picture, coded_pictures, decoded, smaller_file, squared_errors
from texbake.mesh.mesh import ByteArray
from texbake.records import dataclass

_QUALITIES = (15, 35, 60, 75, 85, 90)
_LEAST_SIDE, _MOST_SIDES, _EXACT_SIDES = 64, 4, 2
_GROWTH = 2.5  # bytes of an image over those of half its side, at least
_LESS_ERROR = 0.5  # error of a coding over that of half its side, at least
# Weights of the squared errors of codes: chosen, not measured.
_COLOR, _NORMAL, _OTHER = 1.0, 0.25, 0.15


class _Coding(NamedTuple):
    """A side and a quality of a picture; without data, its figures are predicted."""

    side: int
    quality: int
    n_bytes: float
    error: float  # of the coding at that side: weighted, mean over the texels
    data: bytes | None = None


@dataclass(frozen=True, eq=False)
class Codings:
    """Codes pictures, each side and quality once."""

    most: int  # pixels of a side
    encoding: str
    threads: int | None
    _known: dict[tuple[Hashable, int, int], _Coding] = field(default_factory=dict)
    _of_sides: dict[tuple[Hashable, int], float] = field(default_factory=dict)

    def extreme(self, pictures: Sequence[Picture], *, is_finest: bool) -> dict[str, bytes]:
        """Files of pictures of the finest coding, or of the cheapest."""
        i = -1 if is_finest else 0

        def code(picture: Picture) -> bytes:
            return self._coding(picture, self._sides(picture)[i], _QUALITIES[i]).data or b""

        return coded_pictures(pictures, code, threads=self.threads)

    def are_finest(self, pictures: Sequence[Picture], files: Mapping[str, bytes]) -> bool:
        """Whether files are those of the finest coding."""
        for each in pictures:
            key = _identity(each), self._sides(each)[-1], _QUALITIES[-1]
            if key not in self._known or self._known[key].data != files[each.name]:
                return False
        return True

    def chosen(self, pictures: Sequence[Picture], n_bytes: int) -> dict[str, bytes]:
        """Files of pictures, of the least error in a number of bytes."""
        tables: dict[str, list[_Coding]] = {each.name: [] for each in pictures}  # in order

        def tabulate(picture: Picture) -> bytes:
            tables[picture.name] = self._table(picture, n_bytes)
            return b""

        def complete(picture: Picture) -> bytes:
            coding = picked[picture.name]
            self._coding(picture, coding.side, coding.quality)
            return tabulate(picture)

        coded_pictures(pictures, tabulate, threads=self.threads)
        while True:
            # Files begin at multiples of 4 bytes.
            picked = _cheapest(tables, n_bytes - 4 * len(pictures))
            predicted = [each for each in pictures if picked[each.name].data is None]
            if not predicted:
                return {name: coding.data or b"" for name, coding in picked.items()}
            coded_pictures(predicted, complete, threads=self.threads)

    def _sides(self, picture: Picture) -> list[int]:
        sides = [min(picture.side, self.most)]
        while sides[-1] >= 2 * _LEAST_SIDE and len(sides) < _MOST_SIDES:
            sides.append(sides[-1] // 2)
        return sides[::-1]

    def _table(self, picture: Picture, n_bytes: int) -> list[_Coding]:
        """Codings of a picture that may fit, measured at small sides, predicted at larger ones."""
        found: list[_Coding] = []
        smaller: dict[int, _Coding] = {}
        for number, side in enumerate(self._sides(picture)):
            codings: dict[int, _Coding] = {}
            for quality in _QUALITIES:
                half = smaller.get(quality)
                if number and (half is None or _GROWTH * half.n_bytes > n_bytes):
                    break
                known = self._known.get((_identity(picture), side, quality))
                if known is None and (half is None or number < _EXACT_SIDES):
                    known = self._coding(picture, side, quality)
                if known is None:
                    assert half is not None
                    growth, less = self._change(picture, side, quality, smaller)
                    known = _Coding(side, quality, growth * half.n_bytes, less * half.error)
                codings[quality] = known
                found.append(self._with_side_error(picture, known))
            smaller = codings
        return found

    def _change(
        self, picture: Picture, side: int, quality: int, smaller: Mapping[int, _Coding]
    ) -> tuple[float, float]:
        """Bytes and error over those of half the side, as with the nearest quality known there."""
        known = {q: self._known.get((_identity(picture), side, q)) for q in smaller}
        near = sorted(smaller, key=lambda q: abs(q - quality))
        for found, half in ((known[q], smaller[q]) for q in near):
            if found is not None and half.error > 0.0:
                return found.n_bytes / half.n_bytes, found.error / half.error
        return _GROWTH, _LESS_ERROR

    def _coding(self, picture: Picture, side: int, quality: int) -> _Coding:
        key = _identity(picture), side, quality
        if key not in self._known:
            codes = picture.at_side(side)
            data = smaller_file(codes, self.encoding, quality=quality, is_color=picture.is_color)
            made = decoded(data, codes.shape[2])
            error = _weight(picture) * _squared(made, codes, picture.is_cut)
            self._known[key] = _Coding(side, quality, len(data), error, data)
        return self._known[key]

    def _with_side_error(self, picture: Picture, coding: _Coding) -> _Coding:
        error = _weight(picture) * self._error_of(picture, coding.side)
        return coding._replace(error=coding.error + error)

    def _error_of(self, picture: Picture, side: int) -> float:
        """Mean squared error of a picture that is scaled down to a side.

        The error of each halving is measured by itself: their sum is within a tenth of the whole.
        """
        key = _identity(picture), side
        if side >= picture.side:
            return 0.0
        if key not in self._of_sides:
            twice = min(2 * side, picture.side)
            added = _squared(picture.at_side(side), picture.at_side(twice), picture.is_cut)
            self._of_sides[key] = self._error_of(picture, twice) + added
        return self._of_sides[key]


def _cheapest(tables: Mapping[str, Sequence[_Coding]], n_bytes: float) -> dict[str, _Coding]:
    """Return the codings of the least error in all that have a number of bytes together.

    One price of a byte for all leaves some bytes; they go to what lowers the error most.
    """

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
    picked = at(high)
    left = n_bytes - sum(each.n_bytes for each in picked.values())
    while True:
        better = [
            (now.error - each.error, name, each)
            for name, now in picked.items()
            for each in tables[name]
            if each.error < now.error and each.n_bytes - now.n_bytes <= left
        ]
        if not better:
            return picked
        _, name, coding = max(better, key=lambda each: each[0])
        left -= coding.n_bytes - picked[name].n_bytes
        picked[name] = coding


def _identity(picture: Picture) -> Hashable:
    """What pictures have in common that are one image of several lightened models."""
    return (picture.name, picture.file) if picture.file else id(picture)


def _weight(picture: Picture) -> float:
    return _COLOR if picture.is_color else _NORMAL if picture.is_normal else _OTHER


def _squared(one: ByteArray, other: ByteArray, is_cut: bool) -> float:
    """Mean of the squares of differences of codes."""
    colors, alpha = squared_errors(one, other, is_cut=is_cut)
    return colors if other.shape[2] == 3 else 0.75 * colors + 0.25 * alpha
