#pragma once

#include <array>
#include <cstdint>
#include <random>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "core/scene/capture.h"
#include "kernels/backend.h"

namespace pepeseg {

// Returns FAILED_PRECONDITION, with the view's name, when stage one cannot train on the capture:
// no training view, or an image whose size is not its camera's.
absl::Status CheckTrainable(const Capture& capture);

// A training photograph at one size, in memory that ops can read.
struct TrainingView {
  PinholeView pinhole;
  Buffer<uint8_t> photo;               // [H, W, 3]
  Buffer<uint8_t> ignore;              // [H, W], non-zero: ignored; empty when no pixel is
  Buffer<float> prior;                 // depth prior [H, W], NaN: unknown; empty when there is none
  float min_prior = 0, max_prior = 0;  // the 1st and 99th percentiles; values outside are outliers
  double prior_deviation = 0;          // mean |value - mean| of the values within
  bool inverse_depth = false;          // the prior is compared with 1 / z: it is a disparity
};

// Photograph and ignore mask of a view at a smaller size, before they are uploaded.
struct ShrunkView {
  std::vector<uint8_t> photo, ignore;
};

struct TrainingViewsOptions {
  bool coarse = false;      // also at 1/2 and 1/4 of the size
  bool with_depth = false;  // with the depth priors
  // See ReconstructOptions::disparity_as_inverse_depth. False: `prior` holds negative disparities,
  // which grow with z as the fit demands.
  bool disparity_as_inverse_depth = true;
  MemoryPlace place = MemoryPlace::kDevice;
};

// The capture's training views, uploaded once, photographs as bytes. Smaller sizes are averages
// over blocks of pixels; a block with an ignored pixel is ignored.
class TrainingViews {
 public:
  TrainingViews(Backend& backend, const Capture& capture, const TrainingViewsOptions& options);

  int size() const { return static_cast<int>(views_.size()); }
  // view: index among the training views. shrink: 1, or 2 or 4 with TrainingViewsOptions::coarse.
  const TrainingView& At(int view, int shrink) const { return views_[view][shrink / 2]; }
  int64_t max_pixels() const { return max_pixels_; }
  int64_t num_pixels() const { return num_pixels_; }  // in all views at full size
  bool allocated() const { return allocated_; }       // false: the backend is out of memory

 private:
  static constexpr int kNumSizes = 3;
  void Add(Backend& backend, const View& view, const TrainingViewsOptions& options,
           const std::array<ShrunkView, kNumSizes>& shrunk);

  std::vector<std::array<TrainingView, kNumSizes>> views_;  // by shrink / 2
  int64_t max_pixels_ = 0, num_pixels_ = 0;
  bool allocated_ = true;
};

// Draws indices of views in rounds: a view comes at most once in a round, in random order.
class ViewSampler {
 public:
  // shares: for each view the share of the rounds that it is in, in [0, 1]; at least one must be 1.
  explicit ViewSampler(std::vector<double> shares) : shares_(std::move(shares)) {}

  int Next(std::mt19937_64& random);

  // Indices that this round has not returned yet; the next one is at the back.
  const std::vector<int>& left() const { return left_; }
  // Resumes the round with `left`: each the index of a view, none twice.
  void Restore(std::vector<int> left) { left_ = std::move(left); }

 private:
  std::vector<double> shares_;
  std::vector<int> left_;
};

}  // namespace pepeseg
