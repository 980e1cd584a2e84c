#include "server/api/mask_advice.h"

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace pepeseg {
namespace {

// Keep in step with deploy/sam.sh and clients/python/pepeseg_priors/README.md.
constexpr char kRemedy[] =
    "For better masks, have the server's operator install SAM (make sam, or deploy/sam.sh) and "
    "start it again, or run pepeseg-priors (SAM, in clients/python/pepeseg_priors) on the "
    "photographs and upload its masks/ with them, or start the server with pepesegd "
    "--priors-command=pepeseg-priors; then train again.";

}  // namespace

std::vector<std::string> AdviceOnModel(const std::map<std::string, std::string>& sources) {
  const auto masks = sources.find("masks");
  if (masks == sources.end()) return {};
  // The source's name of the built-in method, as models store it.
  if (masks->second == "embedded") {
    return {absl::StrCat(
        "The masks were made by the server's built-in method, which knows no objects: segments "
        "may be poor. ",
        kRemedy)};
  }
  if (masks->second == "none") {
    return {
        absl::StrCat("Trained without masks: the model can be rendered, not segmented. ", kRemedy)};
  }
  return {};
}

std::vector<std::string> AdviceOnMaskQuality(const std::map<std::string, std::string>& sources,
                                             double mask_quality) {
  // One piece of advice with the remedy is enough.
  if (mask_quality >= kGoodMaskQuality || !AdviceOnModel(sources).empty()) return {};
  return {absl::StrFormat(
      "The masks of different views disagree: their mask quality is %.2f, and under %.1f segments "
      "may be poor. %s",
      mask_quality, kGoodMaskQuality, kRemedy)};
}

std::vector<std::string> AdviceOnDataset(bool has_masks, bool has_mask_maker) {
  if (has_masks || has_mask_maker) return {};
  return {absl::StrCat(
      "No masks are among the files: a training makes them by the server's built-in method, which "
      "knows no objects, so segments may be poor. ",
      kRemedy)};
}

}  // namespace pepeseg
