/* Exposing a picture: scaling its light, and rolling off what is brighter than white.

   Based on: Khronos Group, "Khronos PBR Neutral Tone Mapper", 2024, without its offset, which is for
   light from all sides. Light up to START is unchanged; brighter light keeps its hue and approaches
   white.

   Called from texbake/rendering/resolve.py. */

#include "core.h"
#include "numbers.h"

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
