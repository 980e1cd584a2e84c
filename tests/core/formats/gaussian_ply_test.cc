#include "core/formats/gaussian_ply.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "core/base/file_io.h"
#include "tests/testing/gaussian_file.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

using absl::StatusCode::kInvalidArgument;
using testing::AllOf;
using testing::FileOf;
using testing::RandomGaussians;
using testing::TempFolder;

TEST(GaussianPly, RoundTripsBitForBit) {
  const TempFolder folder;
  for (int degree = 0; degree <= kMaxShDegree; ++degree) {
    const Gaussians gaussians = RandomGaussians(5000, degree);
    ASSERT_OK(WriteGaussianPly(folder / "a.ply", gaussians));
    ASSERT_OK_AND_ASSIGN(const Gaussians read, ReadGaussianPly(folder / "a.ply", "a.ply"));
    EXPECT_EQ(read.count, 5000);
    EXPECT_EQ(read.sh_degree, degree);
    EXPECT_EQ(read.planes, gaussians.planes);
  }
}

TEST(GaussianPly, HasFloatsAndACommentInLocalCoordinates) {
  const TempFolder folder;
  const Eigen::Vector3d origin(4e5, 5.3e6, 100.125);
  const Gaussians gaussians = RandomGaussians(50, 1);
  const GaussianPlyBlocks blocks(gaussians, AllOf(gaussians), origin, PlyCoordinates::kLocal);
  const std::string ply = FileOf(blocks);
  EXPECT_EQ(static_cast<int64_t>(ply.size()), blocks.num_bytes());
  EXPECT_NE(ply.find("comment pepeseg_origin 400000 5300000 100.125\n"), std::string::npos);
  EXPECT_NE(ply.find("property float x\n"), std::string::npos);
  ASSERT_OK(WriteFileAtomically(folder / "a.ply", ply));
  ASSERT_OK_AND_ASSIGN(const Gaussians read, ReadGaussianPly(folder / "a.ply", "a.ply", origin));
  EXPECT_EQ(read.planes, gaussians.planes);
  const size_t at = ply.find("5300000");
  ASSERT_OK(
      WriteFileAtomically(folder / "b.ply", ply.substr(0, at) + "north" + ply.substr(at + 7)));
  EXPECT_STATUS(ReadGaussianPly(folder / "b.ply", "b.ply"), kInvalidArgument, "pepeseg_origin");
}

TEST(GaussianPly, UsesDoublesFarFromZero) {
  const TempFolder folder;
  const Eigen::Vector3d origin(4e5, 5.3e6, 100);
  const Gaussians gaussians = RandomGaussians(5000, 1);
  ASSERT_OK(WriteGaussianPly(folder / "a.ply", gaussians, origin));
  ASSERT_OK_AND_ASSIGN(const Gaussians read, ReadGaussianPly(folder / "a.ply", "a.ply", origin));
  ASSERT_EQ(read.count, 5000);
  for (size_t i = 0; i < read.planes.size(); ++i) {
    EXPECT_NEAR(read.planes[i], gaussians.planes[i], i < 15000 ? 1e-8 : 0);
  }
  // Another program reads coordinates in the world.
  ASSERT_OK_AND_ASSIGN(const Gaussians world, ReadGaussianPly(folder / "a.ply", "a.ply"));
  EXPECT_NEAR(world.Plane(kMeanPlane + 1)[7], gaussians.Plane(kMeanPlane + 1)[7] + 5.3e6, 0.5);
  EXPECT_EQ(world.Plane(kLogScalePlane)[7], gaussians.Plane(kLogScalePlane)[7]);
  ASSERT_OK_AND_ASSIGN(const std::string bytes, ReadFile(folder / "a.ply", "a.ply", 1 << 24));
  EXPECT_NE(bytes.find("property double y\n"), std::string::npos);
  EXPECT_EQ(EncodeGaussianPly(gaussians, origin), bytes);
}

TEST(EncodeGaussianPly, ReturnsTheBytesOfTheFile) {
  const TempFolder folder;
  for (const int64_t count : {0, 1, 5000}) {
    const Gaussians gaussians = RandomGaussians(count, 2);
    ASSERT_OK(WriteGaussianPly(folder / "a.ply", gaussians));
    ASSERT_OK_AND_ASSIGN(const std::string bytes, ReadFile(folder / "a.ply", "a.ply", 1 << 24));
    EXPECT_EQ(EncodeGaussianPly(gaussians), bytes);
  }
}

TEST(GaussianPlyBlocks, EqualTheFileOfTheChosenGaussians) {
  const Gaussians gaussians = RandomGaussians(30'000, 3);
  std::vector<uint32_t> some;
  std::vector<int64_t> rows;
  for (uint32_t i = 0; i < 30'000; i += 1 + i % 3) {
    some.push_back(i);
    rows.push_back(i);
  }
  for (const Eigen::Vector3d& origin : {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(4e5, 5e6, 1)}) {
    const GaussianPlyBlocks blocks(gaussians, some, origin);
    EXPECT_GT(blocks.num_blocks(), 3);
    const std::string joined = FileOf(blocks);
    EXPECT_EQ(static_cast<int64_t>(joined.size()), blocks.num_bytes());
    EXPECT_EQ(joined, EncodeGaussianPly(gaussians.Select(rows), origin));
  }
}

TEST(GaussianPlyBlocks, HaveTheSegmentsOfTheChosenGaussians) {
  const TempFolder folder;
  const Gaussians gaussians = RandomGaussians(5, 1);
  const GaussianPlyBlocks blocks(gaussians, {4, 1}, Eigen::Vector3d::Zero(), PlyCoordinates::kWorld,
                                 {{10, 11, 12, 13, 14}, {0, 1, 2, 3, 70'000}});
  const std::string header = blocks.Encode(0), rows = blocks.Encode(1);
  EXPECT_NE(header.find("property float rot_3\nproperty int segment_0\nproperty int segment_1\n"),
            std::string::npos);
  EXPECT_EQ(static_cast<int64_t>(header.size() + rows.size()), blocks.num_bytes());
  std::vector<int32_t> first(2), second(2);
  std::memcpy(first.data(), rows.data() + rows.size() / 2 - 8, 8);
  std::memcpy(second.data(), rows.data() + rows.size() - 8, 8);
  EXPECT_EQ(first, (std::vector<int32_t>{14, 70'000}));
  EXPECT_EQ(second, (std::vector<int32_t>{11, 1}));
  // Readers of splats skip them.
  ASSERT_OK(WriteFileAtomically(folder / "a.ply", header + rows));
  ASSERT_OK_AND_ASSIGN(const Gaussians read, ReadGaussianPly(folder / "a.ply", "a.ply"));
  EXPECT_EQ(read.planes, gaussians.Select(std::vector<int64_t>{4, 1}).planes);
}

TEST(GaussianPlyBlocks, AreOnlyAHeaderWithoutGaussians) {
  const Gaussians gaussians = RandomGaussians(10, 0);
  const GaussianPlyBlocks blocks(gaussians, {}, Eigen::Vector3d::Zero());
  ASSERT_EQ(blocks.num_blocks(), 1);
  EXPECT_EQ(blocks.Encode(0), EncodeGaussianPly(Gaussians::Zero(0, 0)));
}

TEST(GaussianPly, HasTheLayoutOf3dgs) {
  const TempFolder folder;
  Gaussians gaussians = Gaussians::Zero(1, 3);
  for (int k = 0; k < NumPlanes(3); ++k) gaussians.Plane(k)[0] = static_cast<float>(k);
  ASSERT_OK(WriteGaussianPly(folder / "a.ply", gaussians));
  ASSERT_OK_AND_ASSIGN(const std::string bytes, ReadFile(folder / "a.ply", "a.ply", 1 << 20));
  std::string header = "ply\nformat binary_little_endian 1.0\nelement vertex 1\n";
  for (const char* name : {"x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"}) {
    header += std::string("property float ") + name + "\n";
  }
  for (int i = 0; i < 45; ++i) header += "property float f_rest_" + std::to_string(i) + "\n";
  for (const char* name :
       {"opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"}) {
    header += std::string("property float ") + name + "\n";
  }
  header += "end_header\n";
  ASSERT_EQ(bytes.substr(0, header.size()), header);
  std::vector<float> values(62);
  ASSERT_EQ(bytes.size(), header.size() + 62 * sizeof(float));
  std::memcpy(values.data(), bytes.data() + header.size(), 62 * sizeof(float));
  EXPECT_EQ(values[2], kMeanPlane + 2);
  EXPECT_EQ(values[4], 0);                          // ny
  EXPECT_EQ(values[7], kShPlane + 1);               // green of degree 0
  EXPECT_EQ(values[9], kShPlane + 3 * 1 + 0);       // f_rest_0: red, coefficient 1
  EXPECT_EQ(values[9 + 14], kShPlane + 3 * 15);     // f_rest_14: red, coefficient 15
  EXPECT_EQ(values[9 + 15], kShPlane + 3 * 1 + 1);  // f_rest_15: green, coefficient 1
  EXPECT_EQ(values[54], kOpacityPlane);
  EXPECT_EQ(values[55], kLogScalePlane);
  EXPECT_EQ(values[58], kRotationPlane);  // w
  EXPECT_EQ(values[61], kRotationPlane + 3);
}

// Returns a degree-0 file with another order, doubles, an unknown property and no normals.
std::string ForeignFile(double opacity, float rot_0) {
  std::string bytes = "ply\r\nformat binary_little_endian 1.0\ncomment by hand\nelement vertex 1\n";
  for (const char* name : {"rot_0", "rot_1", "rot_2", "rot_3", "scale_0", "scale_1", "scale_2",
                           "f_dc_0", "f_dc_1", "f_dc_2"}) {
    bytes += std::string("property float ") + name + "\n";
  }
  bytes += "property uchar segment\nproperty double opacity\n";
  for (const char* name : {"x", "y", "z"}) bytes += std::string("property float64 ") + name + "\n";
  bytes += "element face 7\nproperty list uchar int vertex_indices\nend_header\n";
  const auto put = [&bytes](auto value) {
    bytes.append(reinterpret_cast<const char*>(&value), sizeof(value));
  };
  put(rot_0);
  for (int i = 1; i < 10; ++i) put(static_cast<float>(i));
  put(uint8_t{9});
  put(opacity);
  for (int i = 0; i < 3; ++i) put(20.0 + i);
  return bytes;
}

TEST(GaussianPly, ReadsAnyOrderAndDoubles) {
  const TempFolder folder;
  ASSERT_OK(WriteFileAtomically(folder / "a.ply", ForeignFile(0.5, 1)));
  ASSERT_OK_AND_ASSIGN(const Gaussians gaussians, ReadGaussianPly(folder / "a.ply", "a.ply"));
  EXPECT_EQ(gaussians.sh_degree, 0);
  EXPECT_EQ(gaussians.Plane(kMeanPlane + 1)[0], 21);
  EXPECT_EQ(gaussians.Plane(kRotationPlane + 3)[0], 3);
  EXPECT_EQ(gaussians.Plane(kLogScalePlane)[0], 4);
  EXPECT_EQ(gaussians.Plane(kShPlane + 2)[0], 9);
  EXPECT_EQ(gaussians.Plane(kOpacityPlane)[0], 0.5f);
}

// splat-transform and spz-js write infinite logits for opacities of 1 and 0.
TEST(GaussianPly, LimitsInfiniteOpacities) {
  const TempFolder folder;
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  for (const double opacity : {kInfinity, -kInfinity}) {
    ASSERT_OK(WriteFileAtomically(folder / "a.ply", ForeignFile(opacity, 1)));
    ASSERT_OK_AND_ASSIGN(const Gaussians gaussians, ReadGaussianPly(folder / "a.ply", "a.ply"));
    EXPECT_EQ(gaussians.Plane(kOpacityPlane)[0], opacity > 0 ? 20.0f : -20.0f);
  }
}

TEST(GaussianPly, RejectsInvalidValues) {
  const TempFolder folder;
  const double bad = std::numeric_limits<double>::quiet_NaN();
  ASSERT_OK(WriteFileAtomically(folder / "a.ply", ForeignFile(bad, 1)));
  EXPECT_STATUS(ReadGaussianPly(folder / "a.ply", "a.ply"), kInvalidArgument,
                "a.ply: vertex 0: opacity is not finite");
  std::string zero_rotation = ForeignFile(0.5, 0);
  const size_t data = zero_rotation.find("end_header\n") + 11;
  std::memset(zero_rotation.data() + data, 0, 16);
  ASSERT_OK(WriteFileAtomically(folder / "a.ply", zero_rotation));
  EXPECT_STATUS(ReadGaussianPly(folder / "a.ply", "a.ply"), kInvalidArgument, "rot is zero");
}

TEST(GaussianPly, RejectsDamagedHeaders) {
  const TempFolder folder;
  const std::string good = ForeignFile(0.5, 1);
  const auto expect_refused = [&](const std::string& from, const std::string& to,
                                  const std::string& why) {
    std::string bytes = good;
    bytes.replace(bytes.find(from), from.size(), to);
    ASSERT_OK(WriteFileAtomically(folder / "a.ply", bytes));
    EXPECT_STATUS(ReadGaussianPly(folder / "a.ply", "a.ply"), kInvalidArgument, why);
  };
  expect_refused("vertex 1", "vertex 1000000", "declares 1000000 vertices of");
  expect_refused("vertex 1", "vertex 9000000000", "the limit is 50000000");
  expect_refused("vertex 1", "vertex -1", "malformed");
  expect_refused("binary_little_endian", "ascii", "binary_little_endian");
  expect_refused("property float f_dc_1", "property float f_rest_0", "1 properties f_rest");
  expect_refused("property float f_dc_1", "property float f_dc_9", "no property f_dc_1");
  expect_refused("property float f_dc_1", "property float f_dc_0", "two properties f_dc_0");
  expect_refused("property float f_dc_1", "property list uchar int i", "not a single number");
  expect_refused("end_header", "end_heater", "header has no end");
  expect_refused("ply\r\n", "plx\r\n", "not a PLY file");
}

}  // namespace
}  // namespace pepeseg
