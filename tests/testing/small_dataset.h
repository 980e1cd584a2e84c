#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/dataset/import.h"
#include "core/scene/capture.h"
#include "tests/testing/colmap_files.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg::testing {

void WriteBytes(const std::filesystem::path& path, const std::string& bytes);
std::string ReadBytes(const std::filesystem::path& path);

// Returns a smooth colourful picture: a shift of one pixel changes it visibly, one of a hundredth
// does not.
Image Picture(int width, int height);
std::string Png(const Image& image);
std::string Jpeg(const Image& image);

// A dataset on disk that can be imported: three 40x30 photographs a.jpg, b.jpg, sub/c.png with
// poses, points, masks of a.jpg, an ignore mask of each. A test changes what it is about, then
// calls Write().
struct SmallDataset {
  std::vector<CameraRecord> cameras;
  std::vector<ImageRecord> images;
  std::vector<PointRecord> points;
  bool text = false;  // writes COLMAP's text format instead of the binary one
  TempFolder folder;

  SmallDataset();
  // Writes photographs, masks and poses. Files that exist already stay as they are.
  void Write() const;
  absl::StatusOr<Capture> Import(const ImportOptions& options = {}) const;
};

}  // namespace pepeseg::testing
