#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/sfm/front/compare_photographs.h"

namespace pepeseg {

// Facts about a capture that follow from the verified pairs of the own front, without any model.
struct PairEvidence {
  std::vector<std::string> names;     // of the photographs, in COLMAP
  std::vector<int64_t> num_partners;  // of each photograph: others with which a pair is verified
  // True: the camera did not move, or only turned (TurnsOnTheSpot), so that nothing has a depth.
  bool turns_on_the_spot = false;
};
PairEvidence JudgePairs(const ComparedDatabase& compared);

}  // namespace pepeseg
