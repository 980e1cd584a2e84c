#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/correct/corrected_pixels.h"
#include "core/scene/gaussians.h"

namespace pepeseg {

// Length of a feature under which a Gaussian has none: no mask ever reached it.
inline constexpr float kMinFeatureNorm = 0.1f;

// The parts of each Gaussian that the corrected views show: sums of blend weights over pixels.
struct MaskVotes {
  std::vector<float> inside, seen;  // [num_gaussians]

  explicit MaskVotes(int64_t num_gaussians)
      : inside(static_cast<size_t>(num_gaussians)), seen(static_cast<size_t>(num_gaussians)) {}
  void Add(const CorrectedPixels& view);
  // Blend weight of a Gaussian whose vote counts in full. At most 1, a pixel that shows nothing
  // else; less where many Gaussians share a pixel (VotesOf).
  float full = 1;
  // Returns whether the views show enough of a Gaussian for it to vote for itself.
  bool Votes(size_t g) const { return Votes(seen[g]); }
  bool Votes(float shown) const { return shown > 0.5f * full; }
  // Returns the share of a Gaussian that is inside, [0, 1]. It must be seen.
  float Share(size_t g) const { return inside[g] / seen[g]; }
};
// Adds all views. Sets `full` to the weighted median of `seen`, by `inside`, or 1 if that is more.
MaskVotes VotesOf(std::span<const CorrectedPixels> views, int64_t num_gaussians);

// The smallest IoU, over the corrected views, of the mask and what the other views say of the
// pixels: of those that show mostly Gaussians which vote in the others. Pixels that only one view
// shows do not count; a view that shares too few pixels with the others has IoU 1. `view`: the view
// with that IoU.
struct MaskAgreement {
  double iou = 1;
  size_t view = 0;
};
MaskAgreement LeastAgreement(std::span<const CorrectedPixels> views, int64_t num_gaussians);

// The thing in space.
struct ThingPlace {
  Eigen::Vector3f center = Eigen::Vector3f::Zero();  // of the Gaussians inside, by their votes
  float radius = 0;                                  // root mean squared distance from it
};
ThingPlace PlaceOf(const Gaussians& gaussians, const MaskVotes& votes);

// Which Gaussians are inside the thing: [num_gaussians], 1: surely inside, -1: surely outside, 0:
// not known. A Gaussian that the views show votes for itself. Others (of `wanted`) follow those
// with similar features near them: the mean vote of samples of Gaussians inside and outside, with
// the weight exp(-min(d^2 / (0.1 radius)^2, 4) - (1 - cosine) / 0.1), where d is the distance and
// the cosine is that of the features gated by `gate`. Does not depend on the number of threads.
std::vector<float> InsideOrNot(const Model& model, const MaskVotes& votes, const ThingPlace& place,
                               std::span<const float> gate, std::span<const uint8_t> wanted);

}  // namespace pepeseg
