#pragma once

#include <filesystem>
#include <fstream>

namespace pepeseg::testing {

// Writes outlines as LabelMe does: a "cup", a square of 2 x 2 of 8 x 6 pixels.
inline void WriteLabelMe(const std::filesystem::path& path) {
  std::filesystem::create_directories(path.parent_path());
  std::ofstream(path) << R"({"imageWidth": 8, "imageHeight": 6, "shapes": [{"label": "cup",)"
                      << R"("points": [[2, 2], [4, 2], [4, 4], [2, 4]], "group_id": null}]})";
}

}  // namespace pepeseg::testing
