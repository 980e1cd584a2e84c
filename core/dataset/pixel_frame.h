#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/scene/capture.h"
#include "core/scene/mask_set.h"

// A photograph with an EXIF orientation has two pixel frames: "stored", as in the file, and
// "upright", after the orientation was applied (core/scene/photograph.h). Files that belong to a
// photograph are made for either: COLMAP reads the stored pixels, while OpenCV, Polycam and many
// scripts apply the orientation.
namespace pepeseg {

enum class PixelFrame { kStored, kUpright };

// Returns "stored" or "upright".
const char* NameOf(PixelFrame frame);

// Returns the EXIF orientation that undoes `orientation`, which is in [1, 8].
int InverseOrientation(int orientation);

// Rotate and mirror masks or values by an EXIF orientation in [1, 8], as Upright does an image.
// `values` is [height, width].
MaskSet Turned(const MaskSet& masks, int orientation);
FloatImage Turned(const FloatImage& map, int orientation);
std::vector<uint8_t> Turned(const std::vector<uint8_t>& values, int width, int height,
                            int orientation);

// Photographs of a dataset that are compared, evenly spread.
inline constexpr int kMaxExaminedPhotos = 8;
// Longer side at which photographs are compared with what belongs to them, pixels.
inline constexpr int kExaminedSide = 384;
// Ratio from which one frame fits clearly better. Measured on mirrored photographs of
// tests/data/apc_shelf: 2.3 for masks, 1.3 for ignore masks.
inline constexpr double kClearlyMore = 1.15;

// The contrast of photographs across the borders of values that may belong to them, compared with
// their contrast everywhere.
class BorderContrast {
 public:
  // Adds a photograph and values of its size. Two neighbouring values have a border if they differ
  // by more than `least_step`.
  void Add(const Image& photo, const FloatImage& values, float least_step);

  double num_borders() const { return num_borders_; }
  // 1: borders do not follow the photographs.
  double Relative() const;

 private:
  double num_borders_ = 0, at_borders_ = 0, everywhere_ = 0;
  int64_t num_ = 0;
};

// Compares values that belong to photographs with these in both pixel frames (pixel_frame.h). The
// two frames of each photograph have the same shape.
class FrameTrial {
 public:
  enum class Values {
    kLabels,  // different values have a border
    kDepth,   // in [0, 1]; steps are borders, slopes are not
  };
  explicit FrameTrial(Values kind) : kind_(kind) {}

  // Adds a photograph, its EXIF orientation, and values of its shape, at any resolution.
  void Add(const Image& stored, int orientation, const FloatImage& values);

  // Returns true if the values are nearly the same in both frames, or there are hardly any borders.
  bool NeedsNoChoice() const;
  // Returns the frame in which borders have `clearly_more` times the contrast of the other one, or
  // nothing.
  std::optional<PixelFrame> Verdict(double clearly_more) const;

 private:
  void Compare(const FloatImage& a, const FloatImage& b);

  Values kind_;
  BorderContrast stored_, upright_;
  int64_t num_ = 0, num_differing_ = 0;
};

}  // namespace pepeseg
