#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "clients/cpp/resource_names.h"
#include "pepeseg/v1/prompt.pb.h"
#include "pepeseg/v1/render_service.pb.h"
#include "pepeseg/v1/segmentation_service.pb.h"

// Flags that several verbs share, and the parts of a request that they become. Each Add function
// adds flags to a verb; parsing the command line fills the struct, which must outlive the parser.
namespace pepeseg::client::cli {

// A prompt: what is pointed at, in which view of which model.
struct PromptFlags {
  std::string scene;
  std::string model = "live";
  std::string view;
  std::vector<std::pair<std::string, std::string>> parts;  // kind and text, see AddToPrompt
  double stroke_width = 0;                                 // pixels; 0: thin
  v1::PixelFrame frame = v1::PIXEL_FRAME_PHOTOGRAPH;       // of the prompt and of the answer
};
// Adds flags for a prompt of points.
void AddPointFlags(CLI::App& verb, PromptFlags& flags);
// Adds flags for a prompt of any kind; the user must give exactly one, or at most one if
// `optional`. Returns the group of the kinds; what is added to it takes the place of a prompt.
CLI::Option_group* AddPromptFlags(CLI::App& verb, PromptFlags& flags, bool optional = false);
// Returns the prompt. Errors are those of AddToPrompt.
absl::StatusOr<v1::Prompt> ParsePrompt(const PromptFlags& flags);

// How large a thing is meant, and how similar its pixels must be.
struct GranularityFlags {
  double scale = -1;      // quantile, [0, 1]; below 0: the server chooses
  double units = 0;       // instead of `scale`: scene units; 0: not given
  double threshold = -2;  // cosine, [-1, 1]; below -1: the server chooses
};
void AddGranularityFlags(CLI::App& verb, GranularityFlags& flags);
v1::Granularity ToGranularity(const GranularityFlags& flags);

// Sets the views to segment from the values of --views: names, "all" or "held-out".
void SetTargets(const std::vector<std::string>& names, v1::SegmentViewsRequest::Targets& targets);

// Adds --sam-clicks and --no-sam-clicks, which is absent by default.
void AddSamClicksFlag(CLI::App& verb, std::optional<bool>& sam_clicks);

// Adds --scales: the scales of a decomposition.
void AddScalesFlag(CLI::App& verb, std::vector<double>& scales);

// A subset of a model's Gaussians; by default all of them.
struct SubsetFlags {
  int selection = 0;           // number of a selection; 0: none
  std::string segment;         // "LEVEL:ID"; empty: none
  std::vector<double> scales;  // of the decomposition that has the segment; empty: the server's
  bool without = false;        // all other Gaussians instead
};
// Adds the flags; those that name a subset to `group`, if there is one.
void AddSubsetFlags(CLI::App& verb, SubsetFlags& flags, CLI::App* group = nullptr);
// Returns the subset of a model of `scene`. INVALID_ARGUMENT: the segment is not LEVEL:ID, or
// --without is given without a selection or a segment.
absl::StatusOr<v1::Subset> ParseSubset(const SubsetFlags& flags, const std::string& scene);

// Writes what to add to the positions of an exported file to FILE.origin.json, and returns that
// name. Without an origin it returns an empty name, and removes the file of an earlier export.
absl::StatusOr<std::string> WriteOrigin(const v1::Vector3* origin, const std::string& file);

}  // namespace pepeseg::client::cli
