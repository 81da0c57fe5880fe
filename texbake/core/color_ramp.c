/* Colors between the stops of a ramp: a texture of one dimension, with texels at its ends.

   Based on: linear interpolation; texture_lookup.h for the wrap modes.

   Called from texbake/texture/lookup.py. */

#include "core.h"
#include "numbers.h"
#include "texture_lookup.h"

EXPORT void sample_ramp(
    int64_t n_stops, int64_t n_channels, int64_t n,
    const float stops[n_stops][n_channels], const float values[n], int64_t wrap,
    const float border[n_channels], float out[n][n_channels], int64_t start, int64_t stop)
{
    const int64_t last = n_stops - 1;
    for (int64_t i = start; i < stop; i++) {
        double place = wrap_to_unit(values[i], wrap);
        if (wrap == WRAP_BORDER && !(place >= 0.0 && place <= 1.0)) {
            for (int64_t channel = 0; channel < n_channels; channel++)
                out[i][channel] = border[channel];
            continue;
        }
        place *= (double)last;
        const int64_t first = max_i64(min_i64((int64_t)place, last - 1), 0);
        const int64_t second = min_i64(first + 1, last);
        const float along = (float)(place - (double)first);
        for (int64_t channel = 0; channel < n_channels; channel++) {
            const float value = stops[first][channel];
            out[i][channel] = value + along * (stops[second][channel] - value);
        }
    }
}
