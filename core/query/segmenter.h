#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/statusor.h"
#include "core/query/decomposition.h"
#include "core/query/prompt.h"
#include "core/query/view_features.h"
#include "core/render/feature_maps.h"
#include "core/render/renderer.h"
#include "core/scene/capture.h"
#include "core/scene/model.h"
#include "kernels/backend.h"

namespace pepeseg {

// Answers queries on a resident model. Keeps the model in device memory and caches feature maps of
// views. Thread safe. The backend must outlive the segmenter. All segmenters of a backend share its
// device lock, so that an error of the device belongs to the query that caused it. Any call may
// return RESOURCE_EXHAUSTED if the device lacks the memory for it, after which other calls still
// work, or INTERNAL if the device is no longer usable.
class Segmenter {
 public:
  // Loads a model onto the device. A model without a field (trained without masks) is accepted, but
  // nothing is found in it. Adds the segmenter's feature maps to `counts` if it is not null.
  // Returns INVALID_ARGUMENT if the model has no Gaussian, or not one feature for each Gaussian.
  static absl::StatusOr<std::unique_ptr<Segmenter>> Create(Backend& backend, Model model,
                                                           MapCounts* counts = nullptr);
  ~Segmenter();

  const Model& model() const;
  // Returns the backend, for work on the same device under the device lock (WithDeviceLock).
  Backend& backend() const;
  // Returns whether the model has a trained feature field.
  bool has_features() const;
  // Return how many feature maps were rendered so far, and how many are cached now. A new scale or
  // threshold renders none. Never block on a query.
  int64_t num_renders() const;
  int64_t num_maps() const;

  // Returns the RGB colour of a view. A `subset` renders only its Gaussians, as if there were no
  // others; INVALID_ARGUMENT if it is for another number of Gaussians.
  absl::StatusOr<Image> RenderColor(const ModelView& view,
                                    const GaussianSet* subset = nullptr) const;
  // Returns the blend rows of pixels, y * width + x, of a view: which Gaussians contribute and how
  // much. `subset`: as in RenderColor.
  absl::StatusOr<PixelRows> Rows(const ModelView& view, std::span<const int32_t> pixels,
                                 const GaussianSet* subset = nullptr) const;

  // Returns one result per target view, in order. Returns INVALID_ARGUMENT if the scale or
  // threshold is out of range or no feature is positive.
  absl::StatusOr<std::vector<SegmentResult>> Segment(const Query& query,
                                                     std::span<const ModelView> targets,
                                                     const SegmentOptions& options = {}) const;
  // Returns one result per query in one view, in order, while it holds the device lock once.
  absl::StatusOr<std::vector<SegmentResult>> Segment(std::span<const Query> queries,
                                                     const ModelView& target,
                                                     const SegmentOptions& options = {}) const;

  // Returns the features at points of a view as rendered, not gated by a scale: [points, 32].
  // Returns INVALID_ARGUMENT if a point is outside the view or no point is positive, and
  // NothingThereError if no feature is rendered at a point.
  absl::StatusOr<std::vector<float>> PointFeatures(const ModelView& view,
                                                   std::span<const PointPrompt> points) const;
  // Returns the features at any pixels, y * width + x, as rendered: [pixels, 32]. Where nothing is
  // rendered the feature is about 0.
  absl::StatusOr<std::vector<float>> PixelFeatures(const ModelView& view,
                                                   std::span<const int32_t> pixels) const;
  // Returns the similarity (cosine) of each pixel of the target to each feature [features, 32] at a
  // quantile scale: [features, height, width]. Returns INVALID_ARGUMENT if the scale is out of
  // range or there are no features.
  absl::StatusOr<std::vector<float>> Similarity(std::span<const float> features, double scale,
                                                const ModelView& target) const;

  // Returns how the masks of a query's features in the target overlap at all pairs of the given
  // quantile scales and thresholds, both ascending. The query's own scale and threshold are not
  // used. Returns INVALID_ARGUMENT for the reasons of Segment, and unless there are 1 to
  // kMaxLevelScales scales and 1 to kMaxThresholds thresholds.
  absl::StatusOr<LevelCounts> CountLevels(const Query& query, std::span<const double> scales,
                                          std::span<const float> thresholds,
                                          const ModelView& target) const;

  // Returns the depth of a view, see Renderer::Depth. `subset`: as in RenderColor, also below.
  absl::StatusOr<std::vector<float>> RenderDepth(const ModelView& view,
                                                 const GaussianSet* subset = nullptr) const;
  // Returns a view's features at a quantile scale as colours, see FeaturePalette. Returns
  // INVALID_ARGUMENT if the scale is out of range.
  absl::StatusOr<Image> RenderFeatures(const ModelView& view, double scale,
                                       const GaussianSet* subset = nullptr) const;
  // Returns the image of per-Gaussian `ids`, see IdsOfRows. Returns INVALID_ARGUMENT
  // unless there is one id for each Gaussian.
  absl::StatusOr<std::vector<int32_t>> RenderIds(const ModelView& view,
                                                 std::span<const int32_t> ids,
                                                 const GaussianSet* subset = nullptr) const;

  // Calls `use` with the decomposition of the model at these scales, see Decompose, and returns its
  // status. The most recent decompositions are cached. Concurrent callers with the same scales
  // share one computation; other queries are answered meanwhile.
  absl::Status WithDecomposition(std::span<const double> scales,
                                 absl::FunctionRef<absl::Status(const Decomposition&)> use) const;

 private:
  struct State;
  explicit Segmenter(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace pepeseg
