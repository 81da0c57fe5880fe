/* The end of a process that was told to end, even while Python cannot run.

   Python hears a signal between its own steps. A library such as NumPy may hold the interpreter for
   seconds, and then no thread of Python can act either. The thread that waits here needs no Python:
   it reads the numbers of signals from the pipe that `signal.set_wakeup_fd` writes to. If the work
   goes on after one, it removes the temporary files of the process, prints one line and ends it.

   A child process ends at once, without cleaning up, when the pipe from its parent is closed.

   Python shares two pieces of memory: `flags`, and the `notes` of `texbake/unfinished.py`, which say
   whether files are taking their names, and where temporary files are.

   Called from texbake/core/signal_watch.py. */

#define _GNU_SOURCE

#include "core.h"

#if defined(_WIN32)

int64_t end_with_pipe(int64_t descriptor)
{
    (void)descriptor;
    return 0;
}

int64_t end_after_signals(int64_t descriptor, double patience, double to_end, int64_t n_flags,
    uint8_t flags[n_flags], int64_t n_notes, uint8_t notes[n_notes])
{
    (void)descriptor;
    (void)patience;
    (void)to_end;
    (void)flags;
    (void)notes;
    return 0;
}

#else

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

/* Of `flags`. */
enum { HEARD, SAID, PRINTED, ENDED, N_FLAGS };
/* Of `notes`: two flags, then texts that end in 0: the name of the machine, and folders. */
enum { MOVING, ENDING, TEXTS };

static const double A_MOMENT = 0.01; /* seconds between two looks at a flag */
enum { MOST_PASSES = 4 };            /* over a folder that another thread still writes to */

static bool is_set(const uint8_t *flag)
{
    return __atomic_load_n(flag, __ATOMIC_SEQ_CST) != 0;
}

static void pause_for(double seconds)
{
    struct timespec left = {.tv_sec = (time_t)seconds};
    left.tv_nsec = (long)((seconds - (double)left.tv_sec) * 1e9);
    while (nanosleep(&left, &left) != 0 && errno == EINTR)
        continue;
}

/* Wait until a flag has a value, for some seconds at most; return whether it has. */
static bool wait_for(const uint8_t *flag, bool value, double seconds)
{
    for (double waited = 0.0; waited < seconds; waited += A_MOMENT) {
        if (is_set(flag) == value)
            return true;
        pause_for(A_MOMENT);
    }
    return is_set(flag) == value;
}

static void remove_entry(int folder, const char *name);

/* Remove what is in a folder whose entries begin with one of two texts; closes it. */
static void remove_entries(int folder, const char *begins, const char *or_begins)
{
    DIR *entries = fdopendir(folder);
    if (entries == NULL) {
        close(folder);
        return;
    }
    const struct dirent *entry;
    while ((entry = readdir(entries)) != NULL) {
        const char *name = entry->d_name;
        if (strcmp(name, ".") != 0 && strcmp(name, "..") != 0
            && (strncmp(name, begins, strlen(begins)) == 0
                || strncmp(name, or_begins, strlen(or_begins)) == 0))
            remove_entry(dirfd(entries), name);
    }
    closedir(entries);
}

/* Remove a file, or a folder with all that is in it; no link is followed. */
static void remove_entry(int folder, const char *name)
{
    struct stat status;
    if (fstatat(folder, name, &status, AT_SYMLINK_NOFOLLOW) != 0 || status.st_uid != getuid())
        return; /* of another user, in a folder that users share */
    if (!S_ISDIR(status.st_mode)) {
        unlinkat(folder, name, 0);
        return;
    }
    for (int pass = 0; pass < MOST_PASSES; pass++) {
        const int inner = openat(folder, name, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
        if (inner >= 0)
            remove_entries(inner, "", "");
        if (unlinkat(folder, name, AT_REMOVEDIR) == 0 || inner < 0)
            return;
    }
}

/* Remove the temporary files and folders of this process; `texts` end with an empty one. */
static void clear_own(const char *texts, const char *end)
{
    char hidden[64];
    const int length = snprintf(hidden, sizeof hidden, ".texbake-%s-%ld-", texts, (long)getpid());
    if (length < 0 || (size_t)length >= sizeof hidden)
        return;
    for (const char *folder = texts + strlen(texts) + 1; folder < end && *folder != 0;
         folder += strlen(folder) + 1) {
        const int opened = open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
        if (opened >= 0)
            remove_entries(opened, hidden, hidden + 1);
    }
}

static bool ends_process(int number)
{
    return number == SIGINT || number == SIGTERM || number == SIGHUP;
}

/* Wait for the first signal that ends the process; 0 if the pipe is closed. */
static int next_signal(int descriptor)
{
    for (;;) {
        uint8_t number;
        const ssize_t n = read(descriptor, &number, 1);
        if (n == 1 && ends_process(number))
            return number;
        if (n == 0 || (n < 0 && errno != EINTR))
            return 0;
    }
}

/* Print a line on stderr, unless that takes nothing for some seconds, like a paused terminal. */
static void print_line(const char *line, double patience)
{
    struct pollfd to = {.fd = 2, .events = POLLOUT};
    if (poll(&to, 1, (int)(patience * 1000.0)) != 1 || (to.revents & POLLOUT) == 0)
        return;
    if (isatty(2)) { /* progress bars hide the cursor */
        static const char SHOWN[] = "\x1b[?25h\n";
        if (write(2, SHOWN, sizeof SHOWN - 1) < 0)
            return;
    }
    if (write(2, line, strlen(line)) < 0)
        return; /* nobody reads it */
}

/* End the process after a signal: `patience` seconds later if Python does not set `flags[HEARD]`,
   else `to_end` seconds after it has; with the exit code of `flags[ENDED]` if the work was done.
   Returns only if the pipe is closed. */
int64_t end_after_signals(int64_t descriptor, double patience, double to_end, int64_t n_flags,
    uint8_t flags[n_flags], int64_t n_notes, uint8_t notes[n_notes])
{
    if (n_flags < N_FLAGS || n_notes < TEXTS + 2 || notes[n_notes - 1] != 0)
        return 0;
    const int number = next_signal((int)descriptor);
    if (number == 0)
        return 0;
    if (wait_for(&flags[HEARD], true, patience))
        pause_for(to_end);
    /* Files that begin to take their names from now on wait for the end. */
    __atomic_store_n(&notes[ENDING], 1, __ATOMIC_SEQ_CST);
    pause_for(A_MOMENT);
    wait_for(&notes[MOVING], false, patience);
    clear_own((const char *)&notes[TEXTS], (const char *)&notes[n_notes]);
    const int ended = __atomic_load_n(&flags[ENDED], __ATOMIC_SEQ_CST);
    if (ended != 0)
        _exit(ended - 1); /* the work is done, and what is left was no part of it */
    if (__atomic_exchange_n(&flags[SAID], 1, __ATOMIC_SEQ_CST) != 0)
        wait_for(&flags[PRINTED], true, patience); /* Python prints the line */
    else
        print_line(
            number == SIGINT ? "texbake: interrupted\n" : "texbake: terminated\n", patience);
    _exit(128 + number);
}

/* End the process when the other end of a pipe that it reads is closed, as by the end of a parent. */
int64_t end_with_pipe(int64_t descriptor)
{
    struct pollfd pipe = {.fd = (int)descriptor}; /* a closed end is told without asking for it */
#if defined(__APPLE__)
    pipe.events = POLLRDNORM; /* macOS tells it only to whoever asks for data as well */
#endif
    for (;;) {
        const int n = poll(&pipe, 1, -1);
        if (n > 0 && (pipe.revents & (POLLHUP | POLLERR)) != 0)
            _exit(1);
        if ((n > 0 && (pipe.revents & POLLNVAL) != 0) || (n < 0 && errno != EINTR && errno != EAGAIN))
            return 0;
        pause_for(1.0); /* there are data that nobody has read yet */
    }
}

#endif
