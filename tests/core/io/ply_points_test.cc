#include "core/io/ply_points.h"

#include <gtest/gtest.h>

#include "core/io/atomic_file.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

std::string PointsFile(const std::string& colors) {
  std::string bytes =
      "ply\nformat binary_little_endian 1.0\nelement vertex 2\n"
      "property float x\nproperty float y\nproperty float z\n" +
      colors + "end_header\n";
  for (int i = 0; i < 2; ++i) {
    const float xyz[3] = {1.5f + i, 2, -3};
    bytes.append(reinterpret_cast<const char*>(xyz), sizeof(xyz));
    if (!colors.empty()) bytes.append({'\xFF', '\x10', '\0'});
  }
  return bytes;
}

TEST(PlyPoints, AreReadWithTheirColours) {
  const testing::TempFolder folder;
  ASSERT_OK(WriteFileAtomically(
      folder / "p.ply",
      PointsFile("property uchar red\nproperty uchar green\nproperty uchar blue\n")));
  ASSERT_OK_AND_ASSIGN(const auto points, ReadPlyPoints(folder / "p.ply", "p.ply"));
  ASSERT_EQ(points.size(), 2u);
  EXPECT_EQ(points[1].position, Eigen::Vector3f(2.5f, 2, -3));
  EXPECT_EQ(points[1].rgb[0], 255);
  EXPECT_EQ(points[1].rgb[1], 16);
  EXPECT_EQ(points[1].rgb[2], 0);
}

TEST(PlyPoints, AreGreyWithoutColours) {
  const testing::TempFolder folder;
  ASSERT_OK(WriteFileAtomically(folder / "p.ply", PointsFile("")));
  ASSERT_OK_AND_ASSIGN(const auto points, ReadPlyPoints(folder / "p.ply", "p.ply"));
  ASSERT_EQ(points.size(), 2u);
  EXPECT_EQ(points[0].rgb[2], 128);
}

}  // namespace
}  // namespace pepeseg
