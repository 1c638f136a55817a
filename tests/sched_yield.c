/* Open MPI calls sched_yield while a rank waits for another. Ranks that share cores with other tests sleep then: otherwise they take the
   cores from those for which they wait. Sleeping costs more time than most messages need, so that the first moments of a wait are spent
   awake. */
#define _GNU_SOURCE
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

/* Nanoseconds: between calls of the same wait at most; awake. */
enum { SAME_WAIT = 20000, AWAKE = 100000 };

static long long now(void)
{
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return 1000000000LL * time.tv_sec + time.tv_nsec;
}

int sched_yield(void)
{
    static __thread long long since, last;
    const long long time = now();
    if (last == 0)
        prctl(PR_SET_TIMERSLACK, 1UL, 0UL, 0UL, 0UL);
    if (time - last > SAME_WAIT)
        since = time;
    last = time;
    if (time - since < AWAKE)
        return (int)syscall(SYS_sched_yield);
    const struct timespec briefly = {0, 1};
    const int outcome = nanosleep(&briefly, 0);
    last = now();
    return outcome;
}
