#include "core/train/held_out_scores.h"

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"

namespace pepeseg {

absl::StatusOr<HeldOutScorer> HeldOutScorer::Create(const std::filesystem::path& lpips_weights) {
  HeldOutScorer scorer;
  if (lpips_weights.empty()) return scorer;
  ASSIGN_OR_RETURN(scorer.lpips_, Lpips::Open(lpips_weights));
  return scorer;
}

// LPIPS that fails is no reason to end a training: the view then has only PSNR and SSIM.
absl::StatusOr<std::vector<ViewScores>> HeldOutScorer::Score(
    Backend& backend, const Capture& capture, const Gaussians& gaussians,
    absl::FunctionRef<void(const std::string&)> warn) {
  if (!lpips_) return ScoreHeldOut(backend, capture, gaussians);
  bool warned = false;  // one reason is enough for all views
  const auto distance = [&](const Image& photo,
                            std::span<const float> rendering) -> std::optional<double> {
    const absl::StatusOr<double> lpips = lpips_->Distance(photo, rendering);
    if (lpips.ok()) return *lpips;
    if (!warned) warn(absl::StrCat("no LPIPS: ", lpips.status().message()));
    warned = true;
    return std::nullopt;
  };
  return ScoreHeldOut(backend, capture, gaussians, distance);
}

std::map<std::string, double> RecordScores(std::span<const ViewScores> scores, Model& model) {
  // No held-out views: the model then has no scores, instead of means of nothing.
  if (scores.empty()) return {};
  std::map<std::string, const ImageScores*> by_view;
  for (const ViewScores& view : scores) by_view[view.view] = &view.scores;
  for (ModelView& view : model.views) {
    if (const auto found = by_view.find(view.name); found != by_view.end()) {
      view.scores = *found->second;
    }
  }
  const ImageScores mean = Mean(scores);
  std::map<std::string, double> metrics = {{"psnr", mean.psnr}, {"ssim", mean.ssim}};
  if (mean.lpips) metrics["lpips"] = *mean.lpips;
  return metrics;
}

}  // namespace pepeseg
