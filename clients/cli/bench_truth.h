#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "clients/cli/outlines.h"
#include "clients/cli/picture.h"
#include "pepeseg/v1/evaluation_service.pb.h"
#include "pepeseg/v1/scene_service.pb.h"

namespace pepeseg::client::cli {

// The ground truth of one granularity level of a dataset: label images or outlines of views.
struct TruthLevel {
  std::string name;
  std::filesystem::path folder;                   // has STEM.png for views
  std::map<int, std::string> entities;            // names by id; an id without a name is absent
  std::vector<OutlinedPhotograph> outlines = {};  // in place of label images
};

// Returns the levels of a dataset's folder. gt/labels.json lists them with the names of entities by
// id ({"part": ["-", "lamp", ...], ...}), and gt/LEVEL/ has their label images. Without that file
// there is one level, "labels", of the first that exists: label images in labels/; outlines in
// labels/ (see ReadOutlines), annotations.json or annotations/; LabelMe's outlines next to the
// photographs in images/. Without any of these there is none. INVALID_ARGUMENT: gt/labels.json is
// not a JSON object, or outlines are malformed.
absl::StatusOr<std::vector<TruthLevel>> FindTruth(const std::filesystem::path& dataset);

// Returns a request that scores `model` on the held-out views that have a label image or outlines,
// with the dataset's ignore mask. Outlines are drawn in the size of the photograph. Images of
// another size than the photograph are resampled to it (nearest neighbour). INVALID_ARGUMENT: the
// shape of an image, also of one that was drawn on, differs from that of its photograph, or an
// image to be resampled has an id over 255.
absl::StatusOr<v1::EvaluateModelRequest> EvaluateRequestOf(const std::filesystem::path& dataset,
                                                           const TruthLevel& level,
                                                           const std::string& model,
                                                           const std::vector<v1::View>& views);

}  // namespace pepeseg::client::cli
