#pragma once

#include <cstdint>
#include <span>
#include <string>

namespace pepeseg {

// What took a photograph, as its EXIF data tell it; what they do not tell is empty or 0.
struct ExifCamera {
  std::string maker;
  std::string model;
  double focal_length = 0;     // mm
  int focal_length_35_mm = 0;  // mm, for a picture of 36x24 mm

  bool operator==(const ExifCamera&) const = default;
};

// Of a JPEG file; empty for other files and where the data are malformed.
ExifCamera ReadExifCamera(std::span<const uint8_t> bytes);

// EXIF orientation of a JPEG file, [1, 8]: how its pixels are turned and mirrored to be upright,
// see core/scene/photograph.h. 1 for other files and where the data is malformed.
int ReadExifOrientation(std::span<const uint8_t> bytes);

// A JPEG file with EXIF data, `tiff`, in which the orientation is set to 1: for pixels that are
// upright already. Unchanged when the data is longer than a segment holds.
std::string WithUprightExif(std::string jpeg, std::string tiff);

}  // namespace pepeseg
