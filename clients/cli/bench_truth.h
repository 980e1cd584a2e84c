#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "clients/cli/picture.h"
#include "pepeseg/v1/evaluation.pb.h"
#include "pepeseg/v1/scene_service.pb.h"

namespace pepeseg::client::cli {

// What a dataset's folder knows of what is to be segmented: label images of one level.
struct TruthLevel {
  std::string name;
  std::filesystem::path folder;         // of STEM.png
  std::map<int, std::string> entities;  // names by id; those without a name are missing
};

// gt/LEVEL/ for each level of gt/labels.json ({"part": ["-", "lamp", ...], ...}: names by id), else
// labels/ as the level "labels"; none where there is neither. INVALID_ARGUMENT: a list that is
// none.
absl::StatusOr<std::vector<TruthLevel>> FindTruth(const std::filesystem::path& dataset);

// The label images of the held-out views, in the pixels of the photographs, and the ignore mask of
// the dataset. Images of another size are resampled (nearest) to it. INVALID_ARGUMENT: an image of
// another shape than its photograph; ids over 255 in an image that is to be resampled.
absl::StatusOr<v1::EvaluateRequest> EvaluateRequestOf(const std::filesystem::path& dataset,
                                                      const TruthLevel& level,
                                                      const std::string& model,
                                                      const std::vector<v1::View>& views);

}  // namespace pepeseg::client::cli
