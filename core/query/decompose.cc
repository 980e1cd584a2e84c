#include "core/query/decompose.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <utility>
#include <vector>

#include "core/base/device_lock.h"
#include "core/base/status_macros.h"
#include "core/cluster/hdbscan.h"
#include "core/scene/camera.h"
#include "core/scene/model.h"
#include "kernels/ops/render.h"

namespace pepeseg {
namespace {

// These numbers were chosen on the desk scene, by the agreement of its granularity levels with the
// ground truth of the held-out views.
constexpr double kFinestScale = 0.01;  // largest scale at which pieces are found
constexpr size_t kMaxPoints = 16'384;  // Gaussians that are clustered
constexpr HdbscanOptions kPieces = {.min_cluster_size = 8, .min_samples = 3};
// Splits of one piece: chosen on crowded, desk and bolts (tests/bench/results/all_alike.md).
constexpr size_t kMaxPiecePoints = 2'048;
constexpr HdbscanOptions kSplits = {.min_cluster_size = 20, .min_samples = 3};
constexpr int64_t kMaxViews = 32;          // views that show which Gaussians are visible
constexpr double kMaxGridPixels = 16'384;  // pixels of each of these views, about
// A Gaussian whose visible weight is less than this share of the mean was hardly trained. It is not
// clustered, and it needs a larger cosine to be in a piece, which keeps floaters out.
constexpr double kMinVisible = 0.5;
constexpr float kMinCosine = 0.5f, kMinUnseenCosine = 0.8f;
constexpr int32_t kNoPiece = -1;
constexpr float kApart = -2;  // below any cosine

// Returns the cosine of the means above which two segments are joined at a scale. Training pushes
// pairs of one object over 0.75. There are few masks of large objects, so their parts are less
// alike.
double JoinCosine(double scale) { return 0.8 - 0.6 * std::max(0.0, scale - 0.5); }

// Returns how much of each Gaussian the model's views show, [num_gaussians]: the sum of its
// blending weights over a grid of pixels of up to kMaxViews views, spread evenly. All 1 if the
// model has no views. Errors are those of `rows`.
absl::StatusOr<std::vector<float>> VisibleWeights(const Model& model, RowsOfPixels rows) {
  const auto num_views = static_cast<int64_t>(model.views.size());
  const auto count = static_cast<size_t>(model.gaussians.count);
  if (num_views == 0) return std::vector<float>(count, 1.0f);
  std::vector<float> weights(count);
  const int64_t num_shown = std::min(num_views, kMaxViews);
  for (int64_t k = 0; k < num_shown; ++k) {
    // Sums of floats in the order of views and rows, which is fixed: the segments do not depend on
    // threads.
    const ModelView& view = model.views[k * num_views / num_shown];
    ASSIGN_OR_RETURN(const PixelRows shown, rows(view, GridPixels(view.camera, kMaxGridPixels)));
    for (size_t e = 0; e < shown.gaussian.size(); ++e) {
      weights[shown.gaussian[e]] += shown.weight[e];
    }
  }
  return weights;
}

// Returns which Gaussians are visible enough to be clustered, [num_gaussians] 0 or 1.
std::vector<uint8_t> SeenEnough(std::span<const float> visible) {
  const double mean = std::accumulate(visible.begin(), visible.end(), 0.0) /
                      static_cast<double>(std::max<size_t>(1, visible.size()));
  std::vector<uint8_t> seen;
  seen.reserve(visible.size());
  for (const float weight : visible) {
    seen.push_back(weight > 0 && double{weight} >= kMinVisible * mean ? 1 : 0);
  }
  return seen;
}

// Returns the features of up to `max_points` of the visible Gaussians, [n, 32]. They are spread
// evenly over the indices instead of drawn, so that the result does not depend on a seed.
std::vector<float> PointsToCluster(std::span<const float> units, std::span<const size_t> visible,
                                   size_t max_points) {
  const size_t count = std::min(visible.size(), max_points);
  std::vector<float> points;
  points.reserve(count * kFeatureSize);
  for (size_t k = 0; k < count; ++k) {
    const float* unit = &units[visible[k * visible.size() / count] * kFeatureSize];
    points.insert(points.end(), unit, unit + kFeatureSize);
  }
  return points;
}

// Returns the mean with the largest cosine to `unit`, or kNoPiece if none is over `min_cosine`.
int32_t NearestMean(const float* unit, std::span<const float> means, float min_cosine) {
  int32_t nearest = kNoPiece;
  float best = min_cosine;
  for (size_t m = 0; m < means.size(); m += kFeatureSize) {
    float cosine = 0;
    for (int k = 0; k < kFeatureSize; ++k) cosine += unit[k] * means[m + k];
    if (cosine <= best) continue;
    best = cosine;
    nearest = static_cast<int32_t>(m / kFeatureSize);
  }
  return nearest;
}

// Returns the means of the clusters of points, [clusters, 32]. Waits for the device lock.
absl::StatusOr<std::vector<float>> ClusterMeansOf(Backend& backend,
                                                  const std::vector<float>& points,
                                                  const HdbscanOptions& options) {
  ASSIGN_OR_RETURN(const Clusters clusters, WithDeviceLock(backend, [&] {
                     return Hdbscan(backend, std::span<const float>(points), options);
                   }));
  return ClusterMeans(points, clusters);
}

// Returns the piece of each Gaussian, or kNoPiece. Waits for the device lock.
absl::StatusOr<std::vector<int32_t>> FindPieces(Backend& backend, const Model& model, double scale,
                                                std::span<const float> visible) {
  const std::vector<float> units =
      GatedUnits(model.field.features, model.field.gate, static_cast<float>(scale));
  // HDBSCAN finds the pieces in a sample of the visible Gaussians; then each Gaussian, sampled or
  // not, goes to the piece with the nearest mean.
  const std::vector<uint8_t> seen = SeenEnough(visible);
  std::vector<size_t> sampled;
  for (size_t i = 0; i < seen.size(); ++i) {
    if (seen[i] != 0) sampled.push_back(i);
  }
  ASSIGN_OR_RETURN(const std::vector<float> means,
                   ClusterMeansOf(backend, PointsToCluster(units, sampled, kMaxPoints), kPieces));
  std::vector<int32_t> pieces;
  pieces.reserve(visible.size());
  for (size_t i = 0; i < visible.size(); ++i) {
    pieces.push_back(
        NearestMean(&units[i * kFeatureSize], means, seen[i] != 0 ? kMinCosine : kMinUnseenCosine));
  }
  return pieces;
}

// Returns the pieces after splitting each into the clusters of its own visible Gaussians. A piece
// without two clusters stays whole. Waits for the device lock.
absl::StatusOr<std::vector<int32_t>> SplitPieces(Backend& backend, const FeatureField& field,
                                                 double scale, std::span<const int32_t> pieces,
                                                 std::span<const float> visible) {
  const std::vector<float> units =
      GatedUnits(field.features, field.gate, static_cast<float>(scale));
  const std::vector<uint8_t> seen = SeenEnough(visible);
  const int32_t last = pieces.empty() ? kNoPiece : *std::max_element(pieces.begin(), pieces.end());
  std::vector<std::vector<size_t>> sampled(static_cast<size_t>(last + 1));
  for (size_t i = 0; i < pieces.size(); ++i) {
    if (pieces[i] != kNoPiece && seen[i] != 0) sampled[pieces[i]].push_back(i);
  }
  std::vector<int32_t> first;             // number of the first split of each piece
  std::vector<std::vector<float>> means;  // [splits, 32] of each piece
  int32_t next = 0;
  for (const std::vector<size_t>& members : sampled) {
    ASSIGN_OR_RETURN(
        std::vector<float> of,
        ClusterMeansOf(backend, PointsToCluster(units, members, kMaxPiecePoints), kSplits));
    first.push_back(next);
    next += std::max(1, static_cast<int32_t>(of.size() / kFeatureSize));
    means.push_back(std::move(of));
  }
  std::vector<int32_t> splits(pieces.begin(), pieces.end());
  for (size_t i = 0; i < splits.size(); ++i) {
    const int32_t piece = splits[i];
    if (piece == kNoPiece) continue;
    const int32_t nearest = NearestMean(&units[i * kFeatureSize], means[piece], kApart);
    splits[i] = first[piece] + std::max(0, nearest);
  }
  return splits;
}

// Returns the pieces of the Gaussians after joining at a scale. A Gaussian counts in the mean of
// its piece by its visible weight.
std::vector<int32_t> JoinAt(double scale, const FeatureField& field,
                            std::span<const int32_t> pieces, std::span<const float> visible) {
  const int32_t last = pieces.empty() ? kNoPiece : *std::max_element(pieces.begin(), pieces.end());
  // Sums instead of means: the cosine does not need the length, and joined pieces are added.
  std::vector<float> sums(static_cast<size_t>(last + 1) * kFeatureSize);
  const std::vector<float> units =
      GatedUnits(field.features, field.gate, static_cast<float>(scale));
  for (size_t i = 0; i < pieces.size(); ++i) {
    if (pieces[i] == kNoPiece) continue;
    float* sum = &sums[static_cast<size_t>(pieces[i]) * kFeatureSize];
    for (int k = 0; k < kFeatureSize; ++k) sum[k] += visible[i] * units[i * kFeatureSize + k];
  }
  const std::vector<int32_t> numbers = JoinPieces(sums, JoinCosine(scale));
  std::vector<int32_t> joined(pieces.begin(), pieces.end());
  for (int32_t& piece : joined) piece = piece == kNoPiece ? kNoPiece : numbers[piece];
  return joined;
}

// Keeps the matrix of all cosines and the nearest piece of each piece, so that a join costs one row
// of the matrix, and another one for each piece whose nearest piece was one of the two.
class Joiner {
 public:
  explicit Joiner(std::span<const float> sums)
      : count_(sums.size() / kFeatureSize),
        sums_(sums.begin(), sums.end()),
        cosine_(count_ * count_, kApart),
        nearest_(count_),
        joined_to_(count_) {
    std::iota(joined_to_.begin(), joined_to_.end(), 0);
    for (size_t a = 0; a < count_; ++a) {
      for (size_t b = a + 1; b < count_; ++b) SetCosine(a, b, Cosine(a, b));
    }
    for (size_t a = 0; a < count_; ++a) FindNearest(a);
  }

  // Joins the closest two pieces. Returns false if no two have a cosine over `join_cosine`.
  bool JoinClosest(double join_cosine) {
    // Agglomerative clustering by the cosine of the means. The first of equal cosines is joined, so
    // that the result is fixed.
    size_t a = 0;
    for (size_t i = 1; i < count_; ++i) {
      if (NearestCosine(i) > NearestCosine(a)) a = i;
    }
    if (count_ == 0 || !(double{NearestCosine(a)} > join_cosine)) return false;
    Join(a, nearest_[a]);  // a is the lower of the two, because the search took the first maximum
    return true;
  }

  // Returns the new number of each piece.
  std::vector<int32_t> Numbers() const {
    std::vector<int32_t> numbers(count_);
    int32_t next = 0;
    for (size_t i = 0; i < count_; ++i) {  // pieces are joined to lower ones only
      numbers[i] = joined_to_[i] == i ? next++ : numbers[joined_to_[i]];
    }
    return numbers;
  }

 private:
  float Cosine(size_t a, size_t b) const {
    double ab = 0, aa = 0, bb = 0;
    for (int k = 0; k < kFeatureSize; ++k) {
      const double x = sums_[a * kFeatureSize + k], y = sums_[b * kFeatureSize + k];
      ab += x * y;
      aa += x * x;
      bb += y * y;
    }
    // A piece whose features cancel out has no direction and is never joined.
    return aa > 0 && bb > 0 ? static_cast<float>(ab / std::sqrt(aa * bb)) : kApart;
  }
  void SetCosine(size_t a, size_t b, float cosine) {
    cosine_[a * count_ + b] = cosine_[b * count_ + a] = cosine;
  }
  float NearestCosine(size_t a) const { return cosine_[a * count_ + nearest_[a]]; }
  // Sets the first piece with the largest cosine to a.
  void FindNearest(size_t a) {
    nearest_[a] = 0;
    for (size_t b = 1; b < count_; ++b) {
      if (cosine_[a * count_ + b] > NearestCosine(a)) nearest_[a] = b;
    }
  }
  // Joins b to a.
  void Join(size_t a, size_t b) {
    assert(a < b);
    for (int k = 0; k < kFeatureSize; ++k)
      sums_[a * kFeatureSize + k] += sums_[b * kFeatureSize + k];
    joined_to_[b] = a;
    for (size_t i = 0; i < count_; ++i) {
      SetCosine(b, i, kApart);
      if (i != a && joined_to_[i] == i) SetCosine(a, i, Cosine(a, i));
    }
    for (size_t i = 0; i < count_; ++i) {
      // A piece whose nearest was one of the two may now be nearer to any other; for the rest only
      // `a` can have come nearer.
      if (i == a || nearest_[i] == a || nearest_[i] == b) {
        FindNearest(i);
      } else if (cosine_[i * count_ + a] > NearestCosine(i)) {
        nearest_[i] = a;
      }
    }
  }

  size_t count_;
  std::vector<double> sums_;       // [count, 32]
  std::vector<float> cosine_;      // [count, count]; kApart with itself and with joined pieces
  std::vector<size_t> nearest_;    // [count] see FindNearest
  std::vector<size_t> joined_to_;  // [count] the lower piece that it was joined to; itself: none
};

}  // namespace

absl::StatusOr<Decomposition> Decompose(Backend& backend, const Model& model,
                                        std::span<const double> scales, RowsOfPixels rows) {
  RETURN_IF_ERROR(CheckDecompositionScales(scales));
  ASSIGN_OR_RETURN(const std::vector<float> visible, VisibleWeights(model, rows));
  // Scale 0 adds a level and changes no other.
  const bool split = scales.front() == 0;
  const double finest = scales.size() > (split ? 1 : 0)
                            ? std::min(scales[split ? 1 : 0], kFinestScale)
                            : kFinestScale;
  ASSIGN_OR_RETURN(std::vector<int32_t> pieces, FindPieces(backend, model, finest, visible));
  Decomposition decomposition;
  for (const double scale : scales) {
    Decomposition::Level level;
    if (scale == 0) {
      ASSIGN_OR_RETURN(const std::vector<int32_t> splits,
                       SplitPieces(backend, model.field, finest, pieces, visible));
      level = LevelOfPieces(scale, splits, model.gaussians);
    } else {
      // Each granularity level joins segments of the one before, so that segments nest (METHOD.md
      // section 4, "Decomposition").
      pieces = JoinAt(scale, model.field, pieces, visible);
      level = LevelOfPieces(scale, pieces, model.gaussians);
    }
    if (!decomposition.levels.empty()) SetParents(decomposition.levels.back(), level);
    decomposition.levels.push_back(std::move(level));
  }
  return decomposition;
}

std::vector<int32_t> JoinPieces(std::span<const float> sums, double join_cosine) {
  assert(sums.size() % kFeatureSize == 0);
  Joiner joiner(sums);
  while (joiner.JoinClosest(join_cosine)) {
  }
  return joiner.Numbers();
}

}  // namespace pepeseg
