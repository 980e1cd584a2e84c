#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "core/dataset/pixel_frame.h"
#include "core/formats/images.h"

namespace pepeseg {
namespace {

constexpr double kFewestBorders = 100;  // pixels on borders, over all examined photographs

// Resamples values by the nearest pixel to a grid of width x height.
FloatImage Resampled(const FloatImage& values, int width, int height) {
  FloatImage result{width, height, {}};
  result.values.reserve(static_cast<size_t>(width) * height);
  for (int64_t y = 0; y < height; ++y) {
    const auto row = static_cast<size_t>((2 * y + 1) * values.height / (2 * int64_t{height}));
    for (int64_t x = 0; x < width; ++x) {
      const auto column = static_cast<size_t>((2 * x + 1) * values.width / (2 * int64_t{width}));
      result.values.push_back(values.values[row * values.width + column]);
    }
  }
  return result;
}

float ValueAt(const FloatImage& values, int x, int y) {
  return values.values[static_cast<size_t>(y) * values.width + x];
}

double Difference(const Image& photo, std::pair<int, int> a, std::pair<int, int> b) {
  const auto pixel = [&photo](const std::pair<int, int>& at) {
    return &photo.pixels[(static_cast<size_t>(at.second) * photo.width + at.first) * 3];
  };
  double sum = 0;
  for (int c = 0; c < 3; ++c) sum += std::abs(pixel(a)[c] - pixel(b)[c]);
  return sum;
}

}  // namespace

void BorderContrast::Add(const Image& photo, const FloatImage& values, float least_step) {
  for (int y = 1; y + 2 < photo.height; ++y) {
    for (int x = 1; x + 2 < photo.width; ++x) {
      for (const auto& [dx, dy] : {std::pair(1, 0), std::pair(0, 1)}) {
        // Unknown depth has no border: differences to NaN are not over the step.
        const float step = std::abs(ValueAt(values, x, y) - ValueAt(values, x + dx, y + dy));
        const double border = step > least_step ? 1 : 0;
        // Over three pixels: borders are often painted a pixel next to the edge.
        const double contrast = Difference(photo, {x - dx, y - dy}, {x + 2 * dx, y + 2 * dy});
        num_borders_ += border;
        at_borders_ += border * contrast;
        everywhere_ += contrast;
        ++num_;
      }
    }
  }
}

double BorderContrast::Relative() const {
  if (num_borders_ <= 0 || everywhere_ <= 0) return 1;
  return at_borders_ / num_borders_ / (everywhere_ / static_cast<double>(num_));
}

void FrameTrial::Add(const Image& stored, int orientation, const FloatImage& values) {
  constexpr float kLeastDepthStep = 0.05F;  // of the range of depths
  const float least_step = kind_ == Values::kDepth ? kLeastDepthStep : 0;
  const Image photo = ShrunkTo(stored, kExaminedSide);
  const Image upright = Upright(photo, orientation);
  const FloatImage in_stored = Resampled(values, photo.width, photo.height);
  const FloatImage in_upright = Resampled(values, upright.width, upright.height);
  stored_.Add(photo, in_stored, least_step);
  upright_.Add(upright, in_upright, least_step);
  Compare(in_stored, Turned(in_upright, InverseOrientation(orientation)));
}

bool FrameTrial::NeedsNoChoice() const {
  constexpr double kMostDiffering = 0.002;
  return stored_.num_borders() < kFewestBorders ||
         static_cast<double>(num_differing_) <= kMostDiffering * static_cast<double>(num_);
}

std::optional<PixelFrame> FrameTrial::Verdict(double clearly_more) const {
  const double stored = stored_.Relative(), upright = upright_.Relative();
  if (stored > clearly_more * upright) return PixelFrame::kStored;
  if (upright > clearly_more * stored) return PixelFrame::kUpright;
  return std::nullopt;
}

void FrameTrial::Compare(const FloatImage& a, const FloatImage& b) {
  constexpr double kSameDepth = 0.02;  // of the range of depths
  const double same = kind_ == Values::kDepth ? kSameDepth : 0;
  for (size_t i = 0; i < std::min(a.values.size(), b.values.size()); ++i) {
    num_differing_ += std::abs(a.values[i] - b.values[i]) > same ? 1 : 0;
    ++num_;
  }
}

}  // namespace pepeseg
