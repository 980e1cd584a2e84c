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

// The pixels of an uploaded photograph, upright, and of the view that was made of it.
//
// From the view to the photograph it follows the formulas of the import (ViewWarp): the part of the
// pinhole's frame that the view shows, then the lens, then EXIF's turn. The way back inverts the
// lens by Newton's method. Of a view without a photograph both are the same pixels.
class PhotographFrame {
 public:
  explicit PhotographFrame(const ModelView& view);

  // Size of the upright photograph, pixels.
  int width() const { return width_; }
  int height() const { return height_; }
  const Camera& camera() const { return camera_; }
  // Whether a pixel of the photograph is the same pixel of the view, so that nothing is to be done.
  bool is_view() const { return is_view_; }
  // Whether the lens bends nothing: the view is the photograph, turned and shrunk.
  bool is_straight() const { return !photograph_ || photograph_->lens.IsPinhole(); }
  // Whether the view is the photograph, shrunk at most.
  bool is_shrunk() const {
    return is_straight() && (!photograph_ || photograph_->orientation == 1);
  }

  // Where a place of the view is in the photograph. Both count pixels, with centres at + 0.5.
  Eigen::Vector2d FromView(const Eigen::Vector2d& place) const;
  // The inverse; also some way outside of the view, for interpolation. None: the lens has no ray
  // there. `near`: a place of the view to start the search from.
  std::optional<Eigen::Vector2d> Invert(const Eigen::Vector2d& place,
                                        const Eigen::Vector2d* near = nullptr) const;
  // None: the view does not show that place of the photograph.
  std::optional<Eigen::Vector2d> ToView(const Eigen::Vector2d& place) const;
  // The smallest box of the view around what it shows of a box of the photograph; none: nothing.
  std::optional<BoxPrompt> ToView(const BoxPrompt& box) const;

  // Which pixel of the photograph, y * width() + x, each pixel of the view shows, [height, width]:
  // the nearest, as the import takes masks to views.
  std::vector<int32_t> PixelsOfView() const;
  // Of [height(), width()] values of the photograph those of the pixels that the view shows.
  template <class T>
  std::vector<T> TakeToView(std::vector<T> values) const {
    if (is_view_) return values;
    std::vector<T> taken;
    for (const int32_t pixel : PixelsOfView()) taken.push_back(values[pixel]);
    return taken;
  }
  // A pixel of the view is ignored where any of it is, as the import takes ignore masks to views.
  std::vector<uint8_t> TakeIgnoreToView(const std::vector<uint8_t>& ignore) const;

  // Of frames with equal photographs and cameras one can be used for the other.
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
