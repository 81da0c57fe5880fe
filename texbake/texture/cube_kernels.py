"""Kernels of cube maps: lookups, smaller levels, latitude-longitude images, lighting.

`face_coordinates`, `cube_cell` and `interpolate_cube_cell` are made to be called from other
kernels; they read the bordered faces of a `CubeChain`. The Python functions that call the others
are in `cube_map`, `cube_lookup` and `prefilter`, with the sources of the algorithms.
"""

from __future__ import annotations

import numpy as np

from texbake.kernels import kernel
from texbake.texture.interpolation import row_of_v

# Of each face: the directions in which s and t grow, and the direction of its middle.
FACE_AXES = np.array(
    [
        [[0, 0, -1], [0, -1, 0], [1, 0, 0]],
        [[0, 0, 1], [0, -1, 0], [-1, 0, 0]],
        [[1, 0, 0], [0, 0, 1], [0, 1, 0]],
        [[1, 0, 0], [0, 0, -1], [0, -1, 0]],
        [[1, 0, 0], [0, -1, 0], [0, 0, 1]],
        [[-1, 0, 0], [0, -1, 0], [0, 0, -1]],
    ],
    np.float64,
)

CUBE_FILTER_CODES = {"nearest": 0, "bilinear": 1, "trilinear": 2}
_TRILINEAR = CUBE_FILTER_CODES["trilinear"]
_NEAREST = CUBE_FILTER_CODES["nearest"]


@kernel
def face_coordinates(x, y, z):  # type: ignore[no-untyped-def]
    """Face (0 to 5; -1: none), s and t in [0, 1] of a direction of any length.

    The same as `cube_map.locate`, without its table.
    """
    size_x = abs(x)
    size_y = abs(y)
    size_z = abs(z)
    if size_x >= size_y and size_x >= size_z:
        largest = size_x
        face = 0 if x > 0.0 else 1
        s = -z if x > 0.0 else z
        t = -y
    elif size_y >= size_z:
        largest = size_y
        face = 2 if y > 0.0 else 3
        s = x
        t = z if y > 0.0 else -z
    else:
        largest = size_z
        face = 4 if z > 0.0 else 5
        s = x if z > 0.0 else -x
        t = -y
    half = 0.5 / largest
    s = s * half + 0.5
    t = t * half + 0.5
    # None of these holds for what is not a number; `half` is 0 where the largest is infinite.
    if half > 0.0 and s >= -1.0 and t >= -1.0:
        # Rounding can lead beyond an edge.
        return face, min(max(s, 0.0), 1.0), min(max(t, 0.0), 1.0)
    return -1, 0.0, 0.0


@kernel
def cube_cell(offset, size, face, s, t):  # type: ignore[no-untyped-def]
    """Find the four texels about (s, t).

    Returns the index of the first, the texels a row has, and how far along x and y it lies.
    """
    stride = size + 2
    x = s * size + 0.5
    y = t * size + 0.5
    left = int(x)
    top = int(y)
    first = offset + (face * stride + top) * stride + left
    return first, stride, np.float32(x - left), np.float32(y - top)


@kernel
def interpolate_cube_cell(texels, first, stride, along_x, along_y, channel):  # type: ignore[no-untyped-def]
    """Interpolate one channel; exact where the four texels are equal."""
    above = texels[first, channel]
    below = texels[first + stride, channel]
    above += along_x * (texels[first + 1, channel] - above)
    below += along_x * (texels[first + stride + 1, channel] - below)
    return above + along_y * (below - above)


@kernel
def sample_cube_kernel(texels, offsets, sizes, directions, levels, mode, out, start, stop):  # type: ignore[no-untyped-def]
    """Values in directions, at levels or the finest; `mode` is one of CUBE_FILTER_CODES."""
    n_channels = texels.shape[1]
    last = np.float64(len(sizes) - 1)
    for i in range(start, stop):
        x, y, z = directions[i, 0], directions[i, 1], directions[i, 2]
        face, s, t = face_coordinates(np.float64(x), np.float64(y), np.float64(z))
        if face < 0:
            for channel in range(n_channels):
                out[i, channel] = 0.0
            continue
        level = np.float64(0.0)
        if len(levels) > 0 and levels[i] > 0.0:
            level = min(np.float64(levels[i]), last)
        if mode != _TRILINEAR:
            level = np.floor(level + 0.5)
        fine = int(level)
        if mode == _NEAREST:
            size = sizes[fine]
            row = face * (size + 2) + min(int(t * size), size - 1) + 1
            index = offsets[fine] + row * (size + 2) + min(int(s * size), size - 1) + 1
            for channel in range(n_channels):
                out[i, channel] = texels[index, channel]
            continue
        first, stride, along_x, along_y = cube_cell(offsets[fine], sizes[fine], face, s, t)
        for channel in range(n_channels):
            out[i, channel] = interpolate_cube_cell(
                texels, first, stride, along_x, along_y, channel
            )
        blend = np.float32(level - fine)
        if blend > 0.0:
            first, stride, along_x, along_y = cube_cell(
                offsets[fine + 1], sizes[fine + 1], face, s, t
            )
            for channel in range(n_channels):
                value = interpolate_cube_cell(texels, first, stride, along_x, along_y, channel)
                out[i, channel] += blend * (value - out[i, channel])


@kernel
def shrink_cube_kernel(faces, weights, out, start, stop):  # type: ignore[no-untyped-def]
    """Means over what each smaller texel covers; a row is counted over all six faces."""
    size = faces.shape[1]
    small = out.shape[1]
    n_channels = faces.shape[3]
    sums = np.zeros(n_channels)
    ratio = size / small
    for row in range(start, stop):
        face = row // small
        top = (row % small) * ratio
        for column in range(small):
            left = column * ratio
            sums[:] = 0.0
            total = 0.0
            for y in range(int(top), min(int(np.ceil(top + ratio)), size)):
                height = min(y + 1.0, top + ratio) - max(np.float64(y), top)
                for x in range(int(left), min(int(np.ceil(left + ratio)), size)):
                    width = min(x + 1.0, left + ratio) - max(np.float64(x), left)
                    weight = max(width, 0.0) * max(height, 0.0) * weights[y, x]
                    total += weight
                    for channel in range(n_channels):
                        sums[channel] += weight * faces[face, y, x, channel]
            for channel in range(n_channels):
                out[face, row % small, column, channel] = sums[channel] / total


_FACE_AXES = tuple(tuple(tuple(map(float, row)) for row in axes) for axes in FACE_AXES)


@kernel
def _add_from_image(image, x, y, z, weight, sums):  # type: ignore[no-untyped-def]
    """Add `weight` times the bilinear value in a unit direction to `sums` (C,).

    Beyond a pole lies the same row, half a turn away.
    """
    height, width, n_channels = image.shape
    column = (np.arctan2(x, -z) / (2 * np.pi) + 0.5) * width - 0.5
    row = row_of_v(np.arcsin(min(max(y, -1.0), 1.0)) / np.pi + 0.5, height) - 0.5
    above = int(np.floor(row))
    for corner in range(2):
        here = above + corner
        at = column
        if here < 0 or here >= height:
            here = min(max(here, 0), height - 1)
            at += 0.5 * width
        left = int(np.floor(at))
        along = at - left
        left %= width
        right = left + 1 if left + 1 < width else 0
        share = weight * (row - above if corner == 1 else 1.0 - (row - above))
        for channel in range(n_channels):
            first = np.float64(image[here, left, channel])
            sums[channel] += share * (first + along * (image[here, right, channel] - first))


@kernel
def to_cube_kernel(image, n_lookups, out, start, stop):  # type: ignore[no-untyped-def]
    """Rows of faces, counted over all six, from a latitude-longitude image."""
    size = out.shape[1]
    sums = np.zeros(out.shape[3])
    step = 2.0 / (size * n_lookups)
    for index in range(start, stop):
        face = index // size
        row = index % size
        axes = _FACE_AXES[face]
        for column in range(size):
            sums[:] = 0.0
            total = 0.0
            for i in range(n_lookups * n_lookups):
                s = (column * n_lookups + i % n_lookups + 0.5) * step - 1.0
                t = (row * n_lookups + i // n_lookups + 0.5) * step - 1.0
                shrink = 1.0 / np.sqrt(1.0 + s * s + t * t)
                # The solid angle of a piece of the face falls with the cube of its distance.
                weight = shrink * shrink * shrink
                x = (s * axes[0][0] + t * axes[1][0] + axes[2][0]) * shrink
                y = (s * axes[0][1] + t * axes[1][1] + axes[2][1]) * shrink
                z = (s * axes[0][2] + t * axes[1][2] + axes[2][2]) * shrink
                _add_from_image(image, x, y, z, weight, sums)
                total += weight
            for channel in range(len(sums)):
                out[face, row, column, channel] = sums[channel] / total


@kernel
def to_latitude_longitude_kernel(texels, size, n_lookups, out, start, stop):  # type: ignore[no-untyped-def]
    """Rows of a latitude-longitude image from the bordered faces of a cube map."""
    height, width, n_channels = out.shape
    sums = np.zeros(n_channels)
    for row in range(start, stop):
        # Toward the poles texels are narrower, and need fewer lookups across.
        middle = (0.5 - (row + 0.5) / height) * np.pi
        n_across = max(1, int(np.ceil(n_lookups * np.cos(middle))))
        for column in range(width):
            sums[:] = 0.0
            total = 0.0
            for i in range(n_lookups):
                latitude = (row_of_v((row + (i + 0.5) / n_lookups) / height, 1.0) - 0.5) * np.pi
                weight = np.cos(latitude)
                y = np.sin(latitude)
                for j in range(n_across):
                    longitude = ((column + (j + 0.5) / n_across) / width - 0.5) * 2 * np.pi
                    face, s, t = face_coordinates(
                        weight * np.sin(longitude), y, -weight * np.cos(longitude)
                    )
                    first, stride, along_x, along_y = cube_cell(0, size, face, s, t)
                    for channel in range(n_channels):
                        value = interpolate_cube_cell(
                            texels, first, stride, along_x, along_y, channel
                        )
                        sums[channel] += weight * value
                    total += weight
            for channel in range(n_channels):
                out[row, column, channel] = sums[channel] / total


@kernel
def irradiance_kernel(directions, angles, radiance, normals, out, start, stop):  # type: ignore[no-untyped-def]
    """Mean radiance over the hemisphere about each normal, weighted by cosine."""
    n_channels = radiance.shape[1]
    sums = np.zeros(n_channels)
    for i in range(start, stop):
        sums[:] = 0.0
        total = 0.0
        for j in range(len(directions)):
            cosine = (
                normals[i, 0] * directions[j, 0]
                + normals[i, 1] * directions[j, 1]
                + normals[i, 2] * directions[j, 2]
            )
            if cosine > 0.0:
                weight = cosine * angles[j]
                total += weight
                for channel in range(n_channels):
                    sums[channel] += weight * radiance[j, channel]
        for channel in range(n_channels):
            out[i, channel] = sums[channel] / total


@kernel
def specular_kernel(texels, offsets, sizes, lobe, normals, out, start, stop):  # type: ignore[no-untyped-def]
    """Mean over the `lobe` of directions about each normal."""
    n_channels = texels.shape[1]
    sums = np.zeros(n_channels)
    for i in range(start, stop):
        nx = np.float64(normals[i, 0])
        ny = np.float64(normals[i, 1])
        nz = np.float64(normals[i, 2])
        # Two directions that are square to the normal and to each other.
        sign = 1.0 if nz >= 0.0 else -1.0
        a = -1.0 / (sign + nz)
        b = nx * ny * a
        sums[:] = 0.0
        total = 0.0
        for j in range(len(lobe)):
            along, across, up = lobe[j, 0], lobe[j, 1], lobe[j, 2]
            level, weight = int(lobe[j, 3]), lobe[j, 4]
            face, s, t = face_coordinates(
                along * (1.0 + sign * nx * nx * a) + across * b + up * nx,
                along * sign * b + across * (sign + ny * ny * a) + up * ny,
                -along * sign * nx - across * ny + up * nz,
            )
            first, stride, along_x, along_y = cube_cell(offsets[level], sizes[level], face, s, t)
            for channel in range(n_channels):
                value = interpolate_cube_cell(texels, first, stride, along_x, along_y, channel)
                sums[channel] += weight * value
            total += weight
        for channel in range(n_channels):
            out[i, channel] = sums[channel] / total
