/* Open MPI calls sched_yield while a rank waits for another. Ranks that share cores with other tests sleep then, as briefly as the kernel
   can: otherwise they take the cores from those for which they wait. */
#include <time.h>

int sched_yield(void)
{
    const struct timespec briefly = {0, 1};
    return nanosleep(&briefly, 0);
}
