"""Kernels for the light that arrives at fragments and its reflection.

Values have one row per fragment, or a single row for all of them; `row_of` reads both.

Based on: Blinn, "Models of light reflection for computer synthesized pictures", SIGGRAPH 1977; the
glTF 2.0 specification, appendix B; Karis, "Real Shading in Unreal Engine 4", 2013; Schlick, "An
inexpensive BRDF model for physically-based rendering", 1994.
"""

from __future__ import annotations

import math

import numpy as np

from texbake.kernels import kernel

# Sums over a pixel's samples stay far below the greatest float32, 3.4e38.
BRIGHTEST = 1e30


@kernel
def row_of(values, i):  # type: ignore[no-untyped-def]
    """Row of fragment i in values with one row per fragment, or one for all."""
    return i if len(values) > 1 else 0


@kernel
def row_dot(a, i, b, j):  # type: ignore[no-untyped-def]
    """Scalar product of row i of one list of vectors and row j of another."""
    return a[i, 0] * b[j, 0] + a[i, 1] * b[j, 1] + a[i, 2] * b[j, 2]


@kernel
def keep_finite(light):  # type: ignore[no-untyped-def]
    """Bound light (n, 3) in place by `BRIGHTEST`; NaN becomes 0.

    Products of large numbers can overflow float32, and so can the light of extremely bright lamps.
    """
    for i in range(len(light)):
        for k in range(light.shape[1]):
            if math.isnan(light[i, k]):
                light[i, k] = 0.0
            else:
                light[i, k] = min(max(light[i, k], -BRIGHTEST), BRIGHTEST)


# Least distance between a point and a light, in model units, so that its strength stays finite.
NEAREST = 1e-3


@kernel
def find_arriving_light(  # type: ignore[no-untyped-def]
    points, normals, position, axis, inner, outer, decay, color, directions, radiance
):
    """Write the direction and the strength of a lamp's light at points."""
    for i in range(len(points)):
        x, y, z = (
            position[0] - points[i, 0], position[1] - points[i, 1], position[2] - points[i, 2]
        )  # fmt: skip
        distance = math.sqrt(x * x + y * y + z * z)
        if 0.0 < distance < np.inf:
            x, y, z = x / distance, y / distance, z / distance
        else:
            x, y, z = normals[i, 0], normals[i, 1], normals[i, 2]
        directions[i, 0], directions[i, 1], directions[i, 2] = x, y, z
        strength = max(distance, NEAREST) ** -decay
        if outer > -1.0:
            cosine = -(x * axis[0] + y * axis[1] + z * axis[2])
            if cosine <= outer:
                strength = 0.0
            elif cosine < inner:
                t = (cosine - outer) / (inner - outer)
                strength *= t * t * (3.0 - 2.0 * t)
        for k in range(3):
            radiance[i, k] = strength * color[0, k]


# Least value of alpha; below it, highlights are narrower than float32 normals resolve.
LEAST_ALPHA = 1e-3


@kernel
def reflect_lambert(normals, directions, radiance, base, out):  # type: ignore[no-untyped-def]
    """Add a lamp's light, reflected by Lambert's law."""
    for i in range(len(normals)):
        d, r, b = row_of(directions, i), row_of(radiance, i), row_of(base, i)
        facing = row_dot(normals, i, directions, d)
        if facing > 0.0:
            for k in range(3):
                out[i, k] += radiance[r, k] * base[b, k] * facing


@kernel
def reflect_blinn_phong(  # type: ignore[no-untyped-def]
    normals, directions, radiance, to_eye, base, specular, exponent, gloss, out
):
    """Add a lamp's light, reflected by the model of Blinn and Phong."""
    for i in range(len(normals)):
        d, r, b = row_of(directions, i), row_of(radiance, i), row_of(base, i)
        s, e, g = row_of(specular, i), row_of(exponent, i), row_of(gloss, i)
        facing, halfway, squared = 0.0, 0.0, 0.0
        for k in range(3):
            half = directions[d, k] + to_eye[i, k]
            facing += normals[i, k] * directions[d, k]
            halfway += normals[i, k] * half
            squared += half * half
        if facing <= 0.0:
            continue
        shine = 0.0
        if halfway > 0.0:
            shine = gloss[g, 0] * (halfway / math.sqrt(squared)) ** exponent[e, 0]
        for k in range(3):
            out[i, k] += radiance[r, k] * (base[b, k] * facing + specular[s, k] * shine)


@kernel
def reflect_metallic(  # type: ignore[no-untyped-def]
    normals, directions, radiance, to_eye, base, roughness, metalness, dielectric, out
):
    """Add a lamp's light, reflected by the metallic-roughness model of glTF 2.0."""
    for i in range(len(normals)):
        d, r, b = row_of(directions, i), row_of(radiance, i), row_of(base, i)
        facing, toward_eye, halfway, squared = 0.0, 0.0, 0.0, 0.0
        for k in range(3):
            half = directions[d, k] + to_eye[i, k]
            facing += normals[i, k] * directions[d, k]
            toward_eye += normals[i, k] * to_eye[i, k]
            halfway += normals[i, k] * half
            squared += half * half
        if facing <= 0.0:
            continue
        alpha = max(roughness[row_of(roughness, i), 0] ** 2, LEAST_ALPHA)
        metal = metalness[row_of(metalness, i), 0]
        toward_eye = max(abs(toward_eye), 1e-4)  # limits rounding on surfaces seen edge-on
        length = math.sqrt(squared)
        halfway = min(max(halfway / length, 0.0), 1.0) if length > 0.0 else 0.0
        a2 = alpha * alpha
        spread = halfway * halfway * (a2 - 1.0) + 1.0
        # pi D V, with the height-correlated V.
        shine = (
            a2 / (spread * spread) * 0.5
            / (facing * math.sqrt(toward_eye * toward_eye * (1.0 - a2) + a2)
               + toward_eye * math.sqrt(facing * facing * (1.0 - a2) + a2))
        )  # fmt: skip
        # V·H = |L + V| / 2 for unit vectors.
        grazing = (1.0 - min(0.5 * length, 1.0)) ** 5
        for k in range(3):
            f0 = dielectric + (base[b, k] - dielectric) * metal
            fresnel = f0 + (1.0 - f0) * grazing
            diffuse = (1.0 - fresnel) * (1.0 - metal) * base[b, k]
            out[i, k] += radiance[r, k] * facing * (diffuse + shine * fresnel)


@kernel
def reflect_ambient(normals, up, sky, ground, base, share, out):  # type: ignore[no-untyped-def]
    """Add light from above and below, weighted by how far the normal points up."""
    for i in range(len(out)):
        b, s = row_of(base, i), row_of(share, i)
        above = 1.0
        if len(normals) > 0:
            above = 0.5 + 0.5 * (
                normals[i, 0] * up[0] + normals[i, 1] * up[1] + normals[i, 2] * up[2]
            )
        for k in range(3):
            light = above * sky[0, k] + (1.0 - above) * ground[0, k]
            out[i, k] += share[s] * light * base[b, k]


@kernel
def mirror_directions(normals, to_eye, out):  # type: ignore[no-untyped-def]
    """Write the reflected view directions, 2 (N·V) N - V."""
    for i in range(len(normals)):
        along = 2.0 * (
            normals[i, 0] * to_eye[i, 0]
            + normals[i, 1] * to_eye[i, 1]
            + normals[i, 2] * to_eye[i, 2]
        )
        for k in range(3):
            out[i, k] = along * normals[i, k] - to_eye[i, k]


@kernel
def reflect_environment(  # type: ignore[no-untyped-def]
    normals, to_eye, diffuse, mirrored, table, base, roughness, metalness, dielectric, share, out
):
    """Add an environment's light, diffuse and specular."""
    size = len(table)
    for i in range(len(out)):
        b, s = row_of(base, i), row_of(share, i)
        metal = metalness[row_of(metalness, i), 0]
        scale, bias = 0.0, 0.0
        if len(mirrored) > 0:
            toward_eye = 0.0
            for k in range(3):
                toward_eye += normals[i, k] * to_eye[i, k]
            # Bilinear between the four texels around (n·v, roughness), with centers at halves.
            # Beyond the last center, up to roughness 1, extrapolate linearly.
            x = min(max(abs(toward_eye) * size - 0.5, 0.0), size - 1.0)
            y = max(roughness[row_of(roughness, i), 0] * size - 0.5, 0.0)
            y = min(y, size - 0.5)
            left, top = int(x), max(min(int(y), size - 2), 0)
            right, below = min(left + 1, size - 1), min(top + 1, size - 1)
            fx, fy = x - left, y - top
            scale = (1.0 - fy) * (
                (1.0 - fx) * table[top, left, 0] + fx * table[top, right, 0]
            ) + fy * ((1.0 - fx) * table[below, left, 0] + fx * table[below, right, 0])
            bias = (1.0 - fy) * (
                (1.0 - fx) * table[top, left, 1] + fx * table[top, right, 1]
            ) + fy * ((1.0 - fx) * table[below, left, 1] + fx * table[below, right, 1])
        for k in range(3):
            f0 = dielectric + (base[b, k] - dielectric) * metal
            mirror = f0 * scale + bias
            light = (1.0 - mirror) * (1.0 - metal) * base[b, k] * diffuse[i, k]
            if len(mirrored) > 0:
                light += mirror * mirrored[i, k]
            out[i, k] += share[s] * light


@kernel
def refract_directions(normals, to_eye, back_facing, index, out):  # type: ignore[no-untyped-def]
    """Write the view directions refracted by Snell's law."""
    for i in range(len(normals)):
        # Into the material at front faces, out of it at back faces.
        eta = index if back_facing[i] else 1.0 / index
        cosine = 0.0
        for k in range(3):
            cosine += normals[i, k] * to_eye[i, k]
        inside = 1.0 - eta * eta * (1.0 - cosine * cosine)
        for k in range(3):
            if inside < 0.0:  # total reflection
                out[i, k] = 2.0 * cosine * normals[i, k] - to_eye[i, k]
            else:
                out[i, k] = -eta * to_eye[i, k] + (eta * cosine - math.sqrt(inside)) * normals[i, k]


@kernel
def mix_in_environment(normals, to_eye, strength, seen, fresnel, out):  # type: ignore[no-untyped-def]
    """Replace a share of the fragments' light by the environment's."""
    for i in range(len(out)):
        s = row_of(strength, i)
        grazing = 0.0
        if fresnel:
            cosine = 0.0
            for k in range(3):
                cosine += normals[i, k] * to_eye[i, k]
            grazing = (1.0 - min(abs(cosine), 1.0)) ** 5
        for k in range(3):
            share = min(max(strength[s, k], 0.0), 1.0)
            share += (1.0 - share) * grazing
            out[i, k] += share * (seen[i, k] - out[i, k])


def left_after(distance: float, mode: int, density: float, start: float, end: float) -> float:
    """Share of light that remains after a distance; `mode` is 0 linear, 1 exp, 2 exp2."""
    if mode == 0:
        return min(max((end - distance) / (end - start), 0.0), 1.0)
    thickness = density * distance
    return math.exp(-thickness if mode == 1 else -thickness * thickness)


left_after_compiled = kernel(left_after)


@kernel
def fade_into_fog(positions, eye, mode, density, start, end, color, out):  # type: ignore[no-untyped-def]
    """Mix light with the fog's color by the distance from the camera."""
    for i in range(len(out)):
        squared = 0.0
        for k in range(3):
            squared += (positions[i, k] - eye[k]) ** 2
        left = left_after_compiled(math.sqrt(squared), mode, density, start, end)
        for k in range(3):
            out[i, k] = left * out[i, k] + (1.0 - left) * color[k]
