#!/usr/bin/env bash
# Makes the npm package pepeseg-web of the built web app (`make web-app`): the program pepeseg-web, and the
# contract in proto/. It depends on no other package.
#   npm_package.sh FOLDER
set -euo pipefail
[[ $# == 1 && $1 != -* ]] || { sed -n '4s/^# \{0,1\}//p' "$0" >&2; exit 2; }
mkdir -p "$1"
out=$(realpath "$1")
cd "$(dirname "$0")/.."
web=clients/web
[[ -e $web/dist/server/main.js && -e $web/dist/app/index.html ]] ||
  { echo 'npm_package.sh: the web app is not built: make web-app' >&2; exit 1; }
version=$(sed -n 's/^project(pepeseg VERSION \([0-9.]*\).*/\1/p' CMakeLists.txt)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
mkdir -p "$work/proto" "$work/dist"
cp -r $web/dist/app $web/dist/server "$work/dist/"
cp -r proto/pepeseg "$work/proto/"
cp LICENSE "$work/"
deploy/npm_licences.sh $web "$work/licences"
sed -i '1s/^\(#!.*\n\)\{0,1\}/#!\/usr\/bin\/env node\n/' "$work/dist/server/main.js"
chmod 755 "$work/dist/server/main.js"
cat >"$work/README.md" <<'README'
# pepeseg-web

The web app of a pepeseg server, which turns photographs into 3D Gaussians that one click segments.

    npx pepeseg-web --server 127.0.0.1:50051      # then open http://127.0.0.1:8080
    npx pepeseg-web --help

`proto/` has the contract of the server, for clients by @grpc/proto-loader and others. `licences/` has the licences of
the packages that the app contains.
README
node -e '
  const fs = require("fs");
  const { name, license, type, engines, version } = JSON.parse(fs.readFileSync(process.argv[1]));
  if (version !== process.argv[3]) throw new Error(`${process.argv[1]}: version ${version}, not ${process.argv[3]}`);
  const description = "Web app of pepeseg: photographs to 3D Gaussians that one click segments";
  const made = { name, version, description, license, type, engines,
    bin: { "pepeseg-web": "dist/server/main.js" }, files: ["dist", "proto", "licences"] };
  fs.writeFileSync(process.argv[2], JSON.stringify(made, null, 2) + "\n");
' $web/package.json "$work/package.json" "$version"
rm -f "$out"/pepeseg-web-*.tgz
cd "$work"
npm pack --silent --ignore-scripts --pack-destination "$out" >/dev/null
sha256sum "$out"/pepeseg-web-*.tgz
