#include "kernels/ops/cell_masks.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cstdint>
#include <opencv2/imgproc.hpp>
#include <random>
#include <vector>

#include "kernels/buffer.h"
#include "tests/kernels/backend_test.h"

// Duplicates among masks of cells, and their pixels at the photograph's size, which are OpenCV's.

namespace pepeseg {
namespace {

class CellMasksTest : public BackendTest {};
INSTANTIATE_TEST_SUITE_P(Backends, CellMasksTest, AllBackends(), BackendName);

constexpr int kSide = 64, kWords = kSide * kSide / 32;

// The bits of a disc.
std::vector<uint32_t> Disc(double x0, double y0, double radius) {
  std::vector<uint32_t> bits(kWords);
  for (int i = 0; i < kSide * kSide; ++i) {
    const double x = i % kSide - x0, y = i / kSide - y0;
    if (x * x + y * y < radius * radius) bits[i / 32] |= uint32_t{1} << (i % 32);
  }
  return bits;
}
int Area(const std::vector<uint32_t>& bits) {
  int area = 0;
  for (const uint32_t word : bits) area += std::popcount(word);
  return area;
}

struct Candidate {
  std::vector<uint32_t> bits;
  int filler_cell = -1;
};

// Runs the op and returns the candidates that it keeps, after checking that their bits are kept.
std::vector<int> Kept(Backend& backend, const std::vector<Candidate>& candidates, double max_iou) {
  std::vector<uint32_t> bits;
  std::vector<int32_t> order, areas, cells;
  const auto count = static_cast<int>(candidates.size());
  // Masks lie in memory in reverse, so that a candidate is not the mask of its own number.
  for (int i = count - 1; i >= 0; --i) {
    bits.insert(bits.end(), candidates[i].bits.begin(), candidates[i].bits.end());
  }
  for (int i = 0; i < count; ++i) {
    order.push_back(count - 1 - i);
    areas.push_back(Area(candidates[i].bits));
    cells.push_back(candidates[i].filler_cell);
  }
  const Buffer<uint32_t> bit_buffer(backend, std::span<const uint32_t>(bits));
  const Buffer<int32_t> order_buffer(backend, std::span<const int32_t>(order));
  const Buffer<int32_t> area_buffer(backend, std::span<const int32_t>(areas));
  const Buffer<int32_t> cell_buffer(backend, std::span<const int32_t>(cells));
  Buffer<uint8_t> kept(backend, count);
  Buffer<uint32_t> kept_bits(backend, int64_t{count} * kWords);
  backend.SuppressMasks({.words = kWords,
                         .bits = bit_buffer.span(),
                         .candidates = order_buffer.span(),
                         .areas = area_buffer.span(),
                         .filler_cells = cell_buffer.span(),
                         .max_iou = max_iou,
                         .kept = kept.span(),
                         .kept_bits = kept_bits.span()});
  std::vector<uint8_t> flags(candidates.size());
  kept.Download(flags);
  std::vector<uint32_t> copied(static_cast<size_t>(count) * kWords);
  kept_bits.Download(copied);
  std::vector<int> indices;
  for (int i = 0; i < count; ++i) {
    if (flags[i] == 0) continue;
    const auto at = copied.begin() + static_cast<ptrdiff_t>(indices.size()) * kWords;
    EXPECT_TRUE(std::equal(candidates[i].bits.begin(), candidates[i].bits.end(), at)) << i;
    indices.push_back(i);
  }
  return indices;
}

TEST_P(CellMasksTest, DropsDuplicatesOfBetterMasks) {
  const std::vector<Candidate> candidates = {{Disc(20, 20, 12)},
                                             {Disc(20.5, 20, 12)},
                                             {Disc(44, 40, 9)},
                                             {Disc(20, 20, 6)},
                                             {Disc(44, 40, 9)}};
  EXPECT_EQ(Kept(*backend_, candidates, 0.8), (std::vector<int>{0, 2, 3}));
}

// The second is a duplicate of the first and drops nothing, though the third is a duplicate of it.
TEST_P(CellMasksTest, KeepsWhatOnlyADroppedMaskWouldDrop) {
  const std::vector<Candidate> candidates = {
      {Disc(20, 20, 12)}, {Disc(21, 20, 12)}, {Disc(22.4, 20, 12)}};
  EXPECT_EQ(Kept(*backend_, candidates, 0.85), (std::vector<int>{0, 2}));
}

TEST_P(CellMasksTest, KeepsAMaskWhoseIouIsTheLimit) {
  // 4 of 5 rows of the larger mask.
  std::vector<uint32_t> large(kWords), small(kWords);
  std::fill_n(large.begin(), 10, ~0u);
  std::fill_n(small.begin(), 8, ~0u);
  EXPECT_EQ(Kept(*backend_, {{large}, {small}}, 0.8), (std::vector<int>{0, 1}));
  EXPECT_EQ(Kept(*backend_, {{large}, {small}}, 0.79), (std::vector<int>{0}));
}

TEST_P(CellMasksTest, DropsFillersWhoseCellIsHeld) {
  constexpr int kInside = 20 * kSide + 20, kOutside = 50 * kSide + 20;
  const std::vector<Candidate> candidates = {{Disc(20, 20, 12)},
                                             {Disc(30, 25, 12), kInside},
                                             {Disc(20, 50, 8), kOutside},
                                             {Disc(22, 48, 11), kOutside}};
  EXPECT_EQ(Kept(*backend_, candidates, 0.8), (std::vector<int>{0, 2}));
}

TEST_P(CellMasksTest, AgreesWithAPlainScanOfManyMasks) {
  std::mt19937 engine(3);
  std::uniform_real_distribution<double> at(10, 54), radius(3, 9);
  std::vector<Candidate> candidates;
  std::vector<int> want;
  for (int i = 0; i < 700; ++i) {
    const double x = at(engine), y = at(engine);
    const int cell = i > 400 ? static_cast<int>(y) * kSide + static_cast<int>(x) : -1;
    candidates.push_back({Disc(x, y, radius(engine)), cell});
    const auto& bits = candidates.back().bits;
    const bool needless = std::any_of(want.begin(), want.end(), [&](int better) {
      const auto& other = candidates[better].bits;
      int common = 0, united = 0;
      for (int word = 0; word < kWords; ++word) {
        common += std::popcount(bits[word] & other[word]);
        united += std::popcount(bits[word] | other[word]);
      }
      return common > 0.6 * united || (cell >= 0 && (other[cell / 32] >> (cell % 32) & 1) != 0);
    });
    if (!needless) want.push_back(i);
  }
  EXPECT_GT(want.size(), 100u);
  EXPECT_EQ(Kept(*backend_, candidates, 0.6), want);
}

struct EnlargeCase {
  int width, height, photo_width, photo_height;
};

// Smooth logits, whose zeros are closed curves.
std::vector<int8_t> Waves(int extent, int seed) {
  std::vector<int8_t> quarters;
  for (int i = 0; i < extent * extent; ++i) {
    const double x = i % extent, y = static_cast<double>(i) / extent;
    quarters.push_back(static_cast<int8_t>(
        std::lround(90 * std::sin(0.21 * x + seed) * std::cos(0.17 * y - 0.1 * x))));
  }
  return quarters;
}

// The pixels by OpenCV.
std::vector<uint8_t> Warped(const int8_t* quarters, int extent, const EnlargeCase& shape,
                            double scale) {
  cv::Mat cells(shape.height, shape.width, CV_32F), warped;
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) cells.at<float>(y, x) = quarters[y * extent + x];
  }
  const double shift = 0.5 * scale - 0.5;
  cv::warpAffine(cells, warped, cv::Matx23d(scale, 0, shift, 0, scale, shift),
                 {shape.photo_width, shape.photo_height}, cv::INTER_LINEAR | cv::WARP_INVERSE_MAP,
                 cv::BORDER_REPLICATE);
  std::vector<uint8_t> pixels;
  for (int y = 0; y < warped.rows; ++y) {
    for (int x = 0; x < warped.cols; ++x) pixels.push_back(warped.at<float>(y, x) > 0 ? 1 : 0);
  }
  return pixels;
}

TEST_P(CellMasksTest, EnlargesToOpenCvsPixels) {
  constexpr int kExtent = 64;
  const EnlargeCase cases[] = {{64, 48, 640, 480},
                               {64, 43, 1001, 667},
                               {37, 64, 333, 577},
                               {64, 64, 50, 50},
                               {64, 1, 900, 9}};
  for (const EnlargeCase& shape : cases) {
    const double scale =
        static_cast<double>(kExtent) / std::max(shape.photo_width, shape.photo_height);
    std::vector<int8_t> quarters = Waves(kExtent, 1);
    const std::vector<int8_t> second = Waves(kExtent, 2);
    quarters.insert(quarters.end(), second.begin(), second.end());
    std::vector<uint8_t> ignored(static_cast<size_t>(shape.photo_width) * shape.photo_height);
    for (size_t i = 0; i < ignored.size(); ++i) ignored[i] = i % 977 < 40 ? 1 : 0;
    const std::vector<int32_t> masks = {1, 0};
    const Buffer<int8_t> quarter_buffer(*backend_, std::span<const int8_t>(quarters));
    const Buffer<uint8_t> ignored_buffer(*backend_, std::span<const uint8_t>(ignored));
    const Buffer<int32_t> mask_buffer(*backend_, std::span<const int32_t>(masks));
    Buffer<int32_t> first_run, runs;
    backend_->EnlargeMasks({.extent = kExtent,
                            .width = shape.width,
                            .height = shape.height,
                            .cells_per_pixel = scale,
                            .photo_width = shape.photo_width,
                            .photo_height = shape.photo_height,
                            .quarters = quarter_buffer.span(),
                            .masks = mask_buffer.span(),
                            .ignored = ignored_buffer.span(),
                            .first_run = &first_run,
                            .runs = &runs});
    std::vector<int32_t> first(first_run.size()), ends(runs.size());
    first_run.Download(first);
    runs.Download(ends);
    ASSERT_EQ(static_cast<int64_t>(first.size()), int64_t{2} * shape.photo_height + 1);
    ASSERT_EQ(static_cast<int64_t>(ends.size()), 2 * int64_t{first.back()});
    for (int i = 0; i < 2; ++i) {
      std::vector<uint8_t> got(ignored.size());
      for (int y = 0; y < shape.photo_height; ++y) {
        const int scanline = i * shape.photo_height + y;
        for (int run = first[scanline]; run < first[scanline + 1]; ++run) {
          ASSERT_LT(ends[2 * run], ends[2 * run + 1]);
          std::fill(got.begin() + int64_t{y} * shape.photo_width + ends[2 * run],
                    got.begin() + int64_t{y} * shape.photo_width + ends[2 * run + 1], 1);
        }
      }
      const int8_t* mask = quarters.data() + masks[i] * kExtent * kExtent;
      std::vector<uint8_t> want = Warped(mask, kExtent, shape, scale);
      for (size_t k = 0; k < want.size(); ++k) want[k] = ignored[k] == 0 ? want[k] : 0;
      EXPECT_EQ(got, want) << shape.photo_width;
    }
  }
}

}  // namespace
}  // namespace pepeseg
