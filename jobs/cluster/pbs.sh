#!/bin/bash
# Runs a job under PBS (OpenPBS, PBS Professional). If the time limit comes first, the script resubmits itself to continue from
# the checkpoint.
#
#   qsub -v JOB=job.toml jobs/cluster/pbs.sh
#   qsub -v JOB=job.toml -l select=2:ncpus=32:mpiprocs=32 -l walltime=12:00:00 jobs/cluster/pbs.sh
#
# Paths are relative to the folder of the submission. -v separates variables by commas: give paths with commas by
# `export JOB=...; qsub -v JOB jobs/cluster/pbs.sh`. More variables for -v:
#   SOLVER     the binary (default: solver)
#   LAUNCHER   the command that starts the ranks (default: mpirun; if Open MPI was built without PBS support,
#              "mpirun --hostfile $PBS_NODEFILE", already expanded)
#   OUTPUT     the job's output folder (default: asks `solver check`, which repeats the set-up of the problem)
#   RESTART    yes: continue from a checkpoint (set by the resubmission)
#   SCRIPT     this file, for the resubmission (default: jobs/cluster/pbs.sh)
#   MARGIN     seconds before the limit, counted from the start of this script, at which the ranks are asked to stop
#              (default: 120)
#
# Tested only with substitutes for qstat and qsub, not under a real PBS. Some clusters refuse qsub on compute nodes: resubmit by
# hand with -v RESTART=yes.
#
#PBS -N clarke
#PBS -l select=1:ncpus=2:mpiprocs=2
#PBS -l walltime=01:00:00
#PBS -j oe

set -u
export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1

cd "${PBS_O_WORKDIR:?submit this script with qsub}" || exit 2
job=${JOB:?name the job file: qsub -v JOB=job.toml}
solver=${SOLVER:-solver}
read -ra launcher <<<"${LAUNCHER:-mpirun}"

if [[ -z ${OUTPUT:-} ]]; then
    checked=$("${launcher[@]}" "$solver" check "$job" --json) || exit
    OUTPUT=$(sed -n 's/^  "output_folder": "\(.*\)",*$/\1/p' <<<"$checked" | sed 's/\\\(["\\]\)/\1/g')
    : "${OUTPUT:?solver check does not show the output folder}"
fi
# The checkpoints in the output folder; with arguments, those that `find` selects by them.
checkpoints() { find "$OUTPUT" -maxdepth 1 -name 'checkpoint-*.h5' "$@" 2>/dev/null; }

options=()
if [[ ${RESTART:-no} == yes && -n $(checkpoints) ]]; then
    options+=(--restart)
fi
start=$(mktemp)
trap 'rm -f "$start"' EXIT

# PBS warns by SIGTERM only seconds before it kills, so `timeout` asks earlier, by SIGUSR1, which mpirun passes on.
requested() { qstat -f -w "$PBS_JOBID" | sed -n "s/^ *Resource_List\\.$1 = //p"; }
limit=$(requested walltime)
IFS=: read -r hours minutes seconds <<<"${limit:?qstat does not show the time limit}"
# The limit includes the time that this script has taken so far, such as that of `solver check`: SECONDS.
run_seconds=$((10#$hours * 3600 + 10#$minutes * 60 + 10#$seconds - ${MARGIN:-120} - SECONDS))
if [[ $run_seconds -le 0 ]]; then
    echo "the time limit $limit leaves nothing before the last ${MARGIN:-120} seconds: ask for more" >&2
    exit 2
fi

timeout --foreground --preserve-status --signal=USR1 "$run_seconds" \
    "${launcher[@]}" "$solver" run "$job" "${options[@]}"
code=$?

# 3: stopped on request. Without a checkpoint of this run the next one would get no further.
if [[ $code -eq 3 && -n $(checkpoints -newer "$start") ]]; then
    echo "$(date '+%F %T'): stopped with a checkpoint; submitting again"
    # Variables named without a value are taken from the environment, where paths may contain commas.
    export JOB=$job RESTART=yes SOLVER=$solver LAUNCHER="${launcher[*]}" OUTPUT
    export SCRIPT=${SCRIPT:-jobs/cluster/pbs.sh} MARGIN=${MARGIN:-120}
    qsub -l select="$(requested select)" -l walltime="$limit" \
        -v JOB,RESTART,SOLVER,LAUNCHER,OUTPUT,SCRIPT,MARGIN "$SCRIPT" ||
        echo "not submitted: submit again with -v RESTART=yes" >&2
fi
exit "$code"
