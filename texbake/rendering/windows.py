"""Parts of a picture that are rasterized by themselves, so that memory is bounded."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from texbake.mesh.mesh import FloatArray
from texbake.rendering.camera import Camera

# Samples of a window, at eight bytes each and as many again for each transparent layer.
_WINDOW = 1 << 23
# Rows that nothing is wanted of, beyond which there are two windows: each projects all vertices.
_GAP = 16


@dataclass(frozen=True)
class Window:
    """Some rows and columns of a picture, in pixels."""

    top: int
    bottom: int
    left: int
    right: int

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.bottom - self.top, self.right - self.left


@dataclass(frozen=True, kw_only=True, eq=False)
class WindowCamera(Camera):
    """A camera of which a window fills the screen.

    Attributes
    ----------
    window : Window
    width, height : int
        Of the whole picture in pixels.
    """

    window: Window
    width: int
    height: int

    def clip_from_world(self, aspect: float) -> FloatArray:
        """(4, 4) float64: world space to clip space; the aspect is that of the whole picture."""
        rows, columns = self.window.shape
        zoom = np.eye(4)
        zoom[0, 0], zoom[1, 1] = self.width / columns, self.height / rows
        zoom[0, 3] = (self.width - self.window.left - self.window.right) / columns
        zoom[1, 3] = (self.window.top + self.window.bottom - self.height) / rows
        return zoom @ super().clip_from_world(self.width / self.height)


def windows(wanted: npt.NDArray[np.bool_], side: int) -> Iterator[Window]:
    """Strips of a picture that hold all wanted pixels, each as wide as it must be."""
    rows = np.flatnonzero(wanted.any(axis=1))
    most = max(1, _WINDOW // (wanted.shape[1] * side**2))
    # A strip ends before a gap that is worth another one.
    for run in np.split(rows, np.flatnonzero(np.diff(rows) > _GAP) + 1):
        while len(run):
            top = int(run[0])
            inside = run[run < top + most]
            bottom = int(inside[-1]) + 1
            columns = np.flatnonzero(wanted[top:bottom].any(axis=0))
            yield Window(top, bottom, int(columns[0]), int(columns[-1]) + 1)
            run = run[len(inside) :]
