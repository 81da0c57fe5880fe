/* Walks along lines, which draw each line once, and their points as path data of SVG.

   Called from texbake/mapping/layout_svg.py. */

#include "core.h"

/* Draw each line once in few walks, built greedily from the places in the order of `starts`.

   The lines that leave place p are those in slots `nexts[p]` to `stops[p]` - 1; `line_of` is the line
   of a slot, which may have another slot for its way back, and `leads_to` the place at its end. All
   of `used` are false, and `nexts` advances. `walks` gets the places of one walk after another, and
   `ends` where each of them stops. Returns the number of walks. */
EXPORT int64_t find_walks(
    int64_t n_places, int64_t n_slots, int64_t n_lines, int64_t n_walked,
    const int64_t starts[n_places], int64_t nexts[n_places], const int64_t stops[n_places],
    const int64_t leads_to[n_slots], const int64_t line_of[n_slots], bool used[n_lines],
    int64_t walks[n_walked], int64_t ends[n_lines])
{
    int64_t n_walks = 0, filled = 0;
    for (int64_t start = 0; start < n_places; start++) {
        for (;;) {
            const int64_t first = filled;
            int64_t at = starts[start];
            for (;;) {
                while (nexts[at] < stops[at] && used[line_of[nexts[at]]])
                    nexts[at]++;
                if (nexts[at] == stops[at])
                    break;
                if (filled == first)
                    walks[filled++] = at;
                used[line_of[nexts[at]]] = true;
                at = leads_to[nexts[at]];
                walks[filled++] = at;
            }
            if (filled == first)
                break;
            ends[n_walks++] = filled;
        }
    }
    return n_walks;
}

/* Text that is written, or only measured if there is no place for it. */
struct output {
    uint8_t *bytes;
    int64_t n;
};

static inline void put(struct output *out, uint8_t byte)
{
    if (out->bytes)
        out->bytes[out->n] = byte;
    out->n++;
}

/* Write a number, and before it a blank if nothing else would separate it from the one before. */
static void put_number(struct output *out, int64_t number, bool separated)
{
    uint8_t digits[20];
    int n = 0;
    uint64_t rest = number < 0 ? -(uint64_t)number : (uint64_t)number;
    do
        digits[n++] = (uint8_t)('0' + rest % 10);
    while ((rest /= 10) > 0);
    if (number < 0)
        put(out, '-');
    else if (separated)
        put(out, ' ');
    while (n > 0)
        put(out, digits[--n]);
}

/* Write walks as path data, given their points one after another, and where those of each walk end.

   `closed` walks end where they began; "z" draws their last step. Returns the length of the text;
   `text_ends` is where that of each walk ends. */
EXPORT int64_t write_walks(
    int64_t n_points, int64_t n_walks, int64_t n_bytes, const int64_t points[n_points][2],
    const int64_t ends[n_walks], bool closed, OPTIONAL uint8_t text[n_bytes],
    int64_t text_ends[n_walks])
{
    struct output out = {text, 0};
    for (int64_t walk = 0; walk < n_walks; walk++) {
        const int64_t first = walk > 0 ? ends[walk - 1] : 0;
        put(&out, 'M');
        put_number(&out, points[first][0], false);
        put(&out, ' ');
        put_number(&out, points[first][1], false);
        put(&out, 'l');
        for (int64_t at = first + 1; at < ends[walk] - closed; at++) {
            put_number(&out, points[at][0] - points[at - 1][0], at > first + 1);
            put_number(&out, points[at][1] - points[at - 1][1], true);
        }
        if (closed)
            put(&out, 'z');
        text_ends[walk] = out.n;
    }
    return out.n;
}
