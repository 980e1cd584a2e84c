#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <span>
#include <vector>

#include "core/sfm/two_view/magsac.h"
#include "core/sfm/two_view/minimal_solvers.h"
#include "core/sfm/two_view/point_pair.h"

namespace pepeseg {

struct RansacOptions {
  double threshold = 3;  // largest residual of an inlier
  int max_trials = 1000;
  double confidence = 0.999;  // probability of a sample without outliers
  uint64_t seed = 0;
};

// A matrix and the sum of the losses of all pairs.
struct RansacModel {
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Zero();
  double loss = 0;
};

// Returns the number of trials after which a sample of inliers has been drawn with the confidence.
inline double NumTrials(double inlier_share, int sample_size, double confidence) {
  const double hit = std::pow(inlier_share, sample_size);
  if (hit >= 1) return 1;
  // A share of 0 gives log(1) = -0 and with it infinitely many.
  return std::log(1 - confidence) / std::log1p(-hit);
}

// Finds the matrix with the smallest loss among samples of `pool`, indices of pairs: RANSAC
// (Fischler and Bolles 1981) that refines each best model so far (Chum, Matas and Kittler 2003).
// `Problem` has
//   kSampleSize; size(); Candidates Solve(span<const uint32_t, kSampleSize> sample);
//   Prepared Prepare(matrix); double Residual(prepared, i), squared;
//   Matrix3d Refine(matrix, loss): one step of reweighted least squares.
// Returns nothing if the pool is smaller than a sample or no sample has a model.
template <typename Problem>
class LoRansac {
 public:
  LoRansac(const Problem& problem, const MagsacLoss& loss, const RansacOptions& options)
      : problem_(problem), loss_(loss), options_(options), draws_(options.seed) {
    for (const double factor : {3.0, 2.0}) {
      wider_.emplace_back(factor * loss.limit());
    }
  }

  std::optional<RansacModel> Run(std::span<const uint32_t> pool) {
    if (pool.size() < Problem::kSampleSize) return std::nullopt;
    best_.loss = static_cast<double>(problem_.size());
    double num_needed = options_.max_trials;
    for (int trial = 0; trial < options_.max_trials && trial < num_needed; ++trial) {
      const Candidates candidates = problem_.Solve(Sample(pool));
      bool improved = false;
      for (int i = 0; i < candidates.count; ++i) {
        improved = Try(candidates.matrices[i]) || improved;
      }
      if (!improved) continue;
      Spread();
      Improve(kLocalSteps);
      num_needed = NumTrials(InlierShare(pool), Problem::kSampleSize, options_.confidence);
    }
    if (!found_) return std::nullopt;
    Improve(kFinalSteps);
    return best_;
  }

  // Returns the indices of all pairs within the threshold.
  std::vector<uint32_t> Inliers(const Eigen::Matrix3d& matrix) const {
    std::vector<uint32_t> inliers;
    const auto prepared = problem_.Prepare(matrix);
    for (uint32_t i = 0; i < problem_.size(); ++i) {
      if (IsInlier(prepared, i)) inliers.push_back(i);
    }
    return inliers;
  }

 private:
  static constexpr int kLocalSteps = 2, kFinalSteps = 10;

  // Draws distinct indices of the pool.
  std::array<uint32_t, Problem::kSampleSize> Sample(std::span<const uint32_t> pool) {
    std::array<uint32_t, Problem::kSampleSize> sample;
    for (size_t k = 0; k < sample.size();) {
      const uint32_t index = pool[draws_.Below(static_cast<uint32_t>(pool.size()))];
      if (std::find(sample.begin(), sample.begin() + k, index) == sample.begin() + k) {
        sample[k++] = index;
      }
    }
    return sample;
  }

  // Makes a matrix the best one if its loss is smaller. Stops summing once it is not.
  bool Try(const Eigen::Matrix3d& matrix) {
    const auto prepared = problem_.Prepare(matrix);
    double sum = 0;
    for (uint32_t i = 0; i < problem_.size(); ++i) {
      sum += loss_.Loss(problem_.Residual(prepared, i));
      if (sum >= best_.loss) return false;
    }
    best_ = {matrix, sum};
    found_ = true;
    return true;
  }

  // Refines with a limit that shrinks to its size: a sample of noisy inliers fits those far
  // from it only roughly.
  void Spread() {
    Eigen::Matrix3d matrix = best_.matrix;
    for (const MagsacLoss& wider : wider_) {
      matrix = problem_.Refine(matrix, wider);
      if (!matrix.allFinite()) return;
    }
    matrix = problem_.Refine(matrix, loss_);
    if (matrix.allFinite()) Try(matrix);
  }

  // Refines while the loss falls.
  void Improve(int num_steps) {
    for (int step = 0; step < num_steps; ++step) {
      const double before = best_.loss;
      const Eigen::Matrix3d refined = problem_.Refine(best_.matrix, loss_);
      if (!refined.allFinite() || !Try(refined) || best_.loss > before * (1 - 1e-4)) return;
    }
  }

  bool IsInlier(const typename Problem::Prepared& prepared, uint32_t i) const {
    return problem_.Residual(prepared, i) < options_.threshold * options_.threshold;
  }

  double InlierShare(std::span<const uint32_t> pool) const {
    const auto prepared = problem_.Prepare(best_.matrix);
    size_t count = 0;
    for (const uint32_t i : pool) {
      count += IsInlier(prepared, i);
    }
    return static_cast<double>(count) / static_cast<double>(pool.size());
  }

  const Problem& problem_;
  const MagsacLoss& loss_;
  std::vector<MagsacLoss> wider_;  // with limits of three and two times the loss's
  RansacOptions options_;
  SeededDraws draws_;
  RansacModel best_;
  bool found_ = false;
};

}  // namespace pepeseg
