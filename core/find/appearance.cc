#include "core/find/appearance.h"

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

using Eigen::MatrixXf;
using Eigen::VectorXf;

// Chosen on crowded and desk (tests/bench/results/all_alike.md).
constexpr int kMinPixels = 4;       // of a view's grid that make it count
constexpr int64_t kMinSeen = 20;    // pixels of all grids that make a segment count
constexpr float kShrinkage = 0.3f;  // of the variances between views, towards their mean
constexpr double kExtentWeight = 0.5, kColorWeight = 1;
constexpr double kMostExtents = 2;        // difference of the logarithms that counts
constexpr double kDifferenceScale = 0.5;  // difference with a score of 1 / e

using ConstRows =
    Eigen::Map<const Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>;

std::vector<float> ToFloats(std::span<const Half> values) {
  std::vector<float> floats;
  floats.reserve(values.size());
  for (const Half value : values) floats.push_back(FloatFromHalf(value));
  return floats;
}

// The mean features of the segments that one view shows enough of.
struct ViewMeans {
  std::vector<int32_t> segments;  // their numbers
  std::vector<float> weights;     // roots of their pixels
  MatrixXf means;                 // [channels, segments.size()]
};

ViewMeans MeansIn(const SeenView& seen, const ImageFeatures& features) {
  ViewMeans view;
  std::vector<int32_t> column(seen.areas.size(), -1);
  for (size_t s = 0; s < seen.areas.size(); ++s) {
    if (seen.areas[s].pixels < kMinPixels) continue;
    column[s] = static_cast<int32_t>(view.segments.size());
    view.segments.push_back(static_cast<int32_t>(s));
    view.weights.push_back(std::sqrt(static_cast<float>(seen.areas[s].pixels)));
  }
  const std::vector<float> values = ToFloats(features.values);
  view.means = MatrixXf::Zero(features.channels, static_cast<int64_t>(view.segments.size()));
  for (const std::vector<int32_t>& shown : seen.shown) {
    for (size_t i = 0; i < shown.size(); ++i) {
      if (shown[i] < 0 || column[shown[i]] < 0) continue;
      view.means.col(column[shown[i]]) += Eigen::Map<const VectorXf>(
          &values[static_cast<size_t>(features.cells[i]) * features.channels], features.channels);
    }
  }
  for (size_t k = 0; k < view.segments.size(); ++k) {
    view.means.col(static_cast<int64_t>(k)) /=
        static_cast<float>(seen.areas[view.segments[k]].pixels);
  }
  return view;
}

// Returns the weighted means over the views, [channels, segments], and whether any view counts.
std::pair<MatrixXf, std::vector<uint8_t>> MeansOf(std::span<const ViewMeans> views,
                                                  int64_t channels, const SceneSegments& all) {
  const auto count = static_cast<int64_t>(all.segments.size());
  MatrixXf means = MatrixXf::Zero(channels, count);
  std::vector<float> weights(all.segments.size());
  for (const ViewMeans& view : views) {
    for (size_t k = 0; k < view.segments.size(); ++k) {
      means.col(view.segments[k]) += view.weights[k] * view.means.col(static_cast<int64_t>(k));
      weights[view.segments[k]] += view.weights[k];
    }
  }
  std::vector<uint8_t> counts(all.segments.size());
  for (size_t s = 0; s < weights.size(); ++s) {
    if (weights[s] > 0) means.col(static_cast<int64_t>(s)) /= weights[s];
    counts[s] = weights[s] > 0 && all.SeenPixels(static_cast<int32_t>(s)) >= kMinSeen ? 1 : 0;
  }
  return {std::move(means), std::move(counts)};
}

// Returns the matrix that scales the directions in which one segment differs between views to equal
// variance, as far as the shrinkage lets it: [channels, channels].
MatrixXf WhiteningOf(std::span<const ViewMeans> views, const MatrixXf& means) {
  MatrixXf scatter = MatrixXf::Zero(means.rows(), means.rows());
  float total = 0;
  for (const ViewMeans& view : views) {
    MatrixXf deviations = view.means;
    for (size_t k = 0; k < view.segments.size(); ++k) {
      const auto column = static_cast<int64_t>(k);
      deviations.col(column) -= means.col(view.segments[k]);
      deviations.col(column) *= std::sqrt(view.weights[k]);
      total += view.weights[k];
    }
    scatter.selfadjointView<Eigen::Lower>().rankUpdate(deviations);
  }
  const Eigen::SelfAdjointEigenSolver<MatrixXf> solver(scatter / std::max(total, 1e-6f));
  const VectorXf variances = solver.eigenvalues().cwiseMax(0.0f);
  // The least term is for a single view, where nothing differs.
  const float shrinkage = kShrinkage * variances.mean() + 1e-12f;
  return (variances.array() + shrinkage).rsqrt().matrix().asDiagonal() *
         solver.eigenvectors().transpose();
}

double ExtentDifference(const std::array<float, 3>& a, const std::array<float, 3>& b) {
  double sum = 0;
  for (int k = 0; k < 3; ++k) sum += std::abs(double{a[k]} - b[k]);
  return std::min(sum / 3, kMostExtents);
}

double Distance(const std::array<float, 3>& a, const std::array<float, 3>& b) {
  return std::hypot(double{a[0]} - b[0], double{a[1]} - b[1], double{a[2]} - b[2]);
}

}  // namespace

absl::StatusOr<Appearance> Appearance::Look(const SceneModel& model, const SceneSegments& all,
                                            ImageEncoder& encoder, const WantedCheck& check) {
  Appearance looks;
  std::vector<ViewMeans> views;
  for (const SeenView& seen : all.views) {
    RETURN_IF_ERROR(check());
    ASSIGN_OR_RETURN(const ImageFeatures features, encoder.Encode(model.model().views[seen.view],
                                                                  seen.width, seen.height, check));
    looks.channels_ = static_cast<size_t>(features.channels);
    views.push_back(MeansIn(seen, features));
  }
  const auto channels = static_cast<int64_t>(looks.channels_);
  const auto [means, counts] = MeansOf(views, channels, all);
  const MatrixXf whitening = WhiteningOf(views, means);
  looks.whitening_.assign(whitening.data(), whitening.data() + whitening.size());
  VectorXf sum = VectorXf::Zero(channels);
  float number = 0;
  for (size_t s = 0; s < counts.size(); ++s) {
    if (counts[s] == 0) continue;
    sum += means.col(static_cast<int64_t>(s));
    number += 1;
  }
  sum /= std::max(number, 1.0f);
  looks.mean_.assign(sum.data(), sum.data() + sum.size());
  looks.units_.resize(all.segments.size() * looks.channels_);
  for (size_t s = 0; s < counts.size(); ++s) {
    const SceneSegments::Segment& segment = all.segments[s];
    looks.log_extents_.push_back(
        {std::log(segment.extents[0]), std::log(segment.extents[1]), std::log(segment.extents[2])});
    looks.colors_.push_back(segment.color);
    if (counts[s] == 0) continue;
    const float* const mean = means.col(static_cast<int64_t>(s)).data();
    std::ranges::copy(looks.Whitened({mean, looks.channels_}), &looks.units_[s * looks.channels_]);
  }
  return looks;
}

std::vector<float> Appearance::Whitened(std::span<const float> mean) const {
  const auto channels = static_cast<int64_t>(channels_);
  const Eigen::Map<const VectorXf> at(mean.data(), channels), center(mean_.data(), channels);
  const Eigen::Map<const MatrixXf> whitening(whitening_.data(), channels, channels);
  VectorXf unit = whitening * (at - center);
  const float length = unit.norm();
  if (length > 0) unit /= length;
  return {unit.data(), unit.data() + channels};
}

std::vector<double> Appearance::ScoresLike(const LookedFor& looked_for) const {
  const size_t count = log_extents_.size();
  std::vector<float> unit;
  if (looked_for.segment >= 0) {
    const auto first = units_.begin() + static_cast<int64_t>(looked_for.segment * channels_);
    unit.assign(first, first + static_cast<int64_t>(channels_));
  } else {
    unit = Whitened(looked_for.features);
  }
  const ConstRows all(units_.data(), static_cast<int64_t>(count), static_cast<int64_t>(channels_));
  const VectorXf cosines =
      all * Eigen::Map<const VectorXf>(unit.data(), static_cast<int64_t>(channels_));
  std::vector<double> scores(count);
  for (size_t s = 0; s < count; ++s) {
    const auto row = static_cast<int64_t>(s);
    if (all.row(row).isZero()) continue;  // hardly seen
    double difference = 1.0 - std::min(cosines[row], 1.0f);
    if (looked_for.segment >= 0) {
      const size_t with = static_cast<size_t>(looked_for.segment);
      difference += kExtentWeight * ExtentDifference(log_extents_[s], log_extents_[with]) +
                    kColorWeight * Distance(colors_[s], colors_[with]);
    }
    scores[s] = std::exp(-difference / kDifferenceScale);
  }
  return scores;
}

int64_t Appearance::Bytes() const {
  const size_t floats =
      mean_.size() + whitening_.size() + units_.size() + 3 * (log_extents_.size() + colors_.size());
  return static_cast<int64_t>(floats * sizeof(float));
}

std::vector<float> MeanFeatures(const ImageFeatures& features, std::span<const uint8_t> inside) {
  const std::vector<float> values = ToFloats(features.values);
  VectorXf sum = VectorXf::Zero(features.channels);
  int64_t count = 0;
  for (size_t i = 0; i < inside.size(); ++i) {
    if (inside[i] == 0) continue;
    sum += Eigen::Map<const VectorXf>(
        &values[static_cast<size_t>(features.cells[i]) * features.channels], features.channels);
    ++count;
  }
  if (count == 0) return {};
  sum /= static_cast<float>(count);
  return {sum.data(), sum.data() + sum.size()};
}

std::vector<int32_t> BestApart(const SceneSegments& all, std::span<const double> scores,
                               double min_score, size_t max) {
  std::vector<int32_t> order(scores.size());
  std::iota(order.begin(), order.end(), 0);
  std::ranges::stable_sort(order, [&](int32_t a, int32_t b) { return scores[a] > scores[b]; });
  std::vector<int32_t> best;
  for (const int32_t s : order) {
    if (best.size() >= max || scores[s] < min_score || scores[s] <= 0) break;
    const bool apart =
        std::ranges::all_of(best, [&](int32_t other) { return all.OverlapOf(s, other) == 0; });
    if (apart) best.push_back(s);
  }
  return best;
}

}  // namespace pepeseg
