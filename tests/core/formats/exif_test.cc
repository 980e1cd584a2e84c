#include "core/formats/exif.h"

#include <gtest/gtest.h>

#include <vector>

namespace pepeseg {
namespace {

// Builds a TIFF structure by appending to it.
class TiffBytes {
 public:
  explicit TiffBytes(bool big_endian) : big_endian_(big_endian) {
    Text(big_endian ? "MM" : "II");
    Add(42, 2);
    Add(8, 4);
  }
  void Add(uint32_t value, int num_bytes) {
    for (int i = 0; i < num_bytes; ++i) {
      const int shift = 8 * (big_endian_ ? num_bytes - 1 - i : i);
      bytes_.push_back(static_cast<uint8_t>(value >> shift));
    }
  }
  void Entry(uint32_t tag, uint32_t type, uint32_t count, uint32_t value) {
    Add(tag, 2);
    Add(type, 2);
    Add(count, 4);
    const bool is_short = type == 3;
    Add(value, is_short ? 2 : 4);
    if (is_short) Add(0, 2);
  }
  void Text(const std::string& text) { bytes_.insert(bytes_.end(), text.begin(), text.end()); }
  uint32_t size() const { return static_cast<uint32_t>(bytes_.size()); }

  const std::vector<uint8_t>& bytes() const { return bytes_; }

  std::vector<uint8_t> Jpeg() const {
    std::vector<uint8_t> jpeg = {0xff, 0xd8, 0xff, 0xe0, 0, 4, 0, 0, 0xff, 0xe1};
    const size_t length = bytes_.size() + 8;
    jpeg.push_back(static_cast<uint8_t>(length >> 8));
    jpeg.push_back(static_cast<uint8_t>(length));
    jpeg.insert(jpeg.end(), {'E', 'x', 'i', 'f', 0, 0});
    jpeg.insert(jpeg.end(), bytes_.begin(), bytes_.end());
    return jpeg;
  }

 private:
  bool big_endian_;
  std::vector<uint8_t> bytes_;
};

std::vector<uint8_t> Photo(bool big_endian) {
  TiffBytes tiff(big_endian);
  constexpr uint32_t kMain = 8, kExif = kMain + 2 + 2 * 12 + 4, kAfter = kExif + 2 + 2 * 12 + 4;
  tiff.Add(2, 2);
  tiff.Entry(0x0110, 2, 7, kAfter);
  tiff.Entry(0x8769, 4, 1, kExif);
  tiff.Add(0, 4);
  tiff.Add(2, 2);
  tiff.Entry(0x920a, 5, 1, kAfter + 8);
  tiff.Entry(0xa405, 3, 1, 26);
  tiff.Add(0, 4);
  EXPECT_EQ(tiff.size(), kAfter);
  tiff.Text(std::string("PHONE7\0\0", 8));
  tiff.Add(425, 4);
  tiff.Add(100, 4);
  return tiff.Jpeg();
}

TEST(ReadExifCamera, ReadsBothByteOrders) {
  for (const bool big_endian : {false, true}) {
    const ExifCamera camera = ReadExifCamera(Photo(big_endian));
    EXPECT_EQ(camera.model, "PHONE7");
    EXPECT_EQ(camera.focal_length, 4.25);
    EXPECT_EQ(camera.focal_length_35_mm, 26);
  }
}

// Returns a JPEG file whose EXIF data has only an orientation.
std::vector<uint8_t> TurnedPhoto(bool big_endian, uint32_t orientation) {
  TiffBytes tiff(big_endian);
  tiff.Add(1, 2);
  tiff.Entry(0x0112, 3, 1, orientation);
  tiff.Add(0, 4);
  return tiff.Jpeg();
}

TEST(ReadExifOrientation, ReadsBothByteOrders) {
  for (const bool big_endian : {false, true}) {
    EXPECT_EQ(ReadExifOrientation(TurnedPhoto(big_endian, 6)), 6);
    EXPECT_EQ(ReadExifOrientation(TurnedPhoto(big_endian, 1)), 1);
  }
}

TEST(ReadExifOrientation, DefaultsToUpright) {
  EXPECT_EQ(ReadExifOrientation({}), 1);
  EXPECT_EQ(ReadExifOrientation(Photo(false)), 1);
  EXPECT_EQ(ReadExifOrientation(TurnedPhoto(true, 0)), 1);
  EXPECT_EQ(ReadExifOrientation(TurnedPhoto(true, 9)), 1);
}

// Fails under the address sanitizer if a read leaves the buffer.
TEST(ReadExifCamera, NeverReadsBeyondTheBytes) {
  const std::vector<uint8_t> photo = Photo(false);
  for (size_t size = 0; size < photo.size(); ++size) {
    const std::vector<uint8_t> cut(photo.begin(), photo.begin() + static_cast<ptrdiff_t>(size));
    EXPECT_EQ(ReadExifCamera(cut), ExifCamera()) << size;
  }
  for (size_t i = 0; i < photo.size(); ++i) {
    std::vector<uint8_t> changed = photo;
    changed[i] ^= 0xff;
    ReadExifCamera(changed);
    ReadExifOrientation(changed);
  }
}

// Appends a chunk of a PNG (big-endian length, type) or a WebP (type, little-endian length).
void AppendChunk(const std::string& type, const std::vector<uint8_t>& body, bool png,
                 std::vector<uint8_t>& file) {
  if (!png) file.insert(file.end(), type.begin(), type.end());
  for (int i = 0; i < 4; ++i) {
    file.push_back(static_cast<uint8_t>(body.size() >> (8 * (png ? 3 - i : i))));
  }
  if (png) file.insert(file.end(), type.begin(), type.end());
  file.insert(file.end(), body.begin(), body.end());
  if (png) file.insert(file.end(), 4, 0);  // checksum
  if (!png && body.size() % 2 == 1) file.push_back(0);
}

// Returns the head of a PNG or a WebP with one odd-sized chunk and then `tiff`.
std::vector<uint8_t> WithExif(bool png, const std::vector<uint8_t>& tiff) {
  const std::string start = png ? "\x89PNG\r\n\x1a\n" : "RIFF....WEBP";
  std::vector<uint8_t> file(start.begin(), start.end());
  AppendChunk(png ? "IHDR" : "VP8X", std::vector<uint8_t>(13), png, file);
  AppendChunk(png ? "eXIf" : "EXIF", tiff, png, file);
  return file;
}

TEST(ReadExifOrientation, ReadsPngAndWebp) {
  for (const bool png : {true, false}) {
    for (uint32_t orientation = 1; orientation <= 8; ++orientation) {
      TiffBytes tiff(png);
      tiff.Add(1, 2);
      tiff.Entry(0x0112, 3, 1, orientation);
      tiff.Add(0, 4);
      const std::vector<uint8_t> file = WithExif(png, tiff.bytes());
      EXPECT_EQ(ReadExifOrientation(file), static_cast<int>(orientation)) << png;
      for (size_t length = 0; length < file.size(); ++length) {
        ReadExifOrientation(std::span(file).first(length));  // reads nothing beyond the end
      }
    }
  }
}

}  // namespace
}  // namespace pepeseg
