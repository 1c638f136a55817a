/* Open MPI calls sched_yield while a rank waits for another. Ranks that share cores with other tests sleep then: otherwise they take the
   cores from those for which they wait. Sleeping takes longer than most messages, so that the first moments of a wait are spent awake.
   They are counted in processor time, which does not pass while others have the core. */
#define _GNU_SOURCE
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

/* Nanoseconds: at most between two calls of the same wait, and awake. */
enum { SAME_WAIT = 5000, AWAKE = 50000 };

static long long used(void)
{
    struct timespec time;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
    return 1000000000LL * time.tv_sec + time.tv_nsec;
}

int sched_yield(void)
{
    static __thread long long since, last;
    const long long time = used();
    if (time - last > SAME_WAIT)
        since = time;
    int outcome;
    if (time - since < AWAKE) {
        outcome = (int)syscall(SYS_sched_yield);
    } else {
        const struct timespec briefly = {0, 1};
        outcome = nanosleep(&briefly, 0);
    }
    last = used();
    return outcome;
}
