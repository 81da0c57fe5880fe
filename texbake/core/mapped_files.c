/* Files that are mapped into memory and become shorter while they are read.

   Reading a page beyond the end of a mapped file is SIGBUS, which ends the process without a word.
   Here the lost pages of a guarded mapping become zeros instead, and the loss is counted, so that the
   reader can say what happened. On Windows, a mapped file cannot become shorter.

   Called from texbake/mesh/streamed/mapped_file.py. */

#define _GNU_SOURCE

#include "core.h"

#if defined(_WIN32)

int64_t guard_mapping(int64_t n, const uint8_t data[n])
{
    (void)data;
    return -1;
}

void release_mapping(int64_t slot)
{
    (void)slot;
}

int64_t count_lost_mappings(void)
{
    return 0;
}

#else

#include <signal.h>
#include <stdatomic.h>
#include <stddef.h>
#include <sys/mman.h>
#include <unistd.h>

/* A mapping that finds no free slot is not guarded. */
enum { N_SLOTS = 256 };

/* A slot is free where its end is 0, and taken but not yet in use where it is 1. */
struct guarded {
    atomic_uintptr_t start, end;
};

static struct guarded slots[N_SLOTS];
static atomic_long n_lost;
static struct sigaction before;

/* Let whoever handled the signal before handle it. */
static void pass_on(int number, siginfo_t *info, void *context)
{
    if ((before.sa_flags & SA_SIGINFO) != 0 && before.sa_sigaction != NULL) {
        before.sa_sigaction(number, info, context);
    } else if (before.sa_handler != SIG_DFL && before.sa_handler != SIG_IGN) {
        before.sa_handler(number);
    } else {
        signal(number, SIG_DFL); /* the instruction is run again, and ends the process */
    }
}

/* Replace the rest of a guarded mapping, from the page that is missing, by zeros. */
static void on_missing_page(int number, siginfo_t *info, void *context)
{
    const uintptr_t at = (uintptr_t)info->si_addr;
    for (int i = 0; i < N_SLOTS; i++) {
        const uintptr_t start = atomic_load(&slots[i].start), end = atomic_load(&slots[i].end);
        if (end <= 1 || at < start || at >= end)
            continue;
        const uintptr_t page = at & ~((uintptr_t)sysconf(_SC_PAGESIZE) - 1);
        const void *zeros = mmap((void *)page, end - page, PROT_READ,
            MAP_FIXED | MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
        if (zeros == MAP_FAILED)
            break;
        atomic_fetch_add(&n_lost, 1);
        return;
    }
    pass_on(number, info, context);
}

static void install_handler(void)
{
    struct sigaction now;
    if (sigaction(SIGBUS, NULL, &now) != 0
        || ((now.sa_flags & SA_SIGINFO) != 0 && now.sa_sigaction == on_missing_page))
        return;
    before = now;
    struct sigaction ours = {.sa_sigaction = on_missing_page, .sa_flags = SA_SIGINFO | SA_ONSTACK};
    sigemptyset(&ours.sa_mask);
    sigaction(SIGBUS, &ours, NULL);
}

/* Guard the bytes of a mapped file; returns the slot to release before it is unmapped, or -1. */
int64_t guard_mapping(int64_t n, const uint8_t data[n])
{
    install_handler();
    for (int64_t i = 0; i < N_SLOTS; i++) {
        uintptr_t unused = 0;
        if (!atomic_compare_exchange_strong(&slots[i].end, &unused, 1))
            continue;
        atomic_store(&slots[i].start, (uintptr_t)data);
        atomic_store(&slots[i].end, (uintptr_t)data + (uintptr_t)n);
        return i;
    }
    return -1;
}

void release_mapping(int64_t slot)
{
    if (slot >= 0 && slot < N_SLOTS)
        atomic_store(&slots[slot].end, 0);
}

/* How many mappings have lost pages so far in this process. */
int64_t count_lost_mappings(void)
{
    return atomic_load(&n_lost);
}

#endif
