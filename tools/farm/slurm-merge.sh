#!/bin/bash
# One task of the second array of slurm.sh: the parts of a frame become a picture.
set -euo pipefail
name="$OUTPUT/$NAME.$(printf %04d $(( ${FRAMES%%-*} + SLURM_ARRAY_TASK_ID )))"
"$OSCURA" merge "$name".*.part -o "$name.exr"
rm -f "$name".*.part "$name".*.part.checkpoint
