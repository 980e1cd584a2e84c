#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "core/query/photograph_frame.h"

namespace pepeseg {

// Where in a view the pixels of its photograph are, for images to be taken from the view to the
// photograph at any size.
//
// Through a lens that distorts, the inverse is computed exactly on a grid of some pixels of the
// photograph and interpolated in between (the error is under 0.1 pixels for the lenses of the
// tests); next to the border of what the view shows it is computed exactly for each pixel.
class ViewPlaces {
 public:
  // Of the photograph at width x height pixels.
  ViewPlaces(const PhotographFrame& frame, int width, int height);

  const PhotographFrame& frame() const { return frame_; }
  int width() const { return width_; }
  int height() const { return height_; }
  // The places in the view, pixels, of the centres of `places.size()` = width() pixels of a row;
  // NaN where the view does not show them.
  void Row(int y, std::span<Eigen::Vector2f> places) const;

 private:
  Eigen::Vector2d InPhotograph(double x, double y) const;
  void MakeGrid();
  void StraightRow(int y, std::span<Eigen::Vector2f> places) const;
  void CellRow(int column, int y, std::span<Eigen::Vector2f> places) const;
  Eigen::Vector2f Exact(int x, int y) const;

  PhotographFrame frame_;
  int width_, height_;
  int step_ = 1, columns_ = 0;          // of the grid, pixels and nodes
  std::vector<Eigen::Vector2f> nodes_;  // [rows, columns_]; empty: the lens bends nothing
};

}  // namespace pepeseg
