#include "core/query/segmenter.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/device_lock.h"
#include "core/base/status_macros.h"
#include "core/query/decompose.h"
#include "core/query/mask_geometry.h"
#include "core/query/packed_mask.h"
#include "core/query/prompt.h"
#include "core/render/feature_maps.h"
#include "core/render/renderer.h"

namespace pepeseg {
namespace {

// Minimum norm of a clicked pixel's feature. A Gaussian's feature has norm 1, so the norm at a
// pixel is at most its accumulated alpha.
constexpr double kMinClickedNorm = 0.05;

absl::Status CheckModel(const Model& model) {
  const size_t num_features = static_cast<size_t>(model.gaussians.count) * kFeatureSize;
  if (model.gaussians.count == 0) return absl::InvalidArgumentError("the model has no Gaussian");
  const size_t num_confidences = model.field.confidence.size();
  if (num_confidences != 0 && num_confidences * kFeatureSize != num_features) {
    return absl::InvalidArgumentError(absl::StrCat("the model has ", num_confidences,
                                                   " confidences for its ", model.gaussians.count,
                                                   " Gaussians"));
  }
  if (model.field.features.size() == num_features) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("the model has ", model.field.features.size(),
                                                 " feature values, must be ", num_features,
                                                 " for its ", model.gaussians.count, " Gaussians"));
}

absl::Status CheckSubset(const GaussianSet* subset, const Model& model) {
  const auto count = static_cast<size_t>(model.gaussians.count);
  if (subset == nullptr || subset->member.size() == count) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("the subset is of ", subset->member.size(),
                                                 " Gaussians, the model has ", count));
}

// Unpacks the masks and finds their boxes. Nothing of this needs the device.
std::vector<SegmentResult> Unpacked(std::vector<PackedResult> packed) {
  std::vector<SegmentResult> results;
  results.reserve(packed.size());
  for (PackedResult& one : packed) {
    SegmentResult& result = one.result;
    result.mask.pixels.resize(static_cast<size_t>(result.width) * result.height);
    UnpackMask(one.bits, result.mask.pixels);
    if (result.area > 0) FindBox(result.mask.pixels, result.width, result.box);
    results.push_back(std::move(result));
  }
  return results;
}

}  // namespace

// Everything except `model` and `decompositions` may be used only inside WithDevice, which holds
// the device lock.
struct Segmenter::State {
  State(Backend& b, Model m, MapCounts* counts)
      : backend(b), model(std::move(m)), renderer(b, model), features(renderer, model, counts) {}

  // Runs `work` under the device lock and returns its result. Afterwards frees what a view larger
  // than every view of the model took.
  template <typename Work>
  auto WithDevice(Work work) {
    return WithDeviceLock(backend, [&] {
      auto answer = work();
      renderer.ReleaseOversized();
      features.ReleaseOversized();
      return answer;
    });
  }

  Backend& backend;
  const Model model;
  Renderer renderer;
  ViewFeatures features;
  Decompositions decompositions;  // has its own mutex
};

absl::StatusOr<std::unique_ptr<Segmenter>> Segmenter::Create(Backend& backend, Model model,
                                                             MapCounts* counts) {
  if (model.field.empty()) {
    model.field.features.assign(static_cast<size_t>(model.gaussians.count) * kFeatureSize, 0);
  }
  RETURN_IF_ERROR(CheckModel(model));
  return WithDeviceLock(backend, [&]() -> absl::StatusOr<std::unique_ptr<Segmenter>> {
    return std::unique_ptr<Segmenter>(
        new Segmenter(std::make_unique<State>(backend, std::move(model), counts)));
  });
}

Segmenter::Segmenter(std::unique_ptr<State> state) : state_(std::move(state)) {}
Segmenter::~Segmenter() = default;

const Model& Segmenter::model() const { return state_->model; }
Backend& Segmenter::backend() const { return state_->backend; }

// A trained field always has scale quantiles.
bool Segmenter::has_features() const { return !state_->model.field.scale_quantiles.empty(); }

int64_t Segmenter::num_renders() const { return state_->features.maps().num_renders(); }
int64_t Segmenter::num_maps() const { return state_->features.maps().num_maps(); }

absl::StatusOr<std::vector<SegmentResult>> Segmenter::Segment(const Query& query,
                                                              std::span<const ModelView> targets,
                                                              const SegmentOptions& options) const {
  RETURN_IF_ERROR(CheckQuery(query));
  for (const ModelView& target : targets) RETURN_IF_ERROR(CheckView(target));
  std::vector<PackedResult> results;
  results.reserve(targets.size());
  for (const ModelView& target : targets) {
    results.push_back(EmptyResult(query, target, options, model().field));
  }
  RETURN_IF_ERROR(state_->WithDevice(
      [&] { return state_->features.Segment(query, targets, options, results); }));
  return Unpacked(std::move(results));
}

absl::StatusOr<std::vector<SegmentResult>> Segmenter::Segment(std::span<const Query> queries,
                                                              const ModelView& target,
                                                              const SegmentOptions& options) const {
  RETURN_IF_ERROR(CheckView(target));
  for (const Query& query : queries) RETURN_IF_ERROR(CheckQuery(query));
  std::vector<PackedResult> results;
  results.reserve(queries.size());
  for (const Query& query : queries) {
    results.push_back(EmptyResult(query, target, options, model().field));
  }
  RETURN_IF_ERROR(state_->WithDevice([&]() -> absl::Status {
    for (size_t i = 0; i < queries.size(); ++i) {
      RETURN_IF_ERROR(
          state_->features.Segment(queries[i], {&target, 1}, options, {&results[i], 1}));
    }
    return absl::OkStatus();
  }));
  return Unpacked(std::move(results));
}

absl::StatusOr<std::vector<float>> Segmenter::PointFeatures(
    const ModelView& view, std::span<const PointPrompt> points) const {
  RETURN_IF_ERROR(CheckView(view));
  RETURN_IF_ERROR(CheckPoints(ImageOf(view), points));
  std::vector<int32_t> pixels;
  pixels.reserve(points.size());
  for (const PointPrompt& point : points) {
    pixels.push_back(static_cast<int32_t>(point.y) * view.camera.width +
                     static_cast<int32_t>(point.x));
  }
  ASSIGN_OR_RETURN(std::vector<float> features, PixelFeatures(view, pixels));
  for (size_t i = 0; i < points.size(); ++i) {
    if (FeatureNorm(&features[i * kFeatureSize]) >= kMinClickedNorm) continue;
    // The message omits the position: the request may count the photograph's pixels instead of the
    // view's.
    return NothingThereError(absl::StrCat(
        "point ", i, ": nothing with a feature is rendered there; click where the model shows an ",
        "object that a mask covered in training"));
  }
  return features;
}

absl::StatusOr<std::vector<float>> Segmenter::PixelFeatures(const ModelView& view,
                                                            std::span<const int32_t> pixels) const {
  RETURN_IF_ERROR(CheckView(view));
  return state_->WithDevice([&] { return state_->features.At(view, pixels); });
}

absl::StatusOr<std::vector<float>> Segmenter::Similarity(std::span<const float> features,
                                                         double scale,
                                                         const ModelView& target) const {
  if (features.empty() || features.size() % kFeatureSize != 0) {
    return absl::InvalidArgumentError(absl::StrCat(
        features.size(), " feature values, must be a multiple of ", kFeatureSize, " and not 0"));
  }
  RETURN_IF_ERROR(CheckScale(scale));
  RETURN_IF_ERROR(CheckView(target));
  return state_->WithDevice([&] { return state_->features.Similarity(features, scale, target); });
}

absl::StatusOr<LevelCounts> Segmenter::CountLevels(const Query& query,
                                                   std::span<const double> scales,
                                                   std::span<const float> thresholds,
                                                   const ModelView& target) const {
  RETURN_IF_ERROR(CheckQuery(query));
  RETURN_IF_ERROR(CheckView(target));
  for (const double scale : scales) RETURN_IF_ERROR(CheckScale(scale));
  if (scales.empty() || scales.size() > kMaxLevelScales || thresholds.empty() ||
      thresholds.size() > kMaxThresholds) {
    return absl::InvalidArgumentError(absl::StrCat(scales.size(), " scales and ", thresholds.size(),
                                                   " thresholds to compare, allowed are 1..",
                                                   kMaxLevelScales, " and 1..", kMaxThresholds));
  }
  return state_->WithDevice(
      [&] { return state_->features.CountLevels(query, scales, thresholds, target); });
}

absl::StatusOr<Image> Segmenter::RenderColor(const ModelView& view,
                                             const GaussianSet* subset) const {
  RETURN_IF_ERROR(CheckView(view));
  RETURN_IF_ERROR(CheckSubset(subset, model()));
  return state_->WithDevice(
      [&]() -> absl::StatusOr<Image> { return state_->renderer.Color(view, subset); });
}

absl::StatusOr<PixelRows> Segmenter::Rows(const ModelView& view, std::span<const int32_t> pixels,
                                          const GaussianSet* subset) const {
  RETURN_IF_ERROR(CheckView(view));
  RETURN_IF_ERROR(CheckSubset(subset, model()));
  return state_->WithDevice([&]() -> absl::StatusOr<PixelRows> {
    return ToHost(state_->renderer.Rows(view, pixels, subset));
  });
}

absl::StatusOr<std::vector<float>> Segmenter::RenderDepth(const ModelView& view,
                                                          const GaussianSet* subset) const {
  RETURN_IF_ERROR(CheckView(view));
  RETURN_IF_ERROR(CheckSubset(subset, model()));
  return state_->WithDevice(
      [&]() -> absl::StatusOr<std::vector<float>> { return state_->renderer.Depth(view, subset); });
}

absl::StatusOr<Image> Segmenter::RenderFeatures(const ModelView& view, double scale,
                                                const GaussianSet* subset) const {
  RETURN_IF_ERROR(CheckView(view));
  RETURN_IF_ERROR(CheckScale(scale));
  RETURN_IF_ERROR(CheckSubset(subset, model()));
  ASSIGN_OR_RETURN(const std::vector<Half> map,
                   state_->WithDevice([&] { return state_->features.Download(view, subset); }));
  return PaintFeatures(MakeFeaturePalette(model().field, scale), map, view.camera);
}

absl::StatusOr<std::vector<int32_t>> Segmenter::RenderIds(const ModelView& view,
                                                          std::span<const int32_t> ids,
                                                          const GaussianSet* subset) const {
  RETURN_IF_ERROR(CheckView(view));
  RETURN_IF_ERROR(CheckSubset(subset, model()));
  if (static_cast<int64_t>(ids.size()) != model().gaussians.count) {
    return absl::InvalidArgumentError(
        absl::StrCat(ids.size(), " ids, the model has ", model().gaussians.count, " Gaussians"));
  }
  return state_->WithDevice([&]() -> absl::StatusOr<std::vector<int32_t>> {
    return state_->renderer.Ids(view, ids, subset);
  });
}

absl::Status Segmenter::WithDecomposition(
    std::span<const double> scales,
    absl::FunctionRef<absl::Status(const Decomposition&)> use) const {
  const auto rows = [this](const ModelView& view, std::span<const int32_t> pixels) {
    return Rows(view, pixels);
  };
  return state_->decompositions.With(
      scales, [&] { return Decompose(state_->backend, model(), scales, rows); }, use);
}

}  // namespace pepeseg
