#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "clients/benchmark/suite_record.h"
#include "clients/benchmark/suite_scene.h"
#include "clients/cpp/client.h"

// The text protocol of LERF-Mask: the prompt of an entity is its name, which FindSegments answers.
namespace pepeseg::client::cli {

// The name of the protocol in records and tables.
inline constexpr char kTextProtocol[] = "text";

// Scores `model` on the scene's truth: the answer to the best thing that FindSegments finds by the
// name of each entity, by the protocol PROMPT with the scale chosen without any truth, in all views
// that have truth. An entity that is not found counts as 0 everywhere. Errors are those of
// ScoreRequest, FindSegments and EvaluateModel.
absl::StatusOr<LevelScores> ScoreByText(const Client& client, const BenchmarkScene& scene,
                                        const std::string& model,
                                        const std::vector<v1::View>& views, bool refine_borders);

// Adds entities that were not found to the scores of those that were.
void CountMissing(const std::vector<std::string>& missing, LevelScores& scores);

}  // namespace pepeseg::client::cli
