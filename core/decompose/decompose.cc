#include "core/decompose/decompose.h"

#include <algorithm>
#include <numeric>
#include <utility>
#include <vector>

#include "core/base/backend_turn.h"
#include "core/base/status_macros.h"
#include "core/cluster/hdbscan.h"
#include "core/decompose/join_pieces.h"
#include "core/decompose/visible_weights.h"
#include "core/scene/model.h"

namespace pepeseg {
namespace {

// Chosen on the desk scene, by how its levels agree with the truth's of the held-out views.
constexpr double kFinestScale = 0.01;  // of the pieces
constexpr size_t kMaxPoints = 16'384;
constexpr HdbscanOptions kPieces = {.min_cluster_size = 8, .min_samples = 3};
// A Gaussian that is seen less than this part of the mean was hardly trained: it is no point to
// cluster, and it must be the more like a piece to be in it, lest floaters are.
constexpr double kMinVisible = 0.5;
constexpr float kMinCosine = 0.5f, kMinUnseenCosine = 0.8f;
constexpr int32_t kNoPiece = -1;

// Two segments are one where their means have at least this cosine. Training pushes pairs of one
// thing over 0.75. Of the large things there are few masks, so their parts become less alike.
double JoinCosine(double scale) { return 0.8 - 0.6 * std::max(0.0, scale - 0.5); }

// [num_gaussians] 0 or 1.
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

// The features of kMaxPoints that are seen enough, evenly spaced, so that no dice are needed.
std::vector<float> PointsToCluster(std::span<const float> units, std::span<const uint8_t> seen) {
  std::vector<size_t> rows;
  rows.reserve(seen.size());
  for (size_t i = 0; i < seen.size(); ++i) {
    if (seen[i] != 0) rows.push_back(i);
  }
  const size_t count = std::min(rows.size(), kMaxPoints);
  std::vector<float> points;
  points.reserve(count * kFeatureSize);
  for (size_t k = 0; k < count; ++k) {
    const float* unit = &units[rows[k * rows.size() / count] * kFeatureSize];
    points.insert(points.end(), unit, unit + kFeatureSize);
  }
  return points;
}

// kNoPiece: none has a cosine over `min_cosine`.
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

// Of each Gaussian.
absl::StatusOr<std::vector<int32_t>> FindPieces(Backend& backend, const Model& model, double scale,
                                                std::span<const float> visible) {
  const std::vector<float> units =
      GatedUnits(model.field.features, model.field.gate, static_cast<float>(scale));
  const std::vector<uint8_t> seen = SeenEnough(visible);
  const std::vector<float> points = PointsToCluster(units, seen);
  ASSIGN_OR_RETURN(const Clusters clusters, InTurn(backend, [&] {
                     return Hdbscan(backend, std::span<const float>(points), kPieces);
                   }));
  const std::vector<float> means = ClusterMeans(points, clusters);
  std::vector<int32_t> pieces;
  pieces.reserve(visible.size());
  for (size_t i = 0; i < visible.size(); ++i) {
    pieces.push_back(
        NearestMean(&units[i * kFeatureSize], means, seen[i] != 0 ? kMinCosine : kMinUnseenCosine));
  }
  return pieces;
}

// The pieces joined at a scale.
std::vector<int32_t> JoinAt(double scale, const FeatureField& field,
                            std::span<const int32_t> pieces, std::span<const float> visible) {
  const int32_t last = pieces.empty() ? kNoPiece : *std::max_element(pieces.begin(), pieces.end());
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

}  // namespace

absl::StatusOr<Decomposition> Decompose(Backend& backend, const Model& model,
                                        std::span<const double> scales, RowsOfPixels rows) {
  RETURN_IF_ERROR(CheckDecompositionScales(scales));
  ASSIGN_OR_RETURN(const std::vector<float> visible, VisibleWeights(model, rows));
  ASSIGN_OR_RETURN(std::vector<int32_t> pieces,
                   FindPieces(backend, model, std::min(scales.front(), kFinestScale), visible));
  Decomposition decomposition;
  for (const double scale : scales) {
    pieces = JoinAt(scale, model.field, pieces, visible);
    Decomposition::Level level = LevelOfPieces(scale, pieces, model.gaussians);
    if (!decomposition.levels.empty()) SetParents(decomposition.levels.back(), level);
    decomposition.levels.push_back(std::move(level));
  }
  return decomposition;
}

}  // namespace pepeseg
