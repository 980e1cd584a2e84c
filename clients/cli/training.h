#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "clients/cpp/client.h"
#include "pepeseg/v1/job_service.pb.h"

namespace pepeseg::client::cli {

// Flags of the verbs that train or estimate a training. "": not given.
struct TrainingFlags {
  std::string scene;
  std::string dataset;                // number or name
  std::vector<std::string> settings;  // NAME=VALUE, see SetOption
  std::string preset;
  std::string steps;                        // short for reconstruct.num_steps
  std::string feature_steps;                // short for features.num_steps
  std::string image_scale;                  // short for import.image_scale
  std::vector<std::string> held_out_views;  // names of photographs, for import.held_out_views
};
void AddTrainingFlags(CLI::App& verb, TrainingFlags& flags);

// Returns all options of the flags as NAME=VALUE, in the order in which they are to be set:
// `settings` come last and win.
std::vector<std::string> Settings(const TrainingFlags& flags);

// Returns the resource name of a dataset given by number or name ("2": "scenes/shelf/datasets/2"),
// or of the newest one for "". FAILED_PRECONDITION: the scene has no dataset.
absl::StatusOr<std::string> DatasetName(const Client& client, const std::string& scene,
                                        const std::string& dataset);

// Queues a training and returns its job. `settings` are NAME=VALUE, see SetOption.
absl::StatusOr<v1::Job> StartTraining(const Client& client, const std::string& scene,
                                      const std::string& dataset,
                                      const std::vector<std::string>& settings);

}  // namespace pepeseg::client::cli
