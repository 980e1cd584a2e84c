#include "core/query/resolve_prompt.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <optional>
#include <utility>

#include "core/base/status_macros.h"
#include "kernels/ops/render.h"

namespace pepeseg {
namespace {

// Points that are answered one after the other, which bounds the time; those before the last ones
// are answered together.
constexpr size_t kMostCorrections = 8;

// Returns the squared distance of a pixel to the nearest pixel outside the mask. Everything beyond
// the image is outside.
int64_t SquaredDepth(std::span<const uint8_t> mask, int width, const PixelIndex& at) {
  const int height = static_cast<int>(mask.size()) / width;
  const int64_t border = std::min({at.x + 1, width - at.x, at.y + 1, height - at.y});
  int64_t nearest = border * border;
  for (int y = 0; y < height; ++y) {
    const int64_t dy = y - at.y;
    if (dy * dy >= nearest) continue;
    for (int x = 0; x < width; ++x) {
      const int64_t dx = x - at.x;
      if (mask[static_cast<size_t>(y) * width + x] == 0) {
        nearest = std::min(nearest, dx * dx + dy * dy);
      }
    }
  }
  return nearest;
}

// Adds the points one after the other, and keeps what they mean together.
class ClickFollower {
 public:
  ClickFollower(const Segmenter& segmenter, const ClickedFeatures& clicks,
                const GranularityGrid& grid)
      : segmenter_(segmenter), clicks_(clicks), grid_(grid), small_(SmallViewOf(clicks.view)) {}

  // Answers the first points together: with the mask that has the most support.
  absl::Status Start(std::span<const size_t> points) {
    for (const size_t point : points) AddPoint(point);
    RETURN_IF_ERROR(Compare());
    if (points.size() == clicks_.points.size() || plateaus_.empty()) return absl::OkStatus();
    ASSIGN_OR_RETURN(auto first, MasksOf({&plateaus_[0], 1}));
    answer_ = std::move(first[0].mask.pixels);
    return absl::OkStatus();
  }

  // Answers one more point.
  absl::Status Correct(size_t point) {
    AddPoint(point);
    if (!answer_.empty() && NumAnswered(answer_) == static_cast<int64_t>(clicks_made_.size())) {
      ASSIGN_OR_RETURN(auto results, MasksOf({&plateaus_[chosen_], 1}));
      std::vector<uint8_t>& same = results[0].mask.pixels;
      const bool kept = ClickPlausibility(clicks_made_.back(), answer_, same,
                                          small_.view.camera.width) > MaskGrid::kSameMask;
      if (kept) answer_ = std::move(same);
      if (kept) return absl::OkStatus();
    }
    RETURN_IF_ERROR(Compare());
    return Choose();
  }

  Candidates Found(int max_count) const {
    return FindCandidates(*masks_, plateaus_, chosen_, max_count);
  }

 private:
  PixelIndex PixelOf(const PointPrompt& point) const {
    return small_.PixelAt(static_cast<int>(point.x), static_cast<int>(point.y));
  }
  // Returns the masks of plateaus in the small view.
  absl::StatusOr<std::vector<SegmentResult>> MasksOf(std::span<const Candidate> plateaus) const {
    std::vector<Query> queries;
    for (const Candidate& at : plateaus) {
      queries.push_back({query_.features, query_.positive, at.scale, at.threshold});
    }
    return segmenter_.Segment(queries, small_.view);
  }
  int64_t NumAnswered(std::span<const uint8_t> mask) const {
    return pepeseg::NumAnswered(clicks_made_, mask, small_.view.camera.width);
  }

  void AddPoint(size_t point) {
    clicks_made_.push_back({PixelOf(clicks_.points[point]), clicks_.points[point].positive});
    const auto from = clicks_.query.features.begin() + static_cast<int64_t>(point) * kFeatureSize;
    query_.features.insert(query_.features.end(), from, from + kFeatureSize);
    query_.positive.push_back(clicks_.query.positive[point]);
  }

  // Finds the masks of all points so far.
  absl::Status Compare() {
    ASSIGN_OR_RETURN(LevelCounts counts,
                     segmenter_.CountLevels(query_, grid_.scales, grid_.thresholds, small_.view));
    masks_.emplace(std::move(counts), grid_);
    plateaus_ = masks_->FindPlateaus(kMinArea, std::numeric_limits<int>::max());
    chosen_ = 0;
    return absl::OkStatus();
  }

  // Chooses the mask that answers the most points; among equals by plausibility and support.
  absl::Status Choose() {
    std::pair<int64_t, double> best = {-1, 0};
    std::vector<uint8_t> chosen;
    const size_t num = std::min(plateaus_.size(), kMostPlateaus);
    ASSIGN_OR_RETURN(auto results, MasksOf(std::span(plateaus_).first(num)));
    for (size_t i = 0; i < num; ++i) {
      std::vector<uint8_t>& mask = results[i].mask.pixels;
      const double plausibility =
          answer_.empty()
              ? 1
              : ClickPlausibility(clicks_made_.back(), answer_, mask, small_.view.camera.width);
      const std::pair<int64_t, double> rank = {
          NumAnswered(mask), plausibility * std::pow(plateaus_[i].support, kSupportExponent)};
      if (rank <= best) continue;
      best = rank;
      chosen_ = i;
      chosen = std::move(mask);
    }
    answer_ = std::move(chosen);
    return absl::OkStatus();
  }

  const Segmenter& segmenter_;
  const ClickedFeatures& clicks_;
  const GranularityGrid& grid_;
  const SmallView small_;
  // State after the points added so far.
  std::vector<PixelClick> clicks_made_;  // in the small view
  Query query_;
  std::optional<MaskGrid> masks_;
  std::vector<Candidate> plateaus_;
  size_t chosen_ = 0;            // plateau
  std::vector<uint8_t> answer_;  // its mask; empty if no further point follows or nothing is shown
};

absl::StatusOr<Query> ResolvePoints(const Segmenter& segmenter, const ModelView& view,
                                    const PointsPrompt& points, const Granularity& granularity) {
  ASSIGN_OR_RETURN(ClickedFeatures clicks, FindClickedFeatures(segmenter, view, points));
  Query& query = clicks.query;
  query.scale = granularity.scale.value_or(query.scale);
  query.threshold = granularity.threshold.value_or(query.threshold);
  if (granularity.scale && granularity.threshold) return query;
  ASSIGN_OR_RETURN(const Candidates found,
                   FindGranularities(segmenter, clicks, GridOf(granularity), 1));
  if (found.list.empty()) return query;  // masks of under 16 pixels at any scale: keep the defaults
  const Candidate& best = found.list[found.best];
  query.scale = best.scale;
  query.threshold = granularity.threshold.value_or(best.threshold);
  return query;
}

// Returns the points that are on something with a feature.
absl::StatusOr<PointsPrompt> PointsOnSomething(const Segmenter& segmenter, const ModelView& view,
                                               const PointsPrompt& points) {
  std::vector<size_t> found;
  RETURN_IF_ERROR(
      SolidFeatures(segmenter, view, PixelsOf(points, view.camera.width), &found).status());
  PointsPrompt kept;
  kept.reserve(found.size());
  for (const size_t i : found) kept.push_back(points[i]);
  if (std::any_of(kept.begin(), kept.end(), [](const PointPrompt& p) { return p.positive; })) {
    return kept;
  }
  return NothingThereError("nothing with a feature is rendered under the positive points");
}

absl::StatusOr<Query> ResolveMean(const Segmenter& segmenter, const ModelView& view,
                                  const PointMean& mean, const Granularity& granularity) {
  ASSIGN_OR_RETURN(const PointsPrompt points, PointsOnSomething(segmenter, view, mean.points));
  ASSIGN_OR_RETURN(const std::vector<float> features,
                   SolidFeatures(segmenter, view, PixelsOf(points, view.camera.width)));
  ASSIGN_OR_RETURN(const Query query, ResolvePoints(segmenter, view, points, granularity));
  return MeanQuery(segmenter, features, query.scale, query.threshold);
}

}  // namespace

absl::StatusOr<Query> ResolvePrompt(const Segmenter& segmenter, const Prompt& prompt,
                                    const Granularity& granularity) {
  RETURN_IF_ERROR(CheckGranularity(granularity));
  const ModelView& view = prompt.view;
  return std::visit(
      Overloaded{
          [&](const PointsPrompt& points) {
            return ResolvePoints(segmenter, view, points, granularity);
          },
          [&](const BoxPrompt& box) { return FitBox(segmenter, view, box, granularity); },
          [&](const BinaryMask& mask) { return FitMask(segmenter, view, mask, granularity); },
          [&](const Scribbles& scribbles) {
            return FitScribbles(segmenter, view, scribbles, granularity);
          },
          [&](const PointMean& mean) { return ResolveMean(segmenter, view, mean, granularity); }},
      prompt.what);
}

absl::StatusOr<ClickedFeatures> FindClickedFeatures(const Segmenter& segmenter,
                                                    const ModelView& view,
                                                    std::span<const PointPrompt> points) {
  ClickedFeatures clicks = {view, {points.begin(), points.end()}, {}};
  ASSIGN_OR_RETURN(clicks.query.features, segmenter.PointFeatures(view, points));
  for (const PointPrompt& point : points) clicks.query.positive.push_back(point.positive ? 1 : 0);
  return clicks;
}

absl::StatusOr<Candidates> FindGranularities(const Segmenter& segmenter,
                                             const ClickedFeatures& clicks,
                                             const GranularityGrid& grid, int max_count) {
  std::vector<size_t> order(clicks.points.size());
  std::iota(order.begin(), order.end(), size_t{0});
  const auto first =
      std::find_if(order.begin(), order.end(), [&](size_t i) { return clicks.points[i].positive; });
  std::rotate(order.begin(), first, first + 1);
  const std::span<const size_t> all = order;
  const size_t num_corrections = std::min(all.size() - 1, kMostCorrections);
  ClickFollower follower(segmenter, clicks, grid);
  RETURN_IF_ERROR(follower.Start(all.first(all.size() - num_corrections)));
  for (const size_t point : all.last(num_corrections)) RETURN_IF_ERROR(follower.Correct(point));
  return follower.Found(max_count);
}

int64_t NumAnswered(std::span<const PixelClick> clicks, std::span<const uint8_t> mask, int width) {
  return std::count_if(clicks.begin(), clicks.end(), [&](const PixelClick& click) {
    return (mask[static_cast<size_t>(click.pixel.y) * width + click.pixel.x] != 0) ==
           click.positive;
  });
}

double ClickPlausibility(const PixelClick& click, std::span<const uint8_t> before,
                         std::span<const uint8_t> after, int width) {
  std::vector<uint8_t> changed(after.size());
  double area_before = 0, area_after = 0, common = 0;
  for (size_t i = 0; i < after.size(); ++i) {
    const bool was = before[i] != 0, is = after[i] != 0;
    area_before += was ? 1 : 0;
    area_after += is ? 1 : 0;
    common += was && is ? 1 : 0;
    changed[i] = click.positive ? is && !was : was && !is;
  }
  if (area_after == 0) return 0;
  const size_t at = static_cast<size_t>(click.pixel.y) * width + click.pixel.x;
  if ((before[at] != 0) == click.positive) {
    return common / (area_before + area_after - common);
  }
  if (changed[at] == 0) return 0;
  const int height = static_cast<int>(after.size()) / width;
  const auto deepest = static_cast<double>(FindDeepest(changed, width, height).squared_depth);
  const auto depth = static_cast<double>(SquaredDepth(changed, width, click.pixel));
  return std::sqrt(depth / deepest) * common /
         std::max(1.0, click.positive ? area_before : area_after);
}

}  // namespace pepeseg
