#!/bin/bash
# One task of the array of slurm.sh: a shard of the samples of a frame.
set -euo pipefail
task=$SLURM_ARRAY_TASK_ID
frame=$(( ${FRAMES%%-*} + task / SHARDS )) shard=$(( task % SHARDS ))
blocks=$(( (SAMPLES + 7) / 8 ))
from=$(( blocks * shard / SHARDS * 8 )) until=$(( blocks * (shard + 1) / SHARDS * 8 ))
if (( until > SAMPLES )); then until=$SAMPLES; fi
if (( from >= until )); then echo "nothing is left for shard $shard"; exit 0; fi
part="$OUTPUT/$NAME.####.$shard.part"
# The unquoted options are meant to be several words.
exec "$OSCURA" render "$SCENE" -o "$part" --frames $frame --spp "$SAMPLES" --sample-range $from..$until \
    --checkpoint "$part.checkpoint" --resume --progress plain --threads "${SLURM_CPUS_PER_TASK:-1}" $OPTIONS
