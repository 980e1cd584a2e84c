#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "absl/status/status.h"
#include "core/query/segmenter.h"

namespace pepeseg {

// How much was seen of each Gaussian in views, and how much of that inside the views' masks: sums
// of blend weights a_i T_i over pixels, so that both are in pixels.
class GaussianVotes {
 public:
  explicit GaussianVotes(int64_t num_gaussians)
      : inside_(static_cast<size_t>(num_gaussians)), seen_(static_cast<size_t>(num_gaussians)) {}

  // Looks at the view at 65,536 pixels or so: three quarters of them on a grid around the mask,
  // where they decide, the others on a coarser grid of the rest; each counts for the area that it
  // stands for. `result` is the query's answer for the view.
  absl::Status Add(const Segmenter& segmenter, const ModelView& view, const SegmentResult& result);

  bool Seen(size_t i) const { return seen_[i] > 0; }
  // More of what was seen of it lay inside the masks than outside. With the majority the selection
  // disagrees with the masks in as little blend weight as any set of Gaussians can.
  bool Inside(size_t i) const { return inside_[i] > 0.5 * seen_[i]; }
  // Mean of what the masks show, in the world; something is inside.
  Eigen::Vector3d CenterInside(const Gaussians& gaussians) const;

 private:
  std::vector<double> inside_, seen_;  // [num_gaussians]
};

}  // namespace pepeseg
