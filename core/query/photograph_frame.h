#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/query/prompt.h"
#include "core/scene/camera.h"
#include "core/scene/model.h"
#include "core/scene/photograph.h"

namespace pepeseg {

// Maps between the pixels of an uploaded photograph, upright, and of the view made from it.
//
// View to photograph uses the formulas of the import (ViewWarp): the part of the pinhole frame that
// the view shows, then the lens, then the EXIF orientation. Photograph to view inverts the lens by
// Newton's method. For a view without a photograph both have the same pixels. Positions count
// pixels, with pixel centres at + 0.5.
class PhotographFrame {
 public:
  explicit PhotographFrame(const ModelView& view);

  // Size of the upright photograph, pixels.
  int width() const { return width_; }
  int height() const { return height_; }
  const Camera& camera() const { return camera_; }
  // Returns whether photograph and view have the same pixels, so that no mapping is needed.
  bool is_view() const { return is_view_; }
  // Returns whether the lens has no distortion: the view is the photograph, rotated and scaled.
  bool is_straight() const { return !photograph_ || photograph_->lens.IsPinhole(); }
  // Returns whether the view is the photograph, possibly shrunk but not rotated.
  bool is_shrunk() const {
    return is_straight() && (!photograph_ || photograph_->orientation == 1);
  }

  // Returns the position in the photograph of a position in the view.
  Eigen::Vector2d FromView(const Eigen::Vector2d& place) const;
  // Returns the inverse of FromView, which may lie outside the view, or nothing if the search finds
  // no ray of the lens there. `near`, if not null, is a position in the view from which the search
  // starts.
  std::optional<Eigen::Vector2d> Invert(const Eigen::Vector2d& place,
                                        const Eigen::Vector2d* near = nullptr) const;
  // Returns the position in the view, or nothing if the view does not show it.
  std::optional<Eigen::Vector2d> ToView(const Eigen::Vector2d& place) const;
  // Returns the smallest box in the view around the visible part of a box of the photograph, or
  // nothing if no part is visible.
  std::optional<BoxPrompt> ToView(const BoxPrompt& box) const;

  // Returns the photograph's nearest pixel, y * width() + x, for each pixel of the view:
  // [height, width]. The import resamples masks in the same way.
  std::vector<int32_t> PixelsOfView() const;
  // Resamples values [height(), width()] of the photograph to the pixels of the view by
  // PixelsOfView.
  template <class T>
  std::vector<T> TakeToView(std::vector<T> values) const {
    if (is_view_) return values;
    std::vector<T> taken;
    for (const int32_t pixel : PixelsOfView()) taken.push_back(values[pixel]);
    return taken;
  }
  // Resamples an ignore mask: a pixel of the view is ignored if any part of it is, as in the
  // import.
  std::vector<uint8_t> TakeIgnoreToView(const std::vector<uint8_t>& ignore) const;

  // Equal frames have equal photographs and cameras, and map equally.
  bool operator==(const PhotographFrame&) const = default;

 private:
  int32_t PixelAt(int part_x, int part_y) const;
  Eigen::Vector2d PinholePixel(const Eigen::Vector2d& place) const;
  Eigen::Vector2d PlaceOfPinholePixel(const Eigen::Vector2d& pixel) const;

  Camera camera_;
  std::optional<Photograph> photograph_;
  int width_, height_;
  bool is_view_;
};

}  // namespace pepeseg
