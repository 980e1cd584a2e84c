#include "core/formats/ply.h"

#include <gtest/gtest.h>

#include "absl/strings/str_replace.h"
#include "core/base/file_io.h"
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

TEST(PlyPoints, AreReadBehindAHeaderWithLineEndsOfWindows) {
  const testing::TempFolder folder;
  std::string bytes = PointsFile("");
  const size_t data = bytes.size() - 24;
  const std::string header =
      absl::StrReplaceAll(absl::string_view(bytes).substr(0, data), {{"\n", "\r\n"}});
  ASSERT_OK(WriteFileAtomically(folder / "p.ply", header + bytes.substr(data)));
  ASSERT_OK_AND_ASSIGN(const auto points, ReadPlyPoints(folder / "p.ply", "p.ply"));
  ASSERT_EQ(points.size(), 2u);
  EXPECT_EQ(points[1].position, Eigen::Vector3f(2.5f, 2, -3));
}

TEST(PlyPoints, AreReadFromText) {
  const testing::TempFolder folder;
  const std::string header =
      "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\n"
      "property float z\nproperty uint8 red\nproperty uint8 green\nproperty uint8 blue\n"
      "end_header\n";
  const auto read = [&](const std::string& lines) {
    EXPECT_OK(WriteFileAtomically(folder / "p.ply", header + lines));
    return ReadPlyPoints(folder / "p.ply", "p.ply");
  };
  ASSERT_OK_AND_ASSIGN(const auto points, read("1 2 3 4 5 6\r\n-1.5e1  0.25\t7 255 0 1"));
  ASSERT_EQ(points.size(), 2u);
  EXPECT_EQ(points[0].position, Eigen::Vector3f(1, 2, 3));
  EXPECT_EQ(points[1].position, Eigen::Vector3f(-15, 0.25f, 7));
  EXPECT_EQ(points[1].rgb[0], 255);
  EXPECT_EQ(points[1].rgb[2], 1);
  constexpr auto kRefused = absl::StatusCode::kInvalidArgument;
  EXPECT_STATUS(read("1 2 3 4 5 6\n"), kRefused, "declares 2 vertices of 12 bytes");
  EXPECT_STATUS(read("1.000000 2.000000 3 4 5 6\n"), kRefused,
                "p.ply: vertex 1: its line is not 6");
  EXPECT_STATUS(read("1 2 3 4 5 6\n1 2 3 4 5\n7 "), kRefused, "vertex 1: its line is not 6");
  EXPECT_STATUS(read("1 2 3 4 5 6\n1 2 three 4 5 6\n"), kRefused, "vertex 1");
  EXPECT_STATUS(read("1 2 3 4 5 6\n1 nan 3 4 5 6\n"), kRefused, "vertex 1: y is not finite");
  EXPECT_STATUS(read("1 2 3 4 5 6" + std::string(20000, ' ')), kRefused, "vertex 0: its line");
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
