#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "pepeseg/v1/render.pb.h"

namespace pepeseg::client::cli {

// Which of a model's Gaussians are meant.
struct SubsetFlags {
  int selection = 0;           // number; 0: none
  std::string segment;         // "LEVEL:ID"; empty: none
  std::vector<double> scales;  // of the segment's decomposition; empty: the server's
  bool without = false;
};
void AddSubsetFlags(CLI::App& verb, SubsetFlags& flags);
// "0.01,0.5,1".
void AddScalesFlag(CLI::App& verb, std::vector<double>& scales);

// Of a scene. INVALID_ARGUMENT: a segment that is no LEVEL:ID, --without nothing.
absl::StatusOr<v1::Subset> ParseSubset(const SubsetFlags& flags, const std::string& scene);

}  // namespace pepeseg::client::cli
