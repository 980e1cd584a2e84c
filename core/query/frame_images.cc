#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <limits>
#include <optional>

#include "core/query/frame.h"
#include "core/query/mask_geometry.h"

namespace pepeseg {
namespace {

using Eigen::Vector2d;
using Eigen::Vector2f;

// Returns the distance between two nodes, pixels of the photograph. The error of linear
// interpolation grows with the square of the distance and with the curvature of the lens mapping,
// which is inversely proportional to the focal length in pixels.
double GridStep(const Frame& frame) {
  constexpr double kOfFocal = 0.13;  // gives 8 pixels at a focal length of 500
  const Camera& camera = frame.camera();
  const double enlarged = static_cast<double>(std::max(frame.width(), frame.height())) /
                          std::max(camera.width, camera.height);
  return std::clamp(std::sqrt(kOfFocal * enlarged * std::min(camera.fx, camera.fy)), 1.0, 32.0);
}

Vector2f Nowhere() { return Vector2f::Constant(std::numeric_limits<float>::quiet_NaN()); }

bool IsSomewhere(const Vector2f& place) { return !std::isnan(place.x()); }

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

}  // namespace

BinaryMask Resized(const BinaryMask& mask, const ImageSize& from, const ImageSize& to) {
  if (from == to) return mask;
  BinaryMask resized;
  resized.pixels.reserve(static_cast<size_t>(to.width * to.height));
  for (int64_t y = 0; y < to.height; ++y) {
    // The source pixel under the centre of the target pixel: (y + 1/2) * from / to, rounded down.
    const int64_t row = (2 * y + 1) * from.height / (2 * to.height);
    for (int64_t x = 0; x < to.width; ++x) {
      const int64_t column = (2 * x + 1) * from.width / (2 * to.width);
      resized.pixels.push_back(mask.pixels[row * from.width + column]);
    }
  }
  return resized;
}

ModelView AtSize(const ModelView& view, int width, int height) {
  ModelView resized = view;
  resized.camera = Resized(view.camera, width, height);
  return resized;
}

struct Frame::Grid {
  int step = 1, columns = 0;    // pixels between nodes; nodes per grid row
  std::vector<Vector2f> nodes;  // [rows, columns]
};

void Frame::ResizeTo(int width, int height) {
  out_width_ = width;
  out_height_ = height;
  grid_.reset();
}

Vector2d Frame::InPhotograph(double x, double y) const {
  return {x * width() / out_width_, y * height() / out_height_};
}

const Frame::Grid& Frame::MakeGrid() const {
  if (grid_ != nullptr) return *grid_;
  const auto grid = std::make_shared<Grid>();
  const double grid_step = GridStep(*this);
  const double share = std::min(1.0, static_cast<double>(out_width_) / width());
  const int step = grid->step = std::max(1, static_cast<int>(grid_step * share));
  grid->columns = (out_width_ + step - 1) / step + 1;
  const int rows = (out_height_ + step - 1) / step + 1;
  // A node at most this far outside the view may still be next to a visible pixel.
  const double margin = 3 * grid_step;
  grid->nodes.reserve(static_cast<size_t>(grid->columns) * rows);
  for (int j = 0; j < rows; ++j) {
    std::optional<Vector2d> last;
    for (int i = 0; i < grid->columns; ++i) {
      const Vector2d* near = last ? &*last : nullptr;
      const auto place = Invert(InPhotograph(i * step, j * step), near);
      const bool usable = place && place->x() > -margin && place->y() > -margin &&
                          place->x() < camera_.width + margin &&
                          place->y() < camera_.height + margin;
      grid->nodes.push_back(usable ? place->cast<float>() : Nowhere());
      last = usable ? place : std::nullopt;
    }
  }
  grid_ = grid;
  return *grid_;
}

Vector2f Frame::Exact(int x, int y) const {
  const std::optional<Vector2d> place = ToView(InPhotograph(x + 0.5, y + 0.5));
  return place ? place->cast<float>() : Nowhere();
}

// Writes the pixels of scanline y in one column of grid cells: bilinear if all four nodes are
// known, exact if some are, none otherwise.
void Frame::CellRow(int column, int y, std::span<Vector2f> places) const {
  const Grid& grid = MakeGrid();
  const int step = grid.step, row = y / step, first = column * step;
  const int end = std::min(first + step, out_width_);
  const Vector2f* node = &grid.nodes[static_cast<size_t>(row) * grid.columns + column];
  const std::array<const Vector2f*, 4> corners = {node, node + 1, node + grid.columns,
                                                  node + grid.columns + 1};
  const auto known = std::count_if(corners.begin(), corners.end(),
                                   [](const Vector2f* corner) { return IsSomewhere(*corner); });
  if (known < 4) {
    for (int x = first; x < end; ++x) places[x] = known == 0 ? Nowhere() : Exact(x, y);
    return;
  }
  const auto size = static_cast<float>(step);
  const float below = (static_cast<float>(y - row * step) + 0.5f) / size;
  const Vector2f left = *corners[0] + below * (*corners[2] - *corners[0]);
  const Vector2f right = *corners[1] + below * (*corners[3] - *corners[1]);
  const Vector2f move = (right - left) / size;
  for (int x = first; x < end; ++x) {
    places[x] = left + (static_cast<float>(x - first) + 0.5f) * move;
  }
}

// Without distortion the positions of a scanline lie on a line at equal distances.
void Frame::StraightRow(int y, std::span<Vector2f> places) const {
  const std::optional<Vector2d> first = Invert(InPhotograph(0.5, y + 0.5));
  const std::optional<Vector2d> second = Invert(InPhotograph(1.5, y + 0.5));
  const Vector2d move = *second - *first;
  for (int x = 0; x < out_width_; ++x) places[x] = (*first + x * move).cast<float>();
}

void Frame::PlacesOfRow(int y, std::span<Vector2f> places) const {
  assert(static_cast<int>(places.size()) == out_width_);
  if (is_straight()) {
    StraightRow(y, places);
  } else {
    const int columns = MakeGrid().columns;
    for (int column = 0; column + 1 < columns; ++column) CellRow(column, y, places);
  }
  const auto right = static_cast<float>(camera_.width);
  const auto bottom = static_cast<float>(camera_.height);
  for (Vector2f& place : places) {
    // False for NaN.
    const bool shown = place.x() >= 0 && place.y() >= 0 && place.x() < right && place.y() < bottom;
    if (!shown) place = Nowhere();
  }
}

// Calls `use` with the index of each pixel of the photograph that the view shows, and its position
// in the view.
template <class Use>
void Frame::ForEachShown(Use use) const {
  std::vector<Vector2f> row(out_width_);
  for (int y = 0; y < out_height_; ++y) {
    PlacesOfRow(y, row);
    for (int x = 0; x < out_width_; ++x) {
      if (IsSomewhere(row[x])) use(static_cast<size_t>(y) * out_width_ + x, row[x]);
    }
  }
}

template <class T>
std::vector<T> Frame::TakeNearest(std::span<const T> values) const {
  std::vector<T> result(NumPixels(), T{0});
  ForEachShown([&](size_t pixel, const Vector2f& place) {
    result[pixel] = values[PixelOfView(camera_, place)];
  });
  return result;
}

BinaryMask Frame::FromView(const BinaryMask& mask) const {
  if (HasSamePixels()) return mask;
  BinaryMask result = {std::vector<uint8_t>(NumPixels(), 0)};
  const std::vector<uint8_t> counts = CountAround(mask, camera_);
  ForEachShown([&](size_t pixel, const Vector2f& place) {
    const uint8_t around = counts[PixelOfView(camera_, place)];
    if (around == 0) return;
    result.pixels[pixel] = around == 9 || IsInSmoothed(mask, camera_, place) ? 1 : 0;
  });
  return result;
}

SegmentResult Frame::FromView(SegmentResult result) const {
  if (HasSamePixels()) return result;
  result.mask = FromView(result.mask);
  result.width = out_width_;
  result.height = out_height_;
  result.area = std::count(result.mask.pixels.begin(), result.mask.pixels.end(), 1);
  FindBox(result.mask.pixels, result.width, result.box);
  if (result.area == 0) result.score = 0;
  if (!result.similarity.empty()) result.similarity = ValuesFromView(result.similarity);
  return result;
}

std::vector<float> Frame::ValuesFromView(std::span<const float> values) const {
  std::vector<float> result(NumPixels(), 0);
  ForEachShown([&](size_t pixel, const Vector2f& place) {
    const Taps taps(camera_, place);
    float sum = 0;
    for (int i = 0; i < 4; ++i) sum += taps.weights[i] * values[taps.pixels[i]];
    result[pixel] = sum;
  });
  return result;
}

Image Frame::FromView(const Image& image) const {
  const int channels = image.channels;
  Image result = {out_width_, out_height_, channels, {}};
  result.pixels.resize(NumPixels() * channels, 0);
  ForEachShown([&](size_t pixel, const Vector2f& place) {
    const Taps taps(camera_, place);
    for (int k = 0; k < channels; ++k) {
      float sum = 0.5f;
      for (int i = 0; i < 4; ++i)
        sum += taps.weights[i] * image.pixels[taps.pixels[i] * channels + k];
      result.pixels[pixel * channels + k] = static_cast<uint8_t>(sum);
    }
  });
  return result;
}

std::vector<float> Frame::NearestFromView(std::span<const float> values) const {
  return TakeNearest(values);
}

std::vector<int32_t> Frame::NearestFromView(std::span<const int32_t> ids) const {
  return TakeNearest(ids);
}

}  // namespace pepeseg
