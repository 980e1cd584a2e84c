#!/usr/bin/env bash
# Checks whether a Slurm cluster is ready for `pepesegd --launcher slurm`. Run it on the server's
# machine, as the server's user. Submits one small job to each node of a partition and reads its report.
#   check.sh DATA WORKER [PARTITION]
# Prints what is wrong; exits with 0 if nothing is.
set -euo pipefail
[[ $# -ge 2 && $# -le 3 && $1 == /* && $2 == /* ]] || { sed -n '4,5s/^# \{0,1\}//p' "$0" >&2; exit 2; }
data=$1 worker=$2
partition=${3:+--partition=$3}
wrong=0
complain() { echo "$*"; wrong=1; }

for program in sbatch squeue scancel sinfo srun; do
  command -v $program >/dev/null || { complain "$program is not installed here"; exit 1; }
done
sinfo --noheader >/dev/null 2>&1 || { complain 'the controller does not answer: munge, slurm.conf?'; exit 1; }
[[ -w $data ]] || { complain "$data: cannot be written here"; exit 1; }
nodes=$(sinfo --noheader --Node ${partition:+"$partition"} --states=idle,mixed,allocated --format=%N | sort -u)
[[ -n $nodes ]] || complain 'no node is up'
token=$data/.slurm-check-$$
echo "$token" >"$token"
trap 'rm -f "$token" "$token".*' EXIT

# Runs on a node: prints what is wrong there, one line for each fault.
look='
[ "$(cat "$1" 2>/dev/null)" = "$1" ] || echo "does not see $1, which the server has written"
echo "$(hostname)" >"$1.$2" 2>/dev/null || echo "cannot write the data directory"
[ -x "$3" ] || echo "$3 is not a program"
[ ! -x "$3" ] || ! ldd "$3" 2>/dev/null | grep "not found" || true
[ "$(id -u)" = "$4" ] || echo "runs jobs as user $(id -u), but the server is user $4"
command -v colmap >/dev/null || echo "note: has no colmap: photographs without poses fail here"'
for node in $nodes; do
  said=$(srun --quiet --immediate=60 ${partition:+"$partition"} --nodelist="$node" --nodes=1 --ntasks=1 \
    --time=1 --mem=100M sh -c "$look" sh "$token" "$node" "$worker" "$(id -u)" 2>&1) ||
    complain "$node: no job could be run: $said"
  [[ -z $said || $said == note:* ]] || complain "$node: $said"
  [[ $said != note:* ]] || echo "$node: $said"
  [[ -e $token.$node ]] || complain "$node: what it writes is not seen here"
done
((wrong)) || echo "as it should be on $(wc -w <<<"$nodes") nodes"
exit $wrong
