#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "pepeseg/v1/evaluation_service.pb.h"
#include "pepeseg/v1/scene_service.pb.h"

// The truth of an evaluation, read from a folder. STEM is a view's name without its ending.
namespace pepeseg::client::cli {

struct TruthFlags {
  std::filesystem::path folder;
  std::filesystem::path ignore;    // a PNG for all views, or a folder of STEM.png; empty: none
  std::string names;               // a JSON file with names by id; empty: none
  std::vector<std::string> views;  // names, or one file with a name a line; empty: held-out views
  bool trained_views = false;      // reads views that were trained on, too
};

// Returns the views among `views` to score. INVALID_ARGUMENT: a view that the user names is
// unknown, or was trained on and trained views are not wanted. LocalFileError: the list cannot be
// read.
absl::StatusOr<std::vector<v1::View>> ViewsToScore(const TruthFlags& flags,
                                                   const std::vector<v1::View>& views);

// Adds the truth of each view that has some: the label image FOLDER/STEM.png, the binary masks
// FOLDER/STEM/ENTITY.png, or both. Returns the names of views without truth. NOT_FOUND: no view has
// truth.
absl::StatusOr<std::vector<std::string>> AddTruth(const TruthFlags& flags,
                                                  const std::vector<v1::View>& views,
                                                  v1::EvaluateModelRequest& request);
// Adds SAM's masks of each view that has some: FOLDER/STEM.json as its automatic mask generator
// writes it, or binary masks FOLDER/STEM/*.png, all of which count. Returns as AddTruth does.
// INVALID_ARGUMENT: a file is not such JSON.
absl::StatusOr<std::vector<std::string>> AddSamMasks(const TruthFlags& flags,
                                                     const std::vector<v1::View>& views,
                                                     v1::EvaluateModelRequest& request);

// Reads the names of entities: ["none", "apple", ...] by id, or {"7": "apple", ...}.
// INVALID_ARGUMENT: the file is neither.
absl::Status AddNames(const std::string& file, v1::EvaluateModelRequest& request);

// Returns the names of the entities that a view of the request shows. INVALID_ARGUMENT: its label
// image is not a PNG.
absl::StatusOr<std::vector<std::string>> EntitiesOf(const v1::EvaluateModelRequest& request,
                                                    const v1::ViewTruth& truth);

// Returns the ignored pixels of a view as a PNG, empty if there are none.
absl::StatusOr<std::string> IgnorePng(const TruthFlags& flags, const std::string& view);

}  // namespace pepeseg::client::cli
