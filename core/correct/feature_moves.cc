#include "core/correct/feature_moves.h"

#include <algorithm>
#include <cmath>

#include "core/base/on_threads.h"

namespace pepeseg {
namespace {

// Distances of the cosines to be reached from the threshold that fits best: over it inside, under
// it outside.
constexpr double kInsideMargin = 0.1, kOutsideMargin = 0.05;
constexpr double kMaxInsideCosine = 0.97, kMinOutsideCosine = 0.3;
constexpr float kReach = 3;       // radii of the thing within which Gaussians are pulled to it
constexpr float kMinVote = 0.2f;  // of Gaussians that are changed
constexpr int kNumSteps = 20;
constexpr float kStepSize = 0.3f;

// Weight of the common direction in which what is outside leaves the thing.
constexpr float kAwayWeight = 0.2f;

double InsideCosine(const ScaleFit& fit) {
  return std::min(fit.threshold + kInsideMargin, kMaxInsideCosine);
}
double OutsideCosine(const ScaleFit& fit) {
  return std::max(fit.threshold - kOutsideMargin, kMinOutsideCosine);
}

// A feature at a scale: its gated direction, the length, and the cosine to the thing's direction.
struct Gated {
  FeatureRow unit;
  float norm = 0, cosine = 0;
};
Gated GateBy(const ScaleFit& fit, const FeatureRow& feature) {
  Gated gated;
  float squares = 0;
  for (int k = 0; k < kFeatureSize; ++k) {
    gated.unit[k] = feature[k] * fit.gate[k];
    squares += gated.unit[k] * gated.unit[k];
  }
  gated.norm = std::max(std::sqrt(squares), 1e-6f);
  for (int k = 0; k < kFeatureSize; ++k) {
    gated.unit[k] /= gated.norm;
    gated.cosine += gated.unit[k] * fit.direction[k];
  }
  return gated;
}

void Normalise(FeatureRow& row) {
  float squares = 0;
  for (const float value : row) squares += value * value;
  const float scale = squares > 0 ? 1 / std::sqrt(squares) : 0;
  for (float& value : row) value *= scale;
}

FeatureRow RowOf(const FeatureField& field, size_t g) {
  FeatureRow row;
  std::copy_n(&field.features[g * kFeatureSize], kFeatureSize, row.begin());
  return row;
}

// Removes the part of a row along a unit row, and scales the rest to length 1. Returns whether
// there is a rest.
bool MakeOrthogonal(const std::vector<float>& unit, FeatureRow& row) {
  float along = 0, squares = 0;
  for (int k = 0; k < kFeatureSize; ++k) along += row[k] * unit[k];
  for (int k = 0; k < kFeatureSize; ++k) {
    row[k] -= along * unit[k];
    squares += row[k] * row[k];
  }
  if (squares < 1e-8f) return false;
  Normalise(row);
  return true;
}

// Returns, for each corrected scale, the direction in which what is outside leaves the thing: that
// in which it differs from it already, on average. The gradient of a cosine is 0 where both
// features are equal, so without a common direction things with the same feature would never part;
// with one for all, what is outside stays together. If nothing differs, it is the channel that the
// thing uses least for its price.
std::vector<FeatureRow> AwayDirections(const CorrectedScales& scales, const FeatureMoves& moves,
                                       std::span<const float> votes, const FeatureField& field) {
  std::vector<FeatureRow> away;
  for (const ScaleFit& fit : scales.fits) {
    FeatureRow sum{};
    for (size_t g = 0; g < votes.size(); ++g) {
      if (votes[g] > -kMinVote || moves.push[g] == 0) continue;
      const Gated gated = GateBy(fit, RowOf(field, g));
      for (int k = 0; k < kFeatureSize; ++k) sum[k] -= votes[g] * gated.unit[k];
    }
    if (!MakeOrthogonal(fit.direction, sum)) {
      int best = 0;
      const auto cost = [&](int k) {
        return (std::abs(fit.direction[k]) + 0.1f) * scales.price[k] / std::max(fit.gate[k], 1e-3f);
      };
      for (int k = 1; k < kFeatureSize; ++k) best = cost(k) < cost(best) ? k : best;
      sum = {};
      sum[best] = 1;
      MakeOrthogonal(fit.direction, sum);
    }
    away.push_back(sum);
  }
  return away;
}

// Moves a feature by gradient steps until its cosines to the thing are over the threshold (vote >
// 0) or under it, at all corrected scales, each channel the less the higher its price. away: see
// AwayDirections.
FeatureRow Moved(const CorrectedScales& scales, std::span<const FeatureRow> away,
                 FeatureRow feature, float vote) {
  Normalise(feature);
  const float share = std::abs(vote) * kStepSize / static_cast<float>(scales.fits.size());
  for (int step = 0; step < kNumSteps; ++step) {
    FeatureRow change{};
    for (size_t s = 0; s < scales.fits.size(); ++s) {
      const ScaleFit& fit = scales.fits[s];
      const Gated gated = GateBy(fit, feature);
      const double wrong = vote > 0 ? std::max(0.0, InsideCosine(fit) - gated.cosine)
                                    : -std::max(0.0, gated.cosine - OutsideCosine(fit));
      if (wrong == 0) continue;
      const float factor = share * static_cast<float>(wrong) / gated.norm;
      const float leave = vote < 0 ? kAwayWeight : 0;
      for (int k = 0; k < kFeatureSize; ++k) {
        change[k] += factor * fit.gate[k] *
                     (fit.direction[k] - gated.cosine * gated.unit[k] - leave * away[s][k]);
      }
    }
    for (int k = 0; k < kFeatureSize; ++k) feature[k] += change[k] / scales.price[k];
  }
  Normalise(feature);
  return feature;
}

}  // namespace

FeatureMoves FindMoves(const Model& model, const CorrectedScales& scales, const ThingPlace& place) {
  const auto num = static_cast<size_t>(model.gaussians.count);
  FeatureMoves moves = {std::vector<uint8_t>(num), std::vector<uint8_t>(num)};
  const float reach = kReach * place.radius;
  OnThreads(num, [&](size_t g) {
    FeatureRow feature = RowOf(model.field, g);
    float squares = 0;
    for (const float value : feature) squares += value * value;
    if (squares < kMinFeatureNorm * kMinFeatureNorm) return;
    const Eigen::Vector3f mean(model.gaussians.Plane(0)[g], model.gaussians.Plane(1)[g],
                               model.gaussians.Plane(2)[g]);
    const bool near = (mean - place.center).squaredNorm() < reach * reach;
    for (const ScaleFit& fit : scales.fits) {
      const float cosine = GateBy(fit, feature).cosine;
      if (cosine > OutsideCosine(fit)) moves.push[g] = 1;
      if (cosine < InsideCosine(fit) && near) moves.pull[g] = 1;
    }
  });
  return moves;
}

int64_t MoveFeatures(const CorrectedScales& scales, const FeatureMoves& moves,
                     std::span<const float> votes, FeatureField& field) {
  const std::vector<FeatureRow> away = AwayDirections(scales, moves, votes, field);
  std::vector<size_t> moved;
  for (size_t g = 0; g < votes.size(); ++g) {
    const bool move = votes[g] > 0 ? moves.pull[g] != 0 : moves.push[g] != 0;
    if (move && std::abs(votes[g]) > kMinVote) moved.push_back(g);
  }
  OnThreads(moved.size(), [&](size_t i) {
    const size_t g = moved[i];
    const FeatureRow row = Moved(scales, away, RowOf(field, g), votes[g]);
    std::copy(row.begin(), row.end(), &field.features[g * kFeatureSize]);
  });
  return static_cast<int64_t>(moved.size());
}

}  // namespace pepeseg
