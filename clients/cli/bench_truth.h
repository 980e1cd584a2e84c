#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "clients/cli/picture.h"
#include "pepeseg/v1/evaluation_service.pb.h"
#include "pepeseg/v1/scene_service.pb.h"

namespace pepeseg::client::cli {

// The ground truth of one granularity level of a dataset: a label image for each view.
struct TruthLevel {
  std::string name;
  std::filesystem::path folder;         // has STEM.png for views
  std::map<int, std::string> entities;  // names by id; an id without a name is absent
};

// Returns the levels of a dataset's folder. gt/labels.json lists them with the names of entities by
// id ({"part": ["-", "lamp", ...], ...}), and gt/LEVEL/ has their label images. Without that file,
// labels/ is the only level, "labels"; without either there is none. INVALID_ARGUMENT:
// gt/labels.json is not a JSON object.
absl::StatusOr<std::vector<TruthLevel>> FindTruth(const std::filesystem::path& dataset);

// Returns a request that scores `model` on the held-out views that have a label image, with the
// dataset's ignore mask. Images of another size than the photograph are resampled to it (nearest
// neighbour). INVALID_ARGUMENT: the shape of an image differs from that of its photograph, or an
// image to be resampled has an id over 255.
absl::StatusOr<v1::EvaluateModelRequest> EvaluateRequestOf(const std::filesystem::path& dataset,
                                                           const TruthLevel& level,
                                                           const std::string& model,
                                                           const std::vector<v1::View>& views);

}  // namespace pepeseg::client::cli
