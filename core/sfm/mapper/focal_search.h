#pragma once

#include <span>
#include <vector>

#include "core/sfm/mapper/global_model.h"

namespace pepeseg {

// The focal length of a camera group, estimated from its pairs.
struct FocalEstimate {
  double focal = 0;     // pixels; 0: not found
  int num_pairs = 0;    // general pairs that voted
  double contrast = 0;  // highest score over the median score: about 1 if it is flat
  bool is_reliable = false;
};

// Finds the focal length at which the fundamental matrices of a group's general pairs are most
// nearly essential: K' F K has two equal singular values (FastMap, Li et al. 2026). The
// candidates have fields of view of 20 to 120 degrees along the longer side.
FocalEstimate SearchFocal(std::span<const MapperPhotograph> photographs,
                          std::span<const VerifiedPair> pairs, int camera_group);

// Returns whether the photographs were taken from one spot: there is a focal length at which the
// homographies of pairs with 80 % of all inliers are rotations. `focals` by camera group, 0 where
// any focal length is tried.
bool TurnsOnTheSpot(std::span<const MapperPhotograph> photographs,
                    std::span<const VerifiedPair> pairs, std::span<const double> focals);

}  // namespace pepeseg
