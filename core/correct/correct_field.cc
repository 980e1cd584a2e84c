#include "core/correct/correct_field.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/base/status_macros.h"
#include "core/correct/feature_moves.h"
#include "core/correct/membership.h"
#include "core/query/mask_grid.h"
#include "core/query/prompt.h"
#include "kernels/ops/render.h"

namespace pepeseg {
namespace {

// Masks whose agreement in the pixels that views share is lower show different things.
constexpr double kMinAgreement = 0.25;
// Scales next to the best one whose IoU is at most this much lower are corrected, too, up to
// kMaxScaleSteps on each side.
constexpr double kSimilarFit = 0.1;
constexpr size_t kMaxFits = 7;  // of these scales that are looked at: their gates hardly differ
constexpr int kMaxScaleSteps = 8;
constexpr double kGivenScaleReach = 0.1;  // around a scale that the caller gives
// Price of a change: of what the scales that are not corrected see of it, and of any.
constexpr float kOtherScalesPrice = 4, kAnyPrice = 0.1f;

absl::Status Fault(size_t index, const char* part, std::string limit) {
  return FaultError(
      {.part = absl::StrCat("[", index, "].", part), .value = "", .limit = std::move(limit)});
}

absl::Status CheckCorrections(const Segmenter& segmenter, std::span<const Correction> corrections) {
  if (!segmenter.has_features()) {
    return absl::FailedPreconditionError("the model was trained without masks: it has no features");
  }
  if (corrections.empty() || corrections.size() > kMaxCorrections) {
    return FaultError({.part = "",
                       .value = absl::StrCat(corrections.size()),
                       .limit = absl::StrCat("masks; allowed are 1..", kMaxCorrections)});
  }
  std::set<std::string> names;
  for (size_t i = 0; i < corrections.size(); ++i) {
    const Correction& correction = corrections[i];
    RETURN_IF_ERROR(CheckView(correction.view));
    RETURN_IF_ERROR(CheckMask(ImageOf(correction.view), correction.mask));
    const std::string& name = correction.view.name;
    if (!name.empty() && !names.insert(name).second) {
      return Fault(i, "view", absl::StrCat("\"", name, "\" is named twice; unite its masks"));
    }
  }
  return absl::OkStatus();
}

// Refuses masks that teach nothing: with nothing inside or outside, or of different things.
absl::Status CheckPixels(std::span<const CorrectedPixels> views, int64_t num_gaussians) {
  for (size_t v = 0; v < views.size(); ++v) {
    bool some_inside = false, some_outside = false;
    for (size_t p = 0; p < views[v].num_pixels(); ++p) {
      if (views[v].solid[p] == 0) continue;
      (views[v].inside[p] != 0 ? some_inside : some_outside) = true;
    }
    if (!some_inside) {
      return NothingThereError({.part = absl::StrCat("[", v, "].mask"),
                                .value = "",
                                .limit = "nothing with a feature is rendered under the mask"});
    }
    if (!some_outside) {
      return Fault(v, "mask", "covers all that the view shows: nothing is left outside the thing");
    }
  }
  const MaskAgreement least = LeastAgreement(views, num_gaussians);
  if (least.iou >= kMinAgreement) return absl::OkStatus();
  return Fault(least.view, "mask",
               absl::StrFormat("contradicts the other masks: of what they show here, its IoU is "
                               "%.2f; all masks must show the same thing",
                               least.iou));
}

// Returns the first and the last of the fits to correct.
std::pair<size_t, size_t> RangeOf(std::span<const ScaleFit> fits, std::optional<double> scale) {
  const auto better = [](const ScaleFit& a, const ScaleFit& b) { return a.iou < b.iou; };
  auto best =
      static_cast<size_t>(std::max_element(fits.begin(), fits.end(), better) - fits.begin());
  const auto distance = [&](size_t i) { return std::abs(fits[i].scale - *scale); };
  if (scale.has_value()) {
    best = 0;
    for (size_t i = 1; i < fits.size(); ++i) best = distance(i) < distance(best) ? i : best;
  }
  const auto belongs = [&](size_t i) {
    if (scale.has_value()) return distance(i) <= kGivenScaleReach;
    return fits[i].iou >= fits[best].iou - kSimilarFit;
  };
  size_t first = best, last = best;
  while (first > 0 && best - first < kMaxScaleSteps && belongs(first - 1)) --first;
  while (last + 1 < fits.size() && last - best < kMaxScaleSteps && belongs(last + 1)) ++last;
  return {first, last};
}

CorrectedScales ChooseScales(const FeatureField& field, std::span<const CorrectedPixels> views,
                             std::optional<double> scale) {
  std::vector<ScaleFit> all;
  for (const double at : GridOf({}).scales) all.push_back(FitScale(field, views, at));
  const auto range = RangeOf(all, scale);
  CorrectedScales chosen;
  const size_t num = range.second - range.first + 1, num_others = all.size() - num;
  for (size_t i = 0; i < all.size(); ++i) {
    if (i >= range.first && i <= range.second) continue;
    for (int k = 0; k < kFeatureSize; ++k) {
      const float psi = all[i].gate[k];
      chosen.price[k] += kOtherScalesPrice * psi * psi / static_cast<float>(num_others);
    }
  }
  for (float& price : chosen.price) price += kAnyPrice;
  const size_t num_fits = std::min(num, kMaxFits);
  for (size_t i = 0; i < num_fits; ++i) {
    // The first and the last scale, and others evenly between them.
    const size_t at = num_fits == 1 ? 0 : i * (num - 1) / (num_fits - 1);
    chosen.fits.push_back(std::move(all[range.first + at]));
  }
  for (size_t i = 1; i < chosen.fits.size(); ++i) {
    if (chosen.fits[i].iou > chosen.fits[chosen.best].iou) chosen.best = i;
  }
  return chosen;
}

// Returns the best of the corrected scales, with a changed field.
ScaleFit BestFit(const FeatureField& field, const CorrectedScales& scales,
                 std::span<CorrectedPixels> views) {
  for (CorrectedPixels& view : views) BlendFeatures(field, view);
  ScaleFit best;
  for (const ScaleFit& fit : scales.fits) {
    ScaleFit now = FitScale(field, views, fit.scale);
    if (best.iou_of_view.empty() || now.iou > best.iou) best = std::move(now);
  }
  return best;
}

}  // namespace

absl::StatusOr<CorrectedField> CorrectField(const Segmenter& segmenter,
                                            std::span<const Correction> corrections,
                                            std::optional<double> scale,
                                            absl::FunctionRef<absl::Status()> check) {
  RETURN_IF_ERROR(CheckCorrections(segmenter, corrections));
  if (scale.has_value()) RETURN_IF_ERROR(CheckScale(*scale));
  const Model& model = segmenter.model();
  std::vector<CorrectedPixels> views;
  for (const Correction& correction : corrections) {
    RETURN_IF_ERROR(check());
    ASSIGN_OR_RETURN(views.emplace_back(), CapturePixels(segmenter, correction));
  }
  RETURN_IF_ERROR(CheckPixels(views, model.gaussians.count));
  const CorrectedScales scales = ChooseScales(model.field, views, scale);
  RETURN_IF_ERROR(check());
  const MaskVotes votes = VotesOf(views, model.gaussians.count);
  const ThingPlace place = PlaceOf(model.gaussians, votes);
  const FeatureMoves moves = FindMoves(model, scales, place);
  std::vector<uint8_t> wanted(moves.pull.size());
  for (size_t g = 0; g < wanted.size(); ++g) wanted[g] = moves.pull[g] | moves.push[g];
  // The finest of the corrected scales tells most things apart.
  const std::vector<float> inside =
      InsideOrNot(model, votes, place, scales.fits.front().gate, wanted);
  RETURN_IF_ERROR(check());
  const ScaleFit& before = scales.fits[scales.best];
  CorrectedField corrected;
  corrected.field = model.field;
  corrected.num_changed = MoveFeatures(scales, moves, inside, corrected.field);
  const ScaleFit after = BestFit(corrected.field, scales, views);
  if (after.iou <= before.iou) {
    corrected.field = model.field;
    corrected.num_changed = 0;
  }
  const ScaleFit& kept = corrected.num_changed == 0 ? before : after;
  corrected.scale = kept.scale;
  corrected.threshold = kept.threshold;
  corrected.iou_before = before.iou_of_view;
  corrected.iou_after = kept.iou_of_view;
  return corrected;
}

// A pixel has its feature and up to about kEntriesOfPixel entries of its row. A Gaussian has two
// features, its votes (those of LeastAgreement, too) and its moves.
int64_t BytesOfCorrection(const Model& model, size_t num_corrections) {
  constexpr int64_t kEntriesOfPixel = 100, kBytesOfEntry = 8;
  constexpr int64_t kFeatureBytes = kFeatureSize * sizeof(float);
  constexpr int64_t kPixelBytes = kFeatureBytes + kEntriesOfPixel * kBytesOfEntry + 16;
  constexpr int64_t kGaussianBytes = 2 * kFeatureBytes + 8 * sizeof(float) + 8;
  return static_cast<int64_t>(num_corrections) * kMaxCorrectedPixels * kPixelBytes +
         model.gaussians.count * kGaussianBytes;
}

}  // namespace pepeseg
