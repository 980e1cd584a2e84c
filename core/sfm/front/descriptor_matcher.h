#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/sfm/features/features.h"
#include "core/sfm/front/pair_selection.h"
#include "kernels/backend.h"
#include "kernels/buffer.h"

namespace pepeseg {

// Matches the features of photographs on a backend, which keeps all descriptors as long as this
// lives. Holds the backend's exclusive_use() during each call. Results are the same on every
// backend (kernels/ops/match.h).
class DescriptorMatcher {
 public:
  // `features` must outlive it. RESOURCE_EXHAUSTED: the descriptors do not fit the device's memory.
  // INTERNAL: the device failed.
  static absl::StatusOr<DescriptorMatcher> Create(Backend& backend,
                                                  const std::vector<const SfmFeatures*>& features);

  // Returns the matches of each pair: mutual nearest neighbours that pass the tests of COLMAP 3.8
  // (ratio 0.8, 0.7 radians). Errors as Create.
  absl::StatusOr<std::vector<std::vector<FeatureMatch>>> Match(
      std::span<const PhotographPair> pairs);
  // Returns how much each pair seems to have in common: the number of the 256 largest features of
  // either photograph that match a feature of the other (ratio 0.9). Errors as Create.
  absl::StatusOr<std::vector<int64_t>> Score(std::span<const PhotographPair> pairs);

  // Returns the number of the first pairs that should be matched in one call, at least 1: about a
  // quarter of a second of work, so that the caller can report and stop in between.
  size_t BatchOf(std::span<const PhotographPair> pairs, bool for_score) const;

 private:
  DescriptorMatcher(Backend& backend, const std::vector<const SfmFeatures*>& features)
      : backend_(&backend), features_(features) {}
  absl::Status Upload();
  absl::Status Run(std::span<const BlockPair> pairs, const Buffer<int32_t>& limits, bool mutual);

  Backend* backend_;
  std::vector<const SfmFeatures*> features_;
  Buffer<uint8_t> descriptors_;
  Buffer<int32_t> match_limits_, score_limits_;
  // Block i: all features of photograph i. Block n + i: its largest.
  std::vector<int64_t> block_first_;
  // Results of the last call: the matches of pair i start at pair_first_[i].
  std::vector<int64_t> pair_first_;
  std::vector<DescriptorMatch> matches_;
};

}  // namespace pepeseg
