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

// Pixels of the photograph between two nodes. What a straight line between them misses grows with
// the square of it, and with the curvature of the lens, which is the angle of view's, per focal
// length.
double GridStep(const PhotographFrame& frame) {
  constexpr double kOfFocal = 0.13;  // 8 pixels at a focal length of 500
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
  // Nodes that far outside of the view are still next to a pixel that it shows.
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

Vector2f ViewPlaces::Place(int x, int y) const {
  const int column = x / step_, row = y / step_;
  const Vector2f* node = &nodes_[static_cast<size_t>(row) * columns_ + column];
  const std::array<const Vector2f*, 4> corners = {node, node + 1, node + columns_,
                                                  node + columns_ + 1};
  const auto known = std::count_if(corners.begin(), corners.end(),
                                   [](const Vector2f* corner) { return IsSomewhere(*corner); });
  if (known == 0) return Nowhere();
  if (known < 4) return Exact(x, y);
  const float right = (static_cast<float>(x - column * step_) + 0.5f) / static_cast<float>(step_);
  const float below = (static_cast<float>(y - row * step_) + 0.5f) / static_cast<float>(step_);
  const Vector2f above_place = *corners[0] + right * (*corners[1] - *corners[0]);
  const Vector2f below_place = *corners[2] + right * (*corners[3] - *corners[2]);
  return above_place + below * (below_place - above_place);
}

void ViewPlaces::Row(int y, std::span<Vector2f> places) const {
  assert(static_cast<int>(places.size()) == width_);
  const Camera& camera = frame_.camera();
  const auto right = static_cast<float>(camera.width), bottom = static_cast<float>(camera.height);
  for (int x = 0; x < width_; ++x) {
    const Vector2f place = nodes_.empty() ? Exact(x, y) : Place(x, y);
    // False for NaN.
    const bool shown = place.x() >= 0 && place.y() >= 0 && place.x() < right && place.y() < bottom;
    places[x] = shown ? place : Nowhere();
  }
}

}  // namespace pepeseg
