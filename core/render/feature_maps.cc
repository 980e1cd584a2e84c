#include "core/render/feature_maps.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/device_lock.h"
#include "core/base/order_statistics.h"
#include "core/base/status_macros.h"
#include "core/scene/camera.h"
#include "kernels/half.h"
#include "kernels/math/feature.h"

namespace pepeseg {
namespace {

constexpr int64_t MapBytes(int64_t num_pixels) {
  constexpr int64_t kColor = 3 * sizeof(float);
  return num_pixels * (kFeatureSize * static_cast<int64_t>(sizeof(Half)) + kColor);
}

constexpr int64_t kMaxSamples = 65'536;  // most Gaussians that the components are computed from
constexpr double kClippedShare = 0.02;   // share of the Gaussians clipped at either end
// Smallest range that is stretched to [0, 1], so that a constant component does not show its noise.
constexpr float kMinRange = 0.1f;

using Features = Eigen::Matrix<double, Eigen::Dynamic, kFeatureSize, Eigen::RowMajor>;
using Axes = Eigen::Matrix<double, kFeatureSize, 3>;

// Returns the gated unit features of every n-th Gaussian, one a row.
Features SampleUnits(const FeatureField& field, const float* psi) {
  const int64_t count = static_cast<int64_t>(field.features.size()) / kFeatureSize;
  const int64_t stride = std::max<int64_t>(1, (count + kMaxSamples - 1) / kMaxSamples);
  Features units((count + stride - 1) / stride, kFeatureSize);
  float unit[kFeatureSize];
  for (int64_t i = 0; i < count; i += stride) {
    GatedUnit(psi, &field.features[i * kFeatureSize], kFeatureSize, unit);
    for (int k = 0; k < kFeatureSize; ++k) units(i / stride, k) = double{unit[k]};
  }
  return units;
}

// Returns the three axes of the largest variance, the largest first. The sign of an eigenvector is
// arbitrary: its largest component is made positive, so that colours do not flip between runs.
Axes PrincipalAxes(const Features& units) {
  const Eigen::RowVectorXd mean = units.colwise().mean();
  const Features centered = units.rowwise() - mean;
  // Eigenvalues ascend, so the last columns are the axes of the largest variance.
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(centered.transpose() * centered);
  Axes axes;
  for (int k = 0; k < 3; ++k) {
    axes.col(k) = solver.eigenvectors().col(kFeatureSize - 1 - k);
    Eigen::Index largest = 0;
    axes.col(k).cwiseAbs().maxCoeff(&largest);
    if (axes(largest, k) < 0) axes.col(k) *= -1;
  }
  return axes;
}

}  // namespace

std::string ViewKey(const ModelView& view) {
  // PinholeView has no padding.
  const PinholeView v = ToPinholeView(view.camera, view.cam_from_world);
  // Exact bytes: views that differ in the last bit of a pose have maps of their own.
  return {reinterpret_cast<const char*>(&v), sizeof(v)};
}

double FeatureNorm(const float* feature) {
  double squares = 0;
  for (int k = 0; k < kFeatureSize; ++k) squares += double{feature[k]} * feature[k];
  return std::sqrt(squares);
}

int64_t MapReserve(int64_t max_view_pixels) {
  // Room for four maps of the largest view as long as they take no more than 608 MiB, and at least
  // for one of the largest size that is rendered.
  constexpr int64_t kMostBytes = int64_t{608} << 20;
  return std::max(MapBytes(MostPixels(max_view_pixels)),
                  std::min(4 * MapBytes(max_view_pixels), kMostBytes));
}

FeatureMaps::FeatureMaps(Renderer& renderer, int64_t max_bytes, MapCounts* counts)
    : renderer_(renderer), max_bytes_(max_bytes), counts_(counts) {}

// A hit moves its map to the front. A miss drops maps from the back until the new one fits, before
// it is allocated, so that the maps never exceed max_bytes.
absl::StatusOr<FeatureMap> FeatureMaps::Get(const ModelView& view) {
  const std::string key = ViewKey(view);
  const auto found =
      std::find_if(maps_.begin(), maps_.end(), [&](const Map& map) { return map.key == key; });
  if (found != maps_.end()) {
    maps_.splice(maps_.begin(), maps_, found);
    if (counts_ != nullptr) ++counts_->num_hits;
    return maps_.front().View();
  }
  const int64_t num_pixels = int64_t{view.camera.width} * view.camera.height;
  const int64_t num_bytes = MapBytes(num_pixels);
  // Checked before any map is dropped: a view that can never fit must not empty the cache.
  if (num_bytes > max_bytes_) {
    return absl::ResourceExhaustedError(
        absl::StrCat("the feature map of ", view.camera.width, "x", view.camera.height,
                     " pixels needs ", num_bytes, " bytes, but the maps of a model may take ",
                     max_bytes_, "; request a smaller view"));
  }
  while (bytes_ + num_bytes > max_bytes_) {
    bytes_ -= MapBytes(maps_.back().features.size() / kFeatureSize);
    maps_.pop_back();
    --num_maps_;
  }
  Map map = {key, Buffer<Half>(renderer_.backend(), num_pixels * kFeatureSize),
             Buffer<float>(renderer_.backend(), 3 * num_pixels)};
  if (map.features.empty() || map.color.empty()) {
    return absl::ResourceExhaustedError(
        absl::StrCat("no memory for a feature map of ", num_bytes, " bytes"));
  }
  renderer_.Features(view, map.features.span(), map.color.span());
  RETURN_IF_ERROR(TakeStatus(renderer_.backend()));
  ++num_renders_;
  if (counts_ != nullptr) ++counts_->num_renders;
  ++num_maps_;
  bytes_ += num_bytes;
  maps_.push_front(std::move(map));
  return maps_.front().View();
}

FeaturePalette MakeFeaturePalette(const FeatureField& field, double scale) {
  FeaturePalette palette;
  if (field.empty()) return palette;
  // The colours are of gated features, psi(s) * f, so they show what is alike at this scale.
  PsiAt(field.gate, static_cast<float>(scale), palette.psi.data());
  const Features units = SampleUnits(field, palette.psi.data());
  const Axes axes = PrincipalAxes(units);
  for (int k = 0; k < 3; ++k) {
    for (int c = 0; c < kFeatureSize; ++c) palette.axis[k][c] = static_cast<float>(axes(c, k));
    // The mean is subtracted neither here nor in PaintFeatures: low and high contain it.
    const Eigen::VectorXf along = (units * axes.col(k)).cast<float>();
    std::vector<float> values(along.begin(), along.end());
    palette.low[k] = NearestRank(values, kClippedShare);
    palette.high[k] = NearestRank(values, 1 - kClippedShare);
  }
  return palette;
}

Image PaintFeatures(const FeaturePalette& palette, std::span<const Half> map,
                    const Camera& camera) {
  Image image = {camera.width, camera.height, 3, {}};
  image.pixels.assign(map.size() / kFeatureSize * 3, 0);
  float feature[kFeatureSize], unit[kFeatureSize];
  for (size_t i = 0; i < map.size() / kFeatureSize; ++i) {
    float squares = 0;
    for (int c = 0; c < kFeatureSize; ++c) {
      feature[c] = FloatFromHalf(map[i * kFeatureSize + c]);
      squares += feature[c] * feature[c];
    }
    // Black: hardly any feature was blended there, so it has no direction.
    if (squares < kMinPixelNorm * kMinPixelNorm) continue;
    GatedUnit(palette.psi.data(), feature, kFeatureSize, unit);
    for (int k = 0; k < 3; ++k) {
      float along = 0;
      for (int c = 0; c < kFeatureSize; ++c) along += palette.axis[k][c] * unit[c];
      const float range = std::max(palette.high[k] - palette.low[k], kMinRange);
      const float value = std::clamp((along - palette.low[k]) / range, 0.0f, 1.0f);
      image.pixels[3 * i + k] = static_cast<uint8_t>(std::lround(value * 255));
    }
  }
  return image;
}

}  // namespace pepeseg
