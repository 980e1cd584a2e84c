#include "core/correct/membership.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <utility>

#include "core/base/on_threads.h"
#include "kernels/ops/render.h"

namespace pepeseg {
namespace {

// Share of a Gaussian inside the masks from which it is a sample of the inside, and up to which it
// is one of the outside.
constexpr float kInsideShare = 0.6f, kOutsideShare = 0.4f;
constexpr size_t kMaxSamples = 512;  // of either kind
constexpr size_t kMinSamples = 64;
// Limit on pairs of a Gaussian and a sample; half a second to a second of two cores.
constexpr size_t kMaxPairs = size_t{60} << 20;
constexpr float kDistanceUnit = 0.1f;  // radii
constexpr float kMaxDistanceTerm = 4;  // beyond this, distance says nothing more
constexpr float kDissimilarityUnit = 0.1f;
// Weight of the vote "not known": Gaussians that resemble no sample stay as they are.
constexpr float kUnknownWeight = 0.02f;
constexpr uint64_t kSampleSeed = 1;
constexpr int64_t kMinSharedPixels = 64;  // for LeastAgreement

Eigen::Vector3f MeanOf(const Gaussians& gaussians, size_t g) {
  return {gaussians.Plane(0)[g], gaussians.Plane(1)[g], gaussians.Plane(2)[g]};
}

// A Gaussian that others follow.
struct Sample {
  float unit[kFeatureSize];  // gated feature, of length 1
  Eigen::Vector3f mean;
  float vote = 0;  // 1: inside, -1: outside
};

// Writes the gated unit feature. Returns whether the Gaussian has a feature.
bool WriteUnit(const FeatureField& field, std::span<const float> gate, size_t g, float* unit) {
  float squares = 0, plain = 0;
  for (int k = 0; k < kFeatureSize; ++k) {
    const float value = field.features[g * kFeatureSize + k];
    unit[k] = value * gate[k];
    squares += unit[k] * unit[k];
    plain += value * value;
  }
  const float scale = squares > 0 ? 1 / std::sqrt(squares) : 0;
  for (int k = 0; k < kFeatureSize; ++k) unit[k] *= scale;
  return plain >= kMinFeatureNorm * kMinFeatureNorm;
}

// Draws `count` of the Gaussians without replacement, with odds by what the views show of them
// (Efraimidis and Spirakis 2006).
std::vector<size_t> Draw(const std::vector<size_t>& from, const MaskVotes& votes, size_t count) {
  if (from.size() <= count) return from;
  std::mt19937_64 random(kSampleSeed);
  std::vector<std::pair<double, size_t>> keys;
  keys.reserve(from.size());
  for (const size_t g : from) {
    const double odds = votes.seen[g] * std::abs(2 * votes.Share(g) - 1);
    // In (0, 1), from the same bits on all platforms.
    const double uniform = (static_cast<double>(random() >> 12) + 0.5) * 0x1p-52;
    keys.emplace_back(std::log(uniform) / odds, g);
  }
  std::nth_element(keys.begin(), keys.begin() + static_cast<int64_t>(count), keys.end(),
                   [](const auto& a, const auto& b) { return a > b; });
  std::vector<size_t> drawn;
  drawn.reserve(count);
  for (size_t i = 0; i < count; ++i) drawn.push_back(keys[i].second);
  return drawn;
}

// Returns samples of the Gaussians inside, and of those outside that are `wanted`.
std::vector<Sample> DrawSamples(const Model& model, const MaskVotes& votes,
                                std::span<const float> gate, std::span<const uint8_t> wanted,
                                size_t count) {
  std::vector<size_t> inside, outside;
  for (size_t g = 0; g < votes.seen.size(); ++g) {
    if (!votes.Votes(g)) continue;
    const float share = votes.Share(g);
    if (share > kInsideShare) inside.push_back(g);
    if (share < kOutsideShare && wanted[g] != 0) outside.push_back(g);
  }
  std::vector<Sample> samples;
  for (const auto& [from, vote] : {std::pair(&inside, 1.0f), std::pair(&outside, -1.0f)}) {
    for (const size_t g : Draw(*from, votes, count)) {
      Sample sample;
      if (!WriteUnit(model.field, gate, g, sample.unit)) continue;
      sample.mean = MeanOf(model.gaussians, g);
      sample.vote = vote;
      samples.push_back(sample);
    }
  }
  return samples;
}

// Returns the mean vote of the samples for a Gaussian.
float Follow(std::span<const Sample> samples, const float* unit, const Eigen::Vector3f& mean,
             float inverse_square) {
  float votes = 0, weights = kUnknownWeight;
  for (const Sample& sample : samples) {
    float cosine = 0;
    for (int k = 0; k < kFeatureSize; ++k) cosine += unit[k] * sample.unit[k];
    const float distance = (mean - sample.mean).squaredNorm() * inverse_square;
    const float weight =
        std::exp(-std::min(distance, kMaxDistanceTerm) - (1 - cosine) / kDissimilarityUnit);
    votes += weight * sample.vote;
    weights += weight;
  }
  return votes / weights;
}

}  // namespace

void MaskVotes::Add(const CorrectedPixels& view) {
  for (size_t p = 0; p < view.num_pixels(); ++p) {
    for (int32_t e = view.rows.first[p]; e < view.rows.first[p + 1]; ++e) {
      const auto g = static_cast<size_t>(view.rows.gaussian[e]);
      seen[g] += view.rows.weight[e];
      if (view.inside[p] != 0) inside[g] += view.rows.weight[e];
    }
  }
}

MaskVotes VotesOf(std::span<const CorrectedPixels> views, int64_t num_gaussians) {
  MaskVotes votes(num_gaussians);
  for (const CorrectedPixels& view : views) votes.Add(view);
  std::vector<std::pair<float, float>> shown;  // seen, inside
  double half = 0;
  for (size_t g = 0; g < votes.seen.size(); ++g) {
    if (votes.inside[g] <= 0) continue;
    shown.emplace_back(votes.seen[g], votes.inside[g]);
    half += 0.5 * votes.inside[g];
  }
  std::sort(shown.begin(), shown.end());
  double sum = 0;
  for (const auto& [seen, inside] : shown) {
    sum += inside;
    if (sum < half) continue;
    votes.full = std::min(1.0f, seen);
    break;
  }
  return votes;
}

MaskAgreement LeastAgreement(std::span<const CorrectedPixels> views, int64_t num_gaussians) {
  MaskAgreement least;
  if (views.size() < 2) return least;
  const MaskVotes all = VotesOf(views, num_gaussians);
  for (size_t v = 0; v < views.size(); ++v) {
    const CorrectedPixels& view = views[v];
    MaskVotes own(num_gaussians);
    own.Add(view);
    int64_t both = 0, either = 0;
    for (size_t p = 0; p < view.num_pixels(); ++p) {
      float known = 0, inside = 0, sum = 0;
      for (int32_t e = view.rows.first[p]; e < view.rows.first[p + 1]; ++e) {
        const auto g = static_cast<size_t>(view.rows.gaussian[e]);
        const float weight = view.rows.weight[e], seen = all.seen[g] - own.seen[g];
        sum += weight;
        if (!all.Votes(seen)) continue;
        known += weight;
        inside += weight * (all.inside[g] - own.inside[g]) / seen;
      }
      if (known < 0.5f || known < 0.5f * sum) continue;
      const bool others = inside > 0.5f * known, here = view.inside[p] != 0;
      both += others && here ? 1 : 0;
      either += others || here ? 1 : 0;
    }
    const double iou =
        either < kMinSharedPixels ? 1 : static_cast<double>(both) / static_cast<double>(either);
    if (iou < least.iou) least = {iou, v};
  }
  return least;
}

ThingPlace PlaceOf(const Gaussians& gaussians, const MaskVotes& votes) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double weights = 0, squares = 0;
  for (size_t g = 0; g < votes.inside.size(); ++g) {
    if (votes.inside[g] <= 0) continue;
    sum += votes.inside[g] * MeanOf(gaussians, g).cast<double>();
    weights += votes.inside[g];
  }
  if (weights <= 0) return {};
  const Eigen::Vector3d center = sum / weights;
  for (size_t g = 0; g < votes.inside.size(); ++g) {
    if (votes.inside[g] <= 0) continue;
    squares += votes.inside[g] * (MeanOf(gaussians, g).cast<double>() - center).squaredNorm();
  }
  return {center.cast<float>(), static_cast<float>(std::sqrt(squares / weights))};
}

std::vector<float> InsideOrNot(const Model& model, const MaskVotes& votes, const ThingPlace& place,
                               std::span<const float> gate, std::span<const uint8_t> wanted) {
  const size_t num = votes.seen.size();
  std::vector<float> inside(num);
  std::vector<size_t> unseen;
  for (size_t g = 0; g < num; ++g) {
    if (votes.Votes(g)) {
      inside[g] = (2 * votes.Share(g) - 1) * std::min(1.0f, votes.seen[g] / votes.full);
    } else if (wanted[g] != 0) {
      unseen.push_back(g);
    }
  }
  if (unseen.empty()) return inside;
  const size_t count = std::clamp(kMaxPairs / (2 * unseen.size()), kMinSamples, kMaxSamples);
  const std::vector<Sample> samples = DrawSamples(model, votes, gate, wanted, count);
  const float unit_length = std::max(kDistanceUnit * place.radius, 1e-9f);
  const float inverse_square = 1 / (unit_length * unit_length);
  OnThreads(unseen.size(), [&](size_t i) {
    float unit[kFeatureSize];
    if (!WriteUnit(model.field, gate, unseen[i], unit)) return;
    inside[unseen[i]] = Follow(samples, unit, MeanOf(model.gaussians, unseen[i]), inverse_square);
  });
  return inside;
}

}  // namespace pepeseg
