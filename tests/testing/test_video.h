#pragma once

#include <filesystem>
#include <vector>

#include "core/scene/capture.h"

namespace pepeseg::testing {

// Writes an AVI with Motion JPEG, 25 frames a second.
void WriteVideo(const std::filesystem::path& path, const std::vector<Image>& frames);

// How an MP4 is shown, by its header.
struct Mp4Header {
  int a = 1, b = 0, c = 0, d = 1;  // display matrix
  int matrix_coefficients = 0;     // of the box "colr", by H.273. 0: there is no such box
};

// Writes an MP4 with MPEG-4 video, 25 frames a second. Its luma and chroma are BT.601's, whatever
// the header says.
void WriteMp4(const std::filesystem::path& path, const std::vector<Image>& frames,
              const Mp4Header& header);

}  // namespace pepeseg::testing
