/* Vertices of a mesh that stays in its file: read where a face needs them, and marked by one bit each.

   Which vertices lie where some others do is found in two steps: the positions of those are hashed
   into a table of bits, three in one word each, and all vertices of the file are looked up in it. A few are marked for
   nothing, which does no harm.

   Based on: Bloom, "Space/Time Trade-offs in Hash Coding with Allowable Errors", 1970; Putze,
   Sanders, Singler, "Cache-, Hash- and Space-Efficient Bloom Filters", 2007, for bits in one word;
   Jacobson, "Space-Efficient Static Trees and Graphs", 1989, for the number of a bit among those that
   are set.

   Called from texbake/mesh/streamed/. */

#include <string.h>

#include "core.h"
#include "numbers.h"

#define WORD 64 /* bits */

/* Where coordinates stand in a file: first byte, bytes of a row, vertices in a row, bytes from one to
   the next, bytes of x, y and z from there, bytes of a coordinate, and whether the greatest byte of
   it comes first. */
struct layout {
    const uint8_t *bytes;
    const int64_t *numbers;
};

static inline double read_coordinate(const uint8_t *at, bool is_double, bool big_endian)
{
    if (is_double) {
        uint64_t bits;
        memcpy(&bits, at, sizeof bits);
        bits = big_endian ? __builtin_bswap64(bits) : bits;
        double value;
        memcpy(&value, &bits, sizeof value);
        return value;
    }
    uint32_t bits;
    memcpy(&bits, at, sizeof bits);
    bits = big_endian ? __builtin_bswap32(bits) : bits;
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static inline void read_vertex(struct layout layout, int64_t vertex, double point[3])
{
    const int64_t *n = layout.numbers;
    const int64_t row = n[2] == 1 ? vertex : vertex / n[2], place = vertex - row * n[2];
    const uint8_t *at = layout.bytes + n[0] + row * n[1] + place * n[3];
    for (int axis = 0; axis < 3; axis++)
        point[axis] = read_coordinate(at + n[4 + axis], n[7] == 8, n[8]);
}

/* Whether vertices are x, y and z in float32 of this machine, one per row. */
static bool is_plain(struct layout layout)
{
    const uint16_t one = 1;
    const bool this_is_big = !*(const uint8_t *)&one;
    const int64_t *n = layout.numbers;
    return n[2] == 1 && n[4] == 0 && n[5] == 4 && n[6] == 8 && n[7] == 4 && n[8] == this_is_big;
}

static inline void read_plain(struct layout layout, int64_t vertex, double point[3])
{
    float values[3];
    memcpy(values, layout.bytes + layout.numbers[0] + vertex * layout.numbers[1], sizeof values);
    for (int axis = 0; axis < 3; axis++)
        point[axis] = values[axis];
}

/* Write the positions of some vertices; without a list of them, of all from `first` on. */
EXPORT void read_vertices(
    int64_t n_bytes, int64_t n_listed, int64_t n, const uint8_t bytes[n_bytes],
    const int64_t layout[9], OPTIONAL const int32_t vertices[n_listed], int64_t first,
    double positions[n][3])
{
    const struct layout all = {bytes, layout};
    const bool plain = is_plain(all);
    for (int64_t i = 0; i < n; i++) {
        const int64_t vertex = vertices ? vertices[i] : first + i;
        if (plain)
            read_plain(all, vertex, positions[i]);
        else
            read_vertex(all, vertex, positions[i]);
    }
}

/* Least and greatest coordinates of points; NaN is left out. */
EXPORT void bound_points(int64_t n, const double points[n][3], double box[6])
{
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (int64_t i = 0; i < n; i++)
        for (int axis = 0; axis < 3; axis++) {
            low[axis] = min_f64(low[axis], points[i][axis]);
            high[axis] = max_f64(high[axis], points[i][axis]);
        }
    memcpy(box, low, sizeof low);
    memcpy(box + 3, high, sizeof high);
}

/* Least and greatest coordinates of the corners of faces. */
EXPORT void bound_corners(
    int64_t n_vertices, int64_t n, const double positions[n_vertices][3], const int32_t faces[n][3],
    double box[6])
{
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (int64_t i = 0; i < n; i++)
        for (int corner = 0; corner < 3; corner++)
            for (int axis = 0; axis < 3; axis++) {
                const double x = positions[faces[i][corner]][axis];
                low[axis] = min_f64(low[axis], x);
                high[axis] = max_f64(high[axis], x);
            }
    memcpy(box, low, sizeof low);
    memcpy(box + 3, high, sizeof high);
}

/* First of the vertices start to stop - 1 with a coordinate that is not finite, or -1. */
EXPORT int64_t find_not_finite(
    int64_t n_bytes, const uint8_t bytes[n_bytes], const int64_t layout[9], int64_t start,
    int64_t stop)
{
    for (int64_t vertex = start; vertex < stop; vertex++) {
        double point[3];
        read_vertex((struct layout){bytes, layout}, vertex, point);
        if (!(isfinite(point[0]) && isfinite(point[1]) && isfinite(point[2])))
            return vertex;
    }
    return -1;
}

static inline uint64_t hash_point(const double point[3])
{
    uint64_t mixed = 3;
    for (int axis = 0; axis < 3; axis++) {
        const double coordinate = point[axis] + 0.0; /* -0.0 is 0.0 */
        uint64_t word;
        memcpy(&word, &coordinate, sizeof word);
        word *= 0xC6A4A7935BD1E995;
        word ^= word >> 47;
        mixed = (mixed ^ word) * 0xC6A4A7935BD1E995;
    }
    return mixed ^ mixed >> 47;
}

static inline bool is_set(const uint64_t *bits, uint64_t at)
{
    return bits[at / WORD] >> (at % WORD) & 1;
}

static inline void set_bit(uint64_t *bits, uint64_t at)
{
    bits[at / WORD] |= (uint64_t)1 << at % WORD;
}

/* Set the bit of each number. */
EXPORT void set_bits(int64_t n, int64_t n_words, const int32_t numbers[n], uint64_t bits[n_words])
{
    for (int64_t i = 0; i < n; i++)
        set_bit(bits, (uint64_t)numbers[i]);
}

/* Three bits of a word, from the upper bits of a hash; its lower bits choose the word. */
static inline uint64_t bits_of(uint64_t hash)
{
    return (uint64_t)1 << (hash >> 58) | (uint64_t)1 << (hash >> 52 & 63) |
           (uint64_t)1 << (hash >> 46 & 63);
}

/* Set the bits of the hash of each point, in a power of two of words. */
EXPORT void set_hashes(
    int64_t n, int64_t n_words, const double points[n][3], uint64_t table[n_words])
{
    for (int64_t i = 0; i < n; i++) {
        const uint64_t hash = hash_point(points[i]);
        table[hash & (uint64_t)(n_words - 1)] |= bits_of(hash);
    }
}

/* Set the bits of those vertices, from start to stop - 1, whose hash has its bits set. */
EXPORT void mark_by_hash(
    int64_t n_bytes, int64_t n_table, int64_t n_words, const uint8_t bytes[n_bytes],
    const int64_t layout[9], const uint64_t table[n_table], int64_t start, int64_t stop,
    uint64_t bits[n_words])
{
    const struct layout all = {bytes, layout};
    const bool plain = is_plain(all);
    for (int64_t vertex = start; vertex < stop; vertex++) {
        double point[3];
        if (plain)
            read_plain(all, vertex, point);
        else
            read_vertex(all, vertex, point);
        const uint64_t hash = hash_point(point), set = bits_of(hash);
        if ((table[hash & (uint64_t)(n_table - 1)] & set) == set)
            set_bit(bits, (uint64_t)vertex);
    }
}

/* Number the bits that are set: `ranks` is how many come before each word. Returns how many there are. */
EXPORT int64_t rank_bits(int64_t n_words, const uint64_t bits[n_words], int32_t ranks[n_words])
{
    int64_t n = 0;
    for (int64_t i = 0; i < n_words; i++) {
        ranks[i] = (int32_t)n;
        n += __builtin_popcountll(bits[i]);
    }
    return n;
}

/* Write the places of the bits that are set. */
EXPORT void list_bits(int64_t n_words, int64_t n, const uint64_t bits[n_words], int32_t places[n])
{
    int64_t at = 0;
    for (int64_t i = 0; i < n_words; i++)
        for (uint64_t rest = bits[i]; rest && at < n; rest &= rest - 1)
            places[at++] = (int32_t)(i * WORD + __builtin_ctzll(rest));
}

static inline int32_t number_of(const uint64_t *bits, const int32_t *ranks, int32_t vertex)
{
    const uint64_t word = bits[vertex / WORD], bit = (uint64_t)1 << vertex % WORD;
    return word & bit ? ranks[vertex / WORD] + __builtin_popcountll(word & (bit - 1)) : -1;
}

/* Write the numbers of the marks of some places, -1 for none; a place below 0 has none. */
EXPORT void number_marks(
    int64_t n, int64_t n_words, const int32_t places[n], const uint64_t bits[n_words],
    const int32_t ranks[n_words], int32_t numbers[n])
{
    for (int64_t i = 0; i < n; i++)
        numbers[i] = places[i] < 0 ? -1 : number_of(bits, ranks, places[i]);
}

/* Of some faces, keep those that have a marked vertex; also write the numbers of the marks at their
   corners, -1 where there is none. Returns how many faces are kept. */
EXPORT int64_t keep_marked_faces(
    int64_t n, int64_t n_words, const int32_t faces[n][3], const uint64_t bits[n_words],
    const int32_t ranks[n_words], int32_t kept[n][3], int32_t numbers[n][3])
{
    int64_t n_kept = 0;
    for (int64_t i = 0; i < n; i++) {
        const int32_t *face = faces[i];
        if (!(is_set(bits, face[0]) || is_set(bits, face[1]) || is_set(bits, face[2])))
            continue;
        for (int corner = 0; corner < 3; corner++) {
            kept[n_kept][corner] = face[corner];
            numbers[n_kept][corner] = number_of(bits, ranks, face[corner]);
        }
        n_kept++;
    }
    return n_kept;
}
