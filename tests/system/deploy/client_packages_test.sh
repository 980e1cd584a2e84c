#!/usr/bin/env bash
# Tests what `make wheel` and `make npm-package` have made: each is installed in a new folder, without a
# network, and makes calls to a server.
#   client_packages_test.sh FOLDER_OF_PROGRAMS WHEEL NPM_PACKAGE
set -euo pipefail
programs=$1 wheel=$(realpath "$2") package=$(realpath "$3")
# shellcheck source=tests/clients/with_server.sh
source "$(dirname "$0")/../../clients/with_server.sh"
web=
trap '[[ -z $web ]] || kill "$web" 2>/dev/null; stop' EXIT
shelf=$(realpath "$(dirname "$0")/../../data/apc_shelf")
expect 0 pepeseg upload shelf "$shelf"
cd "$work"

# Debian's packages have what the wheel depends on; nothing is looked up in an index.
expect 0 /usr/bin/python3 -m venv --system-site-packages env
expect 0 env/bin/pip install --no-index --no-build-isolation "$wheel"
expect 0 env/bin/python -c '
import pepeseg, sys
assert pepeseg.__file__.startswith(sys.prefix), pepeseg.__file__
with pepeseg.Client("shelf") as client:
    print(client.scenes())'
grep -qE "[\"'/]shelf" "$work/output" || fail 'the wheel does not list the scene'
expect 0 env/bin/python -m pepeseg --help
echo "the wheel: $(basename "$wheel")"

mkdir app
cd app
expect 0 npm install --offline --no-audit --no-fund --ignore-scripts "$package"
[[ $(ls node_modules) == pepeseg-web ]] || fail "the package brings others: $(ls node_modules)"
expect 0 node_modules/.bin/pepeseg-web --help
node_modules/.bin/pepeseg-web --listen 127.0.0.1:0 --port-file "$work/web-port" >"$work/server.log" 2>&1 &
web=$!
for _ in {1..100}; do [[ -s $work/web-port ]] && break; sleep 0.1; done
[[ -s $work/web-port ]] || fail 'the web app does not start'
expect 0 node -e '
  const at = "http://127.0.0.1:" + process.argv[1];
  (async () => {
    const page = await fetch(at + "/scenes/shelf");
    console.log(page.status, (await page.text()).includes("<script"));
    const made = await fetch(at + "/api/rpc/pepeseg.v1.SceneService/ListScenes", {
      method: "POST", headers: { "content-type": "application/json" }, body: "{}" });
    console.log(made.status, await made.text());
  })();' "$(cat "$work/web-port")"
grep -qx '200 true' "$work/output" || fail 'no page'
grep -q '^200 .*"scenes/shelf"' "$work/output" || fail 'the web app does not list the scene'
echo "the npm package: $(basename "$package")"
