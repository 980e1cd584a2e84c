#include "core/formats/gaussian_spz.h"

#include <gtest/gtest.h>
#include <zlib.h>

#include <Eigen/Geometry>
#include <cmath>
#include <cstring>

#include "tests/testing/gaussian_file.h"

namespace pepeseg {
namespace {

using testing::AllOf;

// Gaussians such as a model has: small ones, of which few colours depend much on the direction.
Gaussians ScatteredGaussians(int64_t count, int sh_degree, float size = 1) {
  Gaussians gaussians = testing::RandomGaussians(count, sh_degree);
  for (int k = 0; k < 3; ++k) {
    for (float& value : gaussians.Plane(kMeanPlane + k)) value *= size;
    for (float& value : gaussians.Plane(kLogScalePlane + k)) value -= 4;
  }
  for (int k = 3; k < 3 * NumShCoefficients(sh_degree); ++k) {
    for (float& value : gaussians.Plane(kShPlane + k)) value *= 0.2f;
  }
  return gaussians;
}

// An SPZ file, uncompressed and taken apart.
struct Spz {
  std::string bytes;
  uint32_t version = 0, count = 0;
  int sh_degree = 0, fractional_bits = 0;
  size_t num_bytes = 0;  // of the file

  explicit Spz(const GaussianSpzBlocks& blocks) {
    const std::string file = testing::FileOf(blocks);
    num_bytes = file.size();
    Inflate(file);
    EXPECT_EQ(bytes.substr(0, 4), "NGSP");
    std::memcpy(&version, bytes.data() + 4, 4);
    std::memcpy(&count, bytes.data() + 8, 4);
    sh_degree = ByteAt(12);
    fractional_bits = ByteAt(13);
    EXPECT_EQ(bytes.size(), 16 + count * (20u + 3 * (NumShCoefficients(sh_degree) - 1)));
  }

  // Reads one gzip member to its end, and checks its sum.
  void Inflate(const std::string& file) {
    z_stream stream = {};
    ASSERT_EQ(inflateInit2(&stream, 16 + MAX_WBITS), Z_OK);
    bytes.resize(100 << 20);
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(file.data()));
    stream.avail_in = static_cast<uInt>(file.size());
    stream.next_out = reinterpret_cast<Bytef*>(bytes.data());
    stream.avail_out = static_cast<uInt>(bytes.size());
    EXPECT_EQ(inflate(&stream, Z_FINISH), Z_STREAM_END);
    EXPECT_EQ(stream.avail_in, 0u);
    bytes.resize(stream.total_out);
    inflateEnd(&stream);
  }

  int ByteAt(size_t at) const { return static_cast<uint8_t>(bytes[at]); }
  double Position(size_t row, size_t axis) const {
    const size_t at = 16 + 9 * row + 3 * axis;
    const int value = ByteAt(at) | ByteAt(at + 1) << 8 | static_cast<int8_t>(bytes[at + 2]) * 65536;
    return std::ldexp(value, -fractional_bits);
  }
  double Alpha(size_t row) const { return ByteAt(16 + 9 * count + row) / 255.0; }
  double Color(size_t row, size_t channel) const {
    return (ByteAt(16 + 10 * count + 3 * row + channel) / 255.0 - 0.5) / 0.15;
  }
  double LogScale(size_t row, size_t axis) const {
    return ByteAt(16 + 13 * count + 3 * row + axis) / 16.0 - 10;
  }
  // The largest component is positive, and left out.
  Eigen::Quaterniond Rotation(size_t row) const {
    uint32_t packed = 0;
    std::memcpy(&packed, bytes.data() + 16 + 16 * count + 4 * row, 4);
    double values[4] = {}, squares = 0;  // x, y, z, w
    const size_t largest = packed >> 30;
    for (int k = 3; k >= 0; --k) {
      if (static_cast<size_t>(k) == largest) continue;
      values[k] = (packed & 511) / (511 * std::sqrt(2)) * ((packed & 512) != 0 ? -1 : 1);
      squares += values[k] * values[k];
      packed >>= 10;
    }
    values[largest] = std::sqrt(1 - squares);
    return {values[3], values[0], values[1], values[2]};
  }
  double Sh(size_t row, int coefficient, int channel) const {
    const size_t rest = 3 * (NumShCoefficients(sh_degree) - 1);
    const size_t at = 16 + 20 * count + rest * row + 3 * (coefficient - 1) + channel;
    return (ByteAt(at) - 128) / 128.0;
  }
};

TEST(GaussianSpzBlocks, HoldParametersToTheirPrecision) {
  for (int degree = 0; degree <= kMaxShDegree; ++degree) {
    const Gaussians gaussians = ScatteredGaussians(300, degree);
    const Spz spz{GaussianSpzBlocks(gaussians, AllOf(gaussians))};
    EXPECT_EQ(spz.version, 3u);
    ASSERT_EQ(spz.count, 300u);
    ASSERT_EQ(spz.sh_degree, degree);
    for (size_t i = 0; i < 300; ++i) {
      const auto value = [&](int plane) { return double{gaussians.Plane(plane)[i]}; };
      EXPECT_NEAR(spz.Position(i, 0), value(kMeanPlane), 1e-5);
      EXPECT_NEAR(spz.Position(i, 1), -value(kMeanPlane + 1), 1e-5);
      EXPECT_NEAR(spz.Position(i, 2), -value(kMeanPlane + 2), 1e-5);
      EXPECT_NEAR(spz.Alpha(i), 1 / (1 + std::exp(-value(kOpacityPlane))), 0.5001 / 255);
      EXPECT_NEAR(spz.Color(i, 2), value(kShPlane + 2), 0.5001 / 255 / 0.15);
      EXPECT_NEAR(spz.LogScale(i, 1), value(kLogScalePlane + 1), 0.5001 / 16);
      const Eigen::Quaterniond want(value(kRotationPlane), value(kRotationPlane + 1),
                                    -value(kRotationPlane + 2), -value(kRotationPlane + 3));
      EXPECT_LT(spz.Rotation(i).angularDistance(want.normalized()), 0.004);
      if (degree == 0) continue;
      EXPECT_NEAR(spz.Sh(i, 1, 0), -value(kShPlane + 3), 4.001 / 128);         // y
      EXPECT_NEAR(spz.Sh(i, 3, 1), value(kShPlane + 3 * 3 + 1), 4.001 / 128);  // x
      if (degree < 3) continue;
      EXPECT_NEAR(spz.Sh(i, 15, 2), value(kShPlane + 3 * 15 + 2), 8.001 / 128);
    }
  }
}

TEST(GaussianSpzBlocks, ScaleCoordinatesWithTheScene) {
  for (const float size : {1e-3f, 1.0f, 1e4f}) {
    const Gaussians gaussians = ScatteredGaussians(500, 0, size);
    const Spz spz{GaussianSpzBlocks(gaussians, AllOf(gaussians))};
    for (size_t i = 0; i < 500; ++i) {
      EXPECT_NEAR(spz.Position(i, 0), gaussians.Plane(kMeanPlane)[i], size / 65536) << size;
    }
  }
}

// Something far away must not make the rest of the scene coarse, nor be cut off.
TEST(GaussianSpzBlocks, HoldWhatIsFarAway) {
  Gaussians gaussians = ScatteredGaussians(500, 0);
  gaussians.Plane(kMeanPlane)[7] = 60;
  const Spz spz{GaussianSpzBlocks(gaussians, AllOf(gaussians))};
  EXPECT_NEAR(spz.Position(7, 0), 60, 1e-5);
  EXPECT_NEAR(spz.Position(8, 0), gaussians.Plane(kMeanPlane)[8], 1e-5);
}

TEST(GaussianSpzBlocks, AreOneGzipFileOfManyBlocks) {
  const Gaussians gaussians = ScatteredGaussians(60'000, 3);
  const GaussianSpzBlocks blocks(gaussians, AllOf(gaussians));
  EXPECT_GT(blocks.num_blocks(), 8);
  const Spz spz(blocks);
  EXPECT_EQ(spz.count, 60'000u);
  EXPECT_NEAR(spz.Position(59'999, 0), gaussians.Plane(kMeanPlane)[59'999], 1e-5);
  EXPECT_NEAR(spz.Sh(59'999, 15, 2), gaussians.Plane(kShPlane + 47)[59'999], 8.001 / 128);
  EXPECT_LT(spz.num_bytes, 60'000u * 62 * 4 / 5) << "a PLY has 62 floats each";
}

TEST(GaussianSpzBlocks, ChooseASubset) {
  const Gaussians gaussians = ScatteredGaussians(10, 1);
  const Spz spz{GaussianSpzBlocks(gaussians, {3, 8})};
  ASSERT_EQ(spz.count, 2u);
  EXPECT_NEAR(spz.Position(1, 0), gaussians.Plane(kMeanPlane)[8], 1e-5);
  EXPECT_EQ((Spz{GaussianSpzBlocks(gaussians, {})}.count), 0u);
}

}  // namespace
}  // namespace pepeseg
