"""OpenGL on Mesa's llvmpipe, which rasterizes on the processor; see `peer_job`.

Needs moderngl and Mesa's EGL (Debian: libegl1 libegl-mesa0 libgl1-mesa-dri libopengl0).

llvmpipe takes shortcuts in texture lookup for speed. Pictures are made without them, since texbake
follows the definitions of the OpenGL specification; times are measured with them, as Mesa comes.
"""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass
from typing import Any

import numpy as np
from peer_job import Job, UnavailableError, draw_files, read_job

_SRGB8, _SRGB8_ALPHA8, _FRAMEBUFFER_SRGB = 0x8C41, 0x8C43, 0x8DB9  # moderngl names none of them

_VERTEX = """
uniform mat4 clip_from_world;
in vec3 in_position;
out vec3 position;
#ifdef LIT
in vec3 in_normal;
out vec3 normal;
#endif
#ifdef MAPPED
in vec2 in_uv;
out vec2 uv;
#endif
#ifdef BENT
in vec4 in_tangent;
out vec4 tangent;
#endif
void main() {
    gl_Position = clip_from_world * vec4(in_position, 1.0);
    position = in_position;
#ifdef LIT
    normal = in_normal;
#endif
#ifdef MAPPED
    uv = in_uv;
#endif
#ifdef BENT
    tangent = in_tangent;
#endif
}
"""

_FRAGMENT = """
uniform vec3 base_color, to_light, light, ambient, eye, specular;
uniform float exponent;
uniform sampler2D base_map, normal_map;
in vec3 position;
#ifdef LIT
in vec3 normal;
#endif
#ifdef MAPPED
in vec2 uv;
#endif
#ifdef BENT
in vec4 tangent;
#endif
out vec4 color;
#ifdef MAPPED
#ifdef EXACT
// uv / w and 1 / w are linear over the picture, so that differences of neighbors are exact.
float stretch(sampler2D map, vec2 over_w, float one_over_w) {
    return length((over_w - uv * one_over_w) / gl_FragCoord.w * vec2(textureSize(map, 0)));
}
vec4 look_up(sampler2D map) {
    vec2 over_w = uv * gl_FragCoord.w;
    float along_x = stretch(map, dFdx(over_w), dFdx(gl_FragCoord.w));
    float along_y = stretch(map, dFdy(over_w), dFdy(gl_FragCoord.w));
    return textureLod(map, uv, log2(max(along_x, along_y)));
}
#else
vec4 look_up(sampler2D map) { return texture(map, uv); }
#endif
#endif
void main() {
    vec3 reflected = base_color;
#ifdef COLORED
    reflected *= look_up(base_map).rgb;
#endif
#ifdef LIT
    vec3 n = normal;
#ifdef BENT
    vec3 bend = look_up(normal_map).xyz * 2.0 - 1.0;
    n = bend.x * tangent.xyz + bend.y * (tangent.w * cross(normal, tangent.xyz)) + bend.z * normal;
#endif
    n = normalize(n);
    float facing = dot(n, to_light);
    reflected *= ambient + light * max(facing, 0.0);
#ifdef SHINING
    vec3 halfway = normalize(to_light + normalize(eye - position));
    if (facing > 0.0) reflected += light * specular * pow(max(dot(n, halfway), 0.0), exponent);
#endif
#endif
    color = vec4(reflected, 1.0);
}
"""


@dataclass(frozen=True, eq=False)
class Loaded:
    """A job with all that OpenGL holds of it."""

    job: Job
    program: Any
    vertices: Any
    textures: list[Any]
    drawn: Any
    resolved: Any
    pixels: np.ndarray

    def release(self):
        """Give the memory back."""
        for item in self.vertices, self.drawn, self.resolved, *self.textures:
            item.release()


class Llvmpipe:
    """An OpenGL context without a window.

    Parameters
    ----------
    threads
        Of its rasterizer; None for every processor. The first context of a process decides.
    exact
        Without shortcuts in texture lookup.
    codes
        Pictures are 8-bit sRGB, as on a screen, not linear float32.
    """

    def __init__(self, threads=None, *, exact=False, codes=False):
        # Mesa reads these when it is loaded.
        os.environ["LIBGL_ALWAYS_SOFTWARE"] = "1"
        os.environ["GALLIUM_DRIVER"] = "llvmpipe"
        os.environ["EGL_PLATFORM"] = "surfaceless"
        os.environ["LP_NUM_THREADS"] = str(threads or os.cpu_count())
        if exact:
            os.environ["GALLIVM_PERF"] = "no_brilinear,no_rho_approx,no_quad_lod"
        try:
            import moderngl
        except ImportError as error:
            raise UnavailableError(f"moderngl cannot be imported: {error}") from None
        try:
            self._context = moderngl.create_context(standalone=True, backend="egl", require=330)
        except Exception as error:  # whatever the libraries say that are not there
            raise UnavailableError(f"EGL gives no OpenGL context: {error}") from None
        self.name = f"{self._context.info['GL_RENDERER']}, {self._context.info['GL_VERSION']}"
        if "llvmpipe" not in self.name:
            raise UnavailableError(f"EGL does not draw with llvmpipe, but with {self.name}")
        self.codes = codes
        self._context.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        self._context.enable_direct(_FRAMEBUFFER_SRGB)
        self._programs: dict[str, Any] = {}

    def load(self, job):
        """Hand over a job's arrays and images, mip levels made; a shader is compiled once."""
        program = self._program(job)
        columns = {"in_position": job.positions, "in_normal": job.normals}
        columns |= {"in_uv": job.uvs, "in_tangent": job.tangents}
        contents = [
            (self._buffer(column, np.float32), f"{column.shape[1]}f", name)
            for name, column in columns.items()
            if name in program
        ]
        vertices = self._context.vertex_array(program, contents, self._buffer(job.faces, np.uint32))
        textures = []
        for name in "base_map", "normal_map":
            if name in program:
                program[name] = len(textures)
                textures.append(self._texture(getattr(job, name), job, name == "base_map"))
        pixels = np.empty((job.height, job.width, 4), np.uint8 if self.codes else np.float32)
        drawn = resolved = self._target(job, 0)
        if job.samples > 1:
            drawn = self._target(job, job.samples)
        return Loaded(job, program, vertices, textures, drawn, resolved, pixels)

    def draw(self, loaded):
        """Draw, and read back (H, W, 4), row 0 at the bottom, until the next picture of the job."""
        job, program = loaded.job, loaded.program
        matrix = job.opengl_from_world.T  # OpenGL's matrices go down their columns
        program["clip_from_world"].write(np.ascontiguousarray(matrix, np.float32))
        for name in "base_color", "to_light", "light", "ambient", "eye", "specular", "exponent":
            if name in program:
                value = getattr(job, name)
                program[name] = value if name == "exponent" else tuple(map(float, value))
        loaded.drawn.use()
        loaded.drawn.clear()
        for place, texture in enumerate(loaded.textures):
            texture.use(place)
        loaded.vertices.render()
        if loaded.drawn is not loaded.resolved:
            self._context.copy_framebuffer(loaded.resolved, loaded.drawn)
        loaded.resolved.read_into(loaded.pixels, components=4, dtype="f1" if self.codes else "f4")
        return loaded.pixels

    def _buffer(self, values, dtype):
        return self._context.buffer(np.ascontiguousarray(values, dtype))

    def _program(self, job):
        """The shader of a job's features, compiled when it is first asked for."""
        words = {
            "LIT": job.shading != "unlit", "SHINING": job.shading == "blinn-phong",
            "MAPPED": job.base_map is not None or job.normal_map is not None,
            "COLORED": job.base_map is not None, "BENT": job.normal_map is not None,
            "EXACT": job.exact_levels and job.filter == "trilinear",
        }  # fmt: skip
        head = "#version 330\n" + "".join(f"#define {word}\n" for word in words if words[word])
        if head not in self._programs:
            self._programs[head] = self._context.program(
                vertex_shader=head + _VERTEX, fragment_shader=head + _FRAGMENT
            )
        return self._programs[head]

    def _texture(self, image, job, is_color):
        import moderngl

        height, width, n_channels = image.shape
        is_coded = image.dtype == np.uint8
        internal = _SRGB8 if n_channels == 3 else _SRGB8_ALPHA8
        texture = self._context.texture(
            (width, height), n_channels, np.ascontiguousarray(image[::-1]), alignment=1,
            dtype="f1" if is_coded else "f4",
            internal_format=internal if is_coded and is_color else None,
        )  # fmt: skip
        if job.filter == "trilinear":
            texture.build_mipmaps()
            texture.filter = moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR
        else:
            texture.filter = (
                getattr(moderngl, {"bilinear": "LINEAR"}.get(job.filter, "NEAREST")),
            ) * 2
        return texture

    def _target(self, job, samples):
        size = job.width, job.height
        if self.codes:
            color = self._context.texture(size, 4, samples=samples, internal_format=_SRGB8_ALPHA8)
        else:
            color = self._context.texture(size, 4, samples=samples, dtype="f4")
        depth = self._context.depth_renderbuffer(size, samples=samples)
        return self._context.framebuffer(color, depth)


def draw_all(paths):
    """Draw jobs one after another."""
    renderer = Llvmpipe(exact=True)
    for path in paths:
        loaded = renderer.load(read_job(path))
        yield renderer.draw(loaded)[::-1].copy()
        loaded.release()


if __name__ == "__main__":
    sys.exit(draw_files(__doc__, draw_all))
