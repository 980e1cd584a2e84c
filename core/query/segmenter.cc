#include "core/query/segmenter.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/backend_turn.h"
#include "core/query/check_prompt.h"
#include "core/query/decompositions.h"
#include "core/query/feature_maps.h"
#include "core/query/feature_palette.h"
#include "core/status_macros.h"
#include "kernels/cpu/half.h"
#include "kernels/math/gate.h"
#include "kernels/scratch_bytes.h"

namespace pepeseg {
namespace {

// Features have norm 1, so a pixel's is at most its accumulated alpha.
constexpr double kMinClickedNorm = 0.05;
// A pixel whose feature is shorter is in no mask: Gaussians that are hardly there would stand for
// the nothing behind them. Inside a thing the length is near 1, on the border of two about 0.7.
constexpr float kMinPixelNorm = 0.4f;

absl::Status CheckModel(const Model& model) {
  const size_t num_features = static_cast<size_t>(model.gaussians.count) * kFeatureSize;
  if (model.gaussians.count == 0) return absl::InvalidArgumentError("the model has no Gaussian");
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

double NormOf(const float* feature) {
  double squares = 0;
  for (int k = 0; k < kFeatureSize; ++k) squares += double{feature[k]} * feature[k];
  return std::sqrt(squares);
}

// x, y, width and height of what is set; zeros where nothing is.
void FindBox(std::span<const uint8_t> mask, int width, int box[4]) {
  const int height = static_cast<int>(mask.size()) / width;
  int min_x = width, max_x = -1, min_y = height, max_y = -1;
  for (int y = 0; y < height; ++y) {
    const std::span<const uint8_t> row = mask.subspan(static_cast<size_t>(y) * width, width);
    const auto first = std::find(row.begin(), row.end(), uint8_t{1});
    if (first == row.end()) continue;
    const auto last = std::find(row.rbegin(), row.rend(), uint8_t{1});
    min_x = std::min(min_x, static_cast<int>(first - row.begin()));
    max_x = std::max(max_x, width - 1 - static_cast<int>(last - row.rbegin()));
    min_y = std::min(min_y, y);
    max_y = y;
  }
  if (max_y < 0) return;
  const int found[] = {min_x, min_y, max_x - min_x + 1, max_y - min_y + 1};
  std::copy(std::begin(found), std::end(found), box);
}

// Features of a query, the positive ones first, as SegmentPixels takes them.
std::vector<float> PositiveFirst(const Query& query) {
  std::vector<float> features;
  features.reserve(query.features.size());
  for (const bool positive : {true, false}) {
    for (size_t i = 0; i < query.positive.size(); ++i) {
      if ((query.positive[i] != 0) != positive) continue;
      const auto first = query.features.begin() + static_cast<int64_t>(i) * kFeatureSize;
      features.insert(features.end(), first, first + kFeatureSize);
    }
  }
  return features;
}

}  // namespace

// All but the model and the decompositions is used in a turn of the backend.
struct Segmenter::State {
  State(Backend& b, Model m)
      : backend(b),
        model(std::move(m)),
        renderer(b, model),
        maps(renderer, MapReserve(LargestView(model.views))),
        sums(b, kNumSegmentSums) {}

  // InTurn, and what a view larger than memory is set aside for took is given back.
  template <typename Work>
  auto Turn(Work work) {
    return InTurn(backend, [&] {
      auto answer = work();
      renderer.ReleaseOversized();
      if (mask.capacity() > WithReserve(MostPixels(LargestView(model.views)))) {
        mask = {};
        similarity = {};
      }
      return answer;
    });
  }

  // [pixels, 32] as rendered, not gated.
  absl::StatusOr<std::vector<float>> FeaturesAt(const ModelView& view,
                                                std::span<const int32_t> pixels);
  Buffer<float> GateOf(double scale) const;  // psi(scale): [32]
  // [queries, height, width] of `queries` [queries, 32], on the backend.
  absl::StatusOr<Buffer<float>> SimilarityTo(const Buffer<float>& queries, double scale,
                                             const ModelView& target);
  absl::StatusOr<SegmentResult> SegmentView(const Query& query, const Buffer<float>& queries,
                                            const ModelView& target, bool want_similarity);
  // [height * width, 32]; only maps of all Gaussians are kept.
  absl::StatusOr<std::vector<Half>> DownloadFeatures(const ModelView& view,
                                                     const GaussianSet* subset);

  Backend& backend;
  const Model model;
  ModelRenderer renderer;
  FeatureMaps maps;
  Buffer<uint8_t> mask;
  Buffer<float> similarity;
  Buffer<int64_t> sums;
  Decompositions decompositions;  // has its own mutex
};

absl::StatusOr<std::vector<float>> Segmenter::State::FeaturesAt(const ModelView& view,
                                                                std::span<const int32_t> pixels) {
  ASSIGN_OR_RETURN(const DeviceSpan<const Half> map, maps.Get(view));
  std::vector<float> features;
  features.reserve(pixels.size() * kFeatureSize);
  for (const int32_t pixel : pixels) {
    Half feature[kFeatureSize];
    backend.CopyToHost(feature, map.data + int64_t{pixel} * kFeatureSize, sizeof(feature));
    for (const Half half : feature) features.push_back(FloatFromHalf(half));
  }
  // A device that failed leaves zeros, which would read as nothing there.
  RETURN_IF_ERROR(TakeStatus(backend));
  return features;
}

Buffer<float> Segmenter::State::GateOf(double scale) const {
  std::vector<float> psi(kFeatureSize);
  GateAt(model.field.gate.data(), kFeatureSize, static_cast<float>(scale), psi.data());
  return {backend, std::span<const float>(psi)};
}

absl::StatusOr<Buffer<float>> Segmenter::State::SimilarityTo(const Buffer<float>& queries,
                                                             double scale,
                                                             const ModelView& target) {
  ASSIGN_OR_RETURN(const DeviceSpan<const Half> map, maps.Get(target));
  const int64_t num_queries = queries.size() / kFeatureSize;
  const Buffer<float> psi = GateOf(scale);
  Buffer<float> similarity(backend, map.size / kFeatureSize * num_queries);
  if (similarity.empty()) {
    return absl::ResourceExhaustedError(
        absl::StrCat("no memory for the similarities to ", num_queries, " features"));
  }
  backend.Similarity({map, psi.span(), queries.span(), kMinPixelNorm, similarity.span()});
  return similarity;
}

absl::StatusOr<SegmentResult> Segmenter::State::SegmentView(const Query& query,
                                                            const Buffer<float>& queries,
                                                            const ModelView& target,
                                                            bool want_similarity) {
  ASSIGN_OR_RETURN(const DeviceSpan<const Half> map, maps.Get(target));
  const Buffer<float> psi = GateOf(query.scale);
  const int64_t num_pixels = map.size / kFeatureSize;
  mask.Reserve(backend, num_pixels);
  if (want_similarity) similarity.Reserve(backend, num_pixels);
  if (mask.empty() || (want_similarity && similarity.empty())) {
    return absl::ResourceExhaustedError("no memory for the mask of a view");
  }
  backend.SegmentPixels({.map = map,
                         .psi = psi.span(),
                         .queries = queries.span(),
                         .num_positive = static_cast<int>(
                             std::count(query.positive.begin(), query.positive.end(), 1)),
                         .min_norm = kMinPixelNorm,
                         .threshold = static_cast<float>(query.threshold),
                         .mask = mask.span(),
                         .similarity = want_similarity ? similarity.span() : DeviceSpan<float>(),
                         .sums = sums.span()});
  SegmentResult result;
  result.width = target.camera.width;
  result.height = target.camera.height;
  result.scale = query.scale;
  result.scale_units = ScaleOfQuantile(model.field, query.scale);
  result.threshold = query.threshold;
  result.mask.pixels.resize(num_pixels);
  mask.Download(std::span<uint8_t>(result.mask.pixels));
  int64_t sum[kNumSegmentSums] = {};
  sums.Download(std::span<int64_t>(sum));
  if (sum[kNumInside] > 0) {
    result.score = static_cast<double>(sum[kSimilaritySum]) /
                   (static_cast<double>(sum[kNumInside]) * double{kSimilarityUnit});
    FindBox(result.mask.pixels, result.width, result.box);
  }
  result.area = sum[kNumInside];
  if (want_similarity) {
    result.similarity.resize(num_pixels);
    similarity.Download(std::span<float>(result.similarity));
  }
  return result;
}

absl::StatusOr<std::vector<Half>> Segmenter::State::DownloadFeatures(const ModelView& view,
                                                                     const GaussianSet* subset) {
  Buffer<Half> of_subset;
  DeviceSpan<const Half> pixels;
  if (subset == nullptr) {
    ASSIGN_OR_RETURN(pixels, maps.Get(view));
  } else {
    const int64_t size = int64_t{view.camera.width} * view.camera.height * kFeatureSize;
    of_subset = Buffer<Half>(backend, size);
    if (of_subset.empty()) return absl::ResourceExhaustedError("no memory for a feature map");
    RETURN_IF_ERROR(renderer.Features(view, of_subset.span(), subset));
    pixels = of_subset.span();
  }
  std::vector<Half> map(static_cast<size_t>(pixels.size));
  backend.CopyToHost(map.data(), pixels.data, map.size() * sizeof(Half));
  return map;
}

absl::StatusOr<std::unique_ptr<Segmenter>> Segmenter::Create(Backend& backend, Model model) {
  RETURN_IF_ERROR(CheckModel(model));
  return InTurn(backend, [&]() -> absl::StatusOr<std::unique_ptr<Segmenter>> {
    return std::unique_ptr<Segmenter>(
        new Segmenter(std::make_unique<State>(backend, std::move(model))));
  });
}

Segmenter::Segmenter(std::unique_ptr<State> state) : state_(std::move(state)) {}
Segmenter::~Segmenter() = default;

const Model& Segmenter::model() const { return state_->model; }

int64_t Segmenter::num_renders() const { return state_->maps.num_renders(); }
int64_t Segmenter::num_maps() const { return state_->maps.num_maps(); }

absl::StatusOr<Image> Segmenter::RenderColor(const ModelView& view,
                                             const GaussianSet* subset) const {
  RETURN_IF_ERROR(CheckView(view));
  RETURN_IF_ERROR(CheckSubset(subset, model()));
  return state_->Turn([&] { return state_->renderer.Color(view, subset); });
}

absl::StatusOr<PixelRows> Segmenter::Rows(const ModelView& view,
                                          std::span<const int32_t> pixels) const {
  RETURN_IF_ERROR(CheckView(view));
  return state_->Turn([&] { return state_->renderer.Rows(view, pixels); });
}

absl::StatusOr<std::vector<SegmentResult>> Segmenter::Segment(const Query& query,
                                                              std::span<const ModelView> targets,
                                                              bool want_similarity) const {
  RETURN_IF_ERROR(CheckQuery(query));
  for (const ModelView& target : targets) RETURN_IF_ERROR(CheckView(target));
  const std::vector<float> features = PositiveFirst(query);
  return state_->Turn([&]() -> absl::StatusOr<std::vector<SegmentResult>> {
    const Buffer<float> queries(state_->backend, std::span<const float>(features));
    std::vector<SegmentResult> results;
    results.reserve(targets.size());
    for (const ModelView& target : targets) {
      ASSIGN_OR_RETURN(SegmentResult result,
                       state_->SegmentView(query, queries, target, want_similarity));
      RETURN_IF_ERROR(TakeStatus(state_->backend));
      results.push_back(std::move(result));
    }
    return results;
  });
}

absl::StatusOr<std::vector<float>> Segmenter::PointFeatures(
    const ModelView& view, std::span<const PointPrompt> points) const {
  RETURN_IF_ERROR(CheckPoints(view, points));
  std::vector<int32_t> pixels;
  pixels.reserve(points.size());
  for (const PointPrompt& point : points) {
    pixels.push_back(static_cast<int32_t>(point.y) * view.camera.width +
                     static_cast<int32_t>(point.x));
  }
  ASSIGN_OR_RETURN(std::vector<float> features, PixelFeatures(view, pixels));
  for (size_t i = 0; i < points.size(); ++i) {
    if (NormOf(&features[i * kFeatureSize]) >= kMinClickedNorm) continue;
    return absl::InvalidArgumentError(absl::StrCat(
        "point ", i, " at (", points[i].x, ", ", points[i].y,
        "): nothing with a feature is rendered there; click where the model shows an object that a "
        "mask covered in training"));
  }
  return features;
}

absl::StatusOr<std::vector<float>> Segmenter::PixelFeatures(const ModelView& view,
                                                            std::span<const int32_t> pixels) const {
  RETURN_IF_ERROR(CheckView(view));
  return state_->Turn([&] { return state_->FeaturesAt(view, pixels); });
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
  return state_->Turn([&]() -> absl::StatusOr<std::vector<float>> {
    const Buffer<float> queries(state_->backend, features);
    ASSIGN_OR_RETURN(const Buffer<float> similarity, state_->SimilarityTo(queries, scale, target));
    std::vector<float> values(similarity.size());
    similarity.Download(values);
    return values;
  });
}

absl::StatusOr<std::vector<float>> Segmenter::RenderDepth(const ModelView& view,
                                                          const GaussianSet* subset) const {
  RETURN_IF_ERROR(CheckView(view));
  RETURN_IF_ERROR(CheckSubset(subset, model()));
  return state_->Turn([&] { return state_->renderer.Depth(view, subset); });
}

absl::StatusOr<Image> Segmenter::RenderFeatures(const ModelView& view, double scale,
                                                const GaussianSet* subset) const {
  RETURN_IF_ERROR(CheckView(view));
  RETURN_IF_ERROR(CheckScale(scale));
  RETURN_IF_ERROR(CheckSubset(subset, model()));
  ASSIGN_OR_RETURN(const std::vector<Half> map,
                   state_->Turn([&] { return state_->DownloadFeatures(view, subset); }));
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
  return pepeseg::RenderIds(view, ids, [&](const ModelView& of, std::span<const int32_t> pixels) {
    return state_->Turn([&] { return state_->renderer.Rows(of, pixels, subset); });
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
