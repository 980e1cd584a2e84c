#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "pepeseg/v1/segmentation_service.pb.h"

namespace pepeseg::cli {

// What is clicked, and in which view of which model.
struct PromptFlags {
  std::string scene;
  std::string model = "live";
  std::string view;
  std::vector<std::string> positive;
  std::vector<std::string> negative;
};
void AddPromptFlags(CLI::App& verb, PromptFlags& flags);

// How large a thing is meant, and how alike its pixels are.
struct GranularityFlags {
  double scale = -1;      // below 0: the server's choice
  double threshold = -2;  // below -1: the server's choice
};
void AddGranularityFlags(CLI::App& verb, GranularityFlags& flags);
v1::Granularity ToGranularity(const GranularityFlags& flags);

// "scenes/shelf/models/live".
std::string ModelName(const std::string& scene, const std::string& model);

// INVALID_ARGUMENT: a point that is none.
absl::StatusOr<v1::PointsPrompt> ParsePoints(const PromptFlags& flags);
// The points and their view.
absl::StatusOr<v1::Prompt> ParsePrompt(const PromptFlags& flags);

}  // namespace pepeseg::cli
