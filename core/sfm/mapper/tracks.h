#pragma once

#include <span>
#include <vector>

#include "core/sfm/mapper/view_graph.h"

namespace pepeseg {

// Features that show one point, sorted by photograph.
using Track = std::vector<Observation>;

// Joins the inliers of edges into tracks. Edges with more inliers come first, and two tracks that
// both have a feature in the same photograph stay apart: one of their matches is wrong. Returns
// tracks of at least two photographs, sorted.
std::vector<Track> BuildTracks(std::span<const MapperPhotograph> photographs,
                               std::span<const ViewEdge> edges);

// Selects the longest tracks of each photograph, at most `per_photograph` of them and spread over
// a grid of 16 x 12 cells. Returns indices in ascending order.
std::vector<uint32_t> SelectTracks(std::span<const MapperPhotograph> photographs,
                                   std::span<const Track> tracks, int per_photograph);

}  // namespace pepeseg
