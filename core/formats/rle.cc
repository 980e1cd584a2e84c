#include "core/formats/rle.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cstring>
#include <utility>

#include "absl/strings/str_cat.h"

namespace pepeseg {
namespace {

constexpr int kDigitBits = 5;
constexpr int64_t kMoreDigits = 0x20;
constexpr int64_t kSignBit = 0x10;
constexpr char kFirstCharacter = '0';
constexpr int kMaxDigits = 10;  // 50 bits, far more than any image needs

// Returns eight pixels.
uint64_t WordAt(const uint8_t* pixels) {
  uint64_t word = 0;
  std::memcpy(&word, pixels, sizeof(word));
  return word;
}

// The pixels of a mask that differ from the pixel above them: there, runs down the columns begin.
// Memory runs along the scanlines, so each scanline is compared with the one above it, 32 pixels at
// a time; most of these blocks are equal.
class Changes {
 public:
  Changes(const BinaryMask& mask, int width, int height) : height_(height) {
    const uint8_t* pixels = mask.pixels.data();
    // The pixel above a column's first is the last of the column before it.
    std::vector<uint8_t> above(static_cast<size_t>(width));
    std::copy_n(pixels + static_cast<size_t>(height - 1) * width, width - 1, above.data() + 1);
    for (int y = 0; y < height; ++y) {
      const uint8_t* row = pixels + static_cast<size_t>(y) * width;
      CompareRows(y == 0 ? above.data() : row - width, row, width, y);
    }
  }

  // Returns the positions x * height + y of the changes, ascending. A counting sort by column, in
  // which the changes of a column are in order already.
  std::vector<int64_t> Positions(int width) const {
    std::vector<size_t> next(static_cast<size_t>(width) + 1);
    for (const auto& [x, y] : changes_) ++next[x + 1];
    for (int x = 0; x < width; ++x) next[x + 1] += next[x];
    std::vector<int64_t> positions(changes_.size());
    for (const auto& [x, y] : changes_) positions[next[x]++] = int64_t{x} * height_ + y;
    return positions;
  }

 private:
  void CompareRows(const uint8_t* above, const uint8_t* row, int width, int y) {
    constexpr int kPixels = 32;
    int x = 0;
    for (; x + kPixels <= width; x += kPixels) {
      const uint8_t* const a = above + x;
      const uint8_t* const b = row + x;
      if (((WordAt(a) ^ WordAt(b)) | (WordAt(a + 8) ^ WordAt(b + 8)) |
           (WordAt(a + 16) ^ WordAt(b + 16)) | (WordAt(a + 24) ^ WordAt(b + 24))) == 0) {
        continue;
      }
      for (int first = 0; first < kPixels; first += 8)
        CompareWords(a + first, b + first, x + first, y);
    }
    for (; x < width; ++x) Compare(above[x], row[x], x, y);
  }
  void CompareWords(const uint8_t* above, const uint8_t* row, int x, int y) {
    static_assert(std::endian::native == std::endian::little, "the first pixel is the lowest byte");
    for (uint64_t differing = WordAt(above) ^ WordAt(row); differing != 0;) {
      const int k = std::countr_zero(differing) / 8;
      Compare(above[k], row[k], x + k, y);
      differing &= ~(uint64_t{0xff} << (8 * k));
    }
  }
  void Compare(uint8_t above, uint8_t pixel, int x, int y) {
    if ((above != 0) != (pixel != 0)) changes_.emplace_back(x, y);
  }

  int height_;
  std::vector<std::pair<int, int>> changes_;  // x, y; scanline by scanline
};

// Returns the lengths of the runs.
std::vector<int64_t> CountsOf(const BinaryMask& mask, int width, int height) {
  if (mask.pixels.empty()) return {0};
  const std::vector<int64_t> positions = Changes(mask, width, height).Positions(width);
  std::vector<int64_t> counts;
  counts.reserve(positions.size() + 1);
  int64_t last = 0;
  for (const int64_t position : positions) {
    counts.push_back(position - last);
    last = position;
  }
  counts.push_back(int64_t{width} * height - last);
  return counts;
}

// Writes a number in digits of 5 bits, lowest first, like a signed LEB128. The highest bit of the
// last digit is the sign.
void AppendNumber(int64_t value, std::string& text) {
  bool more = true;
  while (more) {
    int64_t digit = value & 0x1f;
    value >>= kDigitBits;
    more = (digit & kSignBit) != 0 ? value != -1 : value != 0;
    if (more) digit |= kMoreDigits;
    text.push_back(static_cast<char>(kFirstCharacter + digit));
  }
}

// Reads such a number at `position` and moves it on.
absl::StatusOr<int64_t> TakeNumber(absl::string_view text, size_t& position) {
  int64_t value = 0;
  for (int i = 0; i < kMaxDigits && position < text.size(); ++i) {
    const int64_t digit = text[position++] - kFirstCharacter;
    if (digit < 0 || digit > 0x3f) break;
    value |= (digit & 0x1f) << (kDigitBits * i);
    if ((digit & kMoreDigits) != 0) continue;
    if ((digit & kSignBit) != 0) value -= int64_t{1} << (kDigitBits * (i + 1));
    return value;
  }
  return absl::InvalidArgumentError(
      absl::StrCat("the compressed run lengths are malformed near character ", position));
}

}  // namespace

std::string EncodeCocoRle(const BinaryMask& mask, int width, int height) {
  assert(mask.pixels.size() == static_cast<size_t>(width) * height);
  return EncodeCocoCounts(CountsOf(mask, width, height));
}

std::string EncodeCocoCounts(std::span<const int64_t> counts) {
  std::string text;
  for (size_t i = 0; i < counts.size(); ++i) {
    // COCO's format: from the fourth count on, the difference to the count two before is stored.
    AppendNumber(i > 2 ? counts[i] - counts[i - 2] : counts[i], text);
  }
  return text;
}

absl::StatusOr<std::vector<int64_t>> ParseCocoCounts(absl::string_view compressed,
                                                     int64_t max_counts) {
  std::vector<int64_t> counts;
  // There are as many numbers as last digits. Reserving for them keeps the vector from growing,
  // which would take twice the memory for a long string.
  const auto num_last = std::count_if(compressed.begin(), compressed.end(), [](char c) {
    return ((c - kFirstCharacter) & kMoreDigits) == 0;
  });
  counts.reserve(static_cast<size_t>(std::min<int64_t>(num_last, max_counts)));
  for (size_t position = 0; position < compressed.size();) {
    if (static_cast<int64_t>(counts.size()) == max_counts) {
      return absl::InvalidArgumentError(absl::StrCat("has more than ", max_counts, " runs"));
    }
    absl::StatusOr<int64_t> number = TakeNumber(compressed, position);
    if (!number.ok()) return number.status();
    counts.push_back(counts.size() > 2 ? *number + counts[counts.size() - 2] : *number);
    // Checked here, because sums of unchecked 50-bit numbers could overflow.
    if (counts.back() < 0 || counts.back() > INT32_MAX) {
      return absl::InvalidArgumentError(
          absl::StrCat("run ", counts.size() - 1, " has the length ", counts.back()));
    }
  }
  return counts;
}

absl::StatusOr<std::vector<uint32_t>> PixelsOfRuns(std::span<const int64_t> counts, int width,
                                                   int height) {
  const int64_t num_pixels = int64_t{width} * height;
  int64_t total = 0;
  int64_t area = 0;
  for (size_t i = 0; i < counts.size(); ++i) {
    if (counts[i] < 0 || counts[i] > num_pixels - total) {
      return absl::InvalidArgumentError(absl::StrCat("run ", i, " of length ", counts[i],
                                                     " leaves the ", width, "x", height, " image"));
    }
    total += counts[i];
    // Counts alternate, beginning with pixels that are not in the mask.
    if (i % 2 == 1) area += counts[i];
  }
  if (total != num_pixels) {
    return absl::InvalidArgumentError(
        absl::StrCat("the runs cover ", total, " pixels of a ", width, "x", height, " image"));
  }
  // The runs are down the columns; the indices are row-major.
  std::vector<uint32_t> pixels;
  pixels.reserve(static_cast<size_t>(area));
  int64_t position = 0;
  for (size_t i = 0; i < counts.size(); position += counts[i], ++i) {
    if (i % 2 == 0) continue;
    for (int64_t p = position; p < position + counts[i]; ++p) {
      pixels.push_back(static_cast<uint32_t>(p % height * width + p / height));
    }
  }
  return pixels;
}

}  // namespace pepeseg
