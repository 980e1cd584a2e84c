#include "clients/cli/mask.h"

#include <algorithm>
#include <limits>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"

namespace pepeseg::cli {
namespace {

constexpr float kFar = 1e20F;

// Lower envelope of the parabolas (q - i)^2 + f[i], sampled at the integers: the one-dimensional
// transform of the paper's section 2.
class Envelope {
 public:
  explicit Envelope(int size) : apex_(size), from_(size + 1) {}

  void Transform(std::span<const float> f, std::span<float> distance) {
    const int size = static_cast<int>(f.size());
    int last = 0;
    apex_[0] = 0;
    from_[0] = -std::numeric_limits<double>::infinity();
    for (int q = 1; q < size; ++q) {
      double start = Crossing(f, apex_[last], q);
      while (start <= from_[last]) start = Crossing(f, apex_[--last], q);
      apex_[++last] = q;
      from_[last] = start;
    }
    from_[last + 1] = std::numeric_limits<double>::infinity();
    for (int q = 0, k = 0; q < size; ++q) {
      while (from_[k + 1] < q) ++k;
      const int i = apex_[k];
      distance[q] = static_cast<float>(q - i) * static_cast<float>(q - i) + f[i];
    }
  }

 private:
  static double Crossing(std::span<const float> f, int i, int q) {
    const double di = i;
    const double dq = q;
    return ((f[q] + dq * dq) - (f[i] + di * di)) / (2 * (dq - di));
  }

  std::vector<int> apex_;
  std::vector<double> from_;
};

}  // namespace

absl::StatusOr<Mask> DecodeRle(const v1::CocoRle& rle) {
  const int64_t height = rle.height();
  const int64_t num_pixels = height * rle.width();
  if (height < 0 || rle.width() < 0 || num_pixels > (int64_t{1} << 30)) {
    return absl::DataLossError(absl::StrCat("mask of ", rle.width(), "x", height, " pixels"));
  }
  Mask mask(static_cast<size_t>(num_pixels), 0);
  std::vector<int64_t> runs;
  int64_t filled = 0;
  for (size_t i = 0; i < rle.counts().size();) {
    // Five bits a character, lowest first; bit 5: more follow; bit 4 of the last: negative.
    int64_t run = 0;
    int shift = 0;
    bool more = true;
    while (more && i < rle.counts().size() && shift < 60) {
      const int symbol = rle.counts()[i++] - '0';
      run |= static_cast<int64_t>(symbol & 31) << shift;
      more = (symbol & 32) != 0;
      shift += 5;
      if (!more && (symbol & 16) != 0) run |= -(int64_t{1} << shift);
    }
    if (runs.size() > 2) run += runs[runs.size() - 2];
    if (more || run < 0 || run > num_pixels - filled) {
      return absl::DataLossError(absl::StrCat("mask: run ", runs.size(), " is of ", run,
                                              " pixels, ", num_pixels - filled, " are left"));
    }
    for (int64_t k = filled; runs.size() % 2 == 1 && k < filled + run; ++k) {
      mask[static_cast<size_t>((k % height) * rle.width() + k / height)] = 1;
    }
    filled += run;
    runs.push_back(run);
  }
  if (filled != num_pixels) {
    return absl::DataLossError(
        absl::StrCat("mask: runs of ", filled, " pixels in all, not ", num_pixels));
  }
  return mask;
}

double Iou(std::span<const uint8_t> prediction, std::span<const uint8_t> truth,
           std::span<const uint8_t> ignore) {
  int64_t both = 0;
  int64_t either = 0;
  for (size_t i = 0; i < prediction.size(); ++i) {
    if (!ignore.empty() && ignore[i] != 0) continue;
    both += (prediction[i] != 0 && truth[i] != 0) ? 1 : 0;
    either += (prediction[i] != 0 || truth[i] != 0) ? 1 : 0;
  }
  return either == 0 ? 1.0 : static_cast<double>(both) / static_cast<double>(either);
}

int64_t Area(std::span<const uint8_t> mask, std::span<const uint8_t> ignore) {
  int64_t area = 0;
  for (size_t i = 0; i < mask.size(); ++i) {
    area += (mask[i] != 0 && (ignore.empty() || ignore[i] == 0)) ? 1 : 0;
  }
  return area;
}

std::vector<float> SquaredDistanceToOutside(std::span<const uint8_t> mask, int width, int height) {
  // One pixel of outside all around stands for what is beyond the image.
  const int padded_width = width + 2;
  const int padded_height = height + 2;
  std::vector<float> squared(static_cast<size_t>(padded_width) * padded_height, 0);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const bool inside = mask[static_cast<size_t>(y) * width + x] != 0;
      squared[static_cast<size_t>(y + 1) * padded_width + x + 1] = inside ? kFar : 0;
    }
  }
  Envelope envelope(std::max(padded_width, padded_height));
  std::vector<float> column(padded_height);
  std::vector<float> transformed(std::max(padded_width, padded_height));
  for (int x = 0; x < padded_width; ++x) {
    for (int y = 0; y < padded_height; ++y) {
      column[y] = squared[static_cast<size_t>(y) * padded_width + x];
    }
    envelope.Transform(column, transformed);
    for (int y = 0; y < padded_height; ++y) {
      squared[static_cast<size_t>(y) * padded_width + x] = transformed[y];
    }
  }
  std::vector<float> result;
  result.reserve(static_cast<size_t>(width) * height);
  for (int y = 1; y <= height; ++y) {
    envelope.Transform(
        {&squared[static_cast<size_t>(y) * padded_width], static_cast<size_t>(padded_width)},
        transformed);
    result.insert(result.end(), transformed.begin() + 1, transformed.begin() + 1 + width);
  }
  return result;
}

Pixel DeepestPixel(std::span<const uint8_t> mask, int width, int height) {
  const std::vector<float> depth = SquaredDistanceToOutside(mask, width, height);
  const auto deepest =
      static_cast<int>(std::max_element(depth.begin(), depth.end()) - depth.begin());
  return {deepest % width, deepest / width};
}

}  // namespace pepeseg::cli
