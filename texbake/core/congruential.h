/* Random numbers of a linear congruential generator: the same on every machine. */

#ifndef TEXBAKE_CONGRUENTIAL_H
#define TEXBAKE_CONGRUENTIAL_H

#include <stdint.h>

/* Step to the next state; return its bits from 8 up, 23 of them. */
static inline int64_t next_random(uint64_t *state)
{
    *state = (*state * 1103515245 + 12345) & 0x7FFFFFFF;
    return (int64_t)(*state >> 8);
}

#endif
