#!/usr/bin/env bash
# The direction of the house, clients -> proto <- server -> core -> kernels, read from the includes.
#   check_layers.sh ROOT     prints each include that breaks a rule; exit 1 if there is one
set -uo pipefail
cd "${1:?usage: check_layers.sh ROOT}" || exit 2
broken=0

# forbid WHY INCLUDE_PATTERN FIND_ARGUMENTS...: no file that find names may include the pattern.
forbid() {
  local why=$1 pattern=$2 hits
  shift 2
  hits=$(find "$@" -type f \( -name '*.h' -o -name '*.cc' -o -name '*.cu' -o -name '*.cuh' \) \
           -exec grep -nHE "^[[:space:]]*#[[:space:]]*include[[:space:]]*[<\"]($pattern)" {} + \
           2>/dev/null)
  if [[ -n $hits ]]; then
    printf '%s:\n%s\n' "$why" "$hits"
    broken=1
  fi
}

rpc='grpc|google/protobuf|proto/|pepeseg/v[0-9]|[^">]*\.pb\.h'
cuda='cuda|cub/|thrust/|cooperative_groups|device_launch|nvtx|curand|cublas'
forbid 'no RPC in core or kernels' "$rpc" core kernels
forbid 'kernels depend on nothing of ours' 'core/|server/|clients/|tests/' kernels
forbid 'core depends on kernels only' 'server/|clients/|tests/' core
forbid 'clients use the contract only' 'core/|kernels/|server/|tests/' clients
forbid 'the client library knows no command line' 'clients/(benchmark|cli|terminal)/' clients/cpp
forbid 'server does not use clients or tests' 'clients/|tests/' server
forbid 'server evaluates through core/evaluate/evaluate.h' \
  'core/evaluate/(click|entity|evaluation_|image|label|mask|prompt|reference|sam|truth|view)' server
forbid 'Eigen belongs in core' 'Eigen/' kernels clients
forbid 'no logging in kernels' 'spdlog/' kernels
forbid 'OpenCV belongs in core/formats, core/dataset, core/priors and LPIPS' 'opencv' \
  core kernels server clients -not -path 'core/formats/*' -not -path 'core/dataset/*' \
  -not -path 'core/priors/*' -not -path 'core/evaluate/lpips.cc'
forbid 'readers of OpenCV bring 200 libraries' 'opencv2/(highgui|imgcodecs|videoio)' \
  core kernels server clients
forbid 'CUDA headers belong in kernels/cuda' "$cuda" \
  core kernels server clients -not -path 'kernels/cuda/*'
forbid 'no Eigen or Abseil in device code' 'Eigen/|absl/' kernels core -name '*.cu*'
exit $broken
