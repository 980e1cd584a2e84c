#include "core/formats/gaussian_spz.h"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <new>
#include <utility>

#include "core/formats/y_up.h"

namespace pepeseg {
namespace {

// Bytes of a piece before it is compressed: noise grows by less than a thousandth.
constexpr int64_t kPieceBytes = int64_t{1} << 19;
constexpr int kCoordinateBits = 24, kMaxFractionalBits = 30;
constexpr int kScaleBits = 17;  // of the scene's size, in a coordinate

// Little-endian.
void Append(uint32_t number, int num_bytes, std::string& bytes) {
  for (int i = 0; i < num_bytes; ++i) bytes.push_back(static_cast<char>(number >> (8 * i)));
}

void AppendByte(float value, std::string& bytes) {
  bytes.push_back(static_cast<char>(std::lround(std::clamp(value, 0.0f, 255.0f))));
}

// Returns the number of fractional bits for coordinates up to `most`, half of which are below
// `median`: the finest of which all fit, but no finer than the scene needs.
int FractionalBitsFor(float most, float median) {
  const auto bits_below = [](float value) { return value > 0 ? std::ilogb(value) + 1 : 0; };
  const int fitting = kCoordinateBits - 1 - bits_below(most);
  return std::clamp(std::min(fitting, kScaleBits - bits_below(median)), 0, kMaxFractionalBits);
}

// Returns a quaternion of any length in 32 bits: the number of its largest component, and of the
// others, in ascending order, a sign and nine bits, in units of 1 / (511 sqrt 2).
uint32_t SmallestThree(std::array<float, 4> rotation) {
  float squares = 0;
  for (const float value : rotation) squares += value * value;
  size_t largest = 0;
  for (size_t k = 1; k < 4; ++k) {
    if (std::abs(rotation[k]) > std::abs(rotation[largest])) largest = k;
  }
  constexpr float kMost = 511, kSqrt2 = 1.41421356f;
  const float unit = (rotation[largest] < 0 ? -kMost : kMost) * kSqrt2 / std::sqrt(squares);
  auto packed = static_cast<uint32_t>(largest);
  for (size_t k = 0; k < 4; ++k) {
    if (k == largest) continue;
    const float value = rotation[k] * unit;
    const auto size = static_cast<uint32_t>(std::min(kMost, std::round(std::abs(value))));
    packed = packed << 10 | static_cast<uint32_t>(value < 0) << 9 | size;
  }
  return packed;
}

// Returns an SH coefficient as the multiple of 2^(8 - bits) that is nearest to 128 (1 + value),
// within a byte.
uint8_t QuantizedSh(float value, int bits) {
  const int steps = 1 << bits;
  const auto number = static_cast<int>(std::lround(std::ldexp(value + 1, bits - 1)));
  return static_cast<uint8_t>(std::clamp(number, 0, steps - 1) << (8 - bits));
}

// Compresses bytes by themselves, so that what is made of several pieces is one stream.
std::string Deflate(const std::string& bytes, bool is_last) {
  z_stream stream = {};
  constexpr int kRaw = -MAX_WBITS, kMemory = 9;
  // The parameters are valid: the calls fail without memory only, which new reports.
  if (deflateInit2(&stream, Z_DEFAULT_COMPRESSION, Z_DEFLATED, kRaw, kMemory, Z_DEFAULT_STRATEGY) !=
      Z_OK) {
    throw std::bad_alloc();
  }
  constexpr size_t kFlush = 16;  // bytes of a flush, more than enough
  std::string out(deflateBound(&stream, bytes.size()) + kFlush, '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  deflate(&stream, is_last ? Z_FINISH : Z_FULL_FLUSH);
  out.resize(stream.total_out);
  deflateEnd(&stream);
  return out;
}

}  // namespace

GaussianSpzBlocks::GaussianSpzBlocks(const Gaussians& gaussians, std::vector<uint32_t> indices,
                                     int max_sh_degree)
    : GaussianBlocks(gaussians, std::move(indices)),
      sh_degree_(std::min(gaussians.sh_degree, max_sh_degree)) {
  std::vector<float> sizes(static_cast<size_t>(num_gaussians()), 0.0f);
  for (int64_t row = 0; row < num_gaussians(); ++row) {
    float& size = sizes[static_cast<size_t>(row)];
    for (int k = 0; k < 3; ++k) size = std::max(size, std::abs(ValueOf(kMeanPlane + k, row)));
  }
  if (!sizes.empty()) {
    const float most = *std::ranges::max_element(sizes);
    const auto middle = sizes.begin() + static_cast<ptrdiff_t>(sizes.size() / 2);
    std::ranges::nth_element(sizes, middle);
    fractional_bits_ = FractionalBitsFor(most, *middle);
  }
  pieces_.push_back({Array::kHeader, 0, 1});
  for (const Array array : {Array::kPositions, Array::kAlphas, Array::kColors, Array::kScales,
                            Array::kRotations, Array::kSh}) {
    const int64_t row_bytes = RowBytesOf(array);
    if (row_bytes == 0) continue;
    const int64_t rows = kPieceBytes / row_bytes;
    for (int64_t first = 0; first < num_gaussians(); first += rows) {
      pieces_.push_back({array, first, std::min(rows, num_gaussians() - first)});
    }
  }
}

int64_t GaussianSpzBlocks::RowBytesOf(Array array) const {
  switch (array) {
    case Array::kHeader:
      return 16;
    case Array::kPositions:
      return 3 * kCoordinateBits / 8;
    case Array::kAlphas:
      return 1;
    case Array::kColors:
    case Array::kScales:
      return 3;
    case Array::kRotations:
      return 4;
    case Array::kSh:
      return int64_t{3} * (NumShCoefficients(sh_degree_) - 1);
  }
  return 0;
}

void GaussianSpzBlocks::AppendRow(Array array, int64_t row, std::string& bytes) const {
  switch (array) {
    case Array::kHeader:
      Append(0x5053474e, 4, bytes);  // "NGSP"
      Append(3, 4, bytes);           // version
      Append(static_cast<uint32_t>(num_gaussians()), 4, bytes);
      Append(static_cast<uint32_t>(sh_degree_), 1, bytes);
      Append(static_cast<uint32_t>(fractional_bits_), 1, bytes);
      Append(0, 2, bytes);  // trained without antialiasing; reserved
      return;
    case Array::kPositions:
      for (int k = 0; k < 3; ++k) {
        const float value =
            std::ldexp(kYUpMean[k] * ValueOf(kMeanPlane + k, row), fractional_bits_);
        const int32_t limit = (1 << (kCoordinateBits - 1)) - 1;
        const auto rounded =
            static_cast<int32_t>(std::clamp<int64_t>(std::llround(value), -limit, limit));
        Append(static_cast<uint32_t>(rounded), kCoordinateBits / 8, bytes);
      }
      return;
    case Array::kAlphas:
      return AppendByte(255 * OpacityOf(row), bytes);
    case Array::kColors:  // 0.15 leaves room for colours that higher degrees bring back into range
      for (int c = 0; c < 3; ++c) {
        AppendByte(255 * (0.5f + 0.15f * ValueOf(kShPlane + c, row)), bytes);
      }
      return;
    case Array::kScales:
      for (int k = 0; k < 3; ++k) AppendByte(16 * (ValueOf(kLogScalePlane + k, row) + 10), bytes);
      return;
    case Array::kRotations: {
      std::array<float, 4> rotation;  // x, y, z, w
      for (int k = 0; k < 4; ++k) {
        rotation[(k + 3) % 4] = kYUpRotation[k] * ValueOf(kRotationPlane + k, row);
      }
      return Append(SmallestThree(rotation), 4, bytes);
    }
    case Array::kSh:
      for (int k = 1; k < NumShCoefficients(sh_degree_); ++k) {
        for (int c = 0; c < 3; ++c) {
          const float value = kYUpSh[k] * ValueOf(kShPlane + 3 * k + c, row);
          bytes.push_back(static_cast<char>(QuantizedSh(value, k < 4 ? 5 : 4)));
        }
      }
      return;
  }
}

std::string GaussianSpzBlocks::RowsOf(const Piece& piece) const {
  std::string bytes;
  bytes.reserve(static_cast<size_t>(piece.count * RowBytesOf(piece.array)));
  for (int64_t row = piece.first; row < piece.first + piece.count; ++row) {
    AppendRow(piece.array, row, bytes);
  }
  return bytes;
}

std::string GaussianSpzBlocks::Trailer() const {
  std::call_once(summed_, [this] {
    uLong checksum = crc32(0, nullptr, 0);
    size_t size = 0;
    for (const Piece& piece : pieces_) {
      const std::string bytes = RowsOf(piece);
      checksum = crc32(checksum, reinterpret_cast<const Bytef*>(bytes.data()),
                       static_cast<uInt>(bytes.size()));
      size += bytes.size();
    }
    Append(static_cast<uint32_t>(checksum), 4, trailer_);
    Append(static_cast<uint32_t>(size), 4, trailer_);
  });
  return trailer_;
}

std::string GaussianSpzBlocks::Encode(int64_t block) const {
  // RFC 1952: deflate, no name, no time, an unknown system.
  const std::string gzip = {'\x1f', '\x8b', 8, 0, 0, 0, 0, 0, 0, '\xff'};
  const bool is_last = block + 1 == static_cast<int64_t>(pieces_.size());
  std::string bytes = Deflate(RowsOf(pieces_[static_cast<size_t>(block)]), is_last);
  if (block == 0) bytes.insert(0, gzip);
  if (is_last) bytes += Trailer();
  return bytes;
}

}  // namespace pepeseg
