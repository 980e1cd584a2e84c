#pragma once

#include <cstdint>
#include <span>
#include <string>

namespace pepeseg {

// The camera that took a photograph, from its EXIF data. Unknown fields are empty or 0.
struct ExifCamera {
  std::string maker;
  std::string model;
  double focal_length = 0;     // mm
  int focal_length_35_mm = 0;  // mm, equivalent for a sensor of 36x24 mm

  bool operator==(const ExifCamera&) const = default;
};

// Reads the camera from the bytes of a JPEG, PNG or WebP file. All fields are unknown for other
// files and for malformed data.
ExifCamera ReadExifCamera(std::span<const uint8_t> bytes);

// Returns the EXIF orientation of a JPEG, PNG or WebP file, in [1, 8]: how its stored pixels are
// rotated and mirrored to become upright (core/scene/photograph.h). Returns 1 for other files and
// for malformed data.
int ReadExifOrientation(std::span<const uint8_t> bytes);

// Returns the EXIF data of a JPEG, PNG or WebP file, a TIFF structure; empty: it has none.
std::string ReadExifData(std::span<const uint8_t> bytes);

// Inserts EXIF data, the TIFF structure `tiff`, into a JPEG file whose pixels are upright, and sets
// its orientation to 1. Returns the file unchanged if the data does not fit in one JPEG segment.
std::string WithUprightExif(std::string jpeg, std::string tiff);

}  // namespace pepeseg
