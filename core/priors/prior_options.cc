#include "core/priors/prior_options.h"

#include "absl/strings/str_cat.h"

namespace pepeseg {

absl::Status Validate(const PriorOptions& options) {
  for (const auto& [name, maker] : {std::pair{"masks", options.masks}, {"depth", options.depth}}) {
    if (maker >= PriorMaker::kAuto && maker <= PriorMaker::kCommand) continue;
    return absl::InvalidArgumentError(
        absl::StrCat(name, " is ", static_cast<int>(maker),
                     ", it must be none, embedded or command, or left out"));
  }
  return absl::OkStatus();
}

}  // namespace pepeseg
