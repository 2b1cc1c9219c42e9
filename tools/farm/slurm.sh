#!/bin/bash
# Frames times shards of their samples as a job array, then one merge a frame:
#   SCENE=scene.glb OUTPUT=/shared/folder FRAMES=1-10 SHARDS=8 SAMPLES=1024 tools/farm/slurm.sh [options of sbatch]
# NAME, OSCURA (the program) and OPTIONS (further options of 'oscura render') may be set as well. A task that is preempted
# or runs out of time goes on from its checkpoint when Slurm queues it again.
set -euo pipefail
export OSCURA=${OSCURA:-oscura} SCENE OUTPUT NAME=${NAME:-picture} FRAMES=${FRAMES:-0} SHARDS=${SHARDS:-4}
export SAMPLES=${SAMPLES:-128} OPTIONS=${OPTIONS:---float}
first=${FRAMES%%-*} last=${FRAMES##*-}
tasks=$(( (last - first + 1) * SHARDS ))
own=$(cd "$(dirname "$0")" && pwd)
# The signal comes 90 seconds before the time is over: a pass is finished and the checkpoint written.
render=$(sbatch --parsable --job-name="$NAME" --array=0-$(( tasks - 1 )) --signal=TERM@90 --requeue --open-mode=append \
    --output="$OUTPUT/$NAME.%a.log" "$@" "$own/slurm-task.sh")
merge=$(sbatch --parsable --job-name="$NAME-merge" --array=0-$(( last - first )) --dependency=afterok:"$render" \
    --kill-on-invalid-dep=yes --output="$OUTPUT/$NAME.merge.%a.log" "$@" "$own/slurm-merge.sh")
echo "$render $merge"
