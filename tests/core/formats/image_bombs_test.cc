// Small files whose headers declare thousands of megapixels. The import must refuse them by their
// headers, before it allocates memory for their pixels.
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <zlib.h>

#include <cstdint>
#include <ctime>
#include <string>

#include "core/dataset/import.h"
#include "core/formats/image_header.h"
#include "tests/testing/png_bytes.h"
#include "tests/testing/small_dataset.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using testing::SmallDataset;
using testing::WriteBytes;

// Returns a zlib stream of zeros, made by repeating one deflated mebibyte.
std::string DeflatedZeros(uint64_t count) {
  constexpr size_t kChunk = 1 << 20;
  const auto deflated = [](size_t size, int flush) {
    z_stream stream{};
    deflateInit2(&stream, 9, Z_DEFLATED, /*windowBits=*/-15, 8, Z_DEFAULT_STRATEGY);
    std::string zeros(size, '\0'), packed(size / 500 + 100, '\0');
    stream.next_in = reinterpret_cast<Bytef*>(zeros.data());
    stream.avail_in = static_cast<uInt>(size);
    stream.next_out = reinterpret_cast<Bytef*>(packed.data());
    stream.avail_out = static_cast<uInt>(packed.size());
    deflate(&stream, flush);
    packed.resize(stream.total_out);
    deflateEnd(&stream);
    return packed;
  };
  const std::string chunk = deflated(kChunk, Z_FULL_FLUSH);
  std::string bytes = "\x78\xda";
  for (uint64_t i = 0; i < count / kChunk; ++i) bytes += chunk;
  bytes += deflated(count % kChunk, Z_FINISH);
  constexpr uint64_t kAdlerBase = 65521;
  testing::AppendBigEndian(static_cast<uint32_t>((count % kAdlerBase) << 16 | 1), &bytes);
  return bytes;
}

// Returns a black PNG with one bit a pixel, valid to its last byte.
std::string PngBomb(uint32_t side) {
  std::string header;
  testing::AppendBigEndian(side, &header);
  testing::AppendBigEndian(side, &header);
  header += std::string("\1\0\0\0\0", 5);
  std::string png = "\x89PNG\r\n\x1a\n";
  testing::AppendPngChunk("IHDR", header, &png);
  testing::AppendPngChunk("IDAT", DeflatedZeros(uint64_t{side} * ((side + 7) / 8 + 1)), &png);
  testing::AppendPngChunk("IEND", "", &png);
  return png;
}

// Returns the JPEG of a small photograph, with another size in its frame header.
std::string JpegBomb() {
  std::string jpeg = testing::Jpeg(testing::Picture(40, 30));
  jpeg.replace(jpeg.find("\xff\xc0") + 5, 4, "\xff\xff\xff\xff");
  return jpeg;
}

// Returns the JPEG of a small photograph, whose only scan is there `num_scans` times.
std::string JpegOfScans(int num_scans) {
  const std::string jpeg = testing::Jpeg(testing::Picture(40, 30));
  const size_t scan = jpeg.find("\xff\xda");
  const size_t end = jpeg.size() - 2;  // the end marker
  std::string bytes = jpeg.substr(0, scan);
  for (int i = 0; i < num_scans; ++i) bytes += jpeg.substr(scan, end - scan);
  return bytes + jpeg.substr(end);
}

// Returns a lossless WebP of 16384x16384 pixels, the largest size of the format.
std::string WebpBomb() {
  const std::string body = "\x2f\xff\xff\xff\x0f" + std::string(15, '\0');
  return std::string("RIFF\x20\0\0\0WEBPVP8L\x14\0\0\0", 20) + body;
}

class ImageBomb : public ::testing::Test {
 protected:
  ImageBomb() { dataset_.Write(); }

  // Imports a dataset in which `bytes` replace a photograph. Measures processor time, because other
  // processes may delay this one.
  void ExpectRefused(const std::string& photo, const std::string& bytes, const std::string& words) {
    WriteBytes(dataset_.folder / ("images/" + photo), bytes);
    const rlim_t before = PeakBytes();
    const std::clock_t start = std::clock();
    EXPECT_STATUS(dataset_.Import(), absl::StatusCode::kInvalidArgument, words);
    const double seconds = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
    RecordProperty("milliseconds", static_cast<int>(1000 * seconds));
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
    EXPECT_LT(seconds, 0.1);  // a busy machine included; to decode one takes seconds
#endif
    EXPECT_LT(PeakBytes() - before, rlim_t{16} << 20);
  }

 private:
  static rlim_t PeakBytes() {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    return static_cast<rlim_t>(usage.ru_maxrss) << 10;
  }

  SmallDataset dataset_;
};

TEST_F(ImageBomb, IsRejectedAsPng) {
  const std::string small = PngBomb(32'000);
  EXPECT_LT(small.size(), 130'000u);
  ExpectRefused("a.jpg", small, "images/a.jpg: 32000x32000 pixels, the limit is 64000000");
  const std::string large = PngBomb(65'536);
  EXPECT_LT(large.size(), 600'000u);
  ExpectRefused("sub/c.png", large, "images/");
}

TEST_F(ImageBomb, IsAValidPngAtASmallSize) {
  SmallDataset dataset;
  dataset.Write();
  WriteBytes(dataset.folder / "images/a.jpg", PngBomb(3000));  // over a mebibyte
  EXPECT_STATUS(dataset.Import(), absl::StatusCode::kInvalidArgument, "3000x3000");
}

TEST(ReadImageHeader, LimitsTheScansOfAJpeg) {
  const auto read = [](int num_scans) {
    const std::string bytes = JpegOfScans(num_scans);
    const auto* data = reinterpret_cast<const uint8_t*>(bytes.data());
    return ReadImageHeader("a.jpg", {data, bytes.size()}).status();
  };
  EXPECT_OK(read(1));
  EXPECT_OK(read(100));
  EXPECT_EQ(read(101).code(), absl::StatusCode::kInvalidArgument);
  EXPECT_NE(read(101).message().find("it has over 100 scans"), absl::string_view::npos);
}

TEST_F(ImageBomb, IsRejectedAsJpeg) {
  ExpectRefused("a.jpg", JpegBomb(), "images/a.jpg: 65535x65535 pixels");
}

TEST_F(ImageBomb, IsRejectedAsWebp) {
  ExpectRefused("a.jpg", WebpBomb(), "images/a.jpg: 16384x16384 pixels");
}

TEST_F(ImageBomb, IsRejectedAsGifUnderAnotherName) {
  const std::string gif = "GIF89a\xff\xff\xff\xff" + std::string(64, '\0');
  ExpectRefused("a.jpg", gif, "images/a.jpg: not a JPEG, PNG, WebP or HEIC");
}

}  // namespace
}  // namespace pepeseg
