#pragma once

#include <filesystem>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "clients/cli/labelled_masks.h"

// Labelled masks as files of annotation tools. A thing has one category, instance and track id in
// all views.
namespace pepeseg::client::cli {

// Returns COCO's JSON of instances. Masks are run lengths; each annotation has `track_id`,
// `instance_id` and `label`, the label's id.
std::string CocoJson(const LabelledMasks& masks);

// Returns the lines of YOLO's segmentation format for a view, "CLASS X1 Y1 X2 Y2 ...": one a thing
// that the view shows, in the order of `masks.things`. Parts and holes are joined to one polygon.
// `tracks` gets "LINE,TRACK" lines. DATA_LOSS: a mask is malformed.
struct YoloText {
  std::string lines, tracks;
};
absl::StatusOr<YoloText> YoloOf(const LabelledMasks& masks, const LabelledView& view,
                                const std::string& file);

// Returns LabelMe's JSON for a view: a polygon for each part of a thing, with the track id as
// `group_id`.
absl::StatusOr<std::string> LabelMeJson(const LabelledMasks& masks, const LabelledView& view);

// Writes the masks: format "coco" to the file `path`; "yolo", "labelme" and "masks" to the folder
// `path`.
absl::Status WriteAnnotations(const LabelledMasks& masks, const std::string& format,
                              const std::filesystem::path& path);

}  // namespace pepeseg::client::cli
