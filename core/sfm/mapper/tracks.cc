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
                               std::span<const ViewEdge> edges) {
  std::vector<const ViewEdge*> order;
  for (const ViewEdge& edge : edges) order.push_back(&edge);
  std::stable_sort(order.begin(), order.end(), [](const ViewEdge* a, const ViewEdge* b) {
    return a->inliers.size() > b->inliers.size();
  });
  FeatureSets sets(photographs);
  for (const ViewEdge* edge : order) {
    for (const FeatureMatch& match : edge->inliers) {
      sets.Join({edge->first, match.first}, {edge->second, match.second});
    }
  }
  return sets.Take();
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
