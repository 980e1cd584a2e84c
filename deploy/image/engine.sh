# Sourced: podman and buildah for build.sh and test.sh, as they run where there is no daemon, no
# systemd and nothing of a registry: a storage of its own below $store.
: "${store:?}"
export STORAGE_DRIVER=${STORAGE_DRIVER:-overlay} # vfs where overlay cannot be mounted
places=(--root "$store/storage" --runroot "$store/run")

podman() {
  command podman "${places[@]}" --runtime runc --cgroup-manager cgroupfs --events-backend file "$@"
}

buildah() {
  command buildah "${places[@]}" "$@"
}
