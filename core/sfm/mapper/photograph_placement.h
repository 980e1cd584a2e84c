#pragma once

#include <span>

#include "core/sfm/mapper/global_model.h"
#include "kernels/thread_pool.h"

namespace pepeseg {

// Gives poses to photographs without one, from the points that their matches show: those with at
// least 30 sightings in agreement and a quarter of all, as in COLMAP. Photographs that match only
// such photographs wait for the next call. Points stay. Returns the number of poses. The same for
// any number of threads.
int PlacePhotographs(std::span<const MapperPhotograph> photographs,
                     std::span<const VerifiedPair> pairs, ThreadPool& pool, GlobalModel& model);

}  // namespace pepeseg
