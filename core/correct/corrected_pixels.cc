#include "core/correct/corrected_pixels.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <utility>

#include "core/base/on_threads.h"
#include "core/base/status_macros.h"
#include "core/render/feature_maps.h"
#include "kernels/ops/render.h"

namespace pepeseg {
namespace {

// The thresholds that are compared: what a click can choose from, about.
constexpr int kNumThresholds = 28;
constexpr double kFirstThreshold = 0.4, kThresholdStep = 0.02;
// Thresholds whose IoU is this near to the best one fit as well.
constexpr double kSameFit = 0.01;

struct Shrunk {
  ModelView view;
  int factor = 1;
};
Shrunk Shrink(const ModelView& view) {
  Shrunk small = {view, 1};
  Camera& camera = small.view.camera;
  const double num_pixels = static_cast<double>(camera.width) * camera.height;
  small.factor =
      std::max(1, static_cast<int>(std::ceil(std::sqrt(num_pixels / double{kMaxCorrectedPixels}))));
  camera.width = std::max(1, camera.width / small.factor);
  camera.height = std::max(1, camera.height / small.factor);
  for (double* value : {&camera.fx, &camera.fy, &camera.cx, &camera.cy}) *value /= small.factor;
  return small;
}

// Numbers of pixels over each threshold, of one view.
struct Counts {
  std::array<int64_t, kNumThresholds + 1> all{}, inside{};
  int64_t area = 0;  // of the mask

  void Add(float similarity, bool in_mask) {
    const double place = (double{similarity} - kFirstThreshold) / kThresholdStep;
    const int over = std::clamp(static_cast<int>(std::ceil(place)), 0, kNumThresholds);
    ++all[over];
    if (in_mask) ++inside[over];
  }
  // Turns numbers of pixels over exactly t thresholds into those over at least t.
  void Sum() {
    for (int t = kNumThresholds; t > 0; --t) all[t - 1] += all[t], inside[t - 1] += inside[t];
  }
};

// Returns the IoU at threshold t - 1 over the views of `counts`.
double IouAt(std::span<const Counts> counts, int t) {
  int64_t both = 0, either = 0;
  for (const Counts& of_view : counts) {
    both += of_view.inside[t];
    either += of_view.all[t] + of_view.area - of_view.inside[t];
  }
  return either == 0 ? 0 : static_cast<double>(both) / static_cast<double>(either);
}

void SetBestThreshold(std::span<const Counts> counts, ScaleFit& fit) {
  std::array<double, kNumThresholds + 1> iou{};
  for (int t = 1; t <= kNumThresholds; ++t) iou[t] = IouAt(counts, t);
  fit.iou = *std::max_element(iou.begin() + 1, iou.end());
  double sum = 0;
  int num = 0;
  for (int t = 1; t <= kNumThresholds; ++t) {
    if (iou[t] >= fit.iou - kSameFit) sum += t - 1, ++num;
  }
  fit.threshold = kFirstThreshold + kThresholdStep * sum / num;
  const int middle = static_cast<int>(std::lround(sum / num)) + 1;
  for (const Counts& of_view : counts) fit.iou_of_view.push_back(IouAt({&of_view, 1}, middle));
}

// Returns the cosine of a gated feature and a unit direction, and writes the gated unit feature.
float GatedCosine(const float* feature, const ScaleFit& fit, float* unit) {
  float squares = 0, dot = 0;
  for (int k = 0; k < kFeatureSize; ++k) {
    unit[k] = feature[k] * fit.gate[k];
    squares += unit[k] * unit[k];
  }
  const float scale = squares > 0 ? 1 / std::sqrt(squares) : 0;
  for (int k = 0; k < kFeatureSize; ++k) {
    unit[k] *= scale;
    dot += unit[k] * fit.direction[k];
  }
  return dot;
}

}  // namespace

void BlendFeatures(const FeatureField& field, CorrectedPixels& pixels) {
  const size_t num = pixels.num_pixels();
  pixels.features.assign(num * kFeatureSize, 0);
  pixels.solid.assign(num, 0);
  OnThreads(num, [&](size_t p) {
    float* sum = &pixels.features[p * kFeatureSize];
    for (int32_t e = pixels.rows.first[p]; e < pixels.rows.first[p + 1]; ++e) {
      const auto g = static_cast<size_t>(pixels.rows.gaussian[e]);
      const float confidence = field.confidence.empty() ? 1 : field.confidence[g];
      const float weight = pixels.rows.weight[e] * confidence;
      const float* feature = &field.features[g * kFeatureSize];
      for (int k = 0; k < kFeatureSize; ++k) sum[k] += weight * feature[k];
    }
    pixels.solid[p] = FeatureNorm(sum) >= double{kMinPixelNorm} ? 1 : 0;
  });
}

absl::StatusOr<CorrectedPixels> CapturePixels(const Segmenter& segmenter,
                                              const Correction& correction) {
  const Shrunk small = Shrink(correction.view);
  const Camera& camera = correction.view.camera;
  const int width = small.view.camera.width, height = small.view.camera.height;
  std::vector<int32_t> all(static_cast<size_t>(width) * height);
  std::iota(all.begin(), all.end(), 0);
  CorrectedPixels pixels;
  ASSIGN_OR_RETURN(pixels.rows, segmenter.Rows(small.view, all));
  pixels.inside.reserve(all.size());
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      // A view may have fewer scanlines than the factor.
      const int from_y = std::min(y * small.factor + small.factor / 2, camera.height - 1);
      const int from_x = std::min(x * small.factor + small.factor / 2, camera.width - 1);
      const size_t from = static_cast<size_t>(from_y) * camera.width + from_x;
      pixels.inside.push_back(correction.mask.pixels[from] != 0 ? 1 : 0);
    }
  }
  BlendFeatures(segmenter.model().field, pixels);
  return pixels;
}

ScaleFit FitScale(const FeatureField& field, std::span<const CorrectedPixels> views, double scale) {
  ScaleFit fit;
  fit.scale = scale;
  fit.gate.resize(kFeatureSize);
  PsiAt(field.gate, static_cast<float>(scale), fit.gate.data());
  fit.direction.assign(kFeatureSize, 0);
  std::array<float, kFeatureSize> unit;
  std::array<double, kFeatureSize> sum{};
  for (const CorrectedPixels& view : views) {
    for (size_t p = 0; p < view.num_pixels(); ++p) {
      if (view.inside[p] == 0 || view.solid[p] == 0) continue;
      GatedCosine(&view.features[p * kFeatureSize], fit, unit.data());
      for (int k = 0; k < kFeatureSize; ++k) sum[k] += unit[k];
    }
  }
  const double norm = std::sqrt(std::inner_product(sum.begin(), sum.end(), sum.begin(), 0.0));
  for (int k = 0; k < kFeatureSize; ++k) {
    fit.direction[k] = static_cast<float>(norm > 0 ? sum[k] / norm : 0);
  }
  std::vector<Counts> counts(views.size());
  for (size_t v = 0; v < views.size(); ++v) {
    const CorrectedPixels& view = views[v];
    for (size_t p = 0; p < view.num_pixels(); ++p) {
      const bool inside = view.inside[p] != 0;
      if (inside) ++counts[v].area;
      if (view.solid[p] == 0) continue;
      counts[v].Add(GatedCosine(&view.features[p * kFeatureSize], fit, unit.data()), inside);
    }
    counts[v].Sum();
  }
  SetBestThreshold(counts, fit);
  return fit;
}

}  // namespace pepeseg
