#pragma once

#include <cstdint>
#include <filesystem>

#include "opencv2/core.hpp"

namespace pepeseg {

// How the first video track of an MP4 or MOV file is shown, by its header. VideoDecoder returns
// frames as stored, with all colours decoded as BT.601; they are corrected by this.
struct VideoTrack {
  // Display matrix: the stored pixel (x, y) is shown at (a x + c y, b x + d y), up to a shift. Only
  // the signs count.
  int a = 1, b = 0, c = 0, d = 1;
  // Matrix coefficients by ITU-T H.273: 1 is BT.709, 9 is BT.2020. 2: unknown, read as BT.601.
  int matrix_coefficients = 2;
};

// Reads the header of a file. Returns the defaults for other formats and for malformed headers.
VideoTrack ReadVideoTrack(const std::filesystem::path& path);

// Returns a frame upright and in its right colours. `frame` is as stored, 8-bit BGR, decoded with
// the coefficients of BT.601. Full and limited range need no correction: the decoder knows the
// range, and both reach the same colours.
cv::Mat ShownFrame(const cv::Mat& frame, const VideoTrack& track);

}  // namespace pepeseg
