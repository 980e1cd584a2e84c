#include "server/services/sam_choice.h"

#include "server/api/error.h"

namespace pepeseg {

bool IsForSam(const v1::Prompt& prompt, const v1::Granularity& granularity) {
  return (prompt.has_points() || prompt.has_box()) && !granularity.has_threshold() &&
         granularity.scale_case() == v1::Granularity::SCALE_NOT_SET;
}

absl::Status CheckForSam(const v1::Prompt& prompt, const v1::Granularity& granularity) {
  if (IsForSam(prompt, granularity)) return absl::OkStatus();
  return BadField("sam_clicks", "true", "is for points or a box, without scale and threshold");
}

bool SuitsSam(const Model& model, const ViewImages& images) {
  const auto masks = model.facts.find("masks");
  return images.CheckAvailable().ok() && masks != model.facts.end() &&
         (masks->second == "sam" || masks->second == "sam and embedded");
}

bool IsSamsFault(const absl::Status& status) {
  return absl::IsFailedPrecondition(status) || absl::IsResourceExhausted(status) ||
         absl::IsUnavailable(status);
}

}  // namespace pepeseg
