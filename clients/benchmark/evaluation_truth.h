#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "clients/benchmark/outlines.h"
#include "clients/benchmark/scene_truth.h"
#include "pepeseg/v1/evaluation_service.pb.h"
#include "pepeseg/v1/scene_service.pb.h"

// The truth of an evaluation, read from a folder or a file. STEM is a view's name without its
// ending.
namespace pepeseg::client::cli {

struct TruthFlags {
  std::filesystem::path folder;    // or a file of outlines
  std::filesystem::path ignore;    // a PNG for all views, or a folder of STEM.png; empty: none
  std::string names;               // a JSON file with names by id; empty: none
  std::vector<std::string> views;  // names; empty: held-out views
  bool trained_views = false;      // reads views that were trained on, too
  bool fitting = false;            // resamples label images and `ignore` to the photographs
};

// Returns the views among `views` to score. INVALID_ARGUMENT: a view that the user names is
// unknown, or was trained on and trained views are not wanted.
absl::StatusOr<std::vector<v1::View>> ViewsToScore(const TruthFlags& flags,
                                                   const std::vector<v1::View>& views);

// What AddTruth did not add.
struct AddedTruth {
  std::vector<std::string> views_without;    // names of views without truth
  std::vector<OutlinedPhotograph> outlines;  // all that were read, also those of other views
};

// Adds the truth of each view that has some: the label image FOLDER/STEM.png, the binary masks
// FOLDER/STEM/ENTITY.png, or both. If no view has any, adds what FindTruthAt finds at the folder:
// outlines, or the label images of a scene. The frame of the request is the one that outlines were
// drawn on. NOT_FOUND: no view has truth. INVALID_ARGUMENT: outlines are malformed, or were drawn
// on an image of another shape, or, for PIXEL_FRAME_VIEW, of another size; or the scene has
// several levels.
absl::StatusOr<AddedTruth> AddTruth(const TruthFlags& flags, const std::vector<v1::View>& views,
                                    v1::EvaluateModelRequest& request);

// Returns a request that scores `model` on the held-out views that have truth of a level of a
// dataset, with the dataset's ignore_mask.png. Outlines are drawn in the size of the photograph.
// Label images of another size than the photograph are resampled to it (nearest neighbour).
// INVALID_ARGUMENT: the shape of an image, also of one that was drawn on, differs from that of its
// photograph, or an image to be resampled has an id over 255.
absl::StatusOr<v1::EvaluateModelRequest> EvaluateRequestOf(const std::filesystem::path& dataset,
                                                           const TruthLevel& level,
                                                           const std::string& model,
                                                           const std::vector<v1::View>& views);

// Returns a warning about photographs with outlines that are not among `views`, all views of the
// model; "" if there are none.
std::string UnknownPhotographs(const std::vector<OutlinedPhotograph>& outlines,
                               const std::vector<v1::View>& views);

// Adds SAM's masks of each view that has some: FOLDER/STEM.json as its automatic mask generator
// writes it, or binary masks FOLDER/STEM/*.png, all of which count. Returns the names of
// views without masks. NOT_FOUND: no view has masks. INVALID_ARGUMENT: a file is not such JSON.
absl::StatusOr<std::vector<std::string>> AddSamMasks(const TruthFlags& flags,
                                                     const std::vector<v1::View>& views,
                                                     v1::EvaluateModelRequest& request);

// Reads the names of entities: ["none", "apple", ...] by id, or {"7": "apple", ...}.
// INVALID_ARGUMENT: the file is neither.
absl::Status AddNames(const std::string& file, v1::EvaluateModelRequest& request);

// Returns the names of the entities that a view of the request shows: of all ids of its label image
// that are not void (EvaluateModelRequest.ignore_label), and of its masks. INVALID_ARGUMENT: its
// label image is not a PNG.
absl::StatusOr<std::vector<std::string>> EntitiesOf(const v1::EvaluateModelRequest& request,
                                                    const v1::ViewTruth& truth);

// Returns the ignored pixels of a view as a PNG, empty if there are none.
absl::StatusOr<std::string> IgnorePng(const TruthFlags& flags, const std::string& view);

}  // namespace pepeseg::client::cli
