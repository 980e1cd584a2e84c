#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/statusor.h"
#include "core/decompose/decompose.h"
#include "core/query/mask_grid.h"
#include "core/query/prompt.h"
#include "core/render/feature_maps.h"
#include "core/render/model_renderer.h"
#include "core/scene/capture.h"
#include "core/scene/model.h"
#include "kernels/backend.h"

namespace pepeseg {

struct SegmentResult {
  BinaryMask mask;  // of the target view
  int width = 0, height = 0;
  int64_t area = 0;               // pixels in the mask
  double score = 0;               // mean similarity inside the mask, cosine
  double scale = 0;               // quantile scale used, [0, 1]
  double scale_units = 0;         // the same in scene units
  double threshold = 0;           // cosine used
  int box[4] = {};                // x, y, width, height of the mask; zeros when it is empty
  std::vector<float> similarity;  // [height, width], on request
};

// Queries on a resident model: keeps the model in backend memory and a cache of view feature maps.
// Thread safe. The backend must outlive it; all segmenters of one take turns, so that an error of
// it is the query's that caused it. Any call: RESOURCE_EXHAUSTED when the device has not the memory
// for it, which leaves the others unharmed; INTERNAL when the device can be used no more.
class Segmenter {
 public:
  // INVALID_ARGUMENT: not one feature a Gaussian, but for a model without a field (trained without
  // masks), in which nothing is found. `counts`: null, or where its maps are counted.
  static absl::StatusOr<std::unique_ptr<Segmenter>> Create(Backend& backend, Model model,
                                                           MapCounts* counts = nullptr);
  ~Segmenter();

  const Model& model() const;
  bool has_features() const;
  // Feature maps rendered so far (none by a new scale or threshold), and kept now. They wait for no
  // query.
  int64_t num_renders() const;
  int64_t num_maps() const;

  // Colour of a view, RGB; of some Gaussians only, where a subset is given.
  absl::StatusOr<Image> RenderColor(const ModelView& view,
                                    const GaussianSet* subset = nullptr) const;
  // What is blended into pixels, y * width + x, of a view.
  absl::StatusOr<PixelRows> Rows(const ModelView& view, std::span<const int32_t> pixels) const;

  // One result per target view, in order. INVALID_ARGUMENT: a scale or threshold out of range, no
  // positive feature.
  absl::StatusOr<std::vector<SegmentResult>> Segment(const Query& query,
                                                     std::span<const ModelView> targets,
                                                     bool want_similarity = false) const;

  // What points of a view mean, before a scale is chosen: [points, 32] features as rendered.
  // INVALID_ARGUMENT: a point outside its view, no positive point, a point on which nothing was
  // rendered.
  absl::StatusOr<std::vector<float>> PointFeatures(const ModelView& view,
                                                   std::span<const PointPrompt> points) const;
  // Likewise of any pixels, y * width + x, also where nothing was rendered: [pixels, 32].
  absl::StatusOr<std::vector<float>> PixelFeatures(const ModelView& view,
                                                   std::span<const int32_t> pixels) const;
  // Similarity, cosine, of each pixel of the target to each of such features at a quantile scale:
  // [features, height, width]. INVALID_ARGUMENT: a scale out of range, no features.
  absl::StatusOr<std::vector<float>> Similarity(std::span<const float> features, double scale,
                                                const ModelView& target) const;

  // How the masks of a query in the target at other quantile scales and thresholds, both ascending,
  // overlap; those of the query do not count. INVALID_ARGUMENT: as Segment; none, or more than
  // kMaxLevelScales and kMaxThresholds.
  absl::StatusOr<LevelCounts> CountLevels(const Query& query, std::span<const double> scales,
                                          std::span<const float> thresholds,
                                          const ModelView& target) const;

  // The following show some Gaussians only, as if there were no others, where a subset is given, as
  // RenderColor does. INVALID_ARGUMENT: it is of another number of Gaussians.
  //
  // See ModelRenderer::Depth.
  absl::StatusOr<std::vector<float>> RenderDepth(const ModelView& view,
                                                 const GaussianSet* subset = nullptr) const;
  // A view's features at a quantile scale as colours, see FeaturePalette. INVALID_ARGUMENT: a scale
  // out of range.
  absl::StatusOr<Image> RenderFeatures(const ModelView& view, double scale,
                                       const GaussianSet* subset = nullptr) const;
  // See RenderIds.
  absl::StatusOr<std::vector<int32_t>> RenderIds(const ModelView& view,
                                                 std::span<const int32_t> ids,
                                                 const GaussianSet* subset = nullptr) const;

  // Calls `use` with the model taken apart at these scales, see Decompose, and answers what it
  // does. The last few are kept; one is made once, however many ask, and other questions are
  // answered meanwhile.
  absl::Status WithDecomposition(std::span<const double> scales,
                                 absl::FunctionRef<absl::Status(const Decomposition&)> use) const;

 private:
  struct State;
  explicit Segmenter(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace pepeseg
