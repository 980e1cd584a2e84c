#include "core/io/rle.h"

#include <cassert>

#include "absl/strings/str_cat.h"

namespace pepeseg {
namespace {

constexpr int kDigitBits = 5;
constexpr int64_t kMoreDigits = 0x20;
constexpr int64_t kSignBit = 0x10;
constexpr char kFirstCharacter = '0';
constexpr int kMaxDigits = 10;  // 50 bits: far over any image

std::vector<int64_t> CountsOf(const BinaryMask& mask, int width, int height) {
  std::vector<int64_t> counts = {0};
  bool inside = false;
  for (int x = 0; x < width; ++x) {
    for (int y = 0; y < height; ++y) {
      const bool set = mask.pixels[static_cast<size_t>(y) * width + x] != 0;
      if (set != inside) counts.push_back(0);
      inside = set;
      ++counts.back();
    }
  }
  return counts;
}

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
  const std::vector<int64_t> counts = CountsOf(mask, width, height);
  std::string text;
  for (size_t i = 0; i < counts.size(); ++i) {
    AppendNumber(i > 2 ? counts[i] - counts[i - 2] : counts[i], text);
  }
  return text;
}

absl::StatusOr<std::vector<int64_t>> ParseCocoCounts(absl::string_view compressed) {
  std::vector<int64_t> counts;
  for (size_t position = 0; position < compressed.size();) {
    absl::StatusOr<int64_t> number = TakeNumber(compressed, position);
    if (!number.ok()) return number.status();
    counts.push_back(counts.size() > 2 ? *number + counts[counts.size() - 2] : *number);
    // Sums of 50-bit numbers that no check has seen yet must not run over.
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
    if (i % 2 == 1) area += counts[i];
  }
  if (total != num_pixels) {
    return absl::InvalidArgumentError(
        absl::StrCat("the runs cover ", total, " pixels of a ", width, "x", height, " image"));
  }
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
