#include "core/dataset/depth_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "core/formats/npy.h"
#include "tests/testing/float_files.h"
#include "tests/testing/small_dataset.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using absl::StatusCode::kInvalidArgument;
using testing::BytesOf;
using ::testing::ElementsAre;
using ::testing::IsNan;
using testing::NpyDict;
using testing::NpyOf;

constexpr auto kDepth = DepthPrior::Kind::kDepth;
constexpr auto kDisparity = DepthPrior::Kind::kDisparity;
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

const FloatImage kMap = {3, 2, {1, 0, 2.5f, 4, 0.5f, 3}};

absl::StatusOr<FloatImage> Read(const std::string& file, const std::string& bytes,
                                DepthPrior::Kind kind = kDepth,
                                const PhotoSize& photo = {"images/a.jpg", 3, 2}) {
  const testing::TempFolder folder;
  testing::WriteBytes(folder / file, bytes);
  return ReadDepthMap(folder / file, "depth/" + file, kind, photo);
}

template <class T>
void ExpectNpyOfType(const std::string& type, const std::vector<T>& values) {
  SCOPED_TRACE(type);
  ASSERT_OK_AND_ASSIGN(
      const FloatImage image,
      ParseNpy("a.npy", NpyOf(NpyDict(type, "(1, 3)"), BytesOf(std::span<const T>(values)))));
  EXPECT_EQ(image.width, 3);
  EXPECT_EQ(image.height, 1);
  EXPECT_THAT(image.values, ElementsAre(0, 1, 200));
}

TEST(Npy, ReadsFloatsAndUnsignedIntegers) {
  ExpectNpyOfType<uint16_t>("<f2", {0, 0x3C00, 0x5A40});
  ExpectNpyOfType<float>("<f4", {0, 1, 200});
  ExpectNpyOfType<double>("<f8", {0, 1, 200});
  ExpectNpyOfType<uint8_t>("|u1", {0, 1, 200});
  ExpectNpyOfType<uint16_t>("<u2", {0, 1, 200});
  ExpectNpyOfType<uint32_t>("<u4", {0, 1, 200});
}

TEST(Npy, RejectsOtherTypesShapesAndOrders) {
  const std::string bytes(64, '\0');
  const auto parse = [&](const std::string& dict) {
    return ParseNpy("d.npy", NpyOf(dict, bytes)).status();
  };
  for (const char* type : {">f4", "<i4", "<c8", "|O", "<f4x"}) {
    EXPECT_STATUS(parse(NpyDict(type, "(2, 2)")), kInvalidArgument, "d.npy: the array must be of");
  }
  for (const char* shape : {"(4,)", "(1, 2, 2)", "()", "(2, -2)", "4", "(2, 2.5)"}) {
    EXPECT_STATUS(parse(NpyDict("<f4", shape)), kInvalidArgument, "d.npy: the array must have");
  }
  EXPECT_STATUS(parse(NpyDict("<f4", "(0, 4)")), kInvalidArgument, "d.npy: an empty array");
  EXPECT_STATUS(parse("{'descr': '<f4', 'fortran_order': True, 'shape': (2, 2), }"),
                kInvalidArgument, "d.npy: the array must be in C order");
  EXPECT_STATUS(parse("{'descr': '<f4', 'fortran_order': False}"), kInvalidArgument,
                "d.npy: the NPY header is malformed");
  EXPECT_STATUS(ParseNpy("d.npy", "\x93NUMPX"), kInvalidArgument, "d.npy: not an NPY file");
}

TEST(Npy, RejectsShapesLargerThanTheFileBeforeAllocating) {
  const auto parse = [](const std::string& shape) {
    return ParseNpy("d.npy", NpyOf(NpyDict("<f4", shape), std::string(24, '\0'))).status();
  };
  EXPECT_OK(parse("(2, 3)"));
  EXPECT_STATUS(parse("(2, 4)"), kInvalidArgument, "d.npy: cut short");
  EXPECT_STATUS(parse("(8000, 8000)"), kInvalidArgument, "d.npy: cut short");
  EXPECT_STATUS(parse("(8001, 8000)"), kInvalidArgument, "8000x8001 pixels, the limit is 64000000");
  // The product of the sizes overflows to 0 in 64 bits.
  EXPECT_STATUS(parse("(4294967296, 4294967296)"), kInvalidArgument, "the limit is");
}

TEST(Pfm, ReadsTheBottomScanlineFirstInEitherByteOrder) {
  const std::string little = testing::Pfm(kMap);
  ASSERT_OK_AND_ASSIGN(const FloatImage image, ParsePfm("a.pfm", little));
  EXPECT_EQ(image.values, kMap.values);
  std::string big = "Pf 3 2 1.0\n";
  const std::string bytes = little.substr(little.size() - 24);
  for (size_t i = 0; i < bytes.size(); ++i) big += bytes[i / 4 * 4 + 3 - i % 4];
  ASSERT_OK_AND_ASSIGN(const FloatImage swapped, ParsePfm("a.pfm", big));
  EXPECT_EQ(swapped.values, kMap.values);
}

TEST(Pfm, RejectsMalformedFiles) {
  const std::string floats(24, '\0');
  const auto parse = [&](const std::string& header) {
    return ParsePfm("d.pfm", header + floats).status();
  };
  EXPECT_OK(parse("Pf\n3 2\n-1\n"));
  EXPECT_STATUS(parse("PF\n1 2\n-1\n"), kInvalidArgument, "d.pfm: a PFM of three channels");
  EXPECT_STATUS(parse("P5\n3 2\n-1\n"), kInvalidArgument, "d.pfm: not a PFM file");
  for (const char* header : {"Pf\n3 x\n-1\n", "Pf\n3 2\n0\n", "Pf\n3 2\nnan\n", "Pf\n-3 2\n-1\n"}) {
    EXPECT_STATUS(parse(header), kInvalidArgument, "d.pfm: the PFM header is malformed");
  }
  EXPECT_STATUS(parse("Pf\n3 0\n-1\n"), kInvalidArgument, "d.pfm: an empty image");
  EXPECT_STATUS(parse("Pf\n3 3\n-1\n"), kInvalidArgument, "d.pfm: cut short");
  EXPECT_STATUS(parse("Pf\n8001 8000\n-1\n"), kInvalidArgument, "the limit is 64000000");
  EXPECT_STATUS(parse("Pf\n4294967296 4294967296\n-1\n"), kInvalidArgument, "the limit is");
}

TEST(DepthMap, IsReadFromEveryFormat) {
  const std::string png = testing::Png({3, 2, 1, {1, 0, 2, 4, 7, 255}});
  ASSERT_OK_AND_ASSIGN(const FloatImage grey, Read("a.png", png));
  EXPECT_THAT(grey.values, ElementsAre(1, IsNan(), 2, 4, 7, 255));
  for (const auto& [file, bytes] :
       {std::pair{"a.npy", testing::Npy(kMap)}, {"a.pfm", testing::Pfm(kMap)}}) {
    ASSERT_OK_AND_ASSIGN(const FloatImage map, Read(file, bytes));
    EXPECT_THAT(map.values, ElementsAre(1, IsNan(), 2.5f, 4, 0.5f, 3)) << file;
  }
}

TEST(DepthMap, KeepsZerosOfDisparity) {
  ASSERT_OK_AND_ASSIGN(const FloatImage map, Read("a.npy", testing::Npy(kMap), kDisparity));
  EXPECT_EQ(map.values, kMap.values);
}

TEST(DepthMap, KeepsAllSixteenBits) {
  ASSERT_OK_AND_ASSIGN(const FloatImage map,
                       ReadDepthMap(PEPESEG_TEST_DATA "/apc_shelf/depth/frame-000000.png",
                                    "depth/frame-000000.png", kDepth, {"photo", 640, 480}));
  // Values are tenths of a millimetre: nearly all that is visible is 8 cm to 1 m away.
  const auto known = static_cast<size_t>(
      std::count_if(map.values.begin(), map.values.end(), [](float v) { return !std::isnan(v); }));
  const auto near = static_cast<size_t>(std::count_if(
      map.values.begin(), map.values.end(), [](float v) { return v > 800 && v < 10000; }));
  EXPECT_EQ(known, 81376u);
  EXPECT_GT(near, known * 99 / 100);
}

TEST(DepthMap, IsRejectedByNameIfItDoesNotFit) {
  const std::string good = testing::Npy(kMap);
  EXPECT_STATUS(Read("a.npy", good, kDepth, {"images/a.jpg", 4, 2}), kInvalidArgument,
                "depth/a.npy: has 3x2 pixels, its photograph images/a.jpg 4x2");
  EXPECT_OK(Read("a.npy", good, kDepth, {"images/a.jpg", 1500, 1000}));
  EXPECT_OK(Read("a.npy", good, kDepth, {"images/a.jpg", 1500, 1009}));
  EXPECT_STATUS(Read("a.npy", good, kDepth, {"images/a.jpg", 1500, 1020}), kInvalidArgument,
                "not of one shape");
  EXPECT_STATUS(Read("a.png", good), kInvalidArgument,
                "depth/a.png: not a JPEG, PNG, WebP or HEIC");
  EXPECT_STATUS(Read("a.png", testing::Png(testing::Picture(3, 2))), kInvalidArgument,
                "depth/a.png: has colours");
  EXPECT_STATUS(Read("a.png", testing::Jpeg(testing::Picture(3, 2))), kInvalidArgument,
                "depth/a.png: not a PNG");
  EXPECT_STATUS(Read("a.exr", good), kInvalidArgument, "depth/a.exr: depth maps come as");
}

TEST(DepthMap, IsRejectedNamingThePixelThatIsNotFinite) {
  for (const float bad : {kNan, std::numeric_limits<float>::infinity()}) {
    FloatImage map = kMap;
    map.values[5] = bad;
    EXPECT_STATUS(Read("a.npy", testing::Npy(map)), kInvalidArgument,
                  "depth/a.npy: the value at x 2, y 1 is not finite");
    EXPECT_STATUS(Read("a.pfm", testing::Pfm(map), kDisparity), kInvalidArgument,
                  "depth/a.pfm: the value at x 2, y 1 is not finite");
  }
}

}  // namespace
}  // namespace pepeseg
