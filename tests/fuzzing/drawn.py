"""Sound arguments made from any bytes: meshes, images, numbers and options.

The functions that take them refuse what is unsound, and the core behind them trusts that. So what
is drawn is valid, but hostile: coordinates of a few values or of extremes, faces without area or
there twice, images of one texel. A target of the fuzzer takes a `Drawn` and calls the program. When
its bytes are used up, it gives zeros.
"""

from dataclasses import fields
from typing import TypeVar

import numpy as np

from texbake import Mesh
from texbake.mesh.shapes import cube, grid_sphere, icosphere, plane, uv_sphere
from texbake.schema import option_fields

T = TypeVar("T")

EXTREMES = (
    0.0, -0.0, 1.0, -1.0, 0.5, 1e-300, -1e-300, 1e300, -1e300, 5e-324, 1e-30, 1e30, 1e-9, 1e9,
    1.0 + 2**-52, 1.0 - 2**-53, 2.0**31, -(2.0**31), 2.0**53, 1e150, 1e-150, 1.0 / 3.0, 1e38, 1e-45,
)  # fmt: skip
_SOLIDS = (cube, lambda: icosphere(1), lambda: uv_sphere(4, 6), lambda: grid_sphere(4, 6),
           lambda: plane(3, 2))  # fmt: skip


class Drawn:
    """Values drawn from bytes, one after another."""

    def __init__(self, data):
        self._data = data
        self._at = 0

    def bytes(self, n):
        """Return the next bytes, with zeros after the last."""
        taken = self._data[self._at : self._at + n]
        self._at += n
        return taken.ljust(n, b"\0")

    def below(self, n):
        """Return a number from 0 to n - 1."""
        return int.from_bytes(self.bytes(1 if n <= 256 else 4), "little") % n

    def flag(self):
        return self.below(2) == 1

    def rarely(self, n):
        """Return whether a number below n is its last: never where the bytes are used up."""
        return self.below(n) == n - 1

    def pick(self, values):
        return values[self.below(len(values))]

    def rng(self):
        """Return a generator of random numbers, for values that are too many for the bytes."""
        return np.random.default_rng(int.from_bytes(self.bytes(4), "little"))

    def floats(self, *shape, extreme=True):
        """Return finite numbers: of a small grid, or of any size."""
        n = int(np.prod(shape))
        form = self.below(16 if extreme else 12)
        if form == 15:  # any bits
            values = np.frombuffer(self.bytes(8 * n), np.float64).copy()
            values[~np.isfinite(values)] = 0.0
            return values.reshape(shape)
        codes = np.frombuffer(self.bytes(n), np.uint8)
        if form >= 12:
            values = np.array(EXTREMES)
            values = values if form == 12 else values[np.abs(values) <= 2.0**53]
            return values[codes % len(values)].reshape(shape)
        form %= 3
        values = (codes % 4).astype(np.float64) if form == 0 else codes / 255.0
        if form == 2:  # next to the values of a grid
            values = codes % 4 + (codes // 4 % 8 - 3.0) * 2.0 ** -int(10 + self.below(43))
        return values.reshape(shape)

    def singles(self, *shape):
        """Return finite numbers that float32 holds."""
        most = np.finfo(np.float32).max
        return self.floats(*shape).clip(-most, most).astype(np.float32)

    def mesh(self, *, most=12, uvs=None, extreme=True):
        """Return a mesh of few faces, of a whole shape or of any triangles."""
        if self.rarely(4):
            mesh = self.pick(_SOLIDS)()
            moved = mesh.positions + 0.3 * self.rng().normal(size=mesh.positions.shape)
            mesh = mesh.replace(positions=moved if self.flag() else mesh.positions)
        else:
            n_vertices, n_faces = 1 + self.below(most), 1 + self.below(2 * most)
            positions = self.floats(n_vertices, 3, extreme=extreme)
            faces = self.indices(n_vertices, n_faces, 3)
            mesh = Mesh(positions=positions, faces=faces)
        if uvs or (uvs is None and self.flag()):
            n = 1 + self.below(most)
            mesh = mesh.replace(
                uvs=self.floats(n, 2, extreme=extreme), uv_faces=self.indices(n, mesh.n_faces, 3)
            )
        elif uvs is False:
            mesh = mesh.replace(uvs=None, uv_faces=None)
        return self._with_attributes(mesh)

    def _with_attributes(self, mesh):
        if self.flag():
            n = 1 + self.below(8)
            normals = self.floats(n, 3, extreme=False) - 0.5
            mesh = mesh.replace(normals=normals, normal_faces=self.indices(n, mesh.n_faces, 3))
        if self.flag():
            colors = self.rng().random((mesh.n_vertices, self.pick((3, 4))))
            groups = self.indices(2, mesh.n_faces, 1).ravel()
            mesh = mesh.replace(colors=colors, face_groups=groups, group_names=("a", "b"))
        return mesh

    def indices(self, n, *shape):
        """Return numbers from 0 to n - 1."""
        codes = np.frombuffer(self.bytes(int(np.prod(shape))), np.uint8)
        return (codes % n).astype(np.int32).reshape(shape)

    def image(self, *, most=9, channels=(1, 2, 3, 4)):
        """Return (h, w, c) float32 of any values, not all of them finite."""
        height, width, n = 1 + self.below(most), 1 + self.below(most), self.pick(channels)
        image = self.singles(height, width, n)
        if self.rarely(4):
            image[self.below(height), self.below(width)] = self.pick((np.nan, np.inf, -np.inf))
        return image

    def options(self, kind, *names, **given):
        """Return options of a class; those that are named take any of their values."""
        chosen = dict(given)
        for field in option_fields(kind):
            if field.name not in names or field.name in given:
                continue
            option = field.option
            if option.choices:
                values = (*option.choices, None) if field.optional else option.choices
                value = self.pick(values)
                chosen[field.name] = (value,) if tuple in field.kinds else value
            elif bool in field.kinds:
                chosen[field.name] = self.flag()
            elif option.low is not None and option.high is not None and float in field.kinds:
                chosen[field.name] = option.low + (option.high - option.low) * self.below(256) / 255
        assert {field.name for field in fields(kind)} >= set(names)
        return kind(**chosen)
