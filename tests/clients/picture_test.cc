#include "clients/terminal/picture.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>

#include "clients/cpp/file_bytes.h"
#include "clients/terminal/view_picture.h"
#include "tests/testing/status_testing.h"

namespace pepeseg::client::cli {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST(Picture, ReadsPhotographsAndLabels) {
  const auto photo = ReadPicture(PEPESEG_TEST_DATA "/apc_shelf/images/frame-000000.jpg");
  ASSERT_OK(photo);
  EXPECT_EQ(photo->width, 640);
  EXPECT_EQ(photo->height, 480);
  const auto labels = ReadGreyPicture(PEPESEG_TEST_DATA "/apc_shelf/labels/frame-000000.png");
  ASSERT_OK(labels);
  std::array<int, 256> count{};
  for (const uint8_t value : labels->pixels) ++count[value];
  for (const int label : {48, 114, 132, 144}) EXPECT_GT(count[label], 100) << label;
}

TEST(Picture, NamesAFileThatIsNotAPicture) {
  const auto picture = ReadPicture(PEPESEG_TEST_DATA "/apc_shelf/SOURCE.md");
  EXPECT_EQ(picture.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_NE(std::string(picture.status().message()).find("SOURCE.md"), std::string::npos);
}

TEST(Picture, IsUnchangedByWritingAndReading) {
  const fs::path path =
      fs::temp_directory_path() / ("pepeseg_" + std::to_string(getpid())) / "sheet.png";
  Picture picture = Picture::Filled(40, 30, {10, 20, 30});
  DrawMask(picture, std::vector<uint8_t>(40 * 30, 1), {255, 0, 0});
  const std::array<Panel, 2> panels = {{{"left", picture}, {"right", picture}}};
  const Picture sheet = SideBySide(panels);
  ASSERT_OK(WritePng(path, sheet));
  const auto read = ReadPicture(path);
  fs::remove_all(path.parent_path());
  ASSERT_OK(read);
  EXPECT_EQ(read->width, sheet.width);
  EXPECT_EQ(read->pixels, sheet.pixels);
}

TEST(Picture, IsNotWrittenIfItIsWiderThanAPngMayBe) {
  const fs::path path =
      fs::temp_directory_path() / ("pepeseg_" + std::to_string(getpid())) / "wide.png";
  constexpr int kWidth = 1'000'001;  // libpng's limit is a million
  const absl::Status written = WritePng(path, GreyPicture{kWidth, 1, std::vector<uint8_t>(kWidth)});
  EXPECT_EQ(written.code(), absl::StatusCode::kInternal);
  EXPECT_THAT(std::string(written.message()), HasSubstr("1000001x1"));
  EXPECT_FALSE(fs::exists(path));
}

TEST(EncodePng, KeepsLabelValues) {
  const GreyPicture labels = {2, 3, {0, 1, 48, 114, 255, 7}};
  const fs::path path =
      fs::temp_directory_path() / ("pepeseg_" + std::to_string(getpid()) + ".png");
  ASSERT_OK(WriteFile(path, EncodePng(labels)));
  const auto read = ReadGreyPicture(path);
  fs::remove(path);
  ASSERT_OK(read);
  EXPECT_EQ(read->width, 2);
  EXPECT_EQ(read->pixels, labels.pixels);
}

// A PNG of 2 x 1 grey pixels of 16 bits: 3 and 258.
constexpr unsigned char kGrey16[] = {
    0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0x00, 0x00, 0x00, 0x0d, 0x49, 0x48,
    0x44, 0x52, 0x00, 0x00, 0x00, 0x02, 0x00, 0x00, 0x00, 0x01, 0x10, 0x00, 0x00, 0x00,
    0x00, 0x81, 0xd9, 0xfc, 0x15, 0x00, 0x00, 0x00, 0x0d, 0x49, 0x44, 0x41, 0x54, 0x78,
    0x9c, 0x63, 0x60, 0x60, 0x66, 0x64, 0x02, 0x00, 0x00, 0x12, 0x00, 0x07, 0x2a, 0x14,
    0xd9, 0x1f, 0x00, 0x00, 0x00, 0x00, 0x49, 0x45, 0x4e, 0x44, 0xae, 0x42, 0x60, 0x82};

TEST(DecodeGrey16, KeepsAllBits) {
  const absl::string_view bytes(reinterpret_cast<const char*>(kGrey16), sizeof(kGrey16));
  const auto picture = DecodeGrey16(bytes, "ids");
  ASSERT_OK(picture);
  EXPECT_EQ(picture->width, 2);
  EXPECT_EQ(picture->height, 1);
  EXPECT_THAT(picture->pixels, ElementsAre(3, 258));
}

TEST(DecodeGrey16, RefusesOtherPictures) {
  const auto eight = DecodeGrey16(EncodePng(GreyPicture{2, 1, {3, 9}}), "ids");
  EXPECT_EQ(eight.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(eight.status().message()), HasSubstr("ids: not grey of 16 bits"));
  const auto none = DecodeGrey16("nonsense", "ids");
  EXPECT_EQ(none.status().code(), absl::StatusCode::kInvalidArgument);
}

TEST(DrawMask, TintsTheInsideAndDrawsTheBorder) {
  Picture picture = Picture::Filled(5, 5, {0, 0, 0});
  std::vector<uint8_t> mask(25, 0);
  for (int y = 1; y < 4; ++y) {
    for (int x = 1; x < 4; ++x) mask[y * 5 + x] = 1;
  }
  DrawMask(picture, mask, {200, 0, 0});
  EXPECT_EQ(picture.At(0, 0)[0], 0);
  EXPECT_EQ(picture.At(1, 1)[0], 200);
  EXPECT_EQ(picture.At(2, 2)[0], 90);
}

TEST(Resized, KeepsLabelValues) {
  const GreyPicture labels{4, 2, {7, 7, 9, 9, 7, 7, 9, 9}};
  const GreyPicture half = Resized(labels, 2, 1);
  EXPECT_EQ(half.pixels, (std::vector<uint8_t>{7, 9}));
}

TEST(Stem, NeverLeadsOutOfTheFolder) {
  EXPECT_EQ(Stem("left/0001.jpg"), "left-0001");
  EXPECT_EQ(Stem("../../etc/passwd.png").find('/'), std::string::npos);
  EXPECT_NE(Stem("../x.png").front(), '.');
}

}  // namespace
}  // namespace pepeseg::client::cli
