# Sourced by build.sh and test.sh: podman and buildah with their own storage below $store, set up for
# machines without a daemon, without systemd and without a registry.
: "${store:?}"
export STORAGE_DRIVER=${STORAGE_DRIVER:-overlay} # vfs where overlay cannot be mounted
places=(--root "$store/storage" --runroot "$store/run")

# Without systemd podman complains that health checks get no timer; it still reports errors.
podman() {
  command podman "${places[@]}" --runtime runc --cgroup-manager cgroupfs --events-backend file \
    --log-level fatal "$@"
}

buildah() {
  command buildah "${places[@]}" "$@"
}
