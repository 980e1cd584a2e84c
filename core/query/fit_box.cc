#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "core/base/status_macros.h"
#include "core/query/mask_geometry.h"
#include "core/query/mask_grid.h"
#include "core/query/prompt.h"
#include "core/query/resolve_prompt.h"
#include "core/render/feature_maps.h"
#include "kernels/ops/render.h"

namespace pepeseg {
namespace {

constexpr int kSampleSide = 13;       // samples along each side of the box
constexpr double kMiddle = 0.9;       // share of each side of the box that the samples span
constexpr double kSameCosine = 0.95;  // cosine over which two features count as the same
constexpr size_t kMaxCandidates = 12;
constexpr double kMargin =
    0.5;  // share of the box added on each side; strays farther out do not widen a mask
constexpr double kMostlyInside = 0.8;       // minimum share of a candidate's pixels in the box
constexpr double kTogetherHandicap = 0.15;  // score that several candidates lose against one
constexpr double kFillPower = 0.2;          // exponent of the share of the box that the mask fills
constexpr double kTrimmed =
    0.005;  // share of pixels trimmed at each end, so that strays do not widen a mask's box

// Returns the edges of a box in the small view, clipped to the image.
BoxEdges EdgesInSmall(const BoxPrompt& box, const SmallView& small) {
  const Camera& camera = small.view.camera;
  const double f = small.factor;
  return {std::max(0.0, box.x / f), std::max(0.0, box.y / f),
          std::min<double>(camera.width, (box.x + box.width) / f),
          std::min<double>(camera.height, (box.y + box.height) / f)};
}

// Returns the pixels, y * width + x, of a grid of samples around the centre of the box.
std::vector<int32_t> SamplesIn(const BoxEdges& box, const Camera& camera) {
  std::vector<int32_t> pixels;
  pixels.reserve(kSampleSide * kSampleSide);
  for (int j = 0; j < kSampleSide; ++j) {
    for (int i = 0; i < kSampleSide; ++i) {
      const auto along = [](int k) { return 0.5 + kMiddle * ((k + 0.5) / kSampleSide - 0.5); };
      const auto x = static_cast<int32_t>(box.x0 + along(i) * (box.x1 - box.x0));
      const auto y = static_cast<int32_t>(box.y0 + along(j) * (box.y1 - box.y0));
      pixels.push_back(std::clamp(y, 0, camera.height - 1) * camera.width +
                       std::clamp(x, 0, camera.width - 1));
    }
  }
  return pixels;
}

double CosineOf(const float* a, const float* b) {
  double ab = 0, aa = 0, bb = 0;
  for (int k = 0; k < kFeatureSize; ++k) {
    ab += double{a[k]} * b[k], aa += double{a[k]} * a[k], bb += double{b[k]} * b[k];
  }
  return ab / std::sqrt(std::max(1e-12, aa * bb));
}

// Returns the distinct features, the most frequent first, at most kMaxCandidates. Features within
// kSameCosine of an earlier one join its group; pixels on which hardly anything was rendered are
// left out.
std::vector<float> DistinctFeatures(std::span<const float> features) {
  struct Group {
    size_t first;
    int size;
  };
  std::vector<Group> groups;
  for (size_t i = 0; i < features.size(); i += kFeatureSize) {
    if (FeatureNorm(&features[i]) < double{kMinPixelNorm}) continue;
    const auto same = std::find_if(groups.begin(), groups.end(), [&](const Group& group) {
      return CosineOf(&features[group.first], &features[i]) > kSameCosine;
    });
    same == groups.end() ? groups.push_back({i, 1}) : void(++same->size);
  }
  std::stable_sort(groups.begin(), groups.end(),
                   [](const Group& a, const Group& b) { return a.size > b.size; });
  if (groups.size() > kMaxCandidates) groups.resize(kMaxCandidates);
  std::vector<float> kept;
  kept.reserve(groups.size() * kFeatureSize);
  for (const Group& group : groups) {
    const auto at = features.begin() + static_cast<int64_t>(group.first);
    kept.insert(kept.end(), at, at + kFeatureSize);
  }
  return kept;
}

// Returns the range [first, last) of `counts` that remains when kTrimmed of `total` is cut off at
// each end.
std::pair<int, int> Extent(std::span<const int64_t> counts, int64_t total) {
  const auto left_out = static_cast<int64_t>(kTrimmed * static_cast<double>(total));
  int first = 0;
  auto last = static_cast<int>(counts.size());
  for (int64_t sum = counts[first]; sum <= left_out; sum += counts[++first]) {
  }
  for (int64_t sum = counts[last - 1]; sum <= left_out; sum += counts[--last - 1]) {
  }
  return {first, last};
}

// The masks of all candidates at one scale and every threshold. A candidate's mask at level t is
// the set of pixels over at least t thresholds.
class MasksInBox {
 public:
  MasksInBox(const Camera& camera, const BoxEdges& box, std::span<const float> thresholds)
      : camera_(camera), box_(box), thresholds_(thresholds) {
    const double margin_x = kMargin * (box.x1 - box.x0), margin_y = kMargin * (box.y1 - box.y0);
    x0_ = std::max(0, static_cast<int>(box.x0 - margin_x));
    y0_ = std::max(0, static_cast<int>(box.y0 - margin_y));
    x1_ = std::min(camera.width, static_cast<int>(std::ceil(box.x1 + margin_x)));
    y1_ = std::min(camera.height, static_cast<int>(std::ceil(box.y1 + margin_y)));
  }

  // Adds a candidate by its similarity to each pixel of the small view.
  void Add(std::span<const float> similarity) {
    std::vector<uint8_t>& levels = levels_.emplace_back(LevelsOf(similarity, thresholds_));
    std::vector<int64_t>& all = all_.emplace_back(thresholds_.size() + 1);
    std::vector<int64_t>& inside = inside_.emplace_back(thresholds_.size() + 1);
    for (size_t i = 0; i < levels.size(); ++i) {
      ++all[levels[i]];
      const size_t column = i % camera_.width, row = i / camera_.width;
      const double x = static_cast<double>(column) + 0.5, y = static_cast<double>(row) + 0.5;
      if (x >= box_.x0 && x < box_.x1 && y >= box_.y0 && y < box_.y1) ++inside[levels[i]];
    }
    for (size_t t = thresholds_.size(); t > 0; --t) {
      all[t - 1] += all[t];
      inside[t - 1] += inside[t];
    }
  }

  // Returns how well the union of the candidates' masks at this level fills the box: the IoU of the
  // box and the union's own bounding box (without strays), times the share of the masks inside the
  // box, times the share of the box that is filled to the power of kFillPower.
  double Score(std::span<const size_t> candidates, size_t level) const {
    int64_t all = 0, inside = 0;
    for (const size_t c : candidates) all += all_[c][level], inside += inside_[c][level];
    if (inside == 0 || 2 * inside < all) return 0;
    std::vector<int64_t> columns(x1_ - x0_), rows(y1_ - y0_);
    int64_t total = 0;
    for (int y = y0_; y < y1_; ++y) {
      for (int x = x0_; x < x1_; ++x) {
        const size_t pixel = static_cast<size_t>(y) * camera_.width + x;
        const bool shown = std::any_of(candidates.begin(), candidates.end(),
                                       [&](size_t c) { return levels_[c][pixel] >= level; });
        if (!shown) continue;
        ++columns[x - x0_], ++rows[y - y0_], ++total;
      }
    }
    const auto [left, right] = Extent(columns, total);
    const auto [top, bottom] = Extent(rows, total);
    const BoxEdges own = {double(x0_ + left), double(y0_ + top), double(x0_ + right),
                          double(y0_ + bottom)};
    const double filled = std::min(1.0, static_cast<double>(inside) / box_.Area());
    return IouOf(own, box_) * static_cast<double>(inside) / static_cast<double>(all) *
           std::pow(filled, kFillPower);
  }

  // Returns the candidates whose masks at this level lie mostly inside the box.
  std::vector<size_t> Inside(size_t level) const {
    std::vector<size_t> kept;
    for (size_t c = 0; c < all_.size(); ++c) {
      const auto inside = static_cast<double>(inside_[c][level]);
      if (inside > kMostlyInside * static_cast<double>(all_[c][level])) kept.push_back(c);
    }
    return kept;
  }
  size_t num_candidates() const { return all_.size(); }

 private:
  const Camera camera_;
  const BoxEdges box_;
  const std::span<const float> thresholds_;
  int x0_, y0_, x1_, y1_;  // the box with kMargin around it, clipped to the image
  std::vector<std::vector<uint8_t>> levels_;  // [candidates][pixels]
  std::vector<std::vector<int64_t>> all_;     // [candidates][levels] pixels at or over the level
  std::vector<std::vector<int64_t>> inside_;  // those of all_ that are in the box
};

struct Choice {
  double score = -1;
  std::vector<size_t> candidates;
  double scale = 0, threshold = 0;
};

// Considers each candidate alone, and all candidates that lie mostly inside together, at every
// threshold; keeps the best in `choice`. Several candidates must win by kTogetherHandicap.
void LookAt(const MasksInBox& masks, double scale, std::span<const float> thresholds,
            Choice& choice) {
  for (size_t t = thresholds.size(); t > 0; --t) {
    const auto consider = [&](std::vector<size_t> candidates, double handicap) {
      const double score = masks.Score(candidates, t) - handicap;
      if (score <= choice.score) return;
      choice = {score, std::move(candidates), scale, double{thresholds[t - 1]}};
    };
    for (size_t c = 0; c < masks.num_candidates(); ++c) consider({c}, 0);
    std::vector<size_t> inside = masks.Inside(t);
    if (inside.size() > 1) consider(std::move(inside), kTogetherHandicap);
  }
}

}  // namespace

absl::StatusOr<Query> FitBox(const Segmenter& segmenter, const ModelView& view,
                             const BoxPrompt& box, const Granularity& granularity) {
  RETURN_IF_ERROR(CheckView(view));
  RETURN_IF_ERROR(CheckBox(ImageOf(view), box));
  const SmallView small = SmallViewOf(view);
  const Camera& camera = small.view.camera;
  const BoxEdges edges = EdgesInSmall(box, small);
  ASSIGN_OR_RETURN(std::vector<float> features,
                   segmenter.PixelFeatures(small.view, SamplesIn(edges, camera)));
  features = DistinctFeatures(features);
  if (features.empty()) {
    return NothingThereError(
        "nothing with a feature is rendered in the box; draw it about an object that a mask "
        "covered in training");
  }
  const GranularityGrid grid = GridOf(granularity);
  const size_t num_pixels = static_cast<size_t>(camera.width) * camera.height;
  Choice choice;
  for (const double scale : grid.scales) {
    ASSIGN_OR_RETURN(const std::vector<float> similarities,
                     segmenter.Similarity(features, scale, small.view));
    MasksInBox masks(camera, edges, grid.thresholds);
    for (size_t first = 0; first < similarities.size(); first += num_pixels) {
      masks.Add(std::span(similarities).subspan(first, num_pixels));
    }
    LookAt(masks, scale, grid.thresholds, choice);
  }
  Query query = {
      {}, std::vector<uint8_t>(choice.candidates.size(), 1), choice.scale, choice.threshold};
  for (const size_t c : choice.candidates) {
    const auto first = features.begin() + static_cast<int64_t>(c) * kFeatureSize;
    query.features.insert(query.features.end(), first, first + kFeatureSize);
  }
  return query;
}

}  // namespace pepeseg
