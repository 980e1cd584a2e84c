#!/usr/bin/env bash
# Backs up a busy server and restores it onto an empty machine: every scene answers as before, byte
# for byte, and the interrupted training resumes.
#   backup_test.sh FOLDER_OF_PROGRAMS SOURCE_ROOT sqlite|postgresql
# Exits with 77 if a program that it needs is not installed.
set -euo pipefail
programs=$1 root=$2 kind=$3
work=$(mktemp -d)
server= postgres= busy=
stop() {
  for process in $busy $server $postgres; do kill -TERM "$process" 2>/dev/null || true; done
  for process in $busy $server $postgres; do wait "$process" 2>/dev/null || true; done
  rm -rf "$work"
}
trap stop EXIT
fail() { echo "FAILED: $*" >&2; tail -n 40 "$work/server.log" "$work/output" >&2; exit 1; }
expect() {  # expect EXIT_CODE COMMAND...
  local code=0
  "${@:2}" >"$work/output" 2>&1 || code=$?
  [[ $code == "$1" ]] || fail "${*:2}: exit code $code, not $1"
}
touch "$work/server.log" "$work/output"
for program in rsync sqlite3 flock; do
  command -v $program >/dev/null || { echo "skipped: no $program"; exit 77; }
done
pepeseg() { "$programs/pepeseg" "$@"; }

database=() restored_database=()
start_postgresql() {
  local bin as_postgres=()
  bin=$(ls -d /usr/lib/postgresql/15/bin 2>/dev/null) || { echo 'skipped: no PostgreSQL 15'; exit 77; }
  chmod 755 "$work"
  mkdir "$work/postgresql"
  if ((EUID == 0)); then
    chown postgres "$work/postgresql"
    as_postgres=(setpriv --reuid postgres --regid postgres --clear-groups)
  fi
  "${as_postgres[@]}" "$bin/initdb" --pgdata "$work/postgresql/data" --no-sync --auth=trust \
    --username=pepeseg --encoding=UTF8 --locale=C >/dev/null
  "${as_postgres[@]}" "$bin/postgres" -D "$work/postgresql/data" -k "$work/postgresql" \
    -c listen_addresses= >"$work/postgresql.log" 2>&1 &
  postgres=$!
  local at="host=$work/postgresql user=pepeseg"
  for _ in {1..200}; do psql "$at dbname=postgres" -c '' >/dev/null 2>&1 && break; sleep 0.1; done
  psql -q "$at dbname=postgres" -c 'CREATE DATABASE pepeseg' -c 'CREATE DATABASE restored'
  database=(--database "postgresql:$at dbname=pepeseg")
  restored_database=(--database "postgresql:$at dbname=restored")
}
start() {  # start DATA [OPTIONS...]
  rm -f "$work/port"
  "$programs/pepesegd" --listen 127.0.0.1:0 --data "$1" --port-file "$work/port" --devices cpu \
    --checkpoint-seconds 1 "${@:2}" >>"$work/server.log" 2>&1 &
  server=$!
  for _ in {1..200}; do [[ -s $work/port ]] && break; sleep 0.1; done
  [[ -s $work/port ]] || fail 'the server does not serve'
  export PEPESEG_SERVER=127.0.0.1:$(cat "$work/port")
}
end() { kill -"$1" "$server"; wait "$server" || true; server=; }
# Writes all state that a caller can see into files of a folder.
ask() {
  mkdir "$1"
  for scene in shelf Second_2.0; do
    pepeseg --json segment $scene --view frame-000000.jpg --point 280,280 --threshold 0 \
      --views held-out --out "$1/$scene" >/dev/null
    for verb in labels selections scenes; do
      # Maps have no order.
      pepeseg --json $verb $scene | python3 -c '
import json, sys
for line in sys.stdin: print(json.dumps(json.loads(line), sort_keys=True))' >"$1/$scene.$verb"
    done
    pepeseg export $scene "$1/$scene.ply" >/dev/null
  done
  pepeseg export shelf "$1/cup.ply" --selection 1 >/dev/null
}

[[ $kind == sqlite ]] || start_postgresql
start "$work/data" "${database[@]}"
dataset=$root/tests/data/apc_shelf
little=(--steps 60 --feature-steps 30 --image-scale 0.25 -o features.num_pixels=200)
for scene in shelf Second_2.0; do
  expect 0 pepeseg upload $scene "$dataset"
  expect 0 pepeseg train $scene "${little[@]}"
done
expect 0 pepeseg label shelf cup --view frame-000000.jpg --point 280,280 --threshold 0 --text 'A cup'
expect 0 pepeseg select shelf --view frame-000000.jpg --point 280,280 --threshold 0
ask "$work/before"

# Meanwhile a training runs that has saved a checkpoint, and scenes are made and deleted.
expect 0 pepeseg upload third "$dataset"
job=$(pepeseg train third --steps 30000 --image-scale 0.25 --detach)
saved() { ls "$work/data/$job"/work/attempt-*/checkpoints/*.ckpt >/dev/null 2>&1; }
for _ in {1..300}; do saved && break; sleep 0.1; done
saved || fail 'the training saves nothing'
(
  while true; do
    "$programs/pepeseg" upload passing "$dataset"
    "$programs/pepeseg" train passing --steps 20 --feature-steps 10 --image-scale 0.1
    "$programs/pepeseg" scenes passing --delete
  done >/dev/null 2>&1
) &
busy=$!
sleep 1
expect 0 "$root/deploy/backup.sh" "$work/data" "$work/first" "${database[@]}"
expect 0 "$root/deploy/backup.sh" "$work/data" "$work/backup" "${database[@]}" --since "$work/first"
cat "$work/output"
kill "$busy"
wait "$busy" 2>/dev/null || true
busy=
blob=$(cd "$work/backup/data" && find blobs -type f | head -n 1)
[[ $(stat -c %h "$work/backup/data/$blob") -ge 2 ]] || fail 'a second backup copies everything again'
end KILL  # the machine is lost with all its data
rm -rf "$work/data"

# Wrong backups and targets are refused.
expect 1 "$root/deploy/backup.sh" "$work/nothing" "$work/other"
expect 1 "$root/deploy/restore.sh" "$work" "$work/other"
mkdir "$work/full" && touch "$work/full/file"
expect 1 "$root/deploy/restore.sh" "$work/backup" "$work/full" "${restored_database[@]}"

expect 0 "$root/deploy/restore.sh" "$work/backup" "$work/restored" "${restored_database[@]}"
start "$work/restored" "${restored_database[@]}"
ask "$work/after"
diff -r "$work/before" "$work/after" >"$work/output" || fail 'answers differ from before'
expect 0 pepeseg --json jobs
grep -F "$job" "$work/output" >"$work/job" && mv "$work/job" "$work/output"
grep -Eq 'JOB_STATE_(QUEUED|RUNNING)' "$work/output" || fail 'the interrupted training is missing'
resumed() { grep -rqs 'resumes from' "$work/restored/$job" --include='*.log'; }
for _ in {1..300}; do resumed && break; sleep 0.1; done
resumed || fail 'the interrupted training does not resume from its checkpoint'
expect 0 pepeseg cancel "$job"
# Numbers continue after those of the backup: new resources do not replace old ones.
expect 0 pepeseg train Second_2.0 "${little[@]}"
expect 0 pepeseg scenes Second_2.0
grep -q 'models/2' "$work/output" || fail 'a new model does not exist next to the old one'
if grep -q 'Nothing is collected' "$work/server.log"; then fail 'the collector does not know its own directory'; fi
end TERM
echo "$kind: every scene answers as before"
