#include "core/evaluate/sam_agreement.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/evaluate/mask_scores.h"
#include "core/query/mask_geometry.h"
#include "core/query/prompt.h"
#include "core/query/propose.h"

namespace pepeseg {
namespace {

absl::Status CheckUnit(absl::string_view name, double value) {
  if (value >= 0 && value <= 1) return absl::OkStatus();  // false for NaN
  return absl::InvalidArgumentError(
      absl::StrCat("sam_agreement.", name, " is ", value, ", must be in [0, 1]"));
}

absl::Status CheckSamView(const SamView& sam) {
  RETURN_IF_ERROR(CheckView(sam.view));
  const Camera& camera = sam.view.camera;
  const size_t num_pixels = static_cast<size_t>(camera.width) * camera.height;
  const auto num_masks = static_cast<size_t>(sam.masks.num_masks);
  const auto fits = [](size_t size, size_t wanted) { return size == 0 || size == wanted; };
  if (fits(sam.masks.pixel_cell.size(), num_pixels) && fits(sam.ignore.size(), num_pixels) &&
      fits(sam.predicted_iou.size(), num_masks) && fits(sam.stability.size(), num_masks)) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(
      absl::StrCat("view \"", sam.view.name, "\": ", num_masks, " masks of ",
                   sam.masks.pixel_cell.size(), " pixels with ", sam.predicted_iou.size(),
                   " predicted IoUs, ", sam.stability.size(), " stability scores and ",
                   sam.ignore.size(), " ignore values; the view has ", num_pixels, " pixels"));
}

bool Reaches(std::span<const double> scores, int mask, double least) {
  return scores.empty() || scores[static_cast<size_t>(mask)] >= least;
}

// Clicks a mask, [height, width] of 0 and 1, and compares it with the proposals.
absl::StatusOr<SamMaskScore> ScoreOne(const Segmenter& segmenter, const SamView& sam,
                                      std::span<const uint8_t> mask, int num_proposals,
                                      const SegmentOptions& segment) {
  SamMaskScore score;
  const Camera& camera = sam.view.camera;
  const PixelIndex pixel = DeepestPixel(mask, camera.width, camera.height);
  score.click = {pixel.x + 0.5, pixel.y + 0.5, true};
  const auto proposed = Propose(segmenter, {.prompt = {sam.view, PointsPrompt{score.click}},
                                            .max_count = std::max(num_proposals, kDefaultProposals),
                                            .frame = FrameKind::kView,
                                            .options = segment});
  if (IsNothingThere(proposed.status())) return score;
  RETURN_IF_ERROR(proposed.status());
  const std::vector<size_t> order = proposed->candidates.BySupport();
  const size_t count = std::min(static_cast<size_t>(num_proposals), order.size());
  for (size_t i = 0; i < count; ++i) {
    const double iou = Iou(proposed->masks[order[i]].mask.pixels, mask, sam.ignore);
    if (i == 0) score.first_iou = iou;
    score.best_iou = std::max(score.best_iou, iou);
  }
  return score;
}

absl::StatusOr<SamViewScores> ScoreView(const Segmenter& segmenter, const SamView& sam,
                                        const SamAgreementOptions& options,
                                        const SegmentOptions& segment,
                                        absl::FunctionRef<absl::Status()> check_cancelled) {
  SamViewScores scores = {.view = sam.view.name, .masks = {}};
  for (int m = 0; m < sam.masks.num_masks; ++m) {
    if (!Reaches(sam.predicted_iou, m, options.min_predicted_iou) ||
        !Reaches(sam.stability, m, options.min_stability)) {
      continue;
    }
    std::vector<uint8_t> mask = sam.masks.Extract(m).pixels;
    for (size_t i = 0; i < sam.ignore.size(); ++i) {
      if (sam.ignore[i] != 0) mask[i] = 0;
    }
    const int64_t num_pixels = std::count(mask.begin(), mask.end(), uint8_t{1});
    if (num_pixels < options.min_pixels) continue;
    RETURN_IF_ERROR(check_cancelled());
    ASSIGN_OR_RETURN(SamMaskScore score,
                     ScoreOne(segmenter, sam, mask, options.num_proposals, segment));
    score.mask = m;
    score.num_pixels = num_pixels;
    scores.masks.push_back(score);
    scores.first_iou += score.first_iou;
    scores.best_iou += score.best_iou;
  }
  return scores;
}

// Returns the mean from a sum, 0 of nothing.
double MeanFrom(double sum, size_t count) {
  return count == 0 ? 0 : sum / static_cast<double>(count);
}

}  // namespace

absl::Status Validate(const SamAgreementOptions& options) {
  RETURN_IF_ERROR(CheckUnit("min_predicted_iou", options.min_predicted_iou));
  RETURN_IF_ERROR(CheckUnit("min_stability", options.min_stability));
  if (options.min_pixels < 1) {
    return absl::InvalidArgumentError(
        absl::StrCat("sam_agreement.min_pixels is ", options.min_pixels, ", must be at least 1"));
  }
  if (options.num_proposals >= 1) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("sam_agreement.num_proposals is ",
                                                 options.num_proposals, ", must be at least 1"));
}

absl::StatusOr<SamAgreement> ScoreSamAgreement(const Segmenter& segmenter,
                                               std::span<const SamView> views,
                                               const SamAgreementOptions& options,
                                               const SegmentOptions& segment,
                                               absl::FunctionRef<absl::Status()> check_cancelled) {
  RETURN_IF_ERROR(Validate(options));
  for (const SamView& sam : views) RETURN_IF_ERROR(CheckSamView(sam));
  SamAgreement agreement;
  for (const SamView& sam : views) {
    ASSIGN_OR_RETURN(SamViewScores scores,
                     ScoreView(segmenter, sam, options, segment, check_cancelled));
    agreement.num_masks += static_cast<int64_t>(scores.masks.size());
    agreement.first_iou += scores.first_iou;
    agreement.best_iou += scores.best_iou;
    scores.first_iou = MeanFrom(scores.first_iou, scores.masks.size());
    scores.best_iou = MeanFrom(scores.best_iou, scores.masks.size());
    agreement.views.push_back(std::move(scores));
  }
  if (agreement.num_masks == 0) {
    return absl::InvalidArgumentError(absl::StrCat(
        "none of the masks of ", views.size(), " views counts: a mask needs a predicted IoU of ",
        options.min_predicted_iou, ", a stability of ", options.min_stability, " and ",
        options.min_pixels, " pixels"));
  }
  const auto count = static_cast<size_t>(agreement.num_masks);
  agreement.first_iou = MeanFrom(agreement.first_iou, count);
  agreement.best_iou = MeanFrom(agreement.best_iou, count);
  return agreement;
}

}  // namespace pepeseg
