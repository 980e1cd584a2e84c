#!/usr/bin/env bash
# Runs the installed programs without systemd: see deb_test.sh.
source /test/deb_test_steps.sh
[[ $(stat -c '%U %a' /var/lib/pepeseg) == 'pepeseg 750' ]] || fail 'the data directory'
[[ $(stat -c '%U:%G %a' /etc/pepeseg/tls) == 'root:pepeseg 750' ]] || fail 'the folder of keys'
# The options that come with the package, without the socket's folder, which systemd makes.
source <(sed -n 's/^PEPESEGD_OPTIONS=\(.*\)/options="\1"/p' /etc/pepeseg/pepesegd.conf)
install -d -o pepeseg /run/pepeseg
runuser -u pepeseg -- pepesegd --data=/var/lib/pepeseg $options >/tmp/server.log 2>&1 &
server=$!
wait_for pepeseg health
expect 0 pepeseg upload shelf /test/shelf
start=$SECONDS
expect 0 pepeseg train shelf --steps 60 --feature-steps 30 --image-scale 0.25 -o features.num_pixels=200
step "trained in $((SECONDS - start)) s"
click /tmp/masks
expect 0 pepeseg export shelf /tmp/shelf.ply
[[ $(head -c 3 /tmp/shelf.ply) == ply ]] || fail 'the export is not a PLY'
# The modules load with what the packages depend on.
{ printf '\0\0\0\030ftypisom'; head -c 4096 /dev/zero; } >/tmp/walk.mp4
expect 0 pepeseg upload walk /tmp/walk.mp4
expect 7 pepeseg train walk --preset preview
! grep -F 'the module video' /tmp/output || fail 'the module video does not load'
expect 1 runuser -u pepeseg -- pepesegd --listen=127.0.0.1:0 --data=/tmp/other '--database=postgresql:host=/tmp dbname=none'
! grep -F 'the module postgresql' /tmp/output || fail 'the module postgresql does not load'
runuser -u games -- pepeseg-web >/tmp/web.log 2>&1 &
web=$!
ask_web
kill -TERM "$web"
pkill -TERM -x pepesegd 2>/dev/null || kill -TERM "$(cat /proc/"$server"/task/"$server"/children)"
code=0
wait "$server" || code=$?
((code == 0)) || fail "the server ends with $code"
