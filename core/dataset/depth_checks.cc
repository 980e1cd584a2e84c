#include "core/dataset/depth_checks.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/dataset/match_poses.h"

namespace pepeseg {
namespace {

constexpr size_t kFewestSamples = 20, kMostSamples = 2000;
// Mean correlation above which maps agree with the points, and below minus which they hold the
// other kind. Sensors and monocular networks reach 0.8 and more.
constexpr double kClear = 0.3;

// Returns the ranks of the values, from 0; equal values share their mean rank.
std::vector<double> Ranks(const std::vector<double>& values) {
  std::vector<size_t> order(values.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::ranges::sort(order, [&](size_t a, size_t b) { return values[a] < values[b]; });
  std::vector<double> ranks(values.size());
  for (size_t first = 0, last = 0; first < order.size(); first = last) {
    while (last < order.size() && values[order[last]] == values[order[first]]) ++last;
    const double rank = static_cast<double>(first + last - 1) / 2;
    for (size_t i = first; i < last; ++i) ranks[order[i]] = rank;
  }
  return ranks;
}

// Returns Pearson's correlation, or nothing if one of the series is constant.
std::optional<double> Correlation(const std::vector<double>& a, const std::vector<double>& b) {
  const auto num = static_cast<double>(a.size());
  const double mean_a = std::accumulate(a.begin(), a.end(), 0.0) / num;
  const double mean_b = std::accumulate(b.begin(), b.end(), 0.0) / num;
  double ab = 0, aa = 0, bb = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    ab += (a[i] - mean_a) * (b[i] - mean_b);
    aa += (a[i] - mean_a) * (a[i] - mean_a);
    bb += (b[i] - mean_b) * (b[i] - mean_b);
  }
  if (aa <= 0 || bb <= 0) return std::nullopt;
  return ab / std::sqrt(aa * bb);
}

PosedLens PosedPinhole(const View& view) {
  const Camera& camera = view.camera;
  Lens lens;
  lens.width = camera.width, lens.height = camera.height;
  lens.fx = camera.fx, lens.fy = camera.fy, lens.cx = camera.cx, lens.cy = camera.cy;
  return {lens, view.cam_from_world};
}

const char* FolderOf(DepthPrior::Kind kind) {
  return kind == DepthPrior::Kind::kDepth ? "depth/" : "disparity/";
}

// Returns the values of disparity with NaN in place of 0. In a depth map, 0 is unknown.
std::vector<float> WithoutZeros(std::vector<float> values) {
  std::ranges::replace(values, 0.0F, std::numeric_limits<float>::quiet_NaN());
  return values;
}

// The views whose prior is of one kind, and how it agrees with the points.
struct KindTrial {
  std::vector<View*> views;
  std::vector<std::string> names;
  double sum = 0;  // of the correlations, positive if the kind is right
  int num = 0;
};

// Corrects the views of one kind, and returns a warning or an empty string.
std::string Judge(const KindTrial& trial, DepthPrior::Kind kind) {
  const bool is_depth = kind == DepthPrior::Kind::kDepth;
  const std::string what = absl::StrCat(trial.views.size(), " maps of ", FolderOf(kind));
  if (trial.num == 0) {
    return absl::StrCat(what, " are taken to ", is_depth ? "grow away from" : "grow towards",
                        " the camera: there are too few points to check it");
  }
  const double mean = trial.sum / trial.num;
  if (mean > kClear) return "";
  const std::string agreement =
      absl::StrFormat("%s: their rank correlation with the %s of the points is %.2f", what,
                      is_depth ? "depth" : "disparity", mean);
  if (mean >= -kClear) {
    return absl::StrCat(agreement,
                        ", they hardly agree. Check that they belong to these "
                        "photographs: ",
                        FirstNames(trial.names));
  }
  for (View* view : trial.views) {
    view->depth.kind = is_depth ? DepthPrior::Kind::kDisparity : DepthPrior::Kind::kDepth;
    if (is_depth) continue;
    view->depth.values = NormalizeDepth(WithoutZeros(std::move(view->depth.values)));
  }
  return absl::StrCat(agreement, ", they hold ",
                      is_depth ? "disparity (near is large) and are read as such; their folder "
                                 "should be disparity/: "
                               : "depth (far is large) and are read as such; their folder should "
                                 "be depth/: ",
                      FirstNames(trial.names));
}

}  // namespace

std::optional<double> DepthCorrelation(const FloatImage& map, const PosedLens& camera,
                                       std::span<const ScenePoint> points) {
  const size_t step = std::max<size_t>(1, (points.size() + kMostSamples - 1) / kMostSamples);
  std::vector<double> values, depths;
  for (size_t i = 0; i < points.size(); i += step) {
    const Eigen::Vector3d point = points[i].position.cast<double>();
    const auto pixel = Project(camera, point);
    if (!pixel) continue;
    const auto x = static_cast<size_t>(pixel->x() * map.width / camera.lens.width);
    const auto y = static_cast<size_t>(pixel->y() * map.height / camera.lens.height);
    const float value = map.values[y * static_cast<size_t>(map.width) + x];
    if (std::isnan(value)) continue;
    values.push_back(value);
    depths.push_back((camera.cam_from_world * point).z());
  }
  if (values.size() < kFewestSamples) return std::nullopt;
  return Correlation(Ranks(values), Ranks(depths));
}

std::vector<std::string> CorrectDepthKinds(std::span<View* const> views,
                                           std::span<const ScenePoint> points) {
  // Both kinds are collected before one is corrected.
  std::map<DepthPrior::Kind, KindTrial> trials;
  for (View* view : views) {
    const DepthPrior& depth = view->depth;
    if (depth.values.empty() || depth.from_points) continue;
    KindTrial& trial = trials[depth.kind];
    trial.views.push_back(view);
    trial.names.push_back(view->name);
    const bool is_depth = depth.kind == DepthPrior::Kind::kDepth;
    const FloatImage map{view->camera.width, view->camera.height,
                         is_depth ? depth.values : WithoutZeros(depth.values)};
    const auto correlation = DepthCorrelation(map, PosedPinhole(*view), points);
    if (!correlation) continue;
    trial.sum += is_depth ? *correlation : -*correlation;
    ++trial.num;
  }
  std::vector<std::string> warnings;
  for (const auto& [kind, trial] : trials) {
    std::string warning = Judge(trial, kind);
    if (!warning.empty()) warnings.push_back(std::move(warning));
  }
  return warnings;
}

}  // namespace pepeseg
