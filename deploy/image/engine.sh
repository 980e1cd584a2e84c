# Sourced: podman and buildah for build.sh and test.sh, as they run where there is no daemon, no
# systemd and nothing of a registry: a storage of its own below $store.
: "${store:?}"
export STORAGE_DRIVER=${STORAGE_DRIVER:-overlay} # vfs where overlay cannot be mounted
places=(--root "$store/storage" --runroot "$store/run")

# Without systemd podman complains that health checks get no timer; its errors it tells anyway.
podman() {
  command podman "${places[@]}" --runtime runc --cgroup-manager cgroupfs --events-backend file \
    --log-level fatal "$@"
}

buildah() {
  command buildah "${places[@]}" "$@"
}
