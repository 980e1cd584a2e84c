#include "core/dataset/view_warp.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "opencv2/imgproc.hpp"

namespace pepeseg {
namespace {

using Eigen::Vector2d;

// Returns true if the lens maps a neighbourhood of the ray without folding it, that is, if the
// Jacobian of the distortion (by central differences) has a positive determinant.
bool KeepsOrientation(const Lens& lens, const Vector2d& ray) {
  // Relative for far rays, where 1e-6 would drown in rounding.
  const double step = 1e-6 * std::max(1.0, ray.norm());
  const Vector2d dx = lens.Distort(ray + Vector2d(step, 0)) - lens.Distort(ray - Vector2d(step, 0));
  const Vector2d dy = lens.Distort(ray + Vector2d(0, step)) - lens.Distort(ray - Vector2d(0, step));
  return dx.x() * dy.y() - dx.y() * dy.x() > 0;
}

// Returns the largest slope, the tangent of the angle to the axis, for which the lens model is
// valid. Beyond the field of view that they were fitted to, distortion polynomials fold back, and
// would show the border of the photograph a second time. `farthest` is the largest slope to look
// at.
double LargestSlope(const Lens& lens, double farthest) {
  constexpr int kNumDirections = 32;
  constexpr int kNumSteps = 400;
  constexpr double kPi = 3.14159265358979323846;
  double largest = farthest;
  for (int i = 0; i < kNumDirections; ++i) {
    const double angle = 2 * kPi * i / kNumDirections;
    const Vector2d direction(std::cos(angle), std::sin(angle));
    for (int j = 1; j <= kNumSteps; ++j) {
      const double slope = farthest * j / kNumSteps;
      if (slope >= largest) break;
      if (!KeepsOrientation(lens, direction * slope)) largest = farthest * (j - 1) / kNumSteps;
    }
  }
  return largest;
}

// Returns the largest slope of the pinhole image, which is at a corner.
double FarthestSlope(const Lens& lens) {
  double farthest = 0;
  for (const double x : {0.0, static_cast<double>(lens.width)}) {
    for (const double y : {0.0, static_cast<double>(lens.height)}) {
      farthest = std::max(farthest, lens.PinholeRay({x, y}).norm());
    }
  }
  return farthest;
}

// Returns [height, width, 2]: for each pixel of the uncropped pinhole image the position of its
// centre in the photograph, or NaN if the photograph does not cover it.
std::vector<float> SourcePlaces(const Lens& lens) {
  constexpr float kNowhere = std::numeric_limits<float>::quiet_NaN();
  const double largest_slope = LargestSlope(lens, FarthestSlope(lens));
  std::vector<float> source;
  source.reserve(static_cast<size_t>(lens.width) * lens.height * 2);
  for (int y = 0; y < lens.height; ++y) {
    for (int x = 0; x < lens.width; ++x) {
      const Vector2d ray = lens.PinholeRay({x + 0.5, y + 0.5});
      const Vector2d place = lens.Project(ray);
      const bool covered = ray.norm() <= largest_slope && place.x() >= 0 && place.y() >= 0 &&
                           place.x() <= lens.width && place.y() <= lens.height;
      source.push_back(covered ? static_cast<float>(place.x()) : kNowhere);
      source.push_back(covered ? static_cast<float>(place.y()) : kNowhere);
    }
  }
  return source;
}

int Nearest(float place, int size) {
  return std::clamp(static_cast<int>(std::floor(place)), 0, size - 1);
}

// Samples a depth map at (x, y), in its pixels from its corner, as ViewWarp::Depth describes.
float Sample(const FloatImage& map, double x, double y) {
  const int nearest_x = Nearest(static_cast<float>(x), map.width);
  const int nearest_y = Nearest(static_cast<float>(y), map.height);
  const auto at = [&map](int u, int v) {
    return map.values[static_cast<size_t>(v) * map.width + u];
  };
  // The nearest value decides whether the result is known.
  if (std::isnan(at(nearest_x, nearest_y))) return at(nearest_x, nearest_y);
  // Bilinear: pixel centres lie at + 0.5, and the four taps around (x, y) are weighted by their
  // distance.
  const double left = std::floor(x - 0.5), top = std::floor(y - 0.5);
  double sum = 0, weights = 0;
  for (int i = 0; i < 4; ++i) {
    const int column = i % 2, row = i / 2;
    const double tap_x = left + column, tap_y = top + row;
    const double weight = (1 - std::abs(x - 0.5 - tap_x)) * (1 - std::abs(y - 0.5 - tap_y));
    // At the border, values repeat. Unknown ones get no weight.
    const float value = at(std::clamp(static_cast<int>(tap_x), 0, map.width - 1),
                           std::clamp(static_cast<int>(tap_y), 0, map.height - 1));
    if (std::isnan(value)) continue;
    sum += weight * value;
    weights += weight;
  }
  // Not 0 / 0: the nearest value is known, is one of the four, and has the largest weight.
  return static_cast<float>(sum / weights);
}

}  // namespace

// Crops greedily: removes the row or column at the side with the largest share of uncovered pixels,
// until all four sides are covered. The lens is one-to-one up to LargestSlope, so the covered area
// has no holes, and the inside is covered as soon as its border is.
ViewWarp::Frame ViewWarp::CoveredPart(const Lens& lens, const std::vector<float>& source) {
  int left = 0, top = 0, right = lens.width - 1, bottom = lens.height - 1;
  const auto uncovered = [&](int x0, int y0, int x1, int y1) {
    int64_t count = 0;
    for (int y = y0; y <= y1; ++y) {
      for (int x = x0; x <= x1; ++x) {
        count += std::isnan(source[2 * (static_cast<size_t>(y) * lens.width + x)]) ? 1 : 0;
      }
    }
    return static_cast<double>(count) / ((x1 - x0 + 1) * static_cast<double>(y1 - y0 + 1));
  };
  while (left <= right && top <= bottom) {
    const std::array<double, 4> shares = {
        uncovered(left, top, left, bottom), uncovered(right, top, right, bottom),
        uncovered(left, top, right, top), uncovered(left, bottom, right, bottom)};
    const auto worst = std::max_element(shares.begin(), shares.end());
    if (*worst == 0) break;
    const auto side = worst - shares.begin();
    left += side == 0 ? 1 : 0;
    right -= side == 1 ? 1 : 0;
    top += side == 2 ? 1 : 0;
    bottom -= side == 3 ? 1 : 0;
  }
  return {left, top, right - left + 1, bottom - top + 1};
}

void ViewWarp::KeepPart(const Frame& part, const std::vector<float>& source) {
  source_.reserve(static_cast<size_t>(part.width) * part.height * 2);
  for (int y = part.top; y < part.top + part.height; ++y) {
    const auto row = source.begin() + 2 * (static_cast<ptrdiff_t>(y) * photo_width_ + part.left);
    source_.insert(source_.end(), row, row + 2 * static_cast<ptrdiff_t>(part.width));
  }
}

void ViewWarp::SetPart(const Lens& lens, const Frame& part) {
  photograph_ = {lens, 1, part.left, part.top, part.width, part.height};
  photo_width_ = lens.width;
  photo_height_ = lens.height;
  full_width_ = part.width;
  full_height_ = part.height;
}

absl::StatusOr<ViewWarp> ViewWarp::Create(const Lens& lens, double image_scale) {
  ViewWarp warp;
  Frame part{0, 0, lens.width, lens.height};
  warp.SetPart(lens, part);
  if (!lens.IsPinhole()) {
    const std::vector<float> source = SourcePlaces(lens);
    part = CoveredPart(lens, source);
    if (part.width < 1 || part.height < 1) {
      return absl::InvalidArgumentError(absl::StrCat(
          "the ", NameOf(lens.model), " parameters leave no usable part of the photograph"));
    }
    warp.SetPart(lens, part);
    warp.KeepPart(part, source);
  }
  Camera& camera = warp.camera_;
  camera.width = std::max(1, static_cast<int>(std::lround(part.width * image_scale)));
  camera.height = std::max(1, static_cast<int>(std::lround(part.height * image_scale)));
  // Each axis has its own scale, because width and height are rounded.
  const double sx = static_cast<double>(camera.width) / part.width;
  const double sy = static_cast<double>(camera.height) / part.height;
  camera.fx = lens.fx * sx;
  camera.fy = lens.fy * sy;
  // The principal point is measured from the image's corner, so cropping and scaling need no half
  // pixel.
  camera.cx = (lens.cx - part.left) * sx;
  camera.cy = (lens.cy - part.top) * sy;
  return warp;
}

ViewWarp ViewWarp::Restore(const Photograph& photograph, const Camera& camera) {
  ViewWarp warp;
  const Lens& lens = photograph.lens;
  warp.SetPart(lens, {photograph.left, photograph.top, photograph.width, photograph.height});
  warp.camera_ = camera;
  if (lens.IsPinhole()) return warp;
  // The rectangle is covered, so positions need no check against NaN.
  warp.source_.reserve(static_cast<size_t>(photograph.width) * photograph.height * 2);
  for (int y = 0; y < photograph.height; ++y) {
    for (int x = 0; x < photograph.width; ++x) {
      const Vector2d pixel(photograph.left + x + 0.5, photograph.top + y + 0.5);
      const Vector2d place = lens.Project(lens.PinholeRay(pixel));
      warp.source_.push_back(static_cast<float>(place.x()));
      warp.source_.push_back(static_cast<float>(place.y()));
    }
  }
  return warp;
}

Image ViewWarp::Photo(const Image& photo) const {
  const int type = CV_8UC(photo.channels);
  // cv::Mat has no view of const memory; the calls below only read it.
  cv::Mat pixels(photo_height_, photo_width_, type, const_cast<uint8_t*>(photo.pixels.data()));
  if (!source_.empty()) {
    // OpenCV's positions are relative to the centre of the first pixel, ours to the image's corner.
    cv::Mat places =
        cv::Mat(full_height_, full_width_, CV_32FC2, const_cast<float*>(source_.data())) -
        cv::Scalar(0.5, 0.5);
    cv::Mat warped;
    cv::remap(pixels, warped, places, cv::noArray(), cv::INTER_LINEAR, cv::BORDER_REPLICATE);
    pixels = warped;
  }
  Image result{camera_.width, camera_.height, photo.channels, {}};
  result.pixels.resize(static_cast<size_t>(camera_.width) * camera_.height * photo.channels);
  cv::Mat shrunk(camera_.height, camera_.width, type, result.pixels.data());
  if (shrunk.size() == pixels.size()) {
    pixels.copyTo(shrunk);
  } else {
    cv::resize(pixels, shrunk, shrunk.size(), 0, 0, cv::INTER_AREA);
  }
  return result;
}

std::vector<uint8_t> ViewWarp::Ignore(const std::vector<uint8_t>& ignore) const {
  std::vector<uint8_t> result(static_cast<size_t>(camera_.width) * camera_.height, 0);
  for (int y = 0; y < full_height_; ++y) {
    for (int x = 0; x < full_width_; ++x) {
      const size_t i = static_cast<size_t>(y) * full_width_ + x;
      const size_t from =
          source_.empty()
              ? i
              : static_cast<size_t>(Nearest(source_[2 * i + 1], photo_height_)) * photo_width_ +
                    Nearest(source_[2 * i], photo_width_);
      if (ignore[from] == 0) continue;
      // Marks every pixel of the result that this one overlaps.
      const auto first_x = static_cast<int>(int64_t{x} * camera_.width / full_width_);
      const auto first_y = static_cast<int>(int64_t{y} * camera_.height / full_height_);
      const auto last_x = static_cast<int>((int64_t{x + 1} * camera_.width - 1) / full_width_);
      const auto last_y = static_cast<int>((int64_t{y + 1} * camera_.height - 1) / full_height_);
      for (int v = first_y; v <= last_y; ++v) {
        for (int u = first_x; u <= last_x; ++u) {
          result[static_cast<size_t>(v) * camera_.width + u] = 1;
        }
      }
    }
  }
  return result;
}

MaskSet ViewWarp::Masks(const MaskSet& masks) const {
  if (source_.empty() && camera_.width == masks.width && camera_.height == masks.height) {
    return masks;
  }
  const float scale_x = static_cast<float>(masks.width) / static_cast<float>(photo_width_);
  const float scale_y = static_cast<float>(masks.height) / static_cast<float>(photo_height_);
  std::vector<int32_t> source_pixel;
  source_pixel.reserve(static_cast<size_t>(camera_.width) * camera_.height);
  for (int y = 0; y < camera_.height; ++y) {
    // The pixel of the full image that contains the centre of pixel y of the result.
    const int full_y = static_cast<int>((int64_t{2 * y + 1} * full_height_) / (2 * camera_.height));
    for (int x = 0; x < camera_.width; ++x) {
      const int full_x = static_cast<int>((int64_t{2 * x + 1} * full_width_) / (2 * camera_.width));
      const size_t full = static_cast<size_t>(full_y) * full_width_ + full_x;
      const float place_x = source_.empty() ? static_cast<float>(full_x) + 0.5F : source_[2 * full];
      const float place_y =
          source_.empty() ? static_cast<float>(full_y) + 0.5F : source_[2 * full + 1];
      const int from_x = Nearest(place_x * scale_x, masks.width);
      const int from_y = Nearest(place_y * scale_y, masks.height);
      source_pixel.push_back(from_y * masks.width + from_x);
    }
  }
  return ResampleMaskSet(masks, camera_.width, camera_.height, source_pixel);
}

Vector2d ViewWarp::PlaceInPhoto(int x, int y) const {
  Vector2d full((x + 0.5) * full_width_ / camera_.width, (y + 0.5) * full_height_ / camera_.height);
  if (source_.empty()) return full;
  const int full_x = static_cast<int>(full.x()), full_y = static_cast<int>(full.y());
  const float* source = &source_[2 * (static_cast<size_t>(full_y) * full_width_ + full_x)];
  // Within one pixel, the lens is approximated by a translation.
  return Vector2d(source[0], source[1]) + full - Vector2d(full_x + 0.5, full_y + 0.5);
}

std::vector<float> ViewWarp::Depth(const FloatImage& map) const {
  const double scale_x = static_cast<double>(map.width) / photo_width_;
  const double scale_y = static_cast<double>(map.height) / photo_height_;
  std::vector<float> result;
  result.reserve(static_cast<size_t>(camera_.width) * camera_.height);
  for (int y = 0; y < camera_.height; ++y) {
    for (int x = 0; x < camera_.width; ++x) {
      const Vector2d place = PlaceInPhoto(x, y);
      result.push_back(Sample(map, place.x() * scale_x, place.y() * scale_y));
    }
  }
  return result;
}

}  // namespace pepeseg
