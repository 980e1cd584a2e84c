#!/usr/bin/env bash
# Copies the state of a service while it runs: the database as it is at one moment, and every file
# that it refers to.
#   backup.sh DATA BACKUP [--database postgresql:CONNINFO] [--since EARLIER_BACKUP]
# DATA is the servers' --data directory, BACKUP a folder that is made. With PostgreSQL, --database is
# the servers' value (and PGPASSFILE, if they have it); without it DATA/pepeseg.db is copied. --since:
# files that EARLIER_BACKUP has, too, are shared with it by hard links, so that each backup is whole
# and takes only the space of new files. Run it as the servers' user; needs rsync, sqlite3 or pg_dump 15.
#
# Why the copy is consistent: files of results never change, and are written before the record that
# names them. They are copied twice: before the database, because some are deleted meanwhile, and
# after it, because some are made meanwhile. The collector cannot run during the backup. A job's
# folder is copied only if it existed before the database was copied: the number of a later job would
# be given again after a restore. At the end each file that the database names is looked for.
# Unfinished uploads start again after a restore, and jobs resume from what the backup has of them.
set -euo pipefail

usage() {
  sed -n '4,8s/^# \{0,1\}//p' "$0" >&2
  exit 2
}
fail() { echo "backup.sh: $*" >&2; exit 1; }

[[ $# -ge 2 && $1 != -* && $2 != -* ]] || usage
data=$1 backup=$2
shift 2
database='' since=''
while (($# > 0)); do
  (($# > 1)) || usage
  case $1 in
    --database) database=$2 ;;
    --since) since=$(realpath -e "$2") || exit 1 ;;
    *) usage ;;
  esac
  shift 2
done
[[ -z $database || $database == postgresql:* ]] || fail '--database: postgresql:CONNINFO, or none'
data=$(realpath -e "$data") || exit 1
[[ -n $database || -s $data/pepeseg.db ]] || fail "$data has no pepeseg.db: is it in PostgreSQL?"
[[ -z $since || -e $since/complete ]] || fail "$since is not a complete backup"
mkdir -m 700 "$backup" || exit 1
backup=$(realpath "$backup")

# The collector's lock, held until this script ends. A collection in progress may take minutes, so the
# script does not wait for it.
exec {collector}>>"$data/collector.lock"
flock --nonblock "$collector" || fail 'a server is removing old files: try again in a minute'

copy() {
  local status=0
  rsync --archive --exclude='/lock' --exclude='/locks/' --exclude='/collector.lock' \
    --exclude='/partial/' --exclude='/damaged/' --exclude='/jobs/*/work/tmp/' --exclude='/pepeseg.db*' --exclude='*.tmp-*' \
    ${since:+--link-dest="$since/data"} "$@" || status=$?
  # 24: files were deleted meanwhile. The check at the end finds those that are needed.
  ((status == 0 || status == 24)) || fail "rsync left with $status"
}

# Paths below the data directory that must exist. Sealed datasets are 1 (server/store/records.h); files
# that are not stored were found damaged and set aside.
named="SELECT folder || '/manifest.json' FROM models UNION ALL SELECT file FROM selections UNION ALL
  SELECT 'datasets/' || scene || '/' || number || '.json' FROM datasets WHERE state = 1 UNION ALL
  SELECT DISTINCT 'blobs/' || s.project || '/' || substr(f.sha256, 1, 2) || '/' || f.sha256
  FROM dataset_files f JOIN datasets d ON d.scene = f.scene AND d.number = f.dataset
  JOIN scenes s ON s.id = f.scene WHERE d.state = 1 AND f.stored = 1"

copy_sqlite() {
  sqlite3 -bail "$data/pepeseg.db" '.timeout 60000' ".backup '$backup/pepeseg.db'" || return 1
  sqlite3 -bail -readonly "$backup/pepeseg.db" "$named" >"$backup/named" || return 1
  [[ $(sqlite3 "$backup/pepeseg.db" 'PRAGMA integrity_check') == ok ]]
}

# The dump and the names are from the same snapshot.
copy_postgresql() {
  local connection=${database#postgresql:}
  CONNECTION=$connection DUMP=$backup/database.dump psql --no-psqlrc --quiet --tuples-only \
    --no-align --set=ON_ERROR_STOP=1 "$connection" >"$backup/named" <<SQL || return 1
BEGIN ISOLATION LEVEL REPEATABLE READ READ ONLY;
SELECT pg_export_snapshot() AS snapshot \gset
\setenv SNAPSHOT :snapshot
\! pg_dump --format=custom --no-owner --no-privileges --snapshot="\$SNAPSHOT" --file="\$DUMP" "\$CONNECTION"
$named;
COMMIT;
SQL
  pg_restore --list "$backup/database.dump" >/dev/null
}

mkdir "$backup/data"
copy "$data/" "$backup/data/"
(cd "$data" && find jobs -mindepth 1 -maxdepth 1 -print0 2>/dev/null) >"$backup/jobs" || true
if [[ -n $database ]]; then copy_postgresql; else copy_sqlite; fi || fail 'the database was not copied'
copy --exclude=/jobs/ "$data/" "$backup/data/"
copy --recursive --from0 --files-from="$backup/jobs" "$data/" "$backup/data/"
rm "$backup/jobs"

missing=$(cd "$backup/data" && while IFS= read -r path; do
  [[ -z $path || -s $path || -f $path ]] || echo "$path"
done <"$backup/named")
if [[ -n $missing ]]; then
  head -n 20 <<<"$missing" >&2
  fail "$(wc -l <<<"$missing") files that the database names do not exist: deleted while this" \
    'copied (run it again), or lost'
fi
num_named=$(wc -l <"$backup/named")
rm "$backup/named"
sync -f "$backup"
date --utc +%Y-%m-%dT%H:%M:%SZ >"$backup/complete"
echo "$backup: $num_named results and uploaded files, $(du -sm "$backup" | cut -f1) MiB"
