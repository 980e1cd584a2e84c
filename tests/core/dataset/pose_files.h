#pragma once

#include <string>
#include <vector>

#include "core/scene/camera.h"
#include "tests/testing/small_dataset.h"

namespace pepeseg::testing {

// One frame of a transforms.json.
struct FrameRecord {
  std::string file_path;
  Pose cam_from_world;
  double scale = 1;         // factor of the axes
  std::string more_fields;  // `, "w": 40`
};

// Returns the text of the file. `fields` are those of the document, such as `"fl_x": 50`. Doubles
// are written without rounding.
std::string TransformsJson(const std::string& fields, const std::vector<FrameRecord>& frames);

// Returns 17 numbers for each pose: LLFF's axes, 40x30 pixels, focal length 50, bounds 1 and 9.
std::vector<double> PosesBoundsRows(const std::vector<Pose>& poses);
std::string PosesBoundsNpy(const std::vector<double>& rows);

// Returns the poses of SmallDataset's photographs a.jpg, b.jpg and sub/c.png.
std::vector<Pose> SmallPoses();
// Deletes the COLMAP files of a SmallDataset.
void RemoveColmap(const SmallDataset& dataset);

}  // namespace pepeseg::testing
