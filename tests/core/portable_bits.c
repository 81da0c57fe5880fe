/* Runs kernels with much floating-point arithmetic on numbers made here, and prints a checksum of
   what each returns. `.ci/arm64` compares what builds for two processors print. */

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "declarations.h"

enum { SIDE = 49, N_VERTICES = SIDE * SIDE, N_FACES = 2 * (SIDE - 1) * (SIDE - 1), N = 20000 };
enum { N_LEAVES = (N_FACES + 7) / 8, MOST_NODES = N_LEAVES, PICTURE = 64 };

static double positions[N_VERTICES][3], x[N], y[N], out[N], points[N][3], unit[N][3];
static int32_t faces[N_FACES][3];
static float pairs[N][3], colors[N][3], small[N];
static uint8_t permutation[512];
static double gradients[256][3];

static double uniform(void) /* between -1 and 1, from the upper bits of Knuth's generator */
{
    static uint64_t state = 1;
    state = state * 6364136223846793005u + 1442695040888963407u;
    return (double)(state >> 11) / 4503599627370496.0 - 1.0;
}

static void report(const char *name, const void *data, size_t size)
{
    uint64_t hash = 14695981039346656037u; /* FNV-1a */
    for (const uint8_t *byte = data; size--; byte++)
        hash = (hash ^ *byte) * 1099511628211u;
    printf("%-24s %016" PRIx64 "\n", name, hash);
}

#define REPORT(name, data) report(name, data, sizeof(data))

static void make_surface(void)
{
    for (int row = 0; row < SIDE; row++)
        for (int column = 0; column < SIDE; column++) {
            double *p = positions[row * SIDE + column];
            p[0] = (double)column / (SIDE - 1) - 0.5 + 0.002 * uniform();
            p[1] = (double)row / (SIDE - 1) - 0.5 + 0.002 * uniform();
            p[2] = 0.6 * p[0] * p[0] - 0.3 * p[1] * p[0] + 0.004 * uniform();
        }
    for (int row = 0, face = 0; row < SIDE - 1; row++)
        for (int column = 0; column < SIDE - 1; column++) {
            const int32_t a = row * SIDE + column, b = a + 1, c = a + SIDE, d = c + 1;
            const int32_t two[2][3] = {{a, b, d}, {a, d, c}};
            memcpy(faces[face], two, sizeof two);
            face += 2;
        }
}

static void make_numbers(void)
{
    for (int i = 0; i < N; i++) {
        x[i] = uniform() * (i % 3 ? 3.0 : 700.0);
        y[i] = uniform() * (i % 5 ? 2.0 : 1e5);
        small[i] = (float)uniform();
        double square = 0.0;
        for (int axis = 0; axis < 3; axis++) {
            points[i][axis] = 4.0 * uniform();
            colors[i][axis] = (float)(0.5 + 0.5 * uniform());
            unit[i][axis] = uniform();
            square += unit[i][axis] * unit[i][axis];
        }
        array_power(1, &square, (const double[]){-0.5}, &square);
        for (int axis = 0; axis < 3; axis++)
            pairs[i][axis] = (float)(unit[i][axis] *= square);
    }
    for (int i = 0; i < 512; i++)
        permutation[i] = (uint8_t)((i % 256) * 167 + 13);
    memcpy(gradients, unit, sizeof gradients);
}

static void run_elementary(void)
{
    static double positive[N], sine[N];
    for (int i = 0; i < N; i++) {
        positive[i] = x[i] < 0.0 ? -x[i] : x[i];
        sine[i] = x[i] / 701.0;
    }
#define ONE(name, given)               \
    array_##name(N, given, out);       \
    REPORT(#name, out);
    ONE(sin, y) ONE(cos, y) ONE(tan, y) ONE(asin, sine) ONE(acos, sine) ONE(atan, y)
    ONE(exp, x) ONE(log, positive) ONE(log2, positive) ONE(log10, positive)
    array_atan2(N, x, y, out);
    REPORT("atan2", out);
    array_hypot(N, x, y, out);
    REPORT("hypot", out);
    array_power(N, positive, sine, out);
    REPORT("power", out);
    static float powers[N];
    array_float_power(N, &colors[0][0], small, powers);
    REPORT("float_power", powers);
}

static void run_meshes(void)
{
    static double normals[N_VERTICES][3], of_faces[N_FACES][3], uvs[N_VERTICES][2];
    face_normals(N_VERTICES, N_FACES, positions, faces, 1.0, 1e-15, 0, N_FACES, of_faces);
    REPORT("face_normals", of_faces);
    add_vertex_normals(
        N_VERTICES, N_FACES, N_VERTICES, positions, faces, faces, 1.0, 1e-15, 0, N_FACES, normals);
    normalize_sums(N_VERTICES, normals);
    REPORT("vertex_normals", normals);

    double figures[3] = {0};
    flatten_patch(N_VERTICES, N_FACES, positions, faces, false, 20, 1e-6, false, uvs, figures);
    REPORT("flatten_patch", uvs);
    REPORT("its figures", figures);

    int64_t starts[] = {0, N_FACES / 3, N_FACES};
    static double clusters[2][7], windings[2000];
    gather_clusters(N_VERTICES, N_FACES, 2, positions, faces, starts, clusters, 0, 2);
    measure_winding(
        N_VERTICES, N_FACES, 2, 2000, positions, faces, starts, clusters, points, windings, 0, 2000);
    REPORT("measure_winding", windings);

    static double kept[N_VERTICES][3];
    static int32_t left[N_FACES][3], rows[N_VERTICES];
    memcpy(kept, positions, sizeof kept);
    memcpy(left, faces, sizeof left);
    for (int i = 0; i < N_VERTICES; i++)
        rows[i] = i;
    collapse_edges(
        N_VERTICES, N_VERTICES, N_FACES, N_VERTICES, 0, 0, rows, kept, left, rows, uvs, NULL, NULL,
        NULL, NULL, NULL, 0.0, 500, true, false, false);
    REPORT("collapse_edges", kept);
    REPORT("its faces", left);
}

static void run_rays(void)
{
    static uint64_t places[N_FACES];
    static double leaves[N_LEAVES][9][8], lengths[N], nearest[N], backs[N], weights[N][2],
        distances[N], origins[N][3];
    static int32_t ids[N_LEAVES][8], hits[N], texels[N][2], charts[N];
    static float nodes[MOST_NODES][6][8];
    static bool passed[N];
    for (int i = 0; i < N_FACES; i++)
        places[i] = (uint64_t)i;
    int64_t starts[8] = {0}, n_levels = 0, first = 0, size = (N_LEAVES + 7) / 8;
    const double center[3] = {0.0, 0.0, 0.0};
    bound_leaves(
        N_FACES, N_VERTICES, N_FACES, N_LEAVES, size, places, positions, faces, center, 1.0, ids,
        nodes);
    fill_leaves(N_VERTICES, N_FACES, N_LEAVES, ids, positions, faces, 0, center, 1.0, leaves);
    for (;; size = (size + 7) / 8) {
        starts[n_levels++] = first;
        if (size == 1)
            break;
        join_boxes(size, (size + 7) / 8, nodes + first, nodes + first + size);
        first += size;
    }
    for (int i = 0; i < N; i++) {
        lengths[i] = 2.0;
        nearest[i] = backs[i] = 1e300;
        hits[i] = -1;
        texels[i][0] = i % 16, texels[i][1] = i / 16;
        for (int axis = 0; axis < 3; axis++)
            origins[i][axis] = 0.1 * points[i][axis] - 0.7 * unit[i][axis];
    }
    const double box[6] = {-0.6, -0.6, -0.6, 0.6, 0.6, 0.6};
    cast_bundles(
        N, N_LEAVES, first + 1, n_levels, N_VERTICES, N_FACES, positions, faces, 0, center, 1.0, ids,
        leaves, nodes, starts, box, origins, unit, lengths, texels, charts, false, nearest, backs,
        hits, weights, distances, passed);
    int64_t n_hits = 0;
    for (int i = 0; i < N; i++)
        n_hits += hits[i] >= 0;
    printf("%" PRId64 " rays hit\n", n_hits);
    REPORT("cast_bundles", hits);
    REPORT("its weights", weights);
    REPORT("its distances", distances);
}

static void run_pictures(void)
{
    static float values[N][1], direction[N][3], light[N][3];
    static double sums[N];
    fill_octave_sums(
        N, 3, 0, points, NULL, permutation, gradients, sums, true, 6, 2.0, 0.5, 0.0, 0, N);
    REPORT("fill_octave_sums", sums);
    fill_cells(N, 3, 0, points, NULL, permutation, gradients, values, 0.9, true, 1, 0.5, 0, N);
    REPORT("fill_cells", values);
    find_arriving_light(
        N, points, pairs, (const double[]){0.0, 5.0, 1.0}, (const double[]){0.0, -1.0, 0.0}, 0.9,
        0.2, 2.0, (const float[1][3]){{1.0f, 0.9f, 0.7f}}, direction, light);
    REPORT("find_arriving_light", light);
    const float roughness[1][1] = {{0.4f}}, metalness[1][1] = {{0.3f}};
    static float shaded[N][3];
    reflect_metallic(
        N, N, N, N, 1, 1, pairs, direction, light, direction, colors, roughness, metalness, 0.04,
        0.001, shaded);
    REPORT("reflect_metallic", shaded);
    const int64_t sizes[1][2] = {{PICTURE, PICTURE}};
    const float border[3] = {0};
    static double uvs[N][2];
    for (int i = 0; i < N; i++)
        memcpy(uvs[i], points[i], sizeof uvs[i]);
    static float sampled[N][3];
    sample_bicubic(PICTURE * PICTURE, 3, 1, N, colors, sizes, uvs, 0, border, sampled, 0, N);
    REPORT("sample_bicubic", sampled);
}

int main(void)
{
    make_surface();
    make_numbers();
    run_elementary();
    run_meshes();
    run_rays();
    run_pictures();
    return 0;
}
