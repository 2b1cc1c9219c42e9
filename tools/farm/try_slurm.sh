#!/bin/bash
# Runs slurm.sh on this machine, with daemons of its own on the loopback device, and compares with single runs:
#   tools/farm/try_slurm.sh OSCURA SCENE [FRAMES [SHARDS [SAMPLES]]]
# Needs slurmctld, slurmd, sbatch (Debian: slurm-wlm) and munged, and to be root.
set -euo pipefail
oscura=$(realpath "$1") scene=$(realpath "$2") frames=${3:-1-2} shards=${4:-3} samples=${5:-40}
own=$(cd "$(dirname "$0")" && pwd)
export PATH=$PATH:/usr/sbin:/sbin
for program in slurmctld slurmd sbatch munged; do
    command -v $program > /dev/null || { echo "skipped: there is no $program"; exit 0; }
done
[ "$(id -u)" = 0 ] || { echo "skipped: Slurm's daemons need root here"; exit 0; }
folder=$(mktemp -d /tmp/oscura-slurm.XXXXXX)
started=()
clean() {
    for pid in "${started[@]}"; do kill "$pid" 2> /dev/null || true; done
    wait 2> /dev/null || true
    rm -rf "$folder"
}
trap clean EXIT
mkdir -p "$folder/state" "$folder/spool" "$folder/out"
head -c 1024 /dev/urandom > "$folder/key"; chmod 400 "$folder/key"
socket="$folder/munge.socket"
munged --foreground --force --key-file="$folder/key" --socket="$socket" --pid-file="$folder/munged.pid" \
    --log-file="$folder/munged.log" --seed-file="$folder/munge.seed" > /dev/null 2>&1 & started+=($!)
host=$(hostname -s)
cat > "$folder/slurm.conf" <<CONF
ClusterName=oscura
SlurmctldHost=$host(127.0.0.1)
SlurmUser=root
SlurmctldPort=26817
SlurmdPort=26818
AuthType=auth/munge
AuthInfo=socket=$socket
CredType=cred/munge
ProctrackType=proctrack/pgid
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SwitchType=switch/none
MpiDefault=none
ReturnToService=2
SchedulerParameters=sched_interval=1,batch_sched_delay=0
SlurmdParameters=config_overrides
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/slurmd.pid
SlurmctldLogFile=$folder/slurmctld.log
SlurmdLogFile=$folder/slurmd.log
NodeName=$host NodeAddr=127.0.0.1 CPUs=$(nproc) State=UNKNOWN
PartitionName=all Nodes=$host Default=YES MaxTime=INFINITE State=UP
CONF
export SLURM_CONF="$folder/slurm.conf"
for _ in $(seq 50); do [ -S "$socket" ] && break; sleep 0.1; done
slurmctld -D > /dev/null 2>&1 & started+=($!)
slurmd -D > /dev/null 2>&1 & started+=($!)
for _ in $(seq 100); do sinfo -h -o %T 2> /dev/null | grep -q idle && break; sleep 0.2; done
if ! sinfo -h -o %T 2> /dev/null | grep -q idle; then
    echo "skipped: Slurm's daemons don't start here:"; tail -n 3 "$folder"/*.log; exit 0
fi
begin=$(date +%s.%N)
jobs=$(SCENE=$scene OUTPUT=$folder/out OSCURA=$oscura FRAMES=$frames SHARDS=$shards SAMPLES=$samples \
    OPTIONS="--width 64 --float --reproducible --aov all" "$own/slurm.sh" --chdir="$folder")
while squeue -h | grep -q .; do sleep 0.2; done
end=$(date +%s.%N)
first=${frames%%-*} last=${frames##*-}
for frame in $(seq "$first" "$last"); do
    "$oscura" render "$scene" -o "$folder/s.exr" --frames "$frame" --width 64 --float --reproducible --aov all \
        --spp "$samples" --quiet
    number=$(printf %04d "$frame")
    cmp "$folder/s.$number.exr" "$folder/out/picture.$number.exr" || { tail -n 5 "$folder"/out/*.log; exit 1; }
done
echo "jobs $jobs: $(( last - first + 1 )) frames of $shards shards are bit-identical to single runs," \
    "$(echo "$end - $begin" | bc) s"
