#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/query/prompt.h"
#include "core/render/feature_maps.h"
#include "core/render/renderer.h"
#include "core/scene/capture.h"
#include "core/scene/mask_set.h"
#include "core/scene/model.h"
#include "kernels/backend.h"

namespace pepeseg {

// What Segment computes besides the mask as it follows from the threshold.
struct SegmentOptions {
  bool want_similarity = false;  // the similarity of each pixel, too
  bool refine_borders = false;   // see RefineBorderArgs; the score is that of the refined mask
};

// The image by which the border of a mask was placed, other than by its features.
enum class BorderImage { kNone, kPhotograph, kRendering };

// The mask of a query in one view.
struct SegmentResult {
  std::string view;  // name of the target view
  BinaryMask mask;   // [height, width] of the target view
  int width = 0, height = 0;
  int64_t area = 0;               // pixels in the mask
  double score = 0;               // mean similarity inside the mask, cosine
  double scale = 0;               // quantile scale used, [0, 1]
  double scale_units = 0;         // the same scale in scene units
  double threshold = 0;           // cosine used
  int box[4] = {};                // x, y, width, height of the mask, pixels; zeros if it is empty
  std::vector<float> similarity;  // [height, width] cosines; empty unless requested
  BorderImage border_image = BorderImage::kNone;
  std::optional<double> box_agreement;  // of the view of a box prompt, see CutToBox
};

// Pixel counts from which the overlap of any two masks of one prompt follows. The masks are those
// at several scales and thresholds, both ascending.
struct LevelCounts {
  int num_scales = 0, num_thresholds = 0;
  // [num_scales, num_scales, num_thresholds + 1, num_thresholds + 1], see LevelOverlapsArgs.
  std::vector<int32_t> pixels;
};

// A result whose mask is packed as it comes from the device (PackMask), and has neither pixels nor
// a box yet: that work does not need the device.
struct PackedResult {
  SegmentResult result;
  std::vector<uint32_t> bits;
};

// Returns the result of a query in a view before the mask is known: all pixels are outside. Takes
// the memory of the packed mask, and with want_similarity that of the similarities, so that the
// holder of the device lock need not.
PackedResult EmptyResult(const Query& query, const ModelView& target, const SegmentOptions& options,
                         const FeatureField& field);

// Computes masks and similarities from the feature maps of a model's views, on the device. For one
// thread at a time, which must hold the device lock. Views, queries and scales are taken as valid
// (prompt.h). Any call may return RESOURCE_EXHAUSTED; errors of the device itself are those of the
// backend (TakeStatus).
class ViewFeatures {
 public:
  // Renderer and model must outlive it. counts: see FeatureMaps.
  ViewFeatures(Renderer& renderer, const Model& model, MapCounts* counts);

  const FeatureMaps& maps() const { return maps_; }

  // Returns the features at pixels, y * width + x, as rendered and not gated: [pixels, 32].
  absl::StatusOr<std::vector<float>> At(const ModelView& view, std::span<const int32_t> pixels);
  // Returns the similarity of each pixel to each of the features [features, 32] at a quantile
  // scale: [features, height, width].
  absl::StatusOr<std::vector<float>> Similarity(std::span<const float> features, double scale,
                                                const ModelView& target);
  // Writes the masks of a query in the target views, and their areas, scores and similarities, to
  // `results`: those of EmptyResult, in the order of the targets.
  absl::Status Segment(const Query& query, std::span<const ModelView> targets,
                       const SegmentOptions& options, std::span<PackedResult> results);
  // Returns how the masks of a query overlap at all pairs of scales and thresholds.
  absl::StatusOr<LevelCounts> CountLevels(const Query& query, std::span<const double> scales,
                                          std::span<const float> thresholds,
                                          const ModelView& target);
  // Returns the feature map of a view on the host, [height * width, 32]. Maps of a subset are
  // rendered each time and not cached.
  absl::StatusOr<std::vector<Half>> Download(const ModelView& view, const GaussianSet* subset);

  // Frees the scratch of a view that is larger than every view of the model, so that one large free
  // camera does not keep it.
  void ReleaseOversized();

 private:
  absl::Status SegmentView(const Query& query, const ModelView& target,
                           const SegmentOptions& options, PackedResult& packed);
  // Returns the gates psi(scale): [scales, 32].
  Buffer<float> GatesAt(std::span<const double> scales) const;

  Backend& backend_;
  Renderer& renderer_;
  const Model& model_;
  FeatureMaps maps_;
  // Scratch of At and SegmentView, kept from call to call.
  Buffer<Half> at_pixels_;  // [pixels, 32]
  Buffer<float> inputs_;    // [1 + features, 32] the gate, then the features of the query
  Buffer<uint8_t> mask_, refined_;
  Buffer<uint32_t> bits_;  // of the mask
  Buffer<float> similarity_;
  Buffer<int64_t> sums_;
};

}  // namespace pepeseg
