#include "core/query/photograph_images.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/query/mask_geometry.h"

namespace pepeseg {
namespace {

using Eigen::Vector2f;

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
