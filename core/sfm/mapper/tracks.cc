#include "core/sfm/mapper/tracks.h"

#include <algorithm>
#include <numeric>
#include <utility>

namespace pepeseg {
namespace {

constexpr int kColumns = 16, kRows = 12;

// Disjoint sets of features; each set knows its members.
class FeatureSets {
 public:
  explicit FeatureSets(std::span<const MapperPhotograph> photographs) {
    for (const MapperPhotograph& photograph : photographs) {
      begin_.push_back(static_cast<uint32_t>(root_.size()));
      root_.resize(root_.size() + photograph.keypoints.size());
    }
    std::iota(root_.begin(), root_.end(), 0);
    members_.resize(root_.size());
  }

  // Joins the sets of two features, unless the result had two features of one photograph.
  void Join(const Observation& first, const Observation& second) {
    uint32_t a = Find(first), b = Find(second);
    if (a == b) return;
    if (members_[a].size() < members_[b].size()) std::swap(a, b);
    Track joined;
    std::merge(members_[a].begin(), members_[a].end(), members_[b].begin(), members_[b].end(),
               std::back_inserter(joined));
    for (size_t i = 1; i < joined.size(); ++i) {
      if (joined[i].photograph == joined[i - 1].photograph) return;
    }
    members_[a] = std::move(joined);
    members_[b] = {};
    root_[b] = a;
  }

  std::vector<Track> Take() {
    std::vector<Track> tracks;
    for (Track& track : members_) {
      if (track.size() >= 2) tracks.push_back(std::move(track));
    }
    std::sort(tracks.begin(), tracks.end());
    return tracks;
  }

 private:
  uint32_t Find(const Observation& feature) {
    uint32_t i = begin_[feature.photograph] + feature.feature;
    while (root_[i] != i) i = root_[i] = root_[root_[i]];
    if (members_[i].empty()) members_[i] = {feature};
    return i;
  }

  std::vector<uint32_t> begin_;  // index of each photograph's first feature
  std::vector<uint32_t> root_;
  std::vector<Track> members_;  // of each root, sorted
};

int CellOf(const MapperPhotograph& photograph, const Keypoint& keypoint) {
  const auto step = [](float x, int size, int count) {
    return std::clamp(static_cast<int>(x * static_cast<float>(count) / static_cast<float>(size)), 0,
                      count - 1);
  };
  return step(keypoint.y, photograph.height, kRows) * kColumns +
         step(keypoint.x, photograph.width, kColumns);
}

}  // namespace

std::vector<Track> BuildTracks(std::span<const MapperPhotograph> photographs,
                               std::span<const MatchedPair> pairs) {
  std::vector<const MatchedPair*> order;
  for (const MatchedPair& pair : pairs) order.push_back(&pair);
  std::stable_sort(order.begin(), order.end(), [](const MatchedPair* a, const MatchedPair* b) {
    return a->matches.size() > b->matches.size();
  });
  FeatureSets sets(photographs);
  for (const MatchedPair* pair : order) {
    for (const FeatureMatch& match : pair->matches) {
      sets.Join({pair->first, match.first}, {pair->second, match.second});
    }
  }
  return sets.Take();
}

std::vector<MatchedPair> MatchesOf(std::span<const ViewEdge> edges) {
  std::vector<MatchedPair> pairs;
  for (const ViewEdge& edge : edges) {
    pairs.push_back({edge.first, edge.second, edge.view.inliers});
  }
  return pairs;
}

std::vector<MatchedPair> AgreeingMatches(std::span<const MapperPhotograph> photographs,
                                         std::span<const VerifiedPair> pairs,
                                         const GlobalModel& model, double max_error,
                                         ThreadPool& pool) {
  std::vector<MatchedPair> agreeing(pairs.size());
  pool.ParallelFor(static_cast<int64_t>(pairs.size()), [&](int64_t i, int) {
    const VerifiedPair& pair = pairs[i];
    agreeing[i] = {pair.first, pair.second, {}};
    const CameraPose &a = model.poses[pair.first], &b = model.poses[pair.second];
    if (!a.is_registered || !b.is_registered) return;
    const Eigen::Matrix3d turn = b.rotation * a.rotation.transpose();
    const Eigen::Matrix3d essential = EssentialMatrix({turn, b.translation - turn * a.translation});
    const GroupLens& first = model.lenses[photographs[pair.first].camera_group];
    const GroupLens& second = model.lenses[photographs[pair.second].camera_group];
    const double threshold = max_error * 2 / (first.focal + second.focal);
    std::vector<FeatureMatch>& matches = agreeing[i].matches;
    for (const FeatureMatch& match : pair.geometry.inliers) {
      const PointPair points{first.Normalised(PixelOf(photographs, {pair.first, match.first})),
                             second.Normalised(PixelOf(photographs, {pair.second, match.second}))};
      if (SampsonSquared(essential, points) <= threshold * threshold) matches.push_back(match);
    }
    if (2 * matches.size() < pair.geometry.inliers.size()) matches.clear();
  });
  return agreeing;
}

std::vector<uint32_t> SelectTracks(std::span<const MapperPhotograph> photographs,
                                   std::span<const Track> tracks, int per_photograph) {
  std::vector<uint32_t> order(tracks.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](uint32_t a, uint32_t b) { return tracks[a].size() > tracks[b].size(); });
  // Counts by photograph, and by cell of each photograph.
  const int per_cell = std::max(1, 4 * per_photograph / (kColumns * kRows));
  std::vector<int> taken(photographs.size(), 0);
  std::vector<int> in_cell(photographs.size() * kColumns * kRows, 0);
  std::vector<uint32_t> selected;
  for (const uint32_t t : order) {
    bool needed = false;
    for (const Observation& o : tracks[t]) {
      const MapperPhotograph& photograph = photographs[o.photograph];
      const size_t cell = o.photograph * size_t{kColumns * kRows} +
                          CellOf(photograph, photograph.keypoints[o.feature]);
      if (taken[o.photograph] >= per_photograph || in_cell[cell] >= per_cell) continue;
      needed = true;
      ++taken[o.photograph], ++in_cell[cell];
    }
    if (needed) selected.push_back(t);
  }
  std::sort(selected.begin(), selected.end());
  return selected;
}

}  // namespace pepeseg
