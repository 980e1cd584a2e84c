#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "core/query/photograph_frame.h"
#include "core/query/view_features.h"
#include "core/scene/capture.h"
#include "core/scene/mask_set.h"

// Resample images of a view to the pixels of its photograph, [places.height(), places.width()].
// Pixels that the view does not show are 0.
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

// Returns the mask in the photograph. A pixel is inside if the mask, smoothed over three pixels of
// the view by a quadratic B-spline (which keeps straight edges in place), exceeds 0.5 there. An
// enlarged mask thus does not show the steps of the view's pixels.
BinaryMask MaskInPhotograph(const BinaryMask& mask, const ViewPlaces& places);
// Returns the result with mask, size, area, box and similarity (if there is one) in the photograph.
// The score is 0 if the mask becomes empty; the other fields stay.
SegmentResult InPhotograph(const SegmentResult& result, const ViewPlaces& places);

// Resample bilinearly.
std::vector<float> ValuesInPhotograph(std::span<const float> values, const ViewPlaces& places);
Image ColorsInPhotograph(const Image& image, const ViewPlaces& places);
// Resample to the nearest value.
std::vector<float> NearestInPhotograph(std::span<const float> values, const ViewPlaces& places);
std::vector<int32_t> NearestInPhotograph(std::span<const int32_t> ids, const ViewPlaces& places);

}  // namespace pepeseg
