/* Compositing layers, summing samples, averaging pixels, and exposing the picture: scaling its light,
   and rolling off what is brighter than white.

   Based on: Porter and Duff, "Compositing digital images", SIGGRAPH 1984; Khronos Group, "Khronos PBR
   Neutral Tone Mapper", 2024, without its offset, which is for light from all sides. Light up to START
   is unchanged; brighter light keeps its hue and approaches white.

   Called from texbake/rendering/passes.py, texbake/rendering/resolve.py and
   texbake/rendering/effects/transparency.py. */

#include <math.h>

#include "core.h"
#include "numbers.h"
#include "objects.h"

/* Mark the objects that are visible in some sample. */
EXPORT void mark_seen_objects(
    int64_t height, int64_t width, int64_t n_objects, const int32_t face_ids[height][width],
    const int64_t starts[n_objects + 1], bool seen[n_objects], int64_t start, int64_t stop)
{
    int64_t owner = 0;
    for (int64_t row = start; row < stop; row++) {
        for (int64_t column = 0; column < width; column++) {
            const int32_t face = face_ids[row][column];
            if (face < 0)
                continue;
            owner = object_near(owner, face, n_objects, starts);
            seen[owner] = true;
        }
    }
}

/* Bound light in place by `brightest`; NaN becomes 0. Products of large numbers can overflow
   float32, and so can the light of extremely bright lamps. */
EXPORT void keep_finite(int64_t n, float light[n][3], double brightest)
{
    float *values = light[0];
    for (int64_t i = 0; i < 3 * n; i++)
        values[i] = isnan(values[i]) ? 0.0f : (float)clamp_f64(values[i], -brightest, brightest);
}

/* Composite a layer behind the layers in front of it; `directions` and `normals` go together. */
EXPORT void put_layer_behind(
    int64_t height, int64_t width, int64_t n, const int32_t of_samples[height][width],
    const float colors[n][3], const float opacity[n], OPTIONAL const float directions[n][3],
    float light[height][width][3], float passed[height][width],
    OPTIONAL float normals[height][width][3], bool seen[height][width])
{
    for (int64_t j = 0; j < height; j++) {
        for (int64_t i = 0; i < width; i++) {
            const int32_t fragment = of_samples[j][i];
            if (fragment < 0)
                continue;
            const float share = passed[j][i] * opacity[fragment];
            if (share > 0.0f)
                seen[j][i] = true;
            for (int k = 0; k < 3; k++) {
                light[j][i][k] += share * colors[fragment][k];
                if (directions && normals)
                    normals[j][i][k] += share * directions[fragment][k];
            }
            passed[j][i] *= 1.0f - opacity[fragment];
        }
    }
}

/* Add the samples of some rows to their pixels; `normals` and `normal_sums` go together. */
EXPORT void sum_samples(
    int64_t sample_rows, int64_t sample_columns, int64_t height, int64_t width,
    const float light[sample_rows][sample_columns][3],
    const float passed[sample_rows][sample_columns],
    OPTIONAL const float normals[sample_rows][sample_columns][3],
    const bool seen[sample_rows][sample_columns], int64_t first_row, int64_t side,
    float color[height][width][4], float coverage[height][width],
    OPTIONAL float normal_sums[height][width][3])
{
    for (int64_t j = 0; j < sample_rows; j++) {
        const int64_t row = first_row + j / side;
        for (int64_t i = 0; i < sample_columns; i++) {
            const int64_t column = i / side;
            for (int k = 0; k < 3; k++) {
                color[row][column][k] += light[j][i][k];
                if (normals && normal_sums)
                    normal_sums[row][column][k] += normals[j][i][k];
            }
            color[row][column][3] += 1.0f - passed[j][i];
            if (seen[j][i])
                coverage[row][column] += 1.0f;
        }
    }
}

/* Write the nearest triangle in each pixel and its distance. */
EXPORT void find_nearest(
    int64_t sample_rows, int64_t sample_columns, int64_t height, int64_t width,
    const int32_t face_ids[sample_rows][sample_columns],
    const float depths[sample_rows][sample_columns], int64_t side, double near,
    int32_t ids_out[height][width], float depths_out[height][width])
{
    for (int64_t row = 0; row < height; row++) {
        for (int64_t column = 0; column < width; column++) {
            float nearest = 0.0f;
            for (int64_t j = row * side; j < (row + 1) * side; j++) {
                for (int64_t i = column * side; i < (column + 1) * side; i++) {
                    if (depths[j][i] > nearest) {
                        nearest = depths[j][i];
                        ids_out[row][column] = face_ids[j][i];
                    }
                }
            }
            if (nearest > 0.0f)
                depths_out[row][column] = (float)(near / nearest);
        }
    }
}

/* Add opaque fragments to their pixels; `normals` and `normal_sums` go together. */
EXPORT void add_fragments(
    int64_t n, int64_t n_pixels, const int32_t pixels[n], const float counts[n],
    const float light[n][3], OPTIONAL const float normals[n][3], float color[n_pixels][4],
    float coverage[n_pixels], OPTIONAL float normal_sums[n_pixels][3])
{
    for (int64_t i = 0; i < n; i++) {
        const int32_t pixel = pixels[i];
        const float count = counts[i];
        for (int k = 0; k < 3; k++)
            color[pixel][k] += count * light[i][k];
        color[pixel][3] += count;
        coverage[pixel] += count;
        for (int k = 0; normals && normal_sums && k < 3; k++)
            normal_sums[pixel][k] += count * normals[i][k];
    }
}

/* Divide sums by the samples, and composite over the background, which has a single value or one
   per pixel. */
EXPORT void finish_pixels(
    int64_t height, int64_t width, int64_t rows_behind, int64_t columns_behind,
    float color[height][width][4], float coverage[height][width],
    OPTIONAL float normals[height][width][3], double n_samples,
    const float behind[rows_behind][columns_behind][3], bool opaque, int64_t start, int64_t stop)
{
    for (int64_t row = start; row < stop; row++) {
        for (int64_t column = 0; column < width; column++) {
            float *pixel = color[row][column];
            coverage[row][column] = (float)(coverage[row][column] / n_samples);
            const double hiding = min_f64(pixel[3], n_samples);
            const float *back =
                behind[rows_behind > 1 ? row : 0][columns_behind > 1 ? column : 0];
            for (int k = 0; k < 3; k++) {
                double light = pixel[k];
                if (opaque)
                    light = (light + (n_samples - hiding) * back[k]) / n_samples;
                else if (hiding > 0.0)
                    /* Not premultiplied: the color is that of the surface, whatever its coverage. */
                    light /= hiding;
                pixel[k] = (float)light;
            }
            pixel[3] = (float)(opaque ? 1.0 : hiding / n_samples);
            if (!normals)
                continue;
            float *normal = normals[row][column];
            const float length =
                sqrtf(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]);
            for (int k = 0; length > 0.0f && k < 3; k++)
                normal[k] /= length;
        }
    }
}

/* Brightest channel from which light is compressed, and how fast it then fades to white. */
#define START 0.8
#define DESATURATION 0.15

/* Count covered pixels of rows [start, stop), and covered pixels with a channel above 1. */
EXPORT void count_bright(
    int64_t height, int64_t width, const float color[height][width][4],
    const float coverage[height][width], int64_t counts[height][2], int64_t start, int64_t stop)
{
    for (int64_t row = start; row < stop; row++) {
        int64_t n_covered = 0, n_bright = 0;
        for (int64_t column = 0; column < width; column++) {
            const float *c = color[row][column];
            const bool covered = coverage[row][column] == 1.0f;
            n_covered += covered;
            n_bright += covered && (c[0] > 1.0f || c[1] > 1.0f || c[2] > 1.0f);
        }
        counts[row][0] = n_covered;
        counts[row][1] = n_bright;
    }
}

/* Expose light in place; return whether it changed. */
static bool expose(double light[3], double exposure)
{
    double peak = 0.0;
    for (int k = 0; k < 3; k++) {
        light[k] *= exposure;
        if (light[k] > peak)
            peak = light[k];
    }
    if (peak <= START)
        return exposure != 1.0;
    const double room = 1.0 - START;
    const double new_peak = 1.0 - room * room / (peak + room - START);
    const double white = 1.0 - 1.0 / (DESATURATION * (peak - new_peak) + 1.0);
    for (int k = 0; k < 3; k++) {
        const double scaled = light[k] * (new_peak / peak);
        light[k] = scaled + (new_peak - scaled) * white;
    }
    return true;
}

/* Expose the surfaces in the pixels of rows [start, stop). `behind` is the background color that
   opaque pixels show where surfaces do not cover them, and is not exposed; if it is NULL, the light
   is not premultiplied. */
EXPORT void expose_pixels(
    int64_t height, int64_t width, float color[height][width][4],
    const float coverage[height][width], OPTIONAL const float behind[3], double exposure,
    int64_t start, int64_t stop)
{
    for (int64_t row = start; row < stop; row++) {
        for (int64_t column = 0; column < width; column++) {
            const double covered = coverage[row][column];
            float *pixel = color[row][column];
            if (covered <= 0.0)
                continue;
            double light[3];
            const double free = behind ? 1.0 - covered : 0.0;
            for (int k = 0; k < 3; k++) {
                const double back = behind ? free * behind[k] : 0.0;
                light[k] = max_f64((pixel[k] - back) / (1.0 - free), 0.0);
            }
            if (!expose(light, exposure))
                continue;
            for (int k = 0; k < 3; k++)
                pixel[k] = (float)(light[k] * (1.0 - free) + (behind ? free * behind[k] : 0.0));
        }
    }
}
