#include "core/query/photograph_images.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <limits>
#include <optional>

#include "core/query/mask_geometry.h"

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

// Calls `use` with the index of each pixel of the photograph that the view shows, and its position
// in the view.
template <class Use>
void ForEachShown(const ViewPlaces& places, Use use) {
  std::vector<Vector2f> row(places.width());
  for (int y = 0; y < places.height(); ++y) {
    places.Row(y, row);
    for (int x = 0; x < places.width(); ++x) {
      if (std::isnan(row[x].x())) continue;
      use(static_cast<size_t>(y) * places.width() + x, row[x]);
    }
  }
}

size_t NumPixels(const ViewPlaces& places) {
  return static_cast<size_t>(places.width()) * places.height();
}

size_t PixelOfView(const Camera& camera, const Vector2f& place) {
  return static_cast<size_t>(place.y()) * camera.width + static_cast<size_t>(place.x());
}

// Returns how many of the nine pixels around each pixel are inside the mask: [height, width].
// Pixels beyond the border repeat the border. Lets MaskInPhotograph skip the spline where all nine
// agree.
std::vector<uint8_t> CountAround(const BinaryMask& mask, const Camera& camera) {
  const int width = camera.width, height = camera.height;
  std::vector<uint8_t> along(mask.pixels.size()), counts(mask.pixels.size());
  for (int y = 0; y < height; ++y) {
    const uint8_t* in = &mask.pixels[static_cast<size_t>(y) * width];
    uint8_t* out = &along[static_cast<size_t>(y) * width];
    for (int x = 0; x < width; ++x) {
      out[x] =
          static_cast<uint8_t>(in[std::max(x - 1, 0)] + in[x] + in[std::min(x + 1, width - 1)]);
    }
  }
  for (int y = 0; y < height; ++y) {
    const uint8_t* above = &along[static_cast<size_t>(std::max(y - 1, 0)) * width];
    const uint8_t* here = &along[static_cast<size_t>(y) * width];
    const uint8_t* below = &along[static_cast<size_t>(std::min(y + 1, height - 1)) * width];
    uint8_t* out = &counts[static_cast<size_t>(y) * width];
    for (int x = 0; x < width; ++x) out[x] = static_cast<uint8_t>(above[x] + here[x] + below[x]);
  }
  return counts;
}

// Returns the weights of the quadratic B-spline for the pixels before, at and after a position that
// is `offset` from the centre of the middle pixel.
std::array<float, 3> SplineWeights(float offset) {
  const float before = 0.5f - offset, after = 0.5f + offset;
  return {0.5f * before * before, 0.75f - offset * offset, 0.5f * after * after};
}

// Returns whether the smoothed mask exceeds 0.5 at a position in the view.
bool IsInSmoothed(const BinaryMask& mask, const Camera& camera, const Vector2f& place) {
  const auto column = static_cast<int>(place.x()), row = static_cast<int>(place.y());
  const std::array<float, 3> across = SplineWeights(place.x() - static_cast<float>(column) - 0.5f);
  const std::array<float, 3> down = SplineWeights(place.y() - static_cast<float>(row) - 0.5f);
  float sum = 0;
  for (int j = 0; j < 3; ++j) {
    const int y = std::clamp(row + j - 1, 0, camera.height - 1);
    for (int i = 0; i < 3; ++i) {
      const int x = std::clamp(column + i - 1, 0, camera.width - 1);
      if (mask.pixels[static_cast<size_t>(y) * camera.width + x] != 0) sum += across[i] * down[j];
    }
  }
  return sum > 0.5f;
}

// The four pixels around a position, as indices, and their bilinear weights.
struct Taps {
  std::array<size_t, 4> pixels;
  std::array<float, 4> weights;

  Taps(const Camera& camera, const Vector2f& place) {
    const float left = std::floor(place.x() - 0.5f), top = std::floor(place.y() - 0.5f);
    const float right_share = place.x() - 0.5f - left, below_share = place.y() - 0.5f - top;
    for (int i = 0; i < 4; ++i) {
      const int x = std::clamp(static_cast<int>(left) + i % 2, 0, camera.width - 1);
      const int y = std::clamp(static_cast<int>(top) + i / 2, 0, camera.height - 1);
      pixels[i] = static_cast<size_t>(y) * camera.width + x;
      weights[i] = (i % 2 == 0 ? 1 - right_share : right_share) *
                   (i / 2 == 0 ? 1 - below_share : below_share);
    }
  }
};

template <class T>
std::vector<T> TakeNearest(std::span<const T> values, const ViewPlaces& places) {
  std::vector<T> result(NumPixels(places), T{0});
  const Camera& camera = places.frame().camera();
  ForEachShown(places, [&](size_t pixel, const Vector2f& place) {
    result[pixel] = values[PixelOfView(camera, place)];
  });
  return result;
}

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

BinaryMask MaskInPhotograph(const BinaryMask& mask, const ViewPlaces& places) {
  BinaryMask result = {std::vector<uint8_t>(NumPixels(places), 0)};
  const Camera& camera = places.frame().camera();
  const std::vector<uint8_t> counts = CountAround(mask, camera);
  ForEachShown(places, [&](size_t pixel, const Vector2f& place) {
    const uint8_t around = counts[PixelOfView(camera, place)];
    if (around == 0) return;
    result.pixels[pixel] = around == 9 || IsInSmoothed(mask, camera, place) ? 1 : 0;
  });
  return result;
}

SegmentResult InPhotograph(const SegmentResult& result, const ViewPlaces& places) {
  SegmentResult mapped = result;
  mapped.mask = MaskInPhotograph(result.mask, places);
  mapped.width = places.width();
  mapped.height = places.height();
  mapped.area = std::count(mapped.mask.pixels.begin(), mapped.mask.pixels.end(), 1);
  FindBox(mapped.mask.pixels, mapped.width, mapped.box);
  if (mapped.area == 0) mapped.score = 0;
  if (!result.similarity.empty()) {
    mapped.similarity = ValuesInPhotograph(result.similarity, places);
  }
  return mapped;
}

std::vector<float> ValuesInPhotograph(std::span<const float> values, const ViewPlaces& places) {
  std::vector<float> result(NumPixels(places), 0);
  const Camera& camera = places.frame().camera();
  ForEachShown(places, [&](size_t pixel, const Vector2f& place) {
    const Taps taps(camera, place);
    float sum = 0;
    for (int i = 0; i < 4; ++i) sum += taps.weights[i] * values[taps.pixels[i]];
    result[pixel] = sum;
  });
  return result;
}

Image ColorsInPhotograph(const Image& image, const ViewPlaces& places) {
  const int channels = image.channels;
  Image result = {places.width(), places.height(), channels, {}};
  result.pixels.resize(NumPixels(places) * channels, 0);
  const Camera& camera = places.frame().camera();
  ForEachShown(places, [&](size_t pixel, const Vector2f& place) {
    const Taps taps(camera, place);
    for (int k = 0; k < channels; ++k) {
      float sum = 0.5f;
      for (int i = 0; i < 4; ++i)
        sum += taps.weights[i] * image.pixels[taps.pixels[i] * channels + k];
      result.pixels[pixel * channels + k] = static_cast<uint8_t>(sum);
    }
  });
  return result;
}

std::vector<float> NearestInPhotograph(std::span<const float> values, const ViewPlaces& places) {
  return TakeNearest(values, places);
}

std::vector<int32_t> NearestInPhotograph(std::span<const int32_t> ids, const ViewPlaces& places) {
  return TakeNearest(ids, places);
}

}  // namespace pepeseg
