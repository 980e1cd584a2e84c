#pragma once

#include <string>
#include <vector>

#include "pepeseg/v1/evaluation_service.pb.h"

namespace pepeseg::client::cli {

// Returns the lines of a table of the entities, their means, and the means at the fixed scales.
// "views" counts the scored views, without the reference view that was clicked in:
//   entity             views    IoU   BIoU  scale  threshold  oracle
//   48 chenille stems      1  0.765  0.603   0.30       0.75   0.771
//   144                    3  0.000  0.000      -          -   0.000  nothing under the click
//   mean of 2                 0.383  0.301                     0.385
//   left out, in fewer than two held-out views: 7
//
//   fixed scale, threshold 0.75   0.01    0.1      1
//   mean IoU                     0.251  0.260  0.350
std::vector<std::string> EvaluationTable(const v1::EvaluateModelResponse& answer);

}  // namespace pepeseg::client::cli
