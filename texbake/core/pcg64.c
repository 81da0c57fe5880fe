/* Random numbers, the same that NumPy's `default_rng(seed).random(n)` returns.

   Importing `numpy.random` takes as long as all the rest of measuring a small bake.

   Based on: Melissa O'Neill, "PCG: a family of simple fast space-efficient statistically good
   algorithms for random number generation", 2014 (PCG XSL RR 128/64), and "Developing a seed_seq
   alternative", 2015 (how a seed becomes a state).

   Called from texbake/mesh/distance.py. */

#include "core.h"

typedef unsigned __int128 uint128;

struct pcg64 {
    uint128 state, increment;
};

static uint32_t hashed(uint32_t value, uint32_t *constant, uint32_t factor)
{
    value ^= *constant;
    *constant *= factor;
    value *= *constant;
    return value ^ value >> 16;
}

static uint32_t mixed(uint32_t a, uint32_t b)
{
    const uint32_t value = 0xca01f9ddu * a - 0x4973f715u * b;
    return value ^ value >> 16;
}

/* Spread the bits of a seed over 256. */
static void spread_seed(uint64_t seed, uint64_t words[4])
{
    uint32_t pool[4] = {(uint32_t)seed, (uint32_t)(seed >> 32), 0, 0}, constant = 0x43b0d7e5u;
    for (int i = 0; i < 4; i++)
        pool[i] = hashed(pool[i], &constant, 0x931e8875u);
    for (int from = 0; from < 4; from++)
        for (int to = 0; to < 4; to++)
            if (from != to)
                pool[to] = mixed(pool[to], hashed(pool[from], &constant, 0x931e8875u));
    constant = 0x8b51f9ddu;
    for (int i = 0; i < 4; i++) {
        const uint64_t low = hashed(pool[2 * i % 4], &constant, 0x58f38dedu);
        words[i] = low | (uint64_t)hashed(pool[(2 * i + 1) % 4], &constant, 0x58f38dedu) << 32;
    }
}

static void step(struct pcg64 *random)
{
    const uint128 factor = (uint128)2549297995355413924u << 64 | 4865540595714422341u;
    random->state = random->state * factor + random->increment;
}

static uint64_t next_bits(struct pcg64 *random)
{
    step(random);
    const uint64_t folded = (uint64_t)(random->state >> 64) ^ (uint64_t)random->state;
    const int turn = (int)(random->state >> 122);
    return folded >> turn | folded << (-turn & 63);
}

/* Numbers from 0 (included) to 1 (excluded). */
EXPORT void draw_uniform(int64_t n, uint64_t seed, double values[n])
{
    uint64_t words[4];
    spread_seed(seed, words);
    struct pcg64 random = {0, ((uint128)words[2] << 64 | words[3]) << 1 | 1};
    step(&random);
    random.state += (uint128)words[0] << 64 | words[1];
    step(&random);
    for (int64_t i = 0; i < n; i++)
        values[i] = (double)(next_bits(&random) >> 11) * 0x1p-53;
}
