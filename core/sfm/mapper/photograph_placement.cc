#include "core/sfm/mapper/photograph_placement.h"

#include <algorithm>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "core/sfm/mapper/absolute_pose.h"

namespace pepeseg {
namespace {

// COLMAP's limits for a photograph that joins a model.
constexpr size_t kFewestSightings = 30;
constexpr double kLeastAgreeing = 0.25;
constexpr double kMaxSightingError = 12;  // pixels

// A feature of a photograph and a point that one of its matches shows.
struct Sighting {
  uint32_t feature = 0, point = 0;

  auto operator<=>(const Sighting&) const = default;
};

// Returns the sightings of each photograph without a pose, each once.
std::vector<std::vector<Sighting>> FindSightings(std::span<const MapperPhotograph> photographs,
                                                 std::span<const VerifiedPair> pairs,
                                                 const GlobalModel& model) {
  std::map<Observation, uint32_t> point_of;
  for (uint32_t p = 0; p < model.points.size(); ++p) {
    for (const Observation& o : model.points[p].track) point_of[o] = p;
  }
  std::vector<std::vector<Sighting>> sightings(photographs.size());
  const auto add = [&](const Observation& placed, const Observation& lost) {
    const auto found = point_of.find(placed);
    if (found != point_of.end()) {
      sightings[lost.photograph].push_back({lost.feature, found->second});
    }
  };
  for (const VerifiedPair& pair : pairs) {
    const bool first = model.poses[pair.first].is_registered;
    const bool second = model.poses[pair.second].is_registered;
    if (first == second || pair.geometry.kind == TwoViewKind::kWatermark) continue;
    for (const FeatureMatch& match : pair.geometry.inliers) {
      const Observation a{pair.first, match.first}, b{pair.second, match.second};
      first ? add(a, b) : add(b, a);
    }
  }
  for (std::vector<Sighting>& list : sightings) {
    std::sort(list.begin(), list.end());
    list.erase(std::unique(list.begin(), list.end()), list.end());
  }
  return sightings;
}

}  // namespace

int PlacePhotographs(std::span<const MapperPhotograph> photographs,
                     std::span<const VerifiedPair> pairs, ThreadPool& pool, GlobalModel& model) {
  const std::vector<std::vector<Sighting>> found = FindSightings(photographs, pairs, model);
  std::vector<std::optional<AbsolutePose>> poses(photographs.size());
  pool.ParallelFor(static_cast<int64_t>(photographs.size()), [&](int64_t i, int) {
    if (found[i].size() < kFewestSightings) return;
    const GroupLens& lens = model.lenses[photographs[i].camera_group];
    std::vector<PointSighting> sightings;
    for (const Sighting& s : found[i]) {
      const Observation seen{static_cast<uint32_t>(i), s.feature};
      sightings.push_back(
          {model.points[s.point].position, lens.Normalised(PixelOf(photographs, seen))});
    }
    AbsolutePoseOptions options;
    options.max_error = kMaxSightingError / lens.focal;
    options.seed = static_cast<uint64_t>(i) + 1;
    poses[i] = EstimateAbsolutePose(sightings, options);
    const double least = std::max(static_cast<double>(kFewestSightings),
                                  kLeastAgreeing * static_cast<double>(sightings.size()));
    if (poses[i] && static_cast<double>(poses[i]->inliers.size()) < least) poses[i].reset();
  });
  int num_placed = 0;
  for (size_t i = 0; i < poses.size(); ++i) {
    if (!poses[i]) continue;
    model.poses[i] = poses[i]->pose;
    ++num_placed;
  }
  return num_placed;
}

}  // namespace pepeseg
