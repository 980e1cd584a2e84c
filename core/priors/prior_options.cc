#include "core/priors/prior_options.h"

#include <string_view>
#include <utility>

#include "absl/strings/str_cat.h"

namespace pepeseg {

bool AsksForSam(PriorMaker maker) {
  return maker == PriorMaker::kSam || maker == PriorMaker::kSamAndEmbedded;
}

// The makers are ordered so that those of depth come first: SAM makes masks only.
absl::Status Validate(const PriorOptions& options) {
  for (const auto& [name, maker] : {std::pair{"masks", options.masks}, {"depth", options.depth}}) {
    // kAuto is the lowest value, kCommand the last that depth may have.
    const bool masks = name == std::string_view("masks");
    const PriorMaker last = masks ? PriorMaker::kSamAndEmbedded : PriorMaker::kCommand;
    if (maker >= PriorMaker::kAuto && maker <= last) continue;
    return absl::InvalidArgumentError(absl::StrCat(
        name, " is ", static_cast<int>(maker), ", it must be none, embedded",
        masks ? ", command, sam or sam and embedded" : " or command", ", or left out"));
  }
  return absl::OkStatus();
}

}  // namespace pepeseg
