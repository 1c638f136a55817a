#!/bin/bash
# Jobs under a real Slurm on this machine: a study as a job array has the errors of the study run at one go; a job that is warned
# before its time limit and preempted by another job is requeued until it is done, with the answer of a run left alone.
#
#   tests/slurm/run.sh SOLVER
#
# Needs root, slurm-wlm and munge; says so and ends with 0 where they are missing. Everything lies in a temporary folder;
# the daemons it started are ended by their ids. Takes some minutes.
set -euo pipefail

solver=$(realpath "${1:?the solver}")
root=$(realpath "$(dirname "${BASH_SOURCE[0]}")/../..")
if [[ $(id -u) -ne 0 ]] || ! command -v sbatch slurmctld slurmd munged >/dev/null; then
    echo "skipped: this test needs root, slurm-wlm and munge"
    exit 0
fi

here=$(mktemp -d)
export SLURM_CONF=$here/slurm.conf SOLVER=$solver
# As in the batch scripts: threaded BLAS rounds otherwise.
export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1
export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 OMPI_MCA_rmaps_base_oversubscribe=1
daemons=()
end_daemons() {
    for ((at = ${#daemons[@]} - 1; at >= 0; at--)); do
        kill "${daemons[at]}" 2>/dev/null || true
        wait "${daemons[at]}" 2>/dev/null || true
    done
    rm -rf "$here"
}
trap end_daemons EXIT

chmod 755 "$here"
mkdir -p "$here"/{munge,spool,state,work}
dd if=/dev/urandom of="$here/munge/key" bs=1024 count=1 status=none
chmod 700 "$here/munge" && chmod 600 "$here/munge/key"
munged --foreground --force --socket="$here/munge.socket" --key-file="$here/munge/key" --pid-file="$here/munge/pid" \
    --log-file="$here/munge/log" --seed-file="$here/munge/seed" >/dev/null 2>&1 &
daemons+=($!)
host=$(hostname -s)
cat >"$SLURM_CONF" <<END
ClusterName=test
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=16817
SlurmdPort=16818
AuthInfo=socket=$here/munge.socket
ProctrackType=proctrack/pgid
TaskPlugin=task/none
SelectType=select/cons_tres
SlurmUser=root
SlurmdSpoolDir=$here/spool
StateSaveLocation=$here/state
SlurmctldPidFile=$here/slurmctld.pid
SlurmdPidFile=$here/slurmd.pid
JobRequeue=1
MinJobAge=600
PreemptType=preempt/partition_prio
PreemptMode=REQUEUE
NodeName=$host NodeAddr=127.0.0.1 CPUs=2 RealMemory=1000
PartitionName=low Nodes=ALL Default=YES State=UP PriorityTier=1
PartitionName=high Nodes=ALL State=UP PriorityTier=9 PreemptMode=OFF
END
sleep 1
slurmctld -D -L "$here/slurmctld.log" >/dev/null 2>&1 &
daemons+=($!)
sleep 2
slurmd -D -L "$here/slurmd.log" >/dev/null 2>&1 &
daemons+=($!)
for ((wait = 0; wait < 30; wait++)); do
    [[ $(sinfo -h -o %t 2>/dev/null) == *idle* ]] && break
    sleep 1
done

cd "$here/work"
# An end that no run within the limit of a minute reaches; a nearer one is set when there was warning and preemption.
step=0.0001
sed -e "s/^step .*/step = $step/" -e 's/^end .*/end = 1000.0/' -e 's/^every .*/every = 500/' \
    -e 's/^fields .*/fields = { every = 1000000 }/' "$root/jobs/papers/wang_cheng_2022.toml" >job.toml
folder=out/$(sed -n 's/^folder *= *"out\/\(.*\)"/\1/p' job.toml)

status() { scontrol show job "$1" 2>/dev/null | sed -n "s/.*\\b$2=\\([^ ]*\\).*/\\1/p" | head -1; }
wait_for() { # JOB KEY VALUE
    for ((wait = 0; wait < ${PATIENCE:-900}; wait++)); do
        [[ $(status "$1" "$2") == "$3" ]] && return
        sleep 1
    done
    echo "job $1: $2 is $(status "$1" "$2"), not $3" >&2
    cat clarke-*.log slurm-*.out "$here/slurmctld.log" 2>/dev/null | tail -60 >&2
    exit 1
}

# Slurm lets a requeued job wait for two minutes; waits until it has gone on so many times.
wait_for_start() { # JOB TIMES
    for ((wait = 0; wait < ${PATIENCE:-900}; wait++)); do
        [[ $(grep -c '^continuing from' clarke-"$1".log 2>/dev/null) -ge $2 ]] && return
        [[ $(status "$1" JobState) =~ TIMEOUT|FAILED|CANCELLED|COMPLETED ]] && break
        sleep 1
    done
    echo "job $1 has not gone on $2 times" >&2
    tail -60 clarke-*.log >&2
    exit 1
}

# A study whose runs are shared out over an array, and put together by a job that waits for it.
cat >study.toml <<END
[base]
job = "$root/jobs/papers/wang_cheng_2022.toml"
[product]
schemes = ["lagged_euler"]
cells   = [[4, 4], [8, 8]]
steps   = [0.0625, 0.03125]
[reference.run]
cells = [16, 16]
step  = 0.015625
[[norm]]
of   = "velocity"
in   = "H"
over = "end"
END
script=$root/jobs/cluster/study.sbatch
array=$(sbatch --parsable --array=1-3 --ntasks=2 --time=5 "$script" study.toml)
collects=$(sbatch --parsable --dependency=afterok:"$array" --ntasks=2 --time=5 "$script" study.toml)
echo "array $array of three tasks: five runs of a study"
wait_for "$collects" JobState COMPLETED
[[ $(cat clarke-study-"$array"_*.log | grep -c '^run .* s$') -eq 5 ]]
[[ $(grep -c 'already finished' clarke-study-"$collects"_*.log) -eq 5 ]]
cp out/study/study.json array.json
rm -r out/study
mpirun --oversubscribe --bind-to none -n 2 "$solver" study study.toml >study.log
python3 - array.json out/study/study.json <<'END'
import json, sys
one, other = ([run["errors"][0]["error"] for run in json.load(open(name))["runs"]] for name in sys.argv[1:])
assert len(one) == 4 and all(abs(a - b) < 1e-10 * a for a, b in zip(one, other)), (one, other)
END
echo "array $array: the errors of the study run at one go"

id=$(sbatch --parsable --ntasks=2 --time=1 --signal=B:USR1@30 "$root/jobs/cluster/slurm.sbatch" job.toml)
echo "job $id: until its limit warns it"
wait_for_start "$id" 1
sleep 5
echo "job $id: preempted"
other=$(sbatch --parsable --partition=high --ntasks=2 --time=1 --wrap='sleep 3')
wait_for "$other" JobState COMPLETED
wait_for_start "$id" 2
echo "job $id: until its limit warns it again"
wait_for "$id" Restarts 3
steps=$(find "$folder" -name 'checkpoint-*.h5' | sed 's/.*-\([0-9]*\)\.h5/\1/' | sort -n | tail -1)
end=$(awk -v steps=$((steps + 200)) -v step=$step 'BEGIN { printf "%.4f", steps * step }')
sed -i "s/^end .*/end = $end/" job.toml
echo "job $id: until it is done, $((steps + 200)) steps"
wait_for "$id" JobState COMPLETED
restarts=$(status "$id" Restarts)
[[ $restarts -eq 3 ]] || { echo "$restarts restarts" >&2; exit 1; }
grep -q '"status": "completed"' "$folder/summary.json"
grep -q 'stopped with a checkpoint; requeueing' clarke-"$id".log

mpirun --oversubscribe --bind-to none -n 2 "$solver" run job.toml --set output.folder="'straight'" >straight.log
for name in history.csv probes.csv; do
    cmp "straight/$name" "$folder/$name" || { echo "$name differs from that of an undisturbed run" >&2; exit 1; }
done
echo "done after $restarts restarts, with the answer of an undisturbed run: $(wc -l <"$folder/history.csv") rows"
