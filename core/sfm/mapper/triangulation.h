#pragma once

#include <span>
#include <vector>

#include "core/sfm/mapper/global_model.h"
#include "core/sfm/mapper/tracks.h"
#include "kernels/thread_pool.h"

namespace pepeseg {

struct TriangulationOptions {
  double max_error = 4;    // pixels
  double min_angle = 1.5;  // degrees between two of a point's rays
  int max_proposals = 12;  // pairs of rays that propose a position
};

// Returns the points of tracks, at most one for each: each proposal intersects two rays; the one
// with the most observations within `max_error` is refined, and keeps those. Observations of
// photographs that are not registered are left out. The same for any number of threads.
std::vector<MappedPoint> Triangulate(std::span<const MapperPhotograph> photographs,
                                     std::span<const Track> tracks, const GlobalModel& model,
                                     const TriangulationOptions& options, ThreadPool& pool);

// Drops observations beyond `max_error` pixels, and points with fewer than two left or without an
// angle of `min_angle`.
void FilterPoints(std::span<const MapperPhotograph> photographs, double max_error, double min_angle,
                  GlobalModel& model);

// Returns the largest angle between two rays of a point, degrees.
double LargestAngle(const GlobalModel& model, const MappedPoint& point);

}  // namespace pepeseg
