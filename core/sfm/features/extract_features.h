#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/scene/capture.h"
#include "core/sfm/features/features.h"
#include "kernels/backend.h"

// Features of photographs by ExtractSift (kernels/ops/sift.h), as COLMAP 3.8 finds them
// (tests/bench/results/features_sift.md).
namespace pepeseg {

// A photograph whose features are wanted.
struct FeaturePhotograph {
  std::string name;  // of the owner, for messages
  std::filesystem::path path;
  // Returns the pixels that are not to be used, [height, width] of the stored photograph, 1; or
  // none. Called from another thread. Empty: all pixels are used.
  std::function<absl::StatusOr<std::vector<uint8_t>>()> ignored;
};

// Not FeatureOptions, which are those of stage two.
struct SfmFeatureOptions {
  int max_features = 3000;  // of a photograph, see ExtractSiftArgs. > 0
  int max_side = 2000;      // photographs are shrunk to this longer side, pixels. 0: they are not
  int num_threads = 0;      // that decode, see NumDecoding
};

// Returns the number of threads that decode photographs. 0: one for each core. At most 16, because
// each has a photograph in memory.
int NumDecoding(int num_threads);

// Takes the features of a photograph, by its index, in pixels of the stored photograph. Called on
// the calling thread, in the order of the photographs. An error ends the extraction.
using TakeFeaturesFn = absl::FunctionRef<absl::Status(size_t index, SfmFeatures features)>;

// Finds the features of the photographs and calls `take` for each. Photographs are
// decoded by threads while the backend works on those before them; a few are in memory at a time.
// Results depend on the backend, but not on the number of threads.
//
// Returns the first error by the order of the photographs: those of DecodeLuma and `ignored`;
// INVALID_ARGUMENT for ignored pixels of another size; those of the backend (TakeStatus); those of
// `take`.
absl::Status ExtractFeatures(Backend& backend, std::span<const FeaturePhotograph> photographs,
                             const SfmFeatureOptions& options, TakeFeaturesFn take);

}  // namespace pepeseg
