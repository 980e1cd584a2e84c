#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "pepeseg/v1/evaluation_service.pb.h"
#include "pepeseg/v1/job_service.pb.h"
#include "pepeseg/v1/scene_service.pb.h"

// The measurements of the verb "curves", and their text.
namespace pepeseg::client::cli {

// One training with its measurements.
struct BenchRun {
  std::string name;  // of the plan: "standard", "1000 steps"
  uint64_t seed = 0;
  v1::Job job;
  v1::Model model;
  // Wall times, seconds: "queue", "request_to_model", and "first_click" (which loads the model) and
  // "next_click" if something is under the click. The times of the stages are in the model's
  // metrics.
  std::map<std::string, double> seconds;
  std::map<std::string, int64_t> steps;  // steps done, by stage
  std::vector<std::pair<std::string, v1::EvaluateModelResponse>>
      levels;  // scores by TruthLevel::name
};

// All runs, and what they have in common.
struct BenchRecord {
  std::string dataset;                       // name of its folder
  std::map<std::string, std::string> facts;  // given by the caller: "machine", "commit"
  double upload_seconds = 0;
  std::vector<BenchRun> runs;
};

// Returns the text of record.json: every measurement, and the effective options once for each name
// of a plan. In "seconds" of a run, "upload", "queue", the stages, "between" (the time between
// stages) and "first_click" add up to "request_to_click".
nlohmann::ordered_json ToJson(const BenchRecord& record);

// Returns a line about a run for a person.
std::string RunLine(const BenchRun& run);

}  // namespace pepeseg::client::cli
