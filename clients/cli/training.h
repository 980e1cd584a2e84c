#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "clients/cpp/client.h"
#include "pepeseg/v1/job_service.pb.h"

namespace pepeseg::client::cli {

// What is to be trained, as verbs are told.
struct TrainingFlags {
  std::string scene;
  std::string dataset;
  std::vector<std::string> settings;
  std::string preset;
  std::string steps;
  std::string feature_steps;
  std::string image_scale;
};
void AddTrainingFlags(CLI::App& verb, TrainingFlags& flags);

// The short options are the long ones by another name.
std::vector<std::string> Settings(const TrainingFlags& flags);

// "2" -> "scenes/shelf/datasets/2"; empty: the newest.
absl::StatusOr<std::string> DatasetName(const Client& client, const std::string& scene,
                                        const std::string& dataset);

// Queues a training. `settings` are NAME=VALUE, see SetOption.
absl::StatusOr<v1::Job> StartTraining(const Client& client, const std::string& scene,
                                      const std::string& dataset,
                                      const std::vector<std::string>& settings);

}  // namespace pepeseg::client::cli
