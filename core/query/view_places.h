#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "core/query/photograph_frame.h"

namespace pepeseg {

// The positions in a view of the pixels of its photograph, for resampling images of the view to the
// photograph at any size.
//
// For a lens with distortion, the inverse is computed exactly on a coarse grid of pixels of the
// photograph and interpolated in between; the error is under 0.1 pixels for the lenses of the
// tests. Next to the border of the visible part it is computed exactly for each pixel.
class ViewPlaces {
 public:
  // The photograph is resampled to width x height pixels.
  ViewPlaces(const PhotographFrame& frame, int width, int height);

  const PhotographFrame& frame() const { return frame_; }
  int width() const { return width_; }
  int height() const { return height_; }
  // Writes the positions in the view, pixels, of the pixel centres of scanline y. NaN: the view
  // does not show the pixel. places.size() must be width().
  void Row(int y, std::span<Eigen::Vector2f> places) const;

 private:
  Eigen::Vector2d InPhotograph(double x, double y) const;
  void MakeGrid();
  void StraightRow(int y, std::span<Eigen::Vector2f> places) const;
  void CellRow(int column, int y, std::span<Eigen::Vector2f> places) const;
  Eigen::Vector2f Exact(int x, int y) const;

  PhotographFrame frame_;
  int width_, height_;
  int step_ = 1, columns_ = 0;          // pixels between nodes; nodes per grid row
  std::vector<Eigen::Vector2f> nodes_;  // [rows, columns_]; empty: no distortion
};

}  // namespace pepeseg
