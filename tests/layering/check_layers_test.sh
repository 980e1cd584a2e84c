#!/usr/bin/env bash
# check_layers.sh must find each planted violation, name its file, and pass a tree without any.
set -uo pipefail
check=$(realpath "$(dirname "$0")/check_layers.sh")
tree=$(mktemp -d)
trap 'rm -rf "$tree"' EXIT
failures=0

plant() {  # plant FILE INCLUDE
  rm -rf "${tree:?}"/*
  mkdir -p "$tree"/{core/formats,kernels/cuda,kernels/cpu,server/rpc,clients/cli,clients/cpp} "$tree/$(dirname "$1")"
  printf '#pragma once\n#include %s\n' "$2" >"$tree/$1"
}
expect_found() {
  plant "$1" "$2"
  if output=$("$check" "$tree") || [[ $output != *"$1"* ]]; then
    echo "FAILED: not found: $1 includes $2 (said: $output)"
    failures=1
  fi
}
expect_allowed() {
  plant "$1" "$2"
  if ! output=$("$check" "$tree"); then
    echo "FAILED: wrongly refused: $1 includes $2 (said: $output)"
    failures=1
  fi
}

expect_found core/scene/view.h '<grpcpp/grpcpp.h>'
expect_found core/formats/wire.cc '"pepeseg/v1/scene.pb.h"'
expect_found kernels/ops/render.h '"proto/pepeseg/v1/job.pb.h"'
expect_found kernels/cpu/render.cc '"core/scene/camera.h"'
expect_found kernels/math/vec.h '<Eigen/Core>'
expect_found kernels/cpu/update.cc '<spdlog/spdlog.h>'
expect_found core/query/prompt.cc '"server/rpc/guard.h"'
expect_found core/query/prompt.h '<opencv2/core.hpp>'
expect_found server/rpc/pictures.cc '<opencv2/imgcodecs.hpp>'
expect_found core/formats/image.cc '<opencv2/imgcodecs.hpp>'
expect_found core/reconstruct/step.cc '<cuda_runtime.h>'
expect_found kernels/cpu/render.cc '<cub/cub.cuh>'
expect_found kernels/cuda/render.cu '"absl/status/status.h"'
expect_found kernels/cuda/render.cu '<Eigen/Core>'
expect_found clients/cli/main.cc '"core/dataset/import.h"'
expect_found clients/cli/main.cc '"server/store.h"'
expect_found server/rpc/views.cc '"core/evaluate/truth_view.h"'
expect_found server/main.cc '  "clients/cli/picture.h"'
expect_found clients/cpp/client.cc '"clients/cli/shell.h"'
expect_allowed core/formats/image.cc '<opencv2/imgproc.hpp>'
expect_allowed core/priors/edges.cc '<opencv2/imgproc.hpp>'
expect_allowed kernels/cuda/render.cu '<cuda_runtime.h>'
expect_allowed server/api/convert.cc '"core/scene/camera.h"'
expect_allowed clients/cli/main.cc '"pepeseg/v1/job.grpc.pb.h"'
expect_allowed core/scene/view.cc '"kernels/gaussian_planes.h"'
exit $failures
