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

// A smooth colourful picture: what is one pixel off shows, what is a hundredth off does not.
Image Picture(int width, int height);
std::string Png(const Image& image);
std::string Jpeg(const Image& image);

// A dataset on disk that imports: three 40x30 photographs a.jpg, b.jpg, sub/c.png with poses,
// points, masks for a, an ignore mask for all. Change what a test is about, then Write it.
struct SmallDataset {
  std::vector<CameraRecord> cameras;
  std::vector<ImageRecord> images;
  std::vector<PointRecord> points;
  bool text = false;  // COLMAP's text form
  TempFolder folder;

  SmallDataset();
  // Photographs, masks and poses; files already written by hand stay.
  void Write() const;
  absl::StatusOr<Capture> Import(const ImportOptions& options = {}) const;
};

}  // namespace pepeseg::testing
