#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/scene/capture.h"
#include "core/scene/model.h"
#include "kernels/backend.h"

namespace pepeseg {

struct PointPrompt {
  double x = 0, y = 0;  // pixels of the prompt's view, in [0, width) x [0, height)
  bool positive = true;
};

struct SegmentResult {
  BinaryMask mask;  // of the target view
  int width = 0, height = 0;
  double score = 0;               // mean similarity inside the mask, cosine
  double scale = 0;               // quantile scale used, [0, 1]
  double scale_units = 0;         // the same in scene units
  double threshold = 0;           // cosine used
  int box[4] = {};                // x, y, width, height of the mask; zeros when it is empty
  std::vector<float> similarity;  // [height, width], on request
};

// Queries on a resident model: keeps the model in backend memory and a cache of view feature maps.
// Thread safe. The backend must outlive it.
class Segmenter {
 public:
  static absl::StatusOr<std::unique_ptr<Segmenter>> Create(Backend& backend, Model model);
  ~Segmenter();

  const Model& model() const;

  // Colour of a view, RGB.
  absl::StatusOr<Image> RenderColor(const ModelView& view) const;

  struct Prompt {
    ModelView view;                   // where the points are
    std::vector<PointPrompt> points;  // at least one positive
    double scale = 0.5;               // quantile, [0, 1]
    double threshold = 0.75;          // cosine, [-1, 1]
  };
  // One result per target view, in order. A pixel is in when its best positive similarity is over
  // the threshold and over its best negative one. INVALID_ARGUMENT: a point outside its view, a
  // scale or threshold out of range, no positive point, a point on which nothing was rendered.
  absl::StatusOr<std::vector<SegmentResult>> Segment(const Prompt& prompt,
                                                     std::span<const ModelView> targets,
                                                     bool want_similarity = false) const;

  // The two halves of Segment, for who asks the same at many scales and thresholds.
  // What points of a view mean, before a scale is chosen: [points, 32] features as rendered. Errors
  // as Segment's.
  absl::StatusOr<std::vector<float>> PointFeatures(const ModelView& view,
                                                   std::span<const PointPrompt> points) const;
  // Similarity, cosine, of each pixel of the target to each of such features at a quantile scale:
  // [features, height, width]. INVALID_ARGUMENT: a scale out of range, no features.
  absl::StatusOr<std::vector<float>> Similarity(std::span<const float> features, double scale,
                                                const ModelView& target) const;

 private:
  struct State;
  explicit Segmenter(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace pepeseg
