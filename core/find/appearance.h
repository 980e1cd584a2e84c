#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "core/find/image_encoder.h"
#include "core/find/scene_segments.h"
#include "core/query/scene_model.h"

namespace pepeseg {

// The thing that others are compared with: a segment, or pixels of a view.
struct LookedFor {
  int32_t segment = -1;         // its number; -1: none
  std::vector<float> features;  // without a segment: mean features of its pixels, [channels]
};

// How the segments of a scene look, by the features of an image encoder (METHOD.md section 4, "All
// alike"). Immutable.
//
// The features of a segment are the mean over its pixels in each view, and then over the views,
// weighted by the root of the pixels. They are whitened by how the same segment differs between
// views, so that what changes with the view counts little.
class Appearance {
 public:
  // Encodes the views of `all`. Errors are those of the encoder and of `check`, which is called
  // before each view.
  static absl::StatusOr<Appearance> Look(const SceneModel& model, const SceneSegments& all,
                                         ImageEncoder& encoder, const WantedCheck& check);

  // Returns how alike each segment is to what is looked for, [segments] in [0, 1]: e^(-2 d), where
  // d is 1 less the cosine of the whitened features. If a segment is looked for, half the mean
  // difference of the logarithms of the extents and the distance of the colours are added to d. 0:
  // a segment that hardly any view shows.
  std::vector<double> ScoresLike(const LookedFor& looked_for) const;
  // Returns the memory that it takes, bytes.
  int64_t Bytes() const;

 private:
  std::vector<float> Whitened(std::span<const float> mean) const;

  size_t channels_ = 0;
  std::vector<float> mean_;       // [channels] of the segments
  std::vector<float> whitening_;  // [channels, channels]
  std::vector<float> units_;      // [segments, channels] whitened, of length 1; zeros: hardly seen
  std::vector<std::array<float, 3>> log_extents_, colors_;  // [segments]
};

// Returns the mean features of the pixels of a grid where `inside` is not 0, [channels]; empty: no
// pixel is inside.
std::vector<float> MeanFeatures(const ImageFeatures& features, std::span<const uint8_t> inside);

// Returns the segments with the best scores, of at least `min_score`, best first: at most `max` of
// which no two share Gaussians. Where one holds the other, the better one stays.
std::vector<int32_t> BestApart(const SceneSegments& all, std::span<const double> scores,
                               double min_score, size_t max);

}  // namespace pepeseg
