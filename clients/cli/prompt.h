#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "clients/cpp/resource_names.h"
#include "pepeseg/v1/segmentation_service.pb.h"

namespace pepeseg::client::cli {

// What is pointed at, and in which view of which model.
struct PromptFlags {
  std::string scene;
  std::string model = "live";
  std::string view;
  std::vector<std::string> positive;
  std::vector<std::string> negative;
  std::string box, mask, label;                       // in place of points; see AddAnyPromptFlags
  v1::PixelFrame frame = v1::PIXEL_FRAME_PHOTOGRAPH;  // of points, box and mask, and of the answer
};
// Points.
void AddPromptFlags(CLI::App& verb, PromptFlags& flags);
// Points, a box, a mask or a label: exactly one of them.
void AddAnyPromptFlags(CLI::App& verb, PromptFlags& flags);

// How large a thing is meant, and how alike its pixels are.
struct GranularityFlags {
  double scale = -1;      // below 0: the server's choice
  double units = 0;       // the same in scene units; 0: not given
  double threshold = -2;  // below -1: the server's choice
};
void AddGranularityFlags(CLI::App& verb, GranularityFlags& flags);
v1::Granularity ToGranularity(const GranularityFlags& flags);

// INVALID_ARGUMENT: a point that is none.
absl::StatusOr<v1::PointsPrompt> ParsePoints(const PromptFlags& flags);
// What is pointed at, and its view. INVALID_ARGUMENT: a point or a box that is none; NOT_FOUND: no
// such file.
absl::StatusOr<v1::Prompt> ParsePrompt(const PromptFlags& flags);

}  // namespace pepeseg::client::cli
