#include "core/query/view_features.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/device_lock.h"
#include "core/base/status_macros.h"
#include "kernels/buffer.h"
#include "kernels/half.h"

namespace pepeseg {
namespace {

int NumPositive(const Query& query) {
  return static_cast<int>(std::count(query.positive.begin(), query.positive.end(), 1));
}

// Returns the features of a query in the order that ops take, positive ones first: [features, 32].
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

PackedResult EmptyResult(const Query& query, const ModelView& target, const SegmentOptions& options,
                         const FeatureField& field) {
  PackedResult packed;
  SegmentResult& result = packed.result;
  result.view = target.name;
  result.width = target.camera.width;
  result.height = target.camera.height;
  result.scale = query.scale;
  result.scale_units = ScaleOfQuantile(field, query.scale);
  result.threshold = query.threshold;
  const int64_t num_pixels = int64_t{result.width} * result.height;
  packed.bits.resize(static_cast<size_t>(NumMaskWords(num_pixels)));
  if (options.want_similarity) result.similarity.resize(static_cast<size_t>(num_pixels));
  return packed;
}

ViewFeatures::ViewFeatures(Renderer& renderer, const Model& model, MapCounts* counts)
    : backend_(renderer.backend()),
      renderer_(renderer),
      model_(model),
      maps_(renderer, MapReserve(LargestView(model.views)), counts),
      sums_(backend_, kNumSegmentSums) {}

void ViewFeatures::ReleaseOversized() {
  if (mask_.capacity() <= WithReserve(MostPixels(LargestView(model_.views)))) return;
  mask_ = {};
  bits_ = {};
  refined_ = {};
  similarity_ = {};
}

absl::StatusOr<std::vector<float>> ViewFeatures::At(const ModelView& view,
                                                    std::span<const int32_t> pixels) {
  ASSIGN_OR_RETURN(const FeatureMap map, maps_.Get(view));
  const auto size = static_cast<int64_t>(pixels.size()) * kFeatureSize;
  if (!at_pixels_.Reserve(backend_, size)) {
    return absl::ResourceExhaustedError("no memory for the features of pixels");
  }
  // Gathered on the device, so that the host waits once.
  for (size_t i = 0; i < pixels.size(); ++i) {
    backend_.Copy(at_pixels_.span().data + static_cast<int64_t>(i) * kFeatureSize,
                  map.features.data + int64_t{pixels[i]} * kFeatureSize,
                  kFeatureSize * sizeof(Half));
  }
  std::vector<Half> halves(static_cast<size_t>(size));
  at_pixels_.Download(std::span<Half>(halves));
  std::vector<float> features(halves.size());
  std::transform(halves.begin(), halves.end(), features.begin(), FloatFromHalf);
  // A failed device leaves zeros, which would be taken for a pixel without a feature.
  RETURN_IF_ERROR(TakeStatus(backend_));
  return features;
}

Buffer<float> ViewFeatures::GatesAt(std::span<const double> scales) const {
  std::vector<float> psi(scales.size() * kFeatureSize);
  for (size_t i = 0; i < scales.size(); ++i) {
    PsiAt(model_.field.gate, static_cast<float>(scales[i]), &psi[i * kFeatureSize]);
  }
  return {backend_, std::span<const float>(psi)};
}

absl::StatusOr<std::vector<float>> ViewFeatures::Similarity(std::span<const float> features,
                                                            double scale, const ModelView& target) {
  const Buffer<float> queries(backend_, features);
  ASSIGN_OR_RETURN(const FeatureMap map, maps_.Get(target));
  const int64_t num_queries = queries.size() / kFeatureSize;
  const Buffer<float> psi = GatesAt({&scale, 1});
  Buffer<float> similarity(backend_, map.features.size / kFeatureSize * num_queries);
  if (similarity.empty()) {
    return absl::ResourceExhaustedError(
        absl::StrCat("no memory for the similarities to ", num_queries, " features"));
  }
  backend_.Similarity({map.features, psi.span(), queries.span(), kMinPixelNorm, similarity.span()});
  std::vector<float> values(similarity.size());
  similarity.Download(values);
  return values;
}

absl::Status ViewFeatures::Segment(const Query& query, std::span<const ModelView> targets,
                                   const SegmentOptions& options, std::span<PackedResult> results) {
  std::vector<float> inputs(kFeatureSize);
  PsiAt(model_.field.gate, static_cast<float>(query.scale), inputs.data());
  const std::vector<float> features = PositiveFirst(query);
  inputs.insert(inputs.end(), features.begin(), features.end());
  inputs_.Reserve(backend_, static_cast<int64_t>(inputs.size()));
  inputs_.Upload(inputs);
  for (size_t i = 0; i < targets.size(); ++i) {
    RETURN_IF_ERROR(SegmentView(query, targets[i], options, results[i]));
    RETURN_IF_ERROR(TakeStatus(backend_));
  }
  return absl::OkStatus();
}

absl::Status ViewFeatures::SegmentView(const Query& query, const ModelView& target,
                                       const SegmentOptions& options, PackedResult& packed) {
  ASSIGN_OR_RETURN(const FeatureMap map, maps_.Get(target));
  const int64_t num_pixels = map.features.size / kFeatureSize;
  const bool refine = options.refine_borders, with_similarity = refine || options.want_similarity;
  mask_.Reserve(backend_, num_pixels);
  bits_.Reserve(backend_, NumMaskWords(num_pixels));
  if (refine) refined_.Reserve(backend_, num_pixels);
  if (with_similarity) similarity_.Reserve(backend_, num_pixels);
  if (inputs_.empty() || mask_.empty() || bits_.empty() || (refine && refined_.empty()) ||
      (with_similarity && similarity_.empty())) {
    return absl::ResourceExhaustedError("no memory for the mask of a view");
  }
  const DeviceSpan<const float> inputs = std::as_const(inputs_).span();
  const DeviceSpan<const float> psi = inputs.Subspan(0, kFeatureSize);
  const auto threshold = static_cast<float>(query.threshold);
  backend_.SegmentPixels({.map = map.features,
                          .psi = psi,
                          .queries = inputs.Subspan(kFeatureSize, inputs.size - kFeatureSize),
                          .num_positive = NumPositive(query),
                          .min_norm = kMinPixelNorm,
                          .threshold = threshold,
                          .mask = mask_.span(),
                          .similarity = with_similarity ? similarity_.span() : DeviceSpan<float>(),
                          .sums = sums_.span()});
  if (refine) {
    backend_.RefineBorder({.width = target.camera.width,
                           .height = target.camera.height,
                           .map = map.features,
                           .color = map.color,
                           .psi = psi,
                           .similarity = std::as_const(similarity_).span(),
                           .threshold = threshold,
                           .mask = std::as_const(mask_).span(),
                           .refined = refined_.span(),
                           .sums = sums_.span()});
  }
  backend_.PackMask({std::as_const(refine ? refined_ : mask_).span(), bits_.span()});
  bits_.Download(std::span<uint32_t>(packed.bits));
  SegmentResult& result = packed.result;
  int64_t sum[kNumSegmentSums] = {};
  sums_.Download(std::span<int64_t>(sum));
  if (sum[kNumInside] > 0) {
    result.score = static_cast<double>(sum[kSimilaritySum]) /
                   (static_cast<double>(sum[kNumInside]) * double{kSimilarityUnit});
  }
  result.area = sum[kNumInside];
  if (options.want_similarity) similarity_.Download(std::span<float>(result.similarity));
  return absl::OkStatus();
}

absl::StatusOr<LevelCounts> ViewFeatures::CountLevels(const Query& query,
                                                      std::span<const double> scales,
                                                      std::span<const float> thresholds,
                                                      const ModelView& target) {
  ASSIGN_OR_RETURN(const FeatureMap map, maps_.Get(target));
  LevelCounts counts = {static_cast<int>(scales.size()), static_cast<int>(thresholds.size()), {}};
  const size_t side = thresholds.size() + 1;
  counts.pixels.resize(scales.size() * scales.size() * side * side);
  const std::vector<float> features = PositiveFirst(query);
  const Buffer<float> queries(backend_, std::span<const float>(features)), psi = GatesAt(scales);
  const Buffer<float> over(backend_, thresholds);
  Buffer<int32_t> overlaps(backend_, static_cast<int64_t>(counts.pixels.size()));
  Buffer<uint8_t> levels(backend_, map.features.size / kFeatureSize * counts.num_scales);
  if (levels.empty() || overlaps.empty()) {
    return absl::ResourceExhaustedError("no memory for the levels of a view");
  }
  backend_.LevelOverlaps({.map = map.features,
                          .psi = psi.span(),
                          .queries = queries.span(),
                          .num_positive = NumPositive(query),
                          .thresholds = over.span(),
                          .min_norm = kMinPixelNorm,
                          .levels = levels.span(),
                          .overlaps = overlaps.span()});
  overlaps.Download(std::span<int32_t>(counts.pixels));
  RETURN_IF_ERROR(TakeStatus(backend_));
  return counts;
}

absl::StatusOr<std::vector<Half>> ViewFeatures::Download(const ModelView& view,
                                                         const GaussianSet* subset) {
  Buffer<Half> of_subset;
  DeviceSpan<const Half> pixels;
  if (subset == nullptr) {
    ASSIGN_OR_RETURN(const FeatureMap whole, maps_.Get(view));
    pixels = whole.features;
  } else {
    const int64_t size = int64_t{view.camera.width} * view.camera.height * kFeatureSize;
    of_subset = Buffer<Half>(backend_, size);
    if (of_subset.empty()) return absl::ResourceExhaustedError("no memory for a feature map");
    renderer_.Features(view, of_subset.span(), {}, subset);
    pixels = of_subset.span();
  }
  std::vector<Half> map(static_cast<size_t>(pixels.size));
  backend_.CopyToHost(map.data(), pixels.data, map.size() * sizeof(Half));
  return map;
}

}  // namespace pepeseg
