#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "pepeseg/v1/evaluation.pb.h"
#include "pepeseg/v1/job_service.pb.h"
#include "pepeseg/v1/scene_service.pb.h"

namespace pepeseg::client::cli {

// One training and what it came to.
struct BenchRun {
  std::string name;  // of its settings: "standard", "1000 steps"
  uint64_t seed = 0;
  v1::Job job;
  v1::Model model;
  // Wall time beside that of the stages, which stands in the model's metrics: "queue",
  // "request_to_model", and, where there is something to click on, "first_click" (which loads the
  // model) and "next_click".
  std::map<std::string, double> seconds;
  std::map<std::string, int64_t> steps;  // done, by stage
  std::vector<std::pair<std::string, v1::EvaluateResponse>> levels;
};

// What all runs share.
struct BenchRecord {
  std::string dataset;                       // name of its folder
  std::map<std::string, std::string> facts;  // told by the caller: "machine", "commit"
  double upload_seconds = 0;
  std::vector<BenchRun> runs;
};

// Every number of the record; the effective options stand once for each name. "seconds" of a run:
// of "upload", "queue", the stages, what lies "between" them, and "first_click" add up to
// "request_to_click".
nlohmann::ordered_json ToJson(const BenchRecord& record);

// For a person, while it runs.
std::string RunLine(const BenchRun& run);

}  // namespace pepeseg::client::cli
