#include "tests/system/fuzz/byte_mutator.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>

namespace pepeseg::fuzz {
namespace {

constexpr size_t kMaxBytes = 1 << 20;
constexpr size_t kMaxPiece = 64;

// Returns the start and the length of a random piece of `bytes`.
struct Piece {
  size_t begin;
  size_t size;
};

Piece AnyPiece(absl::string_view bytes, std::mt19937& random) {
  const size_t begin = Below(bytes.size(), random);
  return {begin, 1 + Below(std::min(kMaxPiece, bytes.size() - begin), random)};
}

// Overwrites a count or an offset of 1, 2, 4 or 8 bytes, little-endian.
void PutNumber(std::string& bytes, std::mt19937& random) {
  constexpr std::array<uint64_t, 10> kNumbers = {
      0, 1, 0x7f, 0xff, 0x7fff, 0xffffffff, 0x7fffffff, 0x80000000, UINT64_MAX, uint64_t{1} << 62};
  const uint64_t number = kNumbers[Below(kNumbers.size(), random)];
  const size_t begin = Below(bytes.size(), random);
  const size_t width = std::min(size_t{1} << Below(4, random), bytes.size() - begin);
  std::memcpy(bytes.data() + begin, &number, width);
}

void PutDigits(std::string& bytes, std::mt19937& random) {
  constexpr std::array<const char*, 8> kWords = {
      "0", "-1", "nan", "1e999", "4294967296", "9223372036854775807", "null", "[[[["};
  bytes.insert(Below(bytes.size(), random), kWords[Below(kWords.size(), random)]);
}

void MutateOnce(std::string& bytes, absl::string_view other, std::mt19937& random) {
  if (bytes.empty()) {
    bytes.push_back(static_cast<char>(random()));
    return;
  }
  const Piece piece = AnyPiece(bytes, random);
  switch (Below(8, random)) {
    case 0:
    case 1:
      bytes[piece.begin] ^= static_cast<char>(1 << Below(8, random));
      break;
    case 2:
      PutNumber(bytes, random);
      break;
    case 3:
      PutDigits(bytes, random);
      break;
    case 4:
      bytes.erase(piece.begin, piece.size);
      break;
    case 5:
      bytes.insert(piece.begin, std::string(bytes, piece.begin, piece.size));
      break;
    case 6:
      bytes.resize(piece.begin);
      break;
    default:
      if (other.empty()) break;
      const Piece from = AnyPiece(other, random);
      bytes.insert(piece.begin, other.data() + from.begin, from.size);
  }
}

}  // namespace

std::string MutateBytes(absl::string_view bytes, absl::string_view other, std::mt19937& random) {
  std::string changed(bytes.substr(0, kMaxBytes));
  for (size_t i = 1 + Below(4, random); i > 0; --i) MutateOnce(changed, other, random);
  return changed;
}

}  // namespace pepeseg::fuzz
