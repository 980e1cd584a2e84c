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

// Takes what belongs to a photograph of `lens` to the pinhole camera that stands for it.
//
// A lens that distorts is undone by its own formulas: each pixel of the pinhole image looks up the
// place in the photograph where the lens puts its ray. The pinhole keeps the focal lengths and the
// principal point; its image is the largest part of the photograph's own frame, cut at its four
// sides, all of whose pixels the photograph covers. Then both are shrunk by `image_scale`.
class ViewWarp {
 public:
  // INVALID_ARGUMENT: no pixel of the frame is covered.
  static absl::StatusOr<ViewWarp> Create(const Lens& lens, double image_scale);

  // The warp that made a view with this camera of this photograph.
  static ViewWarp Restore(const Photograph& photograph, const Camera& camera);

  const Camera& camera() const { return camera_; }
  // What Restore needs. Its orientation is 1: nothing here looks at how the pixels are turned.
  const Photograph& photograph() const { return photograph_; }
  // Bilinear through the lens, area-averaged to a smaller size.
  Image Photo(const Image& photo) const;
  // Nearest; a pixel of the result is ignored if any of it is.
  std::vector<uint8_t> Ignore(const std::vector<uint8_t>& ignore) const;
  // Nearest. The masks may have any size and stand for the whole photograph.
  MaskSet Masks(const MaskSet& masks) const;
  // [height, width] of camera(). The map may have any size and stands for the whole photograph.
  // Bilinear over what is known; a pixel is unknown (NaN) where the nearest value is, so that what
  // is unknown neither grows nor shrinks.
  std::vector<float> Depth(const FloatImage& map) const;

 private:
  ViewWarp() = default;

  struct Frame {  // a part of the photograph's frame, pixels
    int left = 0, top = 0, width = 0, height = 0;
  };
  void SetPart(const Lens& lens, const Frame& part);
  // The centre of the result's pixel, in pixels of the photograph.
  Eigen::Vector2d PlaceInPhoto(int x, int y) const;
  static Frame CoveredPart(const Lens& lens, const std::vector<float>& source);
  void KeepPart(const Frame& part, const std::vector<float>& source);

  Photograph photograph_;
  int photo_width_ = 0, photo_height_ = 0;
  int full_width_ = 0, full_height_ = 0;  // of the pinhole image before it is shrunk
  std::vector<float> source_;  // [full_height, full_width, 2] x, y; empty: as in the photograph
  Camera camera_;
};

}  // namespace pepeseg
