#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"
#include "core/scene/camera.h"
#include "core/scene/capture.h"
#include "core/scene/lens.h"
#include "core/scene/mask_set.h"
#include "core/scene/photograph.h"

namespace pepeseg {

// Warps a photograph taken with a distorting lens, and its masks and depth, to a pinhole camera.
//
// Each pixel of the pinhole image looks up the position in the photograph to which the lens
// projects its ray, so no inverse of the distortion is needed. The pinhole keeps the lens's focal
// lengths and principal point. Its image has the photograph's size, cropped at the four sides until
// the photograph covers every pixel, and then shrunk by `image_scale`. Thread safe after
// construction.
class ViewWarp {
 public:
  // Makes the warp of a lens. `image_scale` is in (0, 1]. INVALID_ARGUMENT: the photograph covers
  // no pixel of the pinhole image.
  static absl::StatusOr<ViewWarp> Create(const Lens& lens, double image_scale);

  // Returns the warp that made a view with this photograph and camera.
  static ViewWarp Restore(const Photograph& photograph, const Camera& camera);

  const Camera& camera() const { return camera_; }
  // The photograph that Restore needs. Its orientation is always 1; the caller sets it.
  const Photograph& photograph() const { return photograph_; }
  // Warps the photograph: bilinear through the lens, then area averaging to the smaller size.
  Image Photo(const Image& photo) const;
  // Warps an ignore mask of the photograph's size. A pixel of the result is ignored if any pixel
  // that it overlaps is.
  std::vector<uint8_t> Ignore(const std::vector<uint8_t>& ignore) const;
  // Warps masks to the nearest pixel. They cover the whole photograph, at any resolution.
  MaskSet Masks(const MaskSet& masks) const;
  // Warps a depth map that covers the whole photograph, at any resolution. Returns [height, width]
  // of camera(). Interpolates bilinearly between known values. A pixel is unknown (NaN) if the
  // nearest value is, so that unknown areas neither grow nor shrink.
  std::vector<float> Depth(const FloatImage& map) const;

 private:
  ViewWarp() = default;

  struct Frame {  // a rectangle of the uncropped pinhole image, pixels
    int left = 0, top = 0, width = 0, height = 0;
  };
  void SetPart(const Lens& lens, const Frame& part);
  // Returns the position in the photograph, in pixels, of the centre of a pixel of the result.
  Eigen::Vector2d PlaceInPhoto(int x, int y) const;
  static Frame CoveredPart(const Lens& lens, const std::vector<float>& source);
  void KeepPart(const Frame& part, const std::vector<float>& source);

  Photograph photograph_;
  int photo_width_ = 0, photo_height_ = 0;
  int full_width_ = 0, full_height_ = 0;  // of the cropped pinhole image before it is shrunk
  // [full_height, full_width, 2]: position x, y in the photograph. Empty: the lens is a pinhole,
  // and positions are equal.
  std::vector<float> source_;
  Camera camera_;
};

}  // namespace pepeseg
