#pragma once

#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "pepeseg/v1/evaluation_service.pb.h"

// Evaluations as tables and JSON. A column with a star has numbers that used the scored truth to
// choose: they are bounds, not what a user gets.
namespace pepeseg::client::cli {

// Returns the lines of a table of the entities, categories and means of an evaluation:
//   entity     views  reference IoU  Acc    BIoU   scale  thr   automatic IoU  Acc  ...  paper* IoU
//   mug.1      1      0.765          0.981  0.603  0.30   0.75  0.712          0.97 ...  0.771
//   mug.2      3      0.000          0.902  0.000  -      -     0.000 ...  nothing under the prompt
//   mug (2)           0.383          0.942  0.301               0.356 ...                0.385
//   mean of 2         0.383          0.942  0.301               0.356 ...                0.385
// A category has a line if it has several entities. Of CLICKS the columns are clicks and the IoU
// after 1, 2 and 3 of them; of SAM_AGREEMENT there is a line a view.
std::vector<std::string> EvaluationTable(const v1::EvaluateModelResponse& response);

// Returns the summary of an evaluation, name and value each: "reference_iou", "automatic_accuracy",
// "paper_boundary_iou", "num_clicks", "best_iou" and so on. Numbers that are absent are left out.
std::vector<std::pair<std::string, double>> SummaryOf(const v1::EvaluateModelResponse& response);
// Returns whether the number of a summary used the scored truth to choose.
bool UsesScoredTruth(const std::string& name);

// A number over several models, such as one mIoU for each seed.
struct Spread {
  int count = 0;
  double mean = 0;
  double deviation = 0;  // of the sample, by count - 1; 0 for fewer than two values
  double least = 0, most = 0;
};
// Returns the spread of the values, zeros if there are none.
Spread SpreadOf(const std::vector<double>& values);

// Returns the lines of a table of several models, with mean, standard deviation, least and most.
std::vector<std::string> SpreadTable(std::span<const v1::EvaluateModelResponse> responses);
// Returns {"evaluations": [...], "spread": {"reference_iou": {"mean": ..., "deviation": ...,
// "least": ..., "most": ..., "count": ..., "uses_scored_truth": false}, ...}}.
nlohmann::ordered_json SpreadJson(std::span<const v1::EvaluateModelResponse> responses);

// Returns the protocols of an evaluation by the values of --protocol, such as "label-propagation".
const std::map<std::string, v1::EvaluationProtocol>& ProtocolsByName();
// Returns the value of --protocol for a protocol.
std::string ProtocolName(v1::EvaluationProtocol protocol);

}  // namespace pepeseg::client::cli
