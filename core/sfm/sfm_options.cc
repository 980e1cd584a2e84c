#include "core/sfm/sfm_options.h"

#include <string>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

absl::Status CheckRange(const std::string& name, int value, int least, int most) {
  if (value >= least && value <= most) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat(name, " is ", value, ", it must be in [", least, ", ", most, "]"));
}

}  // namespace

absl::Status Validate(const SfmOptions& options) {
  RETURN_IF_ERROR(CheckRange("matching", static_cast<int>(options.matching), 0,
                             static_cast<int>(SfmMatching::kSequential)));
  RETURN_IF_ERROR(CheckRange("max_features", options.max_features, 128, 32768));
  RETURN_IF_ERROR(CheckRange("sequential_overlap", options.sequential_overlap, 1, 100));
  RETURN_IF_ERROR(CheckRange("max_seconds", options.max_seconds, 1, 7 * 24 * 3600));
  RETURN_IF_ERROR(CheckRange("max_video_frames", options.max_video_frames, 3, 2000));
  if (options.min_registered_share >= 0 && options.min_registered_share <= 1) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(absl::StrCat(
      "min_registered_share is ", options.min_registered_share, ", it must be in [0, 1]"));
}

}  // namespace pepeseg
