#include "core/find/scene_segments.h"

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "core/base/order_statistics.h"
#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

constexpr double kInner = 0.9;  // share of a segment's Gaussians that its extents are of
constexpr double kDegree0 = 0.28209479177387814;  // spherical harmonic of degree 0
constexpr float kLeastExtent = 1e-6f;             // scene units; has a logarithm

// Returns the Gaussians of each segment of a level.
std::vector<std::vector<int64_t>> MembersOfLevel(const Decomposition::Level& level) {
  std::vector<std::vector<int64_t>> members(level.segments.size());
  for (size_t i = 0; i < level.ids.size(); ++i) {
    if (level.ids[i] > 0) members[level.ids[i] - 1].push_back(static_cast<int64_t>(i));
  }
  return members;
}

// Returns SceneSegments::Segment::extents. There must be at least one member.
std::array<float, 3> ExtentsOf(const Gaussians& gaussians, std::span<const int64_t> members) {
  Eigen::Matrix3Xf means(3, static_cast<int64_t>(members.size()));
  for (int k = 0; k < 3; ++k) {
    const auto plane = gaussians.Plane(kMeanPlane + k);
    for (size_t i = 0; i < members.size(); ++i) {
      means(k, static_cast<int64_t>(i)) = plane[members[i]];
    }
  }
  Eigen::Vector3f median;
  for (int k = 0; k < 3; ++k) {
    std::vector<float> values(means.row(k).begin(), means.row(k).end());
    median[k] = UpperMedian(values);
  }
  std::vector<float> distances;
  for (int64_t i = 0; i < means.cols(); ++i) distances.push_back((means.col(i) - median).norm());
  std::vector<float> sorted = distances;
  const float reach = NearestRank(sorted, kInner);
  Eigen::Vector3f sum = Eigen::Vector3f::Zero();
  Eigen::Matrix3f squares = Eigen::Matrix3f::Zero();
  float count = 0;
  for (int64_t i = 0; i < means.cols(); ++i) {
    if (distances[i] > reach) continue;
    const Eigen::Vector3f offset = means.col(i) - median;
    sum += offset;
    squares += offset * offset.transpose();
    count += 1;
  }
  const Eigen::Vector3f mean = sum / count;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3f> solver(squares / count -
                                                              mean * mean.transpose());
  std::array<float, 3> extents{};
  for (int k = 0; k < 3; ++k) {
    extents[k] = std::max(kLeastExtent, std::sqrt(std::max(0.0f, solver.eigenvalues()[2 - k])));
  }
  return extents;
}

// Lists the segments of all levels, seen nowhere yet.
SceneSegments ListSegments(const Decomposition& decomposition, const Gaussians& gaussians) {
  SceneSegments all;
  int32_t next_level = 0;
  for (size_t l = 0; l < decomposition.levels.size(); ++l) {
    const auto& segments = decomposition.levels[l].segments;
    const std::vector<std::vector<int64_t>> members = MembersOfLevel(decomposition.levels[l]);
    all.first.push_back(next_level);
    next_level += static_cast<int32_t>(segments.size());
    for (size_t k = 0; k < segments.size(); ++k) {
      const Decomposition::Segment& segment = segments[k];
      all.segments.push_back({{static_cast<int>(l), static_cast<int32_t>(k + 1)},
                              segment.parent > 0 ? next_level + segment.parent - 1 : -1,
                              segment.num_gaussians,
                              segment.min,
                              segment.max,
                              ExtentsOf(gaussians, members[k]),
                              {},
                              decomposition.levels[l].scale == 0});
    }
  }
  return all;
}

// Returns the view at the size of its grid.
ModelView AtGridSize(const ModelView& view) {
  const double share =
      std::min(1.0, std::sqrt(kSeenPixels / (double{1} * view.camera.width * view.camera.height)));
  const auto side = [&](int pixels) {
    return std::max(1, static_cast<int>(std::lround(pixels * share)));
  };
  return AtSize(view, side(view.camera.width), side(view.camera.height));
}

void Extend(SeenArea& area, int x, int y) {
  if (area.pixels++ == 0) area = {1, x, y, x, y};
  area.x0 = std::min(area.x0, x);
  area.x1 = std::max(area.x1, x);
  area.y1 = y;  // scanlines ascend
}

// Returns the blend rows of the grid of a view.
absl::StatusOr<PixelRows> GridRows(const SceneModel& model, const ModelView& view) {
  const ModelView grid = AtGridSize(view);
  std::vector<int32_t> pixels(static_cast<size_t>(grid.camera.width) * grid.camera.height);
  std::iota(pixels.begin(), pixels.end(), 0);
  return model.segmenter().Rows(grid, pixels);
}

// Returns what a view shows, from the blend rows of its grid.
SeenView ReadRows(const PixelRows& rows, const Decomposition& decomposition,
                  const SceneSegments& all, const ModelView& view) {
  SeenView seen;
  const Camera grid = AtGridSize(view).camera;
  seen.width = grid.width;
  seen.height = grid.height;
  seen.areas.resize(all.segments.size());
  for (size_t l = 0; l < decomposition.levels.size(); ++l) {
    std::vector<int32_t> shown = IdsOfRows(rows, decomposition.levels[l].ids);
    for (size_t i = 0; i < shown.size(); ++i) {
      shown[i] = shown[i] > 0 ? all.first[l] + shown[i] - 1 : -1;
      if (shown[i] < 0) continue;
      Extend(seen.areas[shown[i]], static_cast<int>(i) % seen.width,
             static_cast<int>(i) / seen.width);
    }
    seen.shown.push_back(std::move(shown));
  }
  return seen;
}

// Sets the colours of the segments. visible: how much of each Gaussian the views show.
void SetColors(const Decomposition& decomposition, const Gaussians& gaussians,
               std::span<const float> visible, SceneSegments& all) {
  std::vector<double> weights(all.segments.size());
  std::vector<std::array<double, 3>> sums(all.segments.size());
  for (size_t l = 0; l < decomposition.levels.size(); ++l) {
    const std::vector<int32_t>& ids = decomposition.levels[l].ids;
    for (size_t i = 0; i < ids.size(); ++i) {
      if (ids[i] == 0) continue;
      const int32_t s = all.first[l] + ids[i] - 1;
      weights[s] += visible[i];
      for (int k = 0; k < 3; ++k) {
        const double base = 0.5 + kDegree0 * gaussians.Plane(kShPlane + k)[i];
        sums[s][k] += visible[i] * std::clamp(base, 0.0, 1.0);
      }
    }
  }
  for (size_t s = 0; s < sums.size(); ++s) {
    if (weights[s] <= 0) continue;
    for (int k = 0; k < 3; ++k) {
      all.segments[s].color[k] = static_cast<float>(sums[s][k] / weights[s]);
    }
  }
}

}  // namespace

int32_t SceneSegments::NumberOf(const SegmentKey& key) const {
  if (key.level < 0 || key.level >= static_cast<int>(first.size()) || key.id < 1) return -1;
  const int64_t number = int64_t{first[key.level]} + key.id - 1;
  const auto end = key.level + 1 < static_cast<int>(first.size())
                       ? static_cast<size_t>(first[key.level + 1])
                       : segments.size();
  return number < static_cast<int64_t>(end) ? static_cast<int32_t>(number) : -1;
}

double SceneSegments::OverlapOf(int32_t a, int32_t b) const {
  // Segments nest, so two that share a Gaussian are one below the other.
  const int32_t inner = std::min(a, b), outer = std::max(a, b);
  int32_t at = inner;
  while (at >= 0 && at < outer) at = segments[at].parent;
  if (at != outer) return 0;
  return static_cast<double>(segments[inner].num_gaussians) /
         static_cast<double>(segments[outer].num_gaussians);
}

int64_t SceneSegments::SeenPixels(int32_t segment) const {
  return std::accumulate(
      views.begin(), views.end(), int64_t{0},
      [&](int64_t sum, const SeenView& view) { return sum + view.areas[segment].pixels; });
}

int64_t SceneSegments::Bytes() const {
  size_t bytes = segments.size() * sizeof(Segment);
  for (const SeenView& seen : views) {
    bytes += seen.areas.size() * sizeof(SeenArea);
    for (const std::vector<int32_t>& level : seen.shown) bytes += level.size() * sizeof(int32_t);
  }
  return static_cast<int64_t>(bytes);
}

absl::StatusOr<SeenView> SeeView(const SceneModel& model, const Decomposition& decomposition,
                                 const SceneSegments& all, const ModelView& view) {
  ASSIGN_OR_RETURN(const PixelRows rows, GridRows(model, view));
  return ReadRows(rows, decomposition, all, view);
}

int32_t SegmentLike(const SeenView& seen, std::span<const uint8_t> mask, double min_iou) {
  std::vector<int64_t> common(seen.areas.size());
  int64_t area = 0;
  for (size_t i = 0; i < mask.size(); ++i) {
    if (mask[i] == 0) continue;
    ++area;
    for (const std::vector<int32_t>& shown : seen.shown) {
      if (shown[i] >= 0) ++common[shown[i]];
    }
  }
  int32_t best = -1;
  double best_iou = 0;
  for (size_t s = 0; s < common.size(); ++s) {
    const int64_t either = area + seen.areas[s].pixels - common[s];
    const double iou =
        common[s] > 0 ? static_cast<double>(common[s]) / static_cast<double>(either) : 0;
    if (iou < min_iou || iou <= best_iou) continue;
    best = static_cast<int32_t>(s);
    best_iou = iou;
  }
  return best;
}

absl::StatusOr<SceneSegments> SeeSegments(const SceneModel& model,
                                          const Decomposition& decomposition, int max_views,
                                          const WantedCheck& check) {
  SceneSegments all = ListSegments(decomposition, model.model().gaussians);
  const std::vector<ModelView>& views = model.model().views;
  std::vector<float> visible(static_cast<size_t>(model.model().gaussians.count));
  const size_t count = std::min(views.size(), static_cast<size_t>(std::max(0, max_views)));
  for (size_t k = 0; k < count; ++k) {
    RETURN_IF_ERROR(check());
    const size_t view = k * views.size() / count;
    ASSIGN_OR_RETURN(const PixelRows rows, GridRows(model, views[view]));
    for (size_t e = 0; e < rows.gaussian.size(); ++e) visible[rows.gaussian[e]] += rows.weight[e];
    SeenView seen = ReadRows(rows, decomposition, all, views[view]);
    seen.view = view;
    all.views.push_back(std::move(seen));
  }
  SetColors(decomposition, model.model().gaussians, visible, all);
  return all;
}

}  // namespace pepeseg
