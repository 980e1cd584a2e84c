#include "core/query/view_features.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/backend_turn.h"
#include "core/base/status_macros.h"
#include "core/query/border.h"
#include "core/query/mask_geometry.h"
#include "kernels/buffer.h"
#include "kernels/half.h"

namespace pepeseg {
namespace {

int NumPositive(const Query& query) {
  return static_cast<int>(std::count(query.positive.begin(), query.positive.end(), 1));
}

// Computes area, box and score from mask and similarity.
void Remeasure(SegmentResult& result) {
  double sum = 0;
  result.area = 0;
  for (size_t i = 0; i < result.mask.pixels.size(); ++i) {
    if (result.mask.pixels[i] == 0) continue;
    ++result.area;
    sum += double{result.similarity[i]};
  }
  result.score = result.area > 0 ? sum / static_cast<double>(result.area) : 0;
  FindBox(result.mask.pixels, result.width, result.box);
}

}  // namespace

ViewFeatures::ViewFeatures(Renderer& renderer, const Model& model, MapCounts* counts)
    : backend_(renderer.backend()),
      renderer_(renderer),
      model_(model),
      maps_(renderer, MapReserve(LargestView(model.views)), counts),
      sums_(backend_, kNumSegmentSums) {}

void ViewFeatures::ReleaseOversized() {
  if (mask_.capacity() <= WithReserve(MostPixels(LargestView(model_.views)))) return;
  mask_ = {};
  similarity_ = {};
  color_ = {};
  color_key_.clear();
}

absl::StatusOr<std::vector<float>> ViewFeatures::At(const ModelView& view,
                                                    std::span<const int32_t> pixels) {
  ASSIGN_OR_RETURN(const DeviceSpan<const Half> map, maps_.Get(view));
  std::vector<float> features;
  features.reserve(pixels.size() * kFeatureSize);
  for (const int32_t pixel : pixels) {
    Half feature[kFeatureSize];
    backend_.CopyToHost(feature, map.data + int64_t{pixel} * kFeatureSize, sizeof(feature));
    for (const Half half : feature) features.push_back(FloatFromHalf(half));
  }
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
  ASSIGN_OR_RETURN(const DeviceSpan<const Half> map, maps_.Get(target));
  const int64_t num_queries = queries.size() / kFeatureSize;
  const Buffer<float> psi = GatesAt({&scale, 1});
  Buffer<float> similarity(backend_, map.size / kFeatureSize * num_queries);
  if (similarity.empty()) {
    return absl::ResourceExhaustedError(
        absl::StrCat("no memory for the similarities to ", num_queries, " features"));
  }
  backend_.Similarity({map, psi.span(), queries.span(), kMinPixelNorm, similarity.span()});
  std::vector<float> values(similarity.size());
  similarity.Download(values);
  return values;
}

absl::StatusOr<std::vector<SegmentResult>> ViewFeatures::Segment(const Query& query,
                                                                 std::span<const ModelView> targets,
                                                                 const SegmentOptions& options) {
  const Buffer<float> queries = PositiveFirst(query);
  std::vector<SegmentResult> results;
  results.reserve(targets.size());
  for (const ModelView& target : targets) {
    ASSIGN_OR_RETURN(SegmentResult result, SegmentView(query, queries, target, options));
    RETURN_IF_ERROR(TakeStatus(backend_));
    results.push_back(std::move(result));
  }
  return results;
}

absl::StatusOr<SegmentResult> ViewFeatures::SegmentView(const Query& query,
                                                        const Buffer<float>& queries,
                                                        const ModelView& target,
                                                        const SegmentOptions& options) {
  ASSIGN_OR_RETURN(const DeviceSpan<const Half> map, maps_.Get(target));
  const Buffer<float> psi = GatesAt({&query.scale, 1});
  const int64_t num_pixels = map.size / kFeatureSize;
  // Refining needs the similarities, and computes the score again: the device sums over the mask as
  // it was before.
  const bool want_similarity = options.want_similarity || options.refine_borders;
  mask_.Reserve(backend_, num_pixels);
  if (want_similarity) similarity_.Reserve(backend_, num_pixels);
  if (mask_.empty() || (want_similarity && similarity_.empty())) {
    return absl::ResourceExhaustedError("no memory for the mask of a view");
  }
  backend_.SegmentPixels({.map = map,
                          .psi = psi.span(),
                          .queries = queries.span(),
                          .num_positive = NumPositive(query),
                          .min_norm = kMinPixelNorm,
                          .threshold = static_cast<float>(query.threshold),
                          .mask = mask_.span(),
                          .similarity = want_similarity ? similarity_.span() : DeviceSpan<float>(),
                          .sums = sums_.span()});
  SegmentResult result;
  result.width = target.camera.width;
  result.height = target.camera.height;
  result.scale = query.scale;
  result.scale_units = ScaleOfQuantile(model_.field, query.scale);
  result.threshold = query.threshold;
  result.mask.pixels.resize(num_pixels);
  mask_.Download(std::span<uint8_t>(result.mask.pixels));
  int64_t sum[kNumSegmentSums] = {};
  sums_.Download(std::span<int64_t>(sum));
  if (sum[kNumInside] > 0) {
    result.score = static_cast<double>(sum[kSimilaritySum]) /
                   (static_cast<double>(sum[kNumInside]) * double{kSimilarityUnit});
    FindBox(result.mask.pixels, result.width, result.box);
  }
  result.area = sum[kNumInside];
  if (want_similarity) {
    result.similarity.resize(num_pixels);
    similarity_.Download(std::span<float>(result.similarity));
  }
  if (options.refine_borders && result.area > 0) {
    RETURN_IF_ERROR(RefineMask(target, map, result));
  }
  if (!options.want_similarity) result.similarity = {};
  return result;
}

absl::StatusOr<std::span<const uint8_t>> ViewFeatures::ColorOf(const ModelView& view) {
  std::string key = ViewKey(view);
  if (key != color_key_) {
    color_key_.clear();
    color_ = renderer_.Color(view);
    // A failed device leaves zeros, which would look like a black view.
    RETURN_IF_ERROR(TakeStatus(backend_));
    color_key_ = std::move(key);
  }
  return color_.pixels;
}

void ViewFeatures::ReadStrip(const ViewPart& part, const SegmentResult& result,
                             BorderPixels& strip) {
  const auto width = static_cast<size_t>(strip.width);
  strip.features.resize(width * strip.height * kFeatureSize);
  strip.rgb.clear();
  strip.similarity.clear();
  for (int y = 0; y < strip.height; ++y) {
    const size_t from = static_cast<size_t>(part.top + y) * result.width + part.left;
    backend_.CopyToHost(&strip.features[y * width * kFeatureSize],
                        part.map.data + from * kFeatureSize, width * kFeatureSize * sizeof(Half));
    strip.rgb.insert(strip.rgb.end(), &part.rgb[3 * from], &part.rgb[3 * from] + 3 * width);
    strip.similarity.insert(strip.similarity.end(), &result.similarity[from],
                            &result.similarity[from] + width);
  }
}

// Works in strips, so that the copy of the features stays small in a large view.
absl::Status ViewFeatures::RefineMask(const ModelView& target, DeviceSpan<const Half> map,
                                      SegmentResult& result) {
  constexpr int kStripRows = 32;
  ViewPart part = {.map = map, .left = std::max(0, result.box[0] - kBorderReach)};
  ASSIGN_OR_RETURN(part.rgb, ColorOf(target));
  BorderPixels strip;
  strip.width = std::min(result.width, result.box[0] + result.box[2] + kBorderReach) - part.left;
  strip.threshold = result.threshold;
  PsiAt(model_.field.gate, static_cast<float>(result.scale), strip.psi.data());
  const std::vector<uint8_t> before = result.mask.pixels;
  std::vector<uint8_t> mask;
  // The mask may grow by one row.
  const int bottom = std::min(result.height, result.box[1] + result.box[3] + 1);
  for (int row = std::max(0, result.box[1] - 1); row < bottom; row += kStripRows) {
    const int end = std::min(bottom, row + kStripRows);
    part.top = std::max(0, row - kBorderReach);
    strip.height = std::min(result.height, end + kBorderReach) - part.top;
    ReadStrip(part, result, strip);
    // A failed device leaves zeros, which would move the border.
    RETURN_IF_ERROR(TakeStatus(backend_));
    const auto from = [&](int y) { return static_cast<size_t>(y) * result.width + part.left; };
    mask.clear();
    for (int y = part.top; y < part.top + strip.height; ++y) {
      mask.insert(mask.end(), &before[from(y)], &before[from(y)] + strip.width);
    }
    RefineBorder(strip, mask);
    for (int y = row; y < end; ++y) {
      std::copy_n(&mask[static_cast<size_t>(y - part.top) * strip.width], strip.width,
                  &result.mask.pixels[from(y)]);
    }
  }
  Remeasure(result);
  return absl::OkStatus();
}

Buffer<float> ViewFeatures::PositiveFirst(const Query& query) const {
  std::vector<float> features;
  features.reserve(query.features.size());
  for (const bool positive : {true, false}) {
    for (size_t i = 0; i < query.positive.size(); ++i) {
      if ((query.positive[i] != 0) != positive) continue;
      const auto first = query.features.begin() + static_cast<int64_t>(i) * kFeatureSize;
      features.insert(features.end(), first, first + kFeatureSize);
    }
  }
  return {backend_, std::span<const float>(features)};
}

absl::StatusOr<LevelCounts> ViewFeatures::CountLevels(const Query& query,
                                                      std::span<const double> scales,
                                                      std::span<const float> thresholds,
                                                      const ModelView& target) {
  ASSIGN_OR_RETURN(const DeviceSpan<const Half> map, maps_.Get(target));
  LevelCounts counts = {static_cast<int>(scales.size()), static_cast<int>(thresholds.size()), {}};
  const size_t side = thresholds.size() + 1;
  counts.pixels.resize(scales.size() * scales.size() * side * side);
  const Buffer<float> queries = PositiveFirst(query), psi = GatesAt(scales);
  const Buffer<float> over(backend_, thresholds);
  Buffer<int32_t> overlaps(backend_, static_cast<int64_t>(counts.pixels.size()));
  Buffer<uint8_t> levels(backend_, map.size / kFeatureSize * counts.num_scales);
  if (levels.empty() || overlaps.empty()) {
    return absl::ResourceExhaustedError("no memory for the levels of a view");
  }
  backend_.LevelOverlaps({.map = map,
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
    ASSIGN_OR_RETURN(pixels, maps_.Get(view));
  } else {
    const int64_t size = int64_t{view.camera.width} * view.camera.height * kFeatureSize;
    of_subset = Buffer<Half>(backend_, size);
    if (of_subset.empty()) return absl::ResourceExhaustedError("no memory for a feature map");
    renderer_.Features(view, of_subset.span(), subset);
    pixels = of_subset.span();
  }
  std::vector<Half> map(static_cast<size_t>(pixels.size));
  backend_.CopyToHost(map.data(), pixels.data, map.size() * sizeof(Half));
  return map;
}

}  // namespace pepeseg
