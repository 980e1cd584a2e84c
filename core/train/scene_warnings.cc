#include "core/train/scene_warnings.h"

#include <cstddef>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"

namespace pepeseg {

std::optional<std::string> WarningOfBlurred(const Capture& capture,
                                            const std::vector<bool>& blurred) {
  std::vector<std::string> names;
  size_t number = 0;  // among the training views
  for (const View& view : capture.views) {
    if (view.held_out) continue;
    if (number < blurred.size() && blurred[number]) names.push_back(view.name);
    ++number;
  }
  if (names.empty()) return std::nullopt;
  return absl::StrCat(names.size(), " of ", number,
                      " photographs are blurred and count less: ", absl::StrJoin(names, ", "),
                      "; sharp ones of the same places make a better model");
}

std::optional<std::string> WarningOfWrongPoses(int num_steps, double psnr) {
  constexpr double kNothingInCommon = 12;  // dB
  constexpr int kFewSteps = 300;
  if (num_steps < kFewSteps || psnr >= kNothingInCommon) return std::nullopt;
  return absl::StrFormat(
      "the held-out views are rendered at %.1f dB: the model does not show the scene. The likely "
      "cause are camera poses in another convention (axes, or the inverse), of other photographs, "
      "or that do not fit the points; masks are not the cause",
      psnr);
}

}  // namespace pepeseg
