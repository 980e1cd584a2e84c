#pragma once

#include <string>
#include <vector>

#include "pepeseg/v1/decomposition.pb.h"

namespace pepeseg::client::cli {

// A decomposition in lines: its levels, and the segments, LEVEL:ID, each below the one that it lies
// in.
std::vector<std::string> SegmentTree(const v1::DecomposeResponse& answer);

}  // namespace pepeseg::client::cli
