/* Temporary files that a signal removes.
 *
 * Method: a fixed table of paths, each an atomic pointer, which a signal handler may read. A slot
 * has the process that took it: a child of fork() leaves its parent's files alone.
 *
 * Limits: 64 paths at once; the files of further ones stay behind when a signal ends the
 * process. */
#include "src/base/build.h"

#include <signal.h>
#include <stdatomic.h>

#include "cairn/output.h"
#include "src/host/base/output_pending.h"
#include "src/host/base/posix.h"

enum { MAX_PENDING_OUTPUTS = 64 };

static _Atomic(const char *) pending[MAX_PENDING_OUTPUTS];
static _Atomic(long) owner[MAX_PENDING_OUTPUTS];

void output_pending_add(const char *path)
{
    const char *none;

    for (int slot = 0; slot < MAX_PENDING_OUTPUTS && path != NULL; slot++) {
        none = NULL;
        if (atomic_compare_exchange_strong(&pending[slot], &none, path)) {
            atomic_store(&owner[slot], (long)getpid());
            return;
        }
    }
}

void output_pending_take(const char *path)
{
    const char *own;

    for (int slot = 0; slot < MAX_PENDING_OUTPUTS && path != NULL; slot++) {
        own = path;
        if (atomic_compare_exchange_strong(&pending[slot], &own, NULL))
            return;
    }
}

/* Removes the files, then the folders, which are empty by then, and ends the process as the signal
 * does without a handler. Calls only what a signal handler may call. */
static void on_signal(int number)
{
    const char *path;

    for (int pass = 0; pass < 2; pass++)
        for (int slot = 0; slot < MAX_PENDING_OUTPUTS; slot++) {
            path = atomic_load(&pending[slot]);
            if (path != NULL && atomic_load(&owner[slot]) == (long)getpid())
                (void)(pass == 0 ? unlink(path) : rmdir(path));
        }
    (void)raise(number);
}

void cairn_output_clean_up_on_signals(void)
{
    cairn_on_end_signals(on_signal);
}
