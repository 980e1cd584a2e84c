#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include "core/base/status_macros.h"
#include "core/query/click_plausibility.h"
#include "core/query/frame.h"
#include "core/query/mask_grid.h"
#include "core/query/prompt.h"
#include "core/query/resolve_prompt.h"
#include "core/render/feature_maps.h"
#include "kernels/ops/render.h"

namespace pepeseg {
namespace {

constexpr int kMostNegativeFeatures = 4;  // that stand for negative strokes

// Sets the pixels whose centres are at most `radius` away from a line segment.
void DrawSegment(const Eigen::Vector2d& from, const Eigen::Vector2d& to, double radius, int width,
                 BinaryMask& mask) {
  const int height = static_cast<int>(mask.pixels.size()) / width;
  const Eigen::Vector2d along = to - from;
  const double squared = along.squaredNorm();
  const auto nearest = [&](const Eigen::Vector2d& at) -> Eigen::Vector2d {
    const double share = squared == 0 ? 0 : std::clamp((at - from).dot(along) / squared, 0.0, 1.0);
    return from + share * along;
  };
  const auto first = [radius](double a, double b) {
    return std::max(0, static_cast<int>(std::floor(std::min(a, b) - radius)));
  };
  const auto end = [radius](double a, double b, int size) {
    return std::min(size, static_cast<int>(std::ceil(std::max(a, b) + radius)) + 1);
  };
  for (int y = first(from.y(), to.y()); y < end(from.y(), to.y(), height); ++y) {
    // The columns in which the segment passes within `radius` of this scanline.
    const auto column = [&](double row) {
      const double share = along.y() == 0 ? 0 : (row - from.y()) / along.y();
      return from.x() + std::clamp(share, 0.0, 1.0) * along.x();
    };
    const bool is_level = std::abs(along.y()) < radius;
    const double a = is_level ? from.x() : column(y + 0.5 - radius);
    const double b = is_level ? to.x() : column(y + 0.5 + radius);
    for (int x = first(a, b); x < end(a, b, width); ++x) {
      const Eigen::Vector2d at(x + 0.5, y + 0.5);
      if ((at - nearest(at)).squaredNorm() <= radius * radius) {
        mask.pixels[static_cast<size_t>(y) * width + x] = 1;
      }
    }
  }
}

// Returns the one of the features [n, 32] whose direction is nearest to their mean direction.
std::vector<float> MostUsual(std::span<const float> features) {
  const std::vector<float> mean = ClusterDirections(features, 1, 0);
  size_t nearest = 0;
  double best = -2;
  for (size_t i = 0; i < features.size(); i += kFeatureSize) {
    const double cosine =
        std::inner_product(mean.begin(), mean.end(), &features[i], 0.0) / FeatureNorm(&features[i]);
    if (cosine > best) best = cosine, nearest = i;
  }
  const auto first = features.begin() + static_cast<int64_t>(nearest);
  return {first, first + kFeatureSize};
}

// Features of each sign under scribbles, and the scribbled pixels of the small view, which the mask
// is to answer.
struct ScribbledFeatures {
  Query query;
  std::vector<PixelClick> pixels;
};

absl::StatusOr<ScribbledFeatures> FindScribbledFeatures(const Segmenter& segmenter,
                                                        const ModelView& view,
                                                        const SmallView& small,
                                                        const Scribbles& scribbles) {
  ScribbledFeatures found;
  for (const bool positive : {true, false}) {
    const BinaryMask& strokes = positive ? scribbles.positive : scribbles.negative;
    const std::vector<int32_t> pixels = SampleMask(strokes.pixels, kScribblePoints);
    std::vector<size_t> solid;
    ASSIGN_OR_RETURN(const std::vector<float> features,
                     SolidFeatures(segmenter, view, pixels, &solid));
    if (features.empty() && positive) {
      return NothingThereError("nothing with a feature is rendered under the positive strokes");
    }
    if (features.empty()) continue;
    // Positive strokes are on one thing, negative ones may be on several.
    const std::vector<float> directions =
        positive ? MostUsual(features) : ClusterDirections(features, kMostNegativeFeatures, 0);
    found.query.features.insert(found.query.features.end(), directions.begin(), directions.end());
    found.query.positive.resize(found.query.features.size() / kFeatureSize, positive ? 1 : 0);
    for (const size_t i : solid) {
      const int32_t x = pixels[i] % view.camera.width, y = pixels[i] / view.camera.width;
      found.pixels.push_back({small.PixelAt(x, y), positive});
    }
  }
  return found;
}

}  // namespace

absl::StatusOr<Shape> Frame::Take(const Scribbles& scribbles) const {
  Scribbles taken;
  ASSIGN_OR_RETURN(taken.positive, TakeMask(scribbles.positive));
  if (scribbles.negative.pixels.empty()) return taken;
  ASSIGN_OR_RETURN(taken.negative, TakeMask(scribbles.negative));
  return taken;
}

absl::StatusOr<Scribbles> Frame::Draw(std::span<const Stroke> strokes) const {
  RETURN_IF_ERROR(CheckStrokes(image_, strokes));
  constexpr double kThinnest = 2;  // pixels of the view: a line has the centre of one everywhere
  const double view_pixel =
      photograph_ ? std::max({1.0, static_cast<double>(photograph_->width) / camera_.width,
                              static_cast<double>(photograph_->height) / camera_.height})
                  : 1;
  Scribbles drawn;
  for (const Stroke& stroke : strokes) {
    BinaryMask& mask = stroke.positive ? drawn.positive : drawn.negative;
    mask.pixels.resize(static_cast<size_t>(width()) * height());
    const double radius = 0.5 * std::max(stroke.width, kThinnest * view_pixel);
    for (size_t v = 0; v < stroke.path.size(); ++v) {
      DrawSegment(stroke.path[v == 0 ? 0 : v - 1], stroke.path[v], radius, width(), mask);
    }
  }
  return drawn;
}

absl::StatusOr<Query> FitScribbles(const Segmenter& segmenter, const ModelView& view,
                                   const Scribbles& scribbles, const Granularity& granularity) {
  const SmallView small = SmallViewOf(view);
  ASSIGN_OR_RETURN(ScribbledFeatures found,
                   FindScribbledFeatures(segmenter, view, small, scribbles));
  Query& query = found.query;
  query.scale = granularity.scale.value_or(query.scale);
  query.threshold = granularity.threshold.value_or(query.threshold);
  if (granularity.scale && granularity.threshold) return query;
  const GranularityGrid grid = GridOf(granularity);
  ASSIGN_OR_RETURN(LevelCounts counts,
                   segmenter.CountLevels(query, grid.scales, grid.thresholds, small.view));
  const MaskGrid masks(std::move(counts), grid);
  const std::vector<Candidate> plateaus = masks.FindPlateaus(kMinArea, kMostPlateaus);
  std::vector<Query> queries;
  for (const Candidate& at : plateaus) {
    queries.push_back({query.features, query.positive, at.scale, at.threshold});
  }
  ASSIGN_OR_RETURN(const auto results, segmenter.Segment(queries, small.view));
  double best = 0;
  for (size_t i = 0; i < plateaus.size(); ++i) {
    const auto answered = static_cast<double>(
        NumAnswered(found.pixels, results[i].mask.pixels, small.view.camera.width));
    const double rank = answered * std::pow(plateaus[i].support, kSupportExponent);
    if (rank <= best) continue;
    best = rank;
    query.scale = plateaus[i].scale;
    query.threshold = granularity.threshold.value_or(plateaus[i].threshold);
  }
  return query;
}

std::vector<int32_t> SampleMask(std::span<const uint8_t> mask, size_t max_count) {
  std::vector<int32_t> pixels;
  for (size_t i = 0; i < mask.size(); ++i) {
    if (mask[i] != 0) pixels.push_back(static_cast<int32_t>(i));
  }
  if (pixels.size() <= max_count) return pixels;
  std::vector<int32_t> kept;
  kept.reserve(max_count);
  for (size_t k = 0; k < max_count; ++k) {
    kept.push_back(pixels[(2 * k + 1) * pixels.size() / (2 * max_count)]);
  }
  return kept;
}

absl::StatusOr<std::vector<float>> SolidFeatures(const Segmenter& segmenter, const ModelView& view,
                                                 std::span<const int32_t> pixels,
                                                 std::vector<size_t>* found) {
  if (found != nullptr) found->clear();
  if (pixels.empty()) return std::vector<float>();
  ASSIGN_OR_RETURN(const std::vector<float> features, segmenter.PixelFeatures(view, pixels));
  std::vector<float> kept;
  for (size_t i = 0; i < pixels.size(); ++i) {
    const auto first = features.begin() + static_cast<int64_t>(i) * kFeatureSize;
    if (FeatureNorm(&*first) < double{kMinPixelNorm}) continue;
    kept.insert(kept.end(), first, first + kFeatureSize);
    if (found != nullptr) found->push_back(i);
  }
  return kept;
}

std::vector<int32_t> PixelsOf(std::span<const PointPrompt> points, int width) {
  std::vector<int32_t> pixels;
  pixels.reserve(points.size());
  for (const PointPrompt& point : points) {
    pixels.push_back(static_cast<int32_t>(point.y) * width + static_cast<int32_t>(point.x));
  }
  return pixels;
}

Query MeanQuery(const Segmenter& segmenter, std::span<const float> features, double scale,
                double threshold) {
  return {GatedMean(features, segmenter.model().field.gate, static_cast<float>(scale)),
          {1},
          scale,
          threshold};
}

}  // namespace pepeseg
