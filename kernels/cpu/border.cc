#include "kernels/math/border.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <vector>

#include "kernels/cpu/cpu_backend.h"
#include "kernels/half.h"
#include "kernels/ops/similarity.h"

// RefineBorder (kernels/ops/similarity.h). A task has a band of rows. It converts the features near
// borders once, as the windows of neighbouring pixels overlap.

namespace pepeseg {
namespace {

constexpr int kBandRows = 16;

// Gated feature, colour, and a 0 that makes the number a multiple of four.
constexpr int kNumChannels = kFeatureSize + 4;
using Channels = std::array<float, kNumChannels>;

// The pixels of one side in a window.
struct Side {
  int count = 0;
  std::array<SideSums, kNumChannels> sums{};

  void Add(const Channels& channels) {
    ++count;
    for (int k = 0; k < kNumChannels; ++k) sums[k].Add(channels[k]);
  }
};

class BandRefiner {
 public:
  BandRefiner(const RefineBorderArgs& args, int first_row, int last_row)
      : args_(args),
        first_row_(first_row),
        last_row_(last_row),
        top_(std::max(0, first_row - kBorderRadius - 1)),
        bottom_(std::min(args.height, last_row + kBorderRadius + 1)) {
    MarkBorders();
  }

  // Changes in the sums of the mask.
  struct Moved {
    int64_t inside = 0, similarity = 0;
  };
  // Writes the pixels of the band that join the other side.
  Moved Refine() {
    Moved moved;
    if (!any_border_) return moved;
    for (int y = first_row_; y < last_row_; ++y) {
      for (int x = 0; x < args_.width; ++x) {
        const int64_t i = At(x, y);
        if (!IsBorder(i)) continue;
        const float similarity = args_.similarity.data[i];
        if (!(std::abs(similarity - args_.threshold) < kBorderUncertain)) continue;
        const bool was_inside = IsInside(i);
        if (BelongsInsideNow(x, y) == was_inside) continue;
        args_.refined.data[i] = was_inside ? 0 : 1;
        const int64_t sign = was_inside ? -1 : 1;
        moved.inside += sign;
        moved.similarity += sign * std::lrintf(similarity * kSimilarityUnit);
      }
    }
    return moved;
  }

 private:
  int64_t At(int x, int y) const { return int64_t{y} * args_.width + x; }
  size_t InBand(int64_t i) const { return static_cast<size_t>(i - At(0, top_)); }
  bool IsInside(int64_t i) const { return args_.mask.data[i] != 0; }
  bool IsBorder(int64_t i) const { return border_[InBand(i)] != 0; }

  // Compares each pixel with four of its neighbours, so that each pair is compared once. The
  // outermost rows are incomplete where the image continues; no window reaches them.
  void MarkBorders() {
    const size_t size = static_cast<size_t>(bottom_ - top_) * args_.width;
    border_.assign(size, 0);
    const auto compare = [&](int64_t a, int64_t b) {
      if (args_.mask.data[a] == args_.mask.data[b]) return;
      border_[InBand(a)] = border_[InBand(b)] = 1;
      any_border_ = true;
    };
    for (int y = top_; y < bottom_; ++y) {
      for (int x = 0; x < args_.width; ++x) {
        const int64_t i = At(x, y);
        const bool has_right = x + 1 < args_.width;
        if (has_right) compare(i, i + 1);
        if (y + 1 == bottom_) continue;
        compare(i, i + args_.width);
        if (has_right) compare(i, i + args_.width + 1);
        if (x > 0) compare(i, i + args_.width - 1);
      }
    }
    if (any_border_) slot_.assign(size, -1);
  }

  // Calls `use` with the index of each pixel of the window around a pixel.
  template <typename Use>
  void ForWindow(int x, int y, Use use) const {
    const int x1 = std::min(args_.width - 1, x + kBorderRadius);
    const int y1 = std::min(args_.height - 1, y + kBorderRadius);
    for (int j = std::max(0, y - kBorderRadius); j <= y1; ++j) {
      for (int i = std::max(0, x - kBorderRadius); i <= x1; ++i) use(At(i, j));
    }
  }

  // Returns the channels of a pixel, converted when they are first needed. Valid until the next
  // call.
  const Channels& ChannelsOf(int64_t i) {
    int32_t& slot = slot_[InBand(i)];
    if (slot < 0) {
      slot = static_cast<int32_t>(channels_.size());
      Channels& channels = channels_.emplace_back();
      for (int k = 0; k < kFeatureSize; ++k) {
        channels[k] = FloatFromHalf(args_.map.data[i * kFeatureSize + k]) * args_.psi.data[k];
      }
      const int64_t num_pixels = int64_t{args_.width} * args_.height;
      for (int k = 0; k < 3; ++k) {
        channels[kFeatureSize + k] = std::clamp(args_.color.data[k * num_pixels + i], 0.0f, 1.0f);
      }
    }
    return channels_[slot];
  }

  // Describes a side by the pixels of the window that are not at the border or, of a thing too thin
  // to have any, by all.
  Side SideAt(int x, int y, bool inside) {
    Side deep, all;
    ForWindow(x, y, [&](int64_t i) {
      if (IsInside(i) == inside && !IsBorder(i)) deep.Add(ChannelsOf(i));
    });
    if (deep.count > 0) return deep;
    ForWindow(x, y, [&](int64_t i) {
      if (IsInside(i) == inside) all.Add(ChannelsOf(i));
    });
    return all;
  }

  bool BelongsInsideNow(int x, int y) {
    const Side inside = SideAt(x, y, true), outside = SideAt(x, y, false);
    const Channels& at = ChannelsOf(At(x, y));
    SideComparison feature, color;
    for (int k = 0; k < kNumChannels; ++k) {
      const SideComparison channel =
          CompareSides(at[k], inside.sums[k], inside.count, outside.sums[k], outside.count);
      (k < kFeatureSize ? feature : color).Add(channel);
    }
    return BelongsInside(feature, color, IsInside(At(x, y)));
  }

  const RefineBorderArgs& args_;
  const int first_row_, last_row_;  // of the band
  const int top_, bottom_;          // rows with border_ and slot_
  std::vector<uint8_t> border_;     // 1: has a pixel of the other side next to it
  bool any_border_ = false;
  std::vector<int32_t> slot_;       // index into channels_, -1: not yet converted
  std::vector<Channels> channels_;  // of pixels near a border
};

}  // namespace

// Sums are of integers, so that the order of the bands does not matter.
void CpuBackend::RefineBorder(const RefineBorderArgs& args) {
  if (failed()) return;
  std::copy_n(args.mask.data, args.mask.size, args.refined.data);
  std::atomic<int64_t> inside = 0, similarity = 0;
  pool_.ParallelFor((args.height + kBandRows - 1) / kBandRows, [&](int64_t band, int) {
    const int first = static_cast<int>(band) * kBandRows;
    BandRefiner refiner(args, first, std::min(args.height, first + kBandRows));
    const BandRefiner::Moved moved = refiner.Refine();
    inside += moved.inside;
    similarity += moved.similarity;
  });
  args.sums.data[kNumInside] += inside;
  args.sums.data[kSimilaritySum] += similarity;
}

}  // namespace pepeseg
