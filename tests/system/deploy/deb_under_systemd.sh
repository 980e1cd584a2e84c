#!/usr/bin/env bash
# Tests the units: see deb_test.sh. Runs inside the container, as a unit.
source /test/deb_test_steps.sh
trap '(($? == 0)) || { systemctl --no-pager status pepesegd pepeseg-web; journalctl --no-pager -u pepesegd -u pepeseg-web | tail -n 60; }' EXIT
property() { systemctl show --property="$2" --value "$1"; }
wait_for systemctl is-active pepesegd pepeseg-web
systemctl --no-pager --lines=0 status pepesegd pepeseg-web
failed=$(systemctl --failed --plain --no-legend | grep pepeseg || true)
[[ -z $failed ]] || fail "$failed"
wait_for pepeseg health
step 'the scene of before the purge answers'
click /tmp/first
ask_web

step 'both listen on this machine only, and run without rights'
open=$(ss -Hltnp | grep -E 'pepesegd|node' | awk '{print $4}' | sort)
[[ $open == $'127.0.0.1:50051\n127.0.0.1:8080\n127.0.0.1:9464' ]] || fail "listens on: $open"
server=$(property pepesegd MainPID)
[[ $(stat -c %U "/proc/$server") == pepeseg ]] || fail 'the server does not run as pepeseg'
for pid in "$server" "$(property pepeseg-web MainPID)"; do
  grep -Eq '^CapBnd:[[:space:]]+0+$' "/proc/$pid/status" || fail 'a service has capabilities'
  grep -Eq '^NoNewPrivs:[[:space:]]+1$' "/proc/$pid/status" || fail 'a service may get rights'
  grep -Eq '^Seccomp:[[:space:]]+2$' "/proc/$pid/status" || fail 'no system call is filtered'
done
journalctl --no-pager -u pepesegd -o cat | grep -F 'sandbox' | sed 's/^/  /' || true

step 'settings, then a restart'
sed -i 's/^PEPESEGD_OPTIONS=.*/& --checkpoint-seconds=1/' /etc/pepeseg/pepesegd.conf
expect 0 systemctl restart pepesegd
wait_for pepeseg health
[[ $(property pepesegd MainPID) != "$server" ]] || fail 'no restart'
click /tmp/second
cmp /tmp/first/frame-000000_mask.png /tmp/second/frame-000000_mask.png || fail 'another answer after a restart'

step 'kill -9 during a training, from which the job resumes'
job=$(pepeseg train shelf --steps 2500 --feature-steps 60 --image-scale 0.25 --detach)
wait_for sh -c "ls /var/lib/pepeseg/$job/work/attempt-*/checkpoints/*.ckpt"
server=$(property pepesegd MainPID)
worker=$(pgrep -x pepeseg-worker)
kill -KILL "$server"
wait_for sh -c "[ \$(systemctl show --property=NRestarts --value pepesegd) = 1 ]"
wait_for pepeseg health
[[ ! -e /proc/$worker ]] || fail 'the worker outlives the server'
expect 0 pepeseg watch "$job"
grep -o 'resumes from .*' "/var/lib/pepeseg/$job/worker.log" || fail 'the job starts from its first step'
click /tmp/third

step 'a worker is killed by want of memory or by hand: the service stays'
expect 0 pepeseg train shelf --steps 2500 --feature-steps 60 --image-scale 0.25 --detach
job=$(cat /tmp/output)
wait_for pgrep -x pepeseg-worker
server=$(property pepesegd MainPID)
kill -KILL "$(pgrep -x pepeseg-worker)"
expect 0 pepeseg watch "$job"
[[ $(property pepesegd MainPID) == "$server" ]] || fail 'the server has ended with its worker'

step 'systemctl stop'
start=$SECONDS
expect 0 systemctl stop pepesegd pepeseg-web
((SECONDS - start < 15)) || fail "the stop takes $((SECONDS - start)) s"
[[ $(property pepesegd Result) == success && $(property pepeseg-web Result) == success ]] || fail 'not a clean stop'
expect 0 systemctl start pepesegd pepeseg-web
wait_for pepeseg health
ask_web

step 'an upgrade restarts the services and keeps the settings'
server=$(property pepesegd MainPID)
expect 0 env DEBIAN_FRONTEND=noninteractive dpkg --install /test/pepeseg-server_*.deb /test/pepeseg_*.deb /test/pepeseg-web_*.deb
wait_for pepeseg health
[[ $(property pepesegd MainPID) != "$server" ]] || fail 'an upgrade leaves the old program running'
grep -q -- '--checkpoint-seconds=1$' /etc/pepeseg/pepesegd.conf || fail 'an upgrade overwrites the settings'
click /tmp/fourth
ask_web
