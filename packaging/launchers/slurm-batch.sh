#!/usr/bin/env bash
# A launcher of jobs (--launcher "batch=/path/to/slurm-batch.sh -n 8 -- {worker}"): runs the worker as a Slurm batch job and
# says what it says. Options before -- go to sbatch. The folder that it starts in, the job's own, must be shared with the nodes.
set -euo pipefail
options=
while [ $# -gt 0 ] && [ "$1" != "--" ]; do
  options="$options $1"
  shift
done
[ $# -gt 1 ] || { echo "usage: slurm-batch.sh [SBATCH OPTION...] -- WORKER..." >&2; exit 2; }
shift

# The worker's words, each in quotes of its own, for a script that a node's shell reads.
words=
for word in "$@"; do
  words="$words '$(printf %s "$word" | sed "s/'/'\\\\''/g")'"
done
printf '#!/bin/sh\nsrun%s\necho $? >worker.status\n' "$words" >worker.sh
rm -f worker.status
: >worker.out
# shellcheck disable=SC2086 # options are words
id=$(sbatch --parsable $options --chdir="$PWD" --output="$PWD/worker.out" --error="$PWD/log" --open-mode=append worker.sh)
id=${id%%;*}
tail -n +1 -f worker.out &
tail=$!
trap 'scancel "$id"; kill "$tail" 2>/dev/null; exit 143' TERM INT
echo "Slurm job $id" >&2
while [ -n "$(squeue --noheader --jobs "$id" 2>/dev/null)" ]; do
  sleep 1 &
  wait $!
done
# What was written last takes a moment through a shared file system.
sleep 1
kill "$tail" 2>/dev/null || true
exit "$(cat worker.status 2>/dev/null || echo 1)"
