#pragma once

#include <span>
#include <vector>

#include "core/sfm/mapper/view_graph.h"
#include "kernels/thread_pool.h"

namespace pepeseg {

// Features that show one point, sorted by photograph.
using Track = std::vector<Observation>;

// Two photographs and the matches of theirs that are trusted.
struct MatchedPair {
  uint32_t first = 0, second = 0;
  std::vector<FeatureMatch> matches;
};

// Joins matches into tracks. Pairs with more matches come first, and two tracks that both have a
// feature in the same photograph stay apart: one of their matches is wrong. Returns tracks of at
// least two photographs, sorted.
std::vector<Track> BuildTracks(std::span<const MapperPhotograph> photographs,
                               std::span<const MatchedPair> pairs);

// Returns the matches of the edges.
std::vector<MatchedPair> MatchesOf(std::span<const ViewEdge> edges);

// Returns for each pair, in their order, the inliers that are at most `max_error` pixels off the
// epipolar lines of the model's poses; none if less than half of them are, or a pose is missing.
// The same for any number of threads.
std::vector<MatchedPair> AgreeingMatches(std::span<const MapperPhotograph> photographs,
                                         std::span<const VerifiedPair> pairs,
                                         const GlobalModel& model, double max_error,
                                         ThreadPool& pool);

// Selects the longest tracks of each photograph, at most `per_photograph` of them and spread over
// a grid of 16 x 12 cells. Returns indices in ascending order.
std::vector<uint32_t> SelectTracks(std::span<const MapperPhotograph> photographs,
                                   std::span<const Track> tracks, int per_photograph);

}  // namespace pepeseg
