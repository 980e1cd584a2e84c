#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "absl/status/statusor.h"
#include "clients/benchmark/outlines.h"
#include "pepeseg/v1/prompt.pb.h"

// Files of annotation tools with outlines: LabelMe's JSON, one a photograph, and COCO's.
namespace pepeseg::client::cli {

// Reads the outlines in a file, or in all *.json of a folder and of its subfolders. Photographs
// without outlines are left out. A file of LabelMe is named after its photograph, relative to the
// folder if there is one. An entity's name is its label, or category, with the number of the
// instance if it has one ("mug", "mug.2"):
//   LabelMe  polygons, rectangles and circles. group_id is the instance: shapes of one label and
//            group are one entity
//   COCO     polygons or run lengths. track_id or instance_id of an annotation, or of its
//            "attributes", is the instance: annotations of one category and instance are one
//            entity. Of the polygons of one annotation, one inside another is a hole. iscrowd is
//            not read, since tools set it for run lengths
// INVALID_ARGUMENT, with the file, the index of the shape or annotation, and the remedy: a part of
// it is malformed, or two things of one name in a photograph cannot be distinguished.
// `refuse_others`: a file of neither format is refused, too; otherwise it is left out.
absl::StatusOr<std::vector<OutlinedPhotograph>> ReadOutlines(const std::filesystem::path& path,
                                                             bool refuse_others);

// Returns the run lengths of COCO's {"size": [height, width], "counts": ...}, with counts as a list
// or compressed; nothing if it is not that.
std::optional<v1::CocoRle> RleOf(const nlohmann::json& json);

}  // namespace pepeseg::client::cli
