#include "core/sfm/front/pair_selection.h"

#include <algorithm>
#include <numeric>
#include <utility>

namespace pepeseg {
namespace {

void Order(std::vector<PhotographPair>& pairs) {
  std::sort(pairs.begin(), pairs.end(), [](const PhotographPair& a, const PhotographPair& b) {
    return std::pair(a.second, a.first) < std::pair(b.second, b.first);
  });
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
}

// Depth-first search that finds bridges (Tarjan 1974): the edge to a child is one if nothing below
// the child leads back above it. Without recursion, because captures may be long chains.
class BridgeSearch {
 public:
  BridgeSearch(size_t num_photographs, const std::vector<PhotographPair>& verified)
      : neighbors_(num_photographs), found_(num_photographs), lowest_(num_photographs) {
    for (const PhotographPair& pair : verified) {
      neighbors_[pair.first].push_back(pair.second);
      neighbors_[pair.second].push_back(pair.first);
    }
  }

  PhotographGroups Run() {
    PhotographGroups groups;
    groups.group.resize(neighbors_.size());
    for (size_t start = 0; start < neighbors_.size(); ++start) {
      if (found_[start] != 0) continue;
      Visit(start, groups);
      ++groups.num_groups;
    }
    Order(groups.bridges);
    return groups;
  }

 private:
  struct Level {
    size_t photograph, parent;
    size_t next = 0;           // neighbour to look at
    bool seen_parent = false;  // the edge to the parent is skipped once; a second one is a way back
  };

  void Enter(size_t photograph, size_t parent, PhotographGroups& groups) {
    found_[photograph] = lowest_[photograph] = ++num_found_;
    groups.group[photograph] = groups.num_groups;
    path_.push_back({photograph, parent});
  }

  void Visit(size_t start, PhotographGroups& groups) {
    Enter(start, start, groups);
    while (!path_.empty()) {
      Level& level = path_.back();
      const size_t own = level.photograph;
      if (level.next < neighbors_[own].size()) {
        const size_t neighbor = neighbors_[own][level.next++];
        if (found_[neighbor] == 0) {
          Enter(neighbor, own, groups);
        } else if (neighbor == level.parent && !level.seen_parent) {
          level.seen_parent = true;
        } else {
          lowest_[own] = std::min(lowest_[own], found_[neighbor]);
        }
        continue;
      }
      const size_t parent = level.parent;
      path_.pop_back();
      if (path_.empty()) continue;
      lowest_[parent] = std::min(lowest_[parent], lowest_[own]);
      if (lowest_[own] > found_[parent]) groups.bridges.push_back(PairOf(own, parent));
    }
  }

  std::vector<std::vector<size_t>> neighbors_;
  std::vector<size_t> found_;   // order of discovery from 1; 0: not yet
  std::vector<size_t> lowest_;  // order of the first photograph that is reached from below
  std::vector<Level> path_;
  size_t num_found_ = 0;
};

}  // namespace

PhotographPair PairOf(size_t one, size_t other) {
  return {std::min(one, other), std::max(one, other)};
}

void PairScores::Add(size_t one, size_t other, int64_t score) {
  scores_[one * num_photographs_ + other] += score;
  scores_[other * num_photographs_ + one] += score;
}

std::vector<PhotographPair> AllPairs(size_t num_photographs) {
  std::vector<PhotographPair> pairs;
  for (size_t second = 1; second < num_photographs; ++second) {
    for (size_t first = 0; first < second; ++first) pairs.push_back({first, second});
  }
  return pairs;
}

std::vector<PhotographPair> NeighborPairs(size_t num_photographs, size_t overlap, bool powers) {
  std::vector<PhotographPair> pairs;
  const auto add = [&](size_t distance) {
    for (size_t i = 0; i + distance < num_photographs; ++i) pairs.push_back({i, i + distance});
  };
  for (size_t distance = 1; distance <= overlap; ++distance) add(distance);
  for (size_t distance = 1; powers && distance < num_photographs; distance *= 2) {
    if (distance > overlap) add(distance);
  }
  Order(pairs);
  return pairs;
}

PhotographGroups GroupsOf(size_t num_photographs, const std::vector<PhotographPair>& verified) {
  return BridgeSearch(num_photographs, verified).Run();
}

PairSelection::PairSelection(PairScores scores)
    : num_photographs_(scores.num_photographs()),
      ranked_(num_photographs_),
      next_(num_photographs_) {
  for (size_t own = 0; own < num_photographs_; ++own) {
    for (size_t other = 0; other < num_photographs_; ++other) {
      if (other != own && scores.Get(own, other) > 0) ranked_[own].push_back(other);
    }
    // Equal scores: the lower index first.
    std::stable_sort(ranked_[own].begin(), ranked_[own].end(),
                     [&](size_t a, size_t b) { return scores.Get(own, a) > scores.Get(own, b); });
  }
}

void PairSelection::Skip(const std::vector<PhotographPair>& pairs) {
  taken_.insert(pairs.begin(), pairs.end());
}

std::vector<PhotographPair> PairSelection::NextOf(const std::vector<size_t>& photographs,
                                                  size_t count) {
  std::vector<PhotographPair> pairs;
  for (const size_t own : photographs) {
    size_t num_found = 0;
    size_t& next = next_[own];
    for (; next < ranked_[own].size() && num_found < count; ++next) {
      const PhotographPair pair = PairOf(own, ranked_[own][next]);
      if (taken_.contains(pair)) continue;
      pairs.push_back(pair);
      ++num_found;
    }
  }
  // Two photographs may choose each other: the pair is taken only after both have.
  Skip(pairs);
  Order(pairs);
  return pairs;
}

std::vector<PhotographPair> PairSelection::Next(size_t count) {
  std::vector<size_t> all(num_photographs_);
  std::iota(all.begin(), all.end(), size_t{0});
  return NextOf(all, count);
}

std::vector<PhotographPair> PairSelection::NextAtCuts(const PhotographGroups& groups,
                                                      size_t count) {
  std::vector<size_t> size(groups.num_groups);
  for (const size_t group : groups.group) ++size[group];
  const auto largest =
      static_cast<size_t>(std::distance(size.begin(), std::max_element(size.begin(), size.end())));
  std::set<size_t> at_cuts;
  for (size_t i = 0; i < num_photographs_; ++i) {
    if (groups.group[i] != largest) at_cuts.insert(i);
  }
  for (const PhotographPair& bridge : groups.bridges) {
    at_cuts.insert({bridge.first, bridge.second});
  }
  return NextOf({at_cuts.begin(), at_cuts.end()}, count);
}

}  // namespace pepeseg
