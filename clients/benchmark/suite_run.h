#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "clients/benchmark/suite_record.h"
#include "clients/benchmark/suite_scene.h"
#include "clients/benchmark/suite_variants.h"
#include "clients/cpp/client.h"

// One run of a benchmark: a training and its scores.
namespace pepeseg::client::cli {

struct BenchmarkPlan {
  Benchmark benchmark = Benchmark::kScene;
  v1::EvaluationProtocol protocol = v1::EVALUATION_PROTOCOL_UNSPECIFIED;
  bool by_text = false;  // the prompts of LERF-Mask are the names of its entities, see suite_text.h
  std::vector<std::string> settings;  // NAME=VALUE of all trainings, with the preset
  bool refine_borders = true;         // of the masks that are scored
  bool keep_models = false;           // otherwise a model is deleted when it is scored
  std::filesystem::path pictures;     // folder for pictures of the worst entities; empty: none
};

// Trains `dataset` (the name of an uploaded dataset) of the scene with the variant's options and
// the seed of `run`, holds out the scene's test views, and scores the model. `run` has the names
// that identify it; the rest is set.
absl::Status RunScene(const Client& client, const BenchmarkPlan& plan, const BenchmarkScene& scene,
                      const BenchmarkVariant& variant, const std::string& dataset, ScoredRun& run);

}  // namespace pepeseg::client::cli
