#include "core/sfm/mapper/map_globally.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <set>
#include <utility>
#include <vector>

#include "core/base/status_macros.h"
#include "core/sfm/mapper/bundle_adjustment.h"
#include "core/sfm/mapper/check_arguments.h"
#include "core/sfm/mapper/focal_search.h"
#include "core/sfm/mapper/global_positions.h"
#include "core/sfm/mapper/photograph_placement.h"
#include "core/sfm/mapper/rotation_averaging.h"
#include "core/sfm/mapper/tracks.h"
#include "core/sfm/mapper/triangulation.h"
#include "core/sfm/mapper/view_graph.h"
#include "kernels/thread_pool.h"

namespace pepeseg {
namespace {

constexpr int kFewestPhotographs = 3;
constexpr int kFewestObservations = 15;  // of a registered photograph
constexpr double kMaxPositionDifference = 0.01;
// Positions come from edges with this share of the inliers of the best edges, see StrongEdges:
// repeated textures, which hold for a wrong translation, match by few.
constexpr double kStrongShare = 0.2;
constexpr double kNeighbourShare = 0.5;  // the same for pairs that no right model contradicts
constexpr double kMaxTrackError = 4;     // pixels off the epipolar lines of the poses
// EXIF's focal length is replaced by a reliable search that differs by more than this share.
constexpr double kExifTolerance = 0.1;
constexpr double kDefaultFocal = 1.2;  // of the longer side, as in COLMAP
// A focal length that the adjustment changes by more than this share gets a second pass.
constexpr double kMaxFocalChange = 0.05;
// One round: how far off the epipolar lines of the poses so far matches may be, as far as the round
// before kept observations; the errors up to which observations are triangulated, then kept.
// Pixels.
struct Round {
  double match, triangulate, keep;
};
constexpr Round kRounds[] = {{0, 12, 8}, {8, 6, 4}, {kMaxTrackError, 4, 2}};
constexpr double kMinAngle = 1.5;  // degrees
constexpr int kMostPasses = 3;
// Photographs join in steps: those that match only others without a pose come later.
constexpr int kMostPlacements = 5;
// A principal point that differs from the centre by fewer of its standard deviations stays there.
// Errors of features are not independent: on desk, whose principal point is the centre, it comes
// out 8 to 11 deviations off; on fox 24 to 47, and there centres get three times better.
constexpr double kLeastSignificance = 20;
constexpr double kMostShift = 0.1;  // of the principal point, over the longer side

// One mapping. MapGlobally calls the methods in their order, and stops at the first gate.
class GlobalMapping {
 public:
  GlobalMapping(std::span<const MapperPhotograph> photographs, std::span<const VerifiedPair> pairs,
                const MapperOptions& options)
      : photographs_(photographs), pairs_(pairs), options_(options), pool_(options.num_threads) {}

  MapperGate FindLenses();
  // Forgets all but the lenses.
  void Clear();
  MapperGate FindRotations();
  MapperGate FindPositionsOfCameras();
  void Adjust(const Round& round);
  // Returns whether a focal length differs from that of `lenses` by more than kMaxFocalChange.
  bool HasLeft(const std::vector<GroupLens>& lenses) const;
  void PlaceOthers();
  void FreeCentres();
  MapperGate Judge();

  MapperResult result;

 private:
  std::vector<WorldRay> SelectRays(int& num_points) const;
  void DropWeakPhotographs();
  int CountContradicted();

  std::span<const MapperPhotograph> photographs_;
  std::span<const VerifiedPair> pairs_;
  MapperOptions options_;
  ThreadPool pool_;
  std::vector<ViewEdge> all_edges_;
  AveragedRotations averaged_;
  std::vector<Track> tracks_;
  std::vector<bool> free_centres_;  // by camera group; empty: none
};

MapperGate GlobalMapping::FindLenses() {
  std::vector<GroupLens>& lenses = result.model.lenses;
  std::vector<double> exif;
  for (const MapperPhotograph& photograph : photographs_) {
    const auto group = static_cast<size_t>(photograph.camera_group);
    if (lenses.size() <= group) lenses.resize(group + 1), exif.resize(group + 1, 0.0);
    lenses[group].width = photograph.width, lenses[group].height = photograph.height;
    exif[group] = std::max(exif[group], photograph.focal);
  }
  if (TurnsOnTheSpot(photographs_, pairs_, exif)) return MapperGate::kTurn;
  for (size_t group = 0; group < lenses.size(); ++group) {
    const FocalEstimate found = SearchFocal(photographs_, pairs_, static_cast<int>(group));
    const bool trusted =
        exif[group] > 0 &&
        (!found.is_reliable || std::abs(found.focal / exif[group] - 1) < kExifTolerance);
    // The second pass corrects a bad start.
    lenses[group].focal = trusted ? exif[group]
                          : found.is_reliable
                              ? found.focal
                              : kDefaultFocal * std::max(lenses[group].width, lenses[group].height);
  }
  return MapperGate::kPassed;
}

void GlobalMapping::Clear() {
  result.model.poses.assign(photographs_.size(), {});
  result.model.points.clear();
}

bool GlobalMapping::HasLeft(const std::vector<GroupLens>& lenses) const {
  for (size_t i = 0; i < lenses.size(); ++i) {
    const double ratio = result.model.lenses[i].focal / lenses[i].focal;
    if (!(std::abs(ratio - 1) < kMaxFocalChange)) return true;
  }
  return false;
}

MapperGate GlobalMapping::FindRotations() {
  all_edges_ = BuildViewGraph(photographs_, pairs_, result.model.lenses, options_.max_error, pool_);
  averaged_ = AverageRotations(photographs_.size(), all_edges_, pool_);
  const auto num_known = std::count(averaged_.is_known.begin(), averaged_.is_known.end(), true);
  if (num_known < kFewestPhotographs) return MapperGate::kTooFew;
  const bool any_direction = std::any_of(averaged_.edges.begin(), averaged_.edges.end(),
                                         [](const ViewEdge& e) { return e.view.has_direction; });
  if (!any_direction) return MapperGate::kTurn;
  tracks_ = BuildTracks(photographs_,
                        MatchesOf(StrongEdges(photographs_.size(), averaged_.edges, kStrongShare)));
  return MapperGate::kPassed;
}

// Selects rays of long tracks, numbered by the selected tracks.
std::vector<WorldRay> GlobalMapping::SelectRays(int& num_points) const {
  std::vector<WorldRay> rays;
  num_points = 0;
  for (const uint32_t t : SelectTracks(photographs_, tracks_, options_.tracks_per_photograph)) {
    for (const Observation& o : tracks_[t]) {
      const GroupLens& lens = result.model.lenses[photographs_[o.photograph].camera_group];
      const Eigen::Vector3d seen = lens.Normalised(PixelOf(photographs_, o)).homogeneous();
      rays.push_back({o.photograph, static_cast<uint32_t>(num_points),
                      (averaged_.rotations[o.photograph].transpose() * seen).normalized()});
    }
    ++num_points;
  }
  return rays;
}

MapperGate GlobalMapping::FindPositionsOfCameras() {
  int num_points = 0;
  const std::vector<WorldRay> rays = SelectRays(num_points);
  GlobalPositions found[2];
  const auto num_cameras = static_cast<int>(photographs_.size());
  pool_.ParallelFor(2, [&](int64_t i, int) {
    PositionOptions options;
    options.seed = options_.seed + static_cast<uint64_t>(i);
    found[i] = FindPositions(num_cameras, num_points, rays, options);
  });
  result.position_difference =
      PositionDifference(found[0].cameras, found[1].cameras, averaged_.is_known);
  const GlobalPositions& best = found[found[1].cost < found[0].cost];
  result.model.poses.resize(photographs_.size());
  for (size_t i = 0; i < photographs_.size(); ++i) {
    if (!averaged_.is_known[i]) continue;
    const Eigen::Matrix3d& rotation = averaged_.rotations[i];
    result.model.poses[i] = {rotation, -rotation * best.cameras[i], true};
  }
  return result.position_difference < kMaxPositionDifference ? MapperGate::kPassed
                                                             : MapperGate::kPositions;
}

// A pose with few observations is not determined by them.
void GlobalMapping::DropWeakPhotographs() {
  std::vector<int> counts(photographs_.size(), 0);
  for (const MappedPoint& point : result.model.points) {
    for (const Observation& o : point.track) ++counts[o.photograph];
  }
  for (size_t i = 0; i < photographs_.size(); ++i) {
    if (counts[i] < kFewestObservations) result.model.poses[i].is_registered = false;
  }
  for (MappedPoint& point : result.model.points) {
    std::erase_if(point.track, [&](const Observation& o) {
      return !result.model.poses[o.photograph].is_registered;
    });
  }
  std::erase_if(result.model.points, [](const MappedPoint& p) { return p.track.size() < 2; });
}

void GlobalMapping::Adjust(const Round& round) {
  GlobalModel& model = result.model;
  const bool first = &round == &kRounds[0];
  if (!first) {
    tracks_ =
        BuildTracks(photographs_, AgreeingMatches(photographs_, pairs_, model, round.match, pool_));
  }
  TriangulationOptions triangulation;
  triangulation.max_error = round.triangulate;
  triangulation.min_angle = kMinAngle;
  model.points = Triangulate(photographs_, tracks_, model, triangulation, pool_);
  DropWeakPhotographs();
  BundleOptions bundle;
  if (first) {
    bundle.max_steps = 5;
    bundle.fix_rotations = bundle.fix_lenses = true;
    AdjustBundle(photographs_, bundle, pool_, model);
    bundle = {};
  }
  bundle.free_centres = free_centres_;
  AdjustBundle(photographs_, bundle, pool_, model);
  FilterPoints(photographs_, round.keep, kMinAngle, model);
  DropWeakPhotographs();
}

// Places photographs that the averaged rotations left out, or that lost their observations.
void GlobalMapping::PlaceOthers() {
  for (int i = 0; i < kMostPlacements; ++i) {
    if (PlacePhotographs(photographs_, pairs_, pool_, result.model) == 0) return;
    Adjust(kRounds[1]);
    Adjust(kRounds[2]);
  }
}

// Frees the principal points that are off the centre for sure. Others stay there: in photographs
// that look one way, a shift hardly differs from a turn.
void GlobalMapping::FreeCentres() {
  GlobalModel trial = result.model;
  BundleOptions bundle;
  bundle.free_centres.assign(trial.lenses.size(), true);
  const BundleSummary summary = AdjustBundle(photographs_, bundle, pool_, trial);
  std::vector<bool> is_free;
  for (size_t g = 0; g < trial.lenses.size(); ++g) {
    const GroupLens& lens = trial.lenses[g];
    const Eigen::Array2d significance =
        lens.shift.array().abs() / summary.centre_deviations[g].array();
    is_free.push_back(significance.maxCoeff() >= kLeastSignificance &&
                      lens.shift.norm() <= kMostShift * std::max(lens.width, lens.height));
  }
  if (std::find(is_free.begin(), is_free.end(), true) == is_free.end()) return;
  free_centres_ = is_free;
  const bool all_free = std::find(is_free.begin(), is_free.end(), false) == is_free.end();
  if (all_free) result.model = std::move(trial);
  // Twice: observations that the centre left out come back, and move it again.
  Adjust(kRounds[2]);
  Adjust(kRounds[2]);
}

// Counts the strong pairs of which less than half of the inliers agree with the model. Two places
// that look alike fold onto each other at the cost of a few pairs of true neighbours.
int GlobalMapping::CountContradicted() {
  std::set<std::pair<uint32_t, uint32_t>> strong;
  for (const ViewEdge& edge : StrongEdges(photographs_.size(), all_edges_, kNeighbourShare)) {
    strong.emplace(edge.first, edge.second);
  }
  int count = 0;
  for (const MatchedPair& pair :
       AgreeingMatches(photographs_, pairs_, result.model, kMaxTrackError, pool_)) {
    count += pair.matches.empty() && strong.contains({pair.first, pair.second});
  }
  return count;
}

MapperGate GlobalMapping::Judge() {
  FilterPoints(photographs_, kRounds[2].keep, kMinAngle, result.model);
  if (result.model.points.empty()) return MapperGate::kRegistered;
  result.measures =
      MeasureModel(photographs_, result.model, all_edges_, tracks_, options_.compared);
  result.measures.contradicted_pairs = CountContradicted();
  return JudgeMeasures(result.measures);
}

}  // namespace

absl::StatusOr<MapperResult> MapGlobally(std::span<const MapperPhotograph> photographs,
                                         std::span<const VerifiedPair> pairs,
                                         const MapperOptions& options,
                                         absl::FunctionRef<absl::Status(double share)> progress) {
  RETURN_IF_ERROR(CheckMapperArguments(photographs, pairs));
  GlobalMapping mapping(photographs, pairs, options);
  MapperGate& gate = mapping.result.gate;
  if ((gate = mapping.FindLenses()) != MapperGate::kPassed) return std::move(mapping.result);
  for (int pass = 0; pass < kMostPasses; ++pass) {
    const std::vector<GroupLens> start = mapping.result.model.lenses;
    mapping.Clear();
    RETURN_IF_ERROR(progress(0.05));
    if ((gate = mapping.FindRotations()) != MapperGate::kPassed) return std::move(mapping.result);
    RETURN_IF_ERROR(progress(0.2));
    gate = mapping.FindPositionsOfCameras();
    if (gate != MapperGate::kPassed) return std::move(mapping.result);
    double share = 0.4;
    for (const Round& round : kRounds) {
      RETURN_IF_ERROR(progress(share));
      mapping.Adjust(round);
      share += 0.2;
    }
    if (!mapping.HasLeft(start)) break;
    gate = MapperGate::kFocal;
  }
  if (gate == MapperGate::kPassed) {
    mapping.PlaceOthers();
    mapping.FreeCentres();
    gate = mapping.Judge();
  }
  RETURN_IF_ERROR(progress(1));
  return std::move(mapping.result);
}

}  // namespace pepeseg
