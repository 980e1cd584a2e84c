#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "absl/strings/match.h"
#include "core/formats/image_header.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

namespace fs = std::filesystem;

constexpr int64_t kGiB = int64_t{1} << 30;

std::string BigEndian16(int value) {
  return {static_cast<char>(value >> 8), static_cast<char>(value & 0xFF)};
}

// Returns the header of a JPEG whose frame header follows `num_segments` others, such as EXIF.
std::string JpegHeader(int num_segments, int width, int height) {
  std::string jpeg = "\xFF\xD8";
  for (int i = 0; i < num_segments; ++i) {
    jpeg += "\xFF\xE2" + BigEndian16(0xFFFF) + std::string(0xFFFF - 2, 'x');
  }
  jpeg += "\xFF\xC0" + BigEndian16(11) + "\x08" + BigEndian16(height) + BigEndian16(width);
  return jpeg + "\x01" + "\x01\x11" + std::string(1, '\0');
}

std::string PngHeader() {
  const std::string ihdr("\0\0\0\x0DIHDR\0\0\x02\x80\0\0\x01\xE0\x08\x02\0\0\0crc!", 25);
  return "\x89PNG\r\n\x1a\n" + ihdr;
}

std::string WebpHeader() {
  std::string webp("RIFF\xFF\xFF\xFF\x00WEBPVP8X\x0A\0\0\0\0\0\0\0", 24);
  return webp + std::string("\x7F\x02\0\xDF\x01\0", 6);
}

// Returns how many bytes this process has read by system calls so far.
int64_t BytesRead() {
  std::ifstream file("/proc/self/io");
  std::string name;
  int64_t bytes = 0;
  file >> name >> bytes;
  EXPECT_EQ(name, "rchar:");
  return bytes;
}

struct ImageSizeTest : ::testing::Test {
  // Creates a sparse file that begins with these bytes, followed by zeros.
  void Write(const std::string& front, int64_t size = 0) {
    std::ofstream(path, std::ios::binary) << front;
    if (size > 0) fs::resize_file(path, static_cast<uintmax_t>(size));
  }
  void ExpectSize(ImageFormat format, int width, int height) {
    ASSERT_OK_AND_ASSIGN(const ImageHeader header, ReadImageSize(path, "a.jpg"));
    EXPECT_EQ(header.format, format);
    EXPECT_EQ(header.width, width);
    EXPECT_EQ(header.height, height);
  }
  void ExpectRefused(const std::string& words) {
    const absl::Status status = ReadImageSize(path, "a.jpg").status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << status;
    EXPECT_TRUE(absl::StartsWith(status.message(), "a.jpg: ")) << status;
    EXPECT_TRUE(absl::StrContains(status.message(), words)) << status;
  }

  const testing::TempFolder folder;
  const fs::path path = folder / "file";
};

TEST_F(ImageSizeTest, ReadsEachFormatByItsFirstBytes) {
  Write(JpegHeader(0, 4000, 3000), kGiB);
  ExpectSize(ImageFormat::kJpeg, 4000, 3000);
  Write(PngHeader(), kGiB);
  ExpectSize(ImageFormat::kPng, 640, 480);
  Write(WebpHeader(), kGiB);
  ExpectSize(ImageFormat::kWebp, 640, 480);
}

TEST_F(ImageSizeTest, SkipsTheSegmentsOfAJpeg) {
  for (const int num_segments : {1, 2, 10, 200}) {
    Write(JpegHeader(num_segments, 4000, 3000), kGiB);
    const int64_t before = BytesRead();
    ExpectSize(ImageFormat::kJpeg, 4000, 3000);
    EXPECT_LT(BytesRead() - before, (num_segments + 2) * 8192);
  }
}

TEST_F(ImageSizeTest, StopsWithinItsLimits) {
  constexpr int64_t kMostBytes = kMaxHeaderReads * static_cast<int64_t>(kHeaderReadBytes);
  for (const std::string& front : {JpegHeader(300, 40, 30), std::string("\xFF\xD8\xFF")}) {
    Write(front, kGiB);
    const int64_t before = BytesRead();
    ExpectRefused("the header is not found by 256 reads");
    EXPECT_LE(BytesRead() - before, kMostBytes + 8192);
  }
}

TEST_F(ImageSizeTest, RejectsFilesWithoutAHeader) {
  for (const std::string& whole : {JpegHeader(2, 40, 30), PngHeader(), WebpHeader()}) {
    for (const size_t size : {whole.size() - 6, size_t{20}}) {
      Write(whole.substr(0, size));
      ExpectRefused("cut short");
    }
  }
  Write("GIF89a");
  ExpectRefused("not a JPEG, PNG, WebP or HEIC image");
  Write("");
  ExpectRefused("not a JPEG, PNG, WebP or HEIC image");
  Write(JpegHeader(0, 0, 30));
  ExpectRefused("empty");
  Write(JpegHeader(0, 0xFFFF, 0xFFFF));
  ExpectRefused("the limit is");
  Write("\xFF\xD8\xFF\xD9");
  ExpectRefused("no frame header");
}

TEST_F(ImageSizeTest, ReportsAMissingFile) {
  EXPECT_TRUE(absl::IsNotFound(ReadImageSize(path, "a.jpg").status()));
  EXPECT_FALSE(ReadImageSize(folder.path(), "a.jpg").ok()) << "a folder";
}

}  // namespace
}  // namespace pepeseg
