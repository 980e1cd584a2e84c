#!/usr/bin/env bash
# Restores a backup of backup.sh onto an empty machine. No server may run there yet.
#   restore.sh BACKUP DATA [--database postgresql:CONNINFO]
# DATA: the --data directory, which is made; --database: an empty PostgreSQL database, for a backup
# of PostgreSQL. Run it as the servers' user.
set -euo pipefail

usage() {
  sed -n '3,5s/^# \{0,1\}//p' "$0" >&2
  exit 2
}
fail() { echo "restore.sh: $*" >&2; exit 1; }

[[ $# -ge 2 && $1 != -* && $2 != -* ]] || usage
backup=$1 data=$2
shift 2
database=''
while (($# > 0)); do
  [[ $# -gt 1 && $1 == --database ]] || usage
  database=$2
  shift 2
done
[[ -e $backup/complete ]] || fail "$backup is not a complete backup"
[[ ! -e $data || -z $(ls -A "$data") ]] || fail "$data is not empty"
if [[ -e $backup/database.dump ]]; then
  [[ $database == postgresql:* ]] || fail "$backup is of PostgreSQL: give --database postgresql:CONNINFO"
  tables=$(psql --no-psqlrc --tuples-only --no-align "${database#postgresql:}" \
    -c "SELECT count(*) FROM information_schema.tables WHERE table_schema = current_schema()") ||
    fail 'the database cannot be reached'
  [[ $tables == 0 ]] || fail 'the database is not empty'
else
  [[ -z $database ]] || fail "$backup is of SQLite, whose file is in DATA: leave out --database"
fi

mkdir -p -m 750 "$data"
# Copies, not hard links: a server would change some of the backup's own files.
cp -a "$backup/data/." "$data/"
if [[ -n $database ]]; then
  pg_restore --exit-on-error --single-transaction --no-owner --no-privileges \
    --dbname="${database#postgresql:}" "$backup/database.dump" || fail 'the database was not restored'
else
  # Comes last: with the database the service is complete.
  cp "$backup/pepeseg.db" "$data/pepeseg.db.new"
  mv "$data/pepeseg.db.new" "$data/pepeseg.db"
fi
sync -f "$data"
echo "$data: as of $(cat "$backup/complete")"
