#pragma once

#include <string>
#include <vector>

#include "clients/terminal/picture.h"
#include "pepeseg/v1/decomposition.pb.h"

// How the verb "decompose" shows a decomposition.
namespace pepeseg::client::cli {

// Returns the lines of a decomposition: the model, its levels, and the segments as a tree from the
// coarsest level down, each named LEVEL:ID and indented below the segment that it lies in:
//   scenes/shelf/models/1
//   level 0  scale 0.01 (0.1 scene units)  2 segments  4 Gaussians in none
//   level 1  scale 0.5 (1.2 scene units)  1 segments  0 Gaussians in none
//     1:1                   20 Gaussians  1 x 2 x 0.5 scene units
//       0:1                 11 Gaussians  1 x 1 x 0.5 scene units
std::vector<std::string> SegmentTree(const v1::DecomposeModelResponse& answer);

// Returns the colour of a segment, the same wherever the id is shown; neighbouring ids have
// distinct hues. 0 stands for no segment and is black.
Rgb ColorOfSegment(int id);

// Colours an image of segment ids.
Picture ColorSegments(const Grey16Picture& ids);

}  // namespace pepeseg::client::cli
