#include "clients/cpp/mask.h"

#include <cstring>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"

namespace pepeseg::client {
namespace {

// Marks a run, the pixels from `first` to before `last` counted down the columns, in a mask
// [height, width]: its first pixel in each column, and the pixel after its last one. A pixel that
// is marked twice is not marked.
void MarkRun(int64_t first, int64_t last, int64_t width, int64_t height, Mask& mask) {
  const auto mark = [&](int64_t pixel) {
    mask[static_cast<size_t>(pixel % height * width + pixel / height)] ^= 1;
  };
  if (first == last) return;
  mark(first);
  for (int64_t x = first / height + 1; x * height < last; ++x) mask[static_cast<size_t>(x)] ^= 1;
  if (last % height != 0) mark(last);
}

// Fills a mask from its marks, eight pixels at a time: a pixel is inside if the number of marks at
// it and above it is odd.
void FillFromMarks(int64_t width, int64_t height, Mask& mask) {
  for (int64_t y = 1; y < height; ++y) {
    uint8_t* const row = mask.data() + y * width;
    const uint8_t* const above = row - width;
    int64_t x = 0;
    for (uint64_t word, word_above; x + 8 <= width; x += 8) {
      std::memcpy(&word, row + x, sizeof(word));
      std::memcpy(&word_above, above + x, sizeof(word_above));
      word ^= word_above;
      std::memcpy(row + x, &word, sizeof(word));
    }
    for (; x < width; ++x) row[x] ^= above[x];
  }
}

}  // namespace

// The format is that of rleFrString in cocoapi's common/maskApi.c: each run is a number of five
// bits a character, and from the fourth run on the difference to the run before the last.
absl::StatusOr<Mask> DecodeRle(const v1::CocoRle& rle) {
  const int64_t height = rle.height();
  const int64_t num_pixels = height * rle.width();
  if (height < 0 || rle.width() < 0 || num_pixels > (int64_t{1} << 30)) {
    return absl::DataLossError(
        absl::StrCat("mask: ", rle.width(), "x", height, " is not a size of at most 2^30 pixels"));
  }
  Mask mask(static_cast<size_t>(num_pixels), 0);
  std::vector<int64_t> runs;
  int64_t filled = 0;
  for (size_t i = 0; i < rle.counts().size();) {
    // Lowest bits first. Bit 5 of a character: more follow. Bit 4 of the last one: the number is
    // negative.
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
    // Runs go down the columns and alternate, beginning with pixels outside the mask.
    if (runs.size() > 2) run += runs[runs.size() - 2];
    if (more || run < 0 || run > num_pixels - filled) {
      return absl::DataLossError(absl::StrCat("mask: run ", runs.size(), " has ", run,
                                              " pixels, but ", num_pixels - filled, " are left"));
    }
    if (runs.size() % 2 == 1) MarkRun(filled, filled + run, rle.width(), height, mask);
    filled += run;
    runs.push_back(run);
  }
  if (filled != num_pixels) {
    return absl::DataLossError(
        absl::StrCat("mask: the runs have ", filled, " pixels, not ", num_pixels));
  }
  FillFromMarks(rle.width(), height, mask);
  return mask;
}

v1::CocoRle EncodeRle(std::span<const uint8_t> mask, int width, int height) {
  std::vector<int64_t> runs = {0};
  bool inside = false;
  for (int x = 0; x < width; ++x) {
    for (int y = 0; y < height; ++y) {
      if ((mask[static_cast<size_t>(y) * width + x] != 0) != inside) {
        inside = !inside;
        runs.push_back(0);
      }
      ++runs.back();
    }
  }
  v1::CocoRle rle;
  rle.set_width(width);
  rle.set_height(height);
  rle.set_counts(CompressRuns(runs));
  return rle;
}

// Digits of 5 bits, the lowest first, each with a bit for "more follow"; from the fourth run on the
// difference to the run two before it.
std::string CompressRuns(std::span<const int64_t> runs) {
  std::string text;
  for (size_t i = 0; i < runs.size(); ++i) {
    int64_t value = runs[i] - (i > 2 ? runs[i - 2] : 0);
    for (bool more = true; more;) {
      const int64_t digit = value & 0x1f;
      value >>= 5;
      // The sign is the highest bit of the last digit.
      more = (digit & 0x10) != 0 ? value != -1 : value != 0;
      text += static_cast<char>(digit + (more ? 0x20 : 0) + 48);
    }
  }
  return text;
}

}  // namespace pepeseg::client
