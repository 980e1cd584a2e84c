#include "core/query/view_places.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <limits>

namespace pepeseg {
namespace {

using Eigen::Vector2d;
using Eigen::Vector2f;

// Returns the distance between two nodes, pixels of the photograph. The error of linear
// interpolation grows with the square of the distance and with the curvature of the lens mapping,
// which is inversely proportional to the focal length in pixels.
double GridStep(const PhotographFrame& frame) {
  constexpr double kOfFocal = 0.13;  // gives 8 pixels at a focal length of 500
  const Camera& camera = frame.camera();
  const double enlarged = static_cast<double>(std::max(frame.width(), frame.height())) /
                          std::max(camera.width, camera.height);
  return std::clamp(std::sqrt(kOfFocal * enlarged * std::min(camera.fx, camera.fy)), 1.0, 32.0);
}

Vector2f Nowhere() { return Vector2f::Constant(std::numeric_limits<float>::quiet_NaN()); }

bool IsSomewhere(const Vector2f& place) { return !std::isnan(place.x()); }

}  // namespace

ViewPlaces::ViewPlaces(const PhotographFrame& frame, int width, int height)
    : frame_(frame), width_(width), height_(height) {
  if (!frame_.is_straight()) MakeGrid();
}

Vector2d ViewPlaces::InPhotograph(double x, double y) const {
  return {x * frame_.width() / width_, y * frame_.height() / height_};
}

void ViewPlaces::MakeGrid() {
  const double grid_step = GridStep(frame_);
  const double share = std::min(1.0, static_cast<double>(width_) / frame_.width());
  step_ = std::max(1, static_cast<int>(grid_step * share));
  columns_ = (width_ + step_ - 1) / step_ + 1;
  const int rows = (height_ + step_ - 1) / step_ + 1;
  // A node at most this far outside the view may still be next to a visible pixel.
  const double margin = 3 * grid_step;
  const Camera& camera = frame_.camera();
  nodes_.reserve(static_cast<size_t>(columns_) * rows);
  for (int j = 0; j < rows; ++j) {
    std::optional<Vector2d> last;
    for (int i = 0; i < columns_; ++i) {
      const Vector2d* near = last ? &*last : nullptr;
      const auto place = frame_.Invert(InPhotograph(i * step_, j * step_), near);
      const bool usable = place && place->x() > -margin && place->y() > -margin &&
                          place->x() < camera.width + margin && place->y() < camera.height + margin;
      nodes_.push_back(usable ? place->cast<float>() : Nowhere());
      last = usable ? place : std::nullopt;
    }
  }
}

Vector2f ViewPlaces::Exact(int x, int y) const {
  const std::optional<Vector2d> place = frame_.ToView(InPhotograph(x + 0.5, y + 0.5));
  return place ? place->cast<float>() : Nowhere();
}

// Writes the pixels of scanline y in one column of grid cells: bilinear if all four nodes are
// known, exact if some are, none otherwise.
void ViewPlaces::CellRow(int column, int y, std::span<Vector2f> places) const {
  const int row = y / step_, first = column * step_;
  const int end = std::min(first + step_, width_);
  const Vector2f* node = &nodes_[static_cast<size_t>(row) * columns_ + column];
  const std::array<const Vector2f*, 4> corners = {node, node + 1, node + columns_,
                                                  node + columns_ + 1};
  const auto known = std::count_if(corners.begin(), corners.end(),
                                   [](const Vector2f* corner) { return IsSomewhere(*corner); });
  if (known < 4) {
    for (int x = first; x < end; ++x) places[x] = known == 0 ? Nowhere() : Exact(x, y);
    return;
  }
  const auto size = static_cast<float>(step_);
  const float below = (static_cast<float>(y - row * step_) + 0.5f) / size;
  const Vector2f left = *corners[0] + below * (*corners[2] - *corners[0]);
  const Vector2f right = *corners[1] + below * (*corners[3] - *corners[1]);
  const Vector2f move = (right - left) / size;
  for (int x = first; x < end; ++x) {
    places[x] = left + (static_cast<float>(x - first) + 0.5f) * move;
  }
}

// Without distortion the positions of a scanline lie on a line at equal distances.
void ViewPlaces::StraightRow(int y, std::span<Vector2f> places) const {
  const std::optional<Vector2d> first = frame_.Invert(InPhotograph(0.5, y + 0.5));
  const std::optional<Vector2d> second = frame_.Invert(InPhotograph(1.5, y + 0.5));
  const Vector2d move = *second - *first;
  for (int x = 0; x < width_; ++x) places[x] = (*first + x * move).cast<float>();
}

void ViewPlaces::Row(int y, std::span<Vector2f> places) const {
  assert(static_cast<int>(places.size()) == width_);
  if (nodes_.empty()) {
    StraightRow(y, places);
  } else {
    for (int column = 0; column + 1 < columns_; ++column) CellRow(column, y, places);
  }
  const Camera& camera = frame_.camera();
  const auto right = static_cast<float>(camera.width), bottom = static_cast<float>(camera.height);
  for (Vector2f& place : places) {
    // False for NaN.
    const bool shown = place.x() >= 0 && place.y() >= 0 && place.x() < right && place.y() < bottom;
    if (!shown) place = Nowhere();
  }
}

}  // namespace pepeseg
