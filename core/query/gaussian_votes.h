#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "core/query/segmenter.h"
#include "core/scene/model.h"

namespace pepeseg {

// Returns up to `num` views that vote on a selection, without the one named `prompted`: spread
// evenly over the views that have `center` (world) in their image, and over the others if those are
// too few. Occlusion is not considered.
std::vector<ModelView> VotingViews(std::span<const ModelView> views, const std::string& prompted,
                                   const Eigen::Vector3d& center, size_t num);

// Counts, for each Gaussian of a model, how much of it views show and how much of that is inside
// their masks: sums of blending weights over pixels, so both are areas in pixels.
class GaussianVotes {
 public:
  explicit GaussianVotes(int64_t num_gaussians)
      : inside_(static_cast<size_t>(num_gaussians)), seen_(static_cast<size_t>(num_gaussians)) {}

  // Adds a view. result: the mask of the query in this view. About 65,536 pixels are looked at:
  // three quarters of them on a grid around the mask, where they decide, the others on a coarser
  // grid elsewhere. A pixel counts with the area that it stands for. Errors are those of
  // Segmenter::Rows.
  absl::Status Add(const Segmenter& segmenter, const ModelView& view, const SegmentResult& result);

  // Returns whether any view shows Gaussian i.
  bool Seen(size_t i) const { return seen_[i] > 0; }
  // Returns whether more of Gaussian i was seen inside the masks than outside. No other set of
  // Gaussians disagrees with the masks in less blending weight than the set of these.
  bool Inside(size_t i) const { return inside_[i] > 0.5 * seen_[i]; }
  // Returns the mean of the Gaussians in world coordinates, weighted by what the masks show of
  // them. Something must be inside a mask.
  Eigen::Vector3d CenterInside(const Gaussians& gaussians) const;

 private:
  std::vector<double> inside_, seen_;  // [num_gaussians] pixels
};

}  // namespace pepeseg
