#include "core/dataset/video_frames.h"

#include <algorithm>
#include <array>
#include <fstream>
#include <map>
#include <utility>

#include "core/formats/images.h"
#include "core/formats/movie_size.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"
#include "tests/testing/test_video.h"

namespace pepeseg {
namespace {

constexpr auto kInvalid = absl::StatusCode::kInvalidArgument;

// Returns stripes about 20 pixels wide, shifted by `shift` pixels and blurred over `smear` pixels.
Image Stripes(int shift, int smear) {
  Image image{160, 112, 3, {}};
  for (int i = 0; i < image.width * image.height; ++i) {
    int sum = 0;
    for (int j = 0; j <= smear; ++j) {
      sum += ((i % image.width + shift + j) / 10 + i / image.width / 12) % 2;
    }
    image.pixels.insert(image.pixels.end(), 3, static_cast<uint8_t>(40 + 170 * sum / (smear + 1)));
  }
  return image;
}

class VideoFramesTest : public ::testing::Test {
 protected:
  VideoFramesTest() { task_ = {folder_ / "blob", "videos/walk.avi", folder_.path(), "v0", 5}; }

  void Write(const std::vector<Image>& frames) const {
    testing::WriteVideo(folder_ / "blob.avi", frames);
    std::filesystem::rename(folder_ / "blob.avi", task_.path);
  }
  void Write(const std::string& bytes) const {
    std::ofstream(task_.path, std::ios::binary) << bytes;
  }
  absl::StatusOr<std::vector<VideoFrame>> Extract() const {
    return ExtractFrames(task_, [](int64_t done, int64_t num_frames) {
      EXPECT_LE(done, num_frames);
      return absl::OkStatus();
    });
  }

  testing::TempFolder folder_;
  VideoTask task_;
};

TEST_F(VideoFramesTest, TakesTheSharpestOfEachWindow) {
  std::vector<Image> frames;
  frames.reserve(50);
  for (int i = 0; i < 50; ++i) frames.push_back(Stripes(3 * i, i % 10 == 6 ? 0 : 6));
  Write(frames);
  ASSERT_OK_AND_ASSIGN(const std::vector<VideoFrame> taken, Extract());
  ASSERT_EQ(taken.size(), 5u);
  for (size_t i = 0; i < taken.size(); ++i) {
    EXPECT_EQ(taken[i].index, static_cast<int64_t>(10 * i + 6));
  }
  EXPECT_EQ(taken[1].path.filename(), "v0_000016.jpg");
  ASSERT_OK_AND_ASSIGN(const Image photo, DecodePhoto(taken[1].path, "frame"));
  EXPECT_EQ(photo.width, 160);
  EXPECT_EQ(photo.height, 112);
}

TEST_F(VideoFramesTest, TakesAllFramesOfAShortVideo) {
  task_.max_frames = 120;
  Write({Stripes(0, 0), Stripes(4, 0), Stripes(8, 0), Stripes(12, 0)});
  ASSERT_OK_AND_ASSIGN(const std::vector<VideoFrame> taken, Extract());
  EXPECT_EQ(taken.size(), 4u);
}

TEST_F(VideoFramesTest, RejectsAVideoWithoutMotion) {
  Write(std::vector<Image>(40, Stripes(0, 0)));
  EXPECT_STATUS(Extract(), absl::StatusCode::kFailedPrecondition,
                "videos/walk.avi: the camera hardly moves: of 40 frames 1 differs");
}

TEST_F(VideoFramesTest, RejectsFilesThatDoNotBeginLikeAVideo) {
  for (const char* bytes : {"", "#EXTM3U\nhttp://127.0.0.1/x.ts\n", "ffconcat version 1.0\n",
                            "GIF89a no video at all", "RIFF1234WEBPVP8 "}) {
    Write(bytes);
    EXPECT_STATUS(Extract(), kInvalid, "is not an MP4, MOV, WebM, MKV or AVI");
  }
  task_.path = "http://127.0.0.1/walk.mp4";
  EXPECT_STATUS(Extract(), kInvalid, "is not a regular file");
}

TEST_F(VideoFramesTest, RejectsFilesThatOnlyBeginLikeAVideo) {
  constexpr char kBytes[] =
      "\0\0\0\x18"
      "ftypmp42 and then nothing of the kind";
  Write(std::string(kBytes, sizeof(kBytes)));
  EXPECT_STATUS(Extract(), kInvalid, "videos/walk.avi: ");
}

TEST_F(VideoFramesTest, StopsWhenProgressReturnsAnError) {
  Write(std::vector<Image>(20, Stripes(0, 0)));
  const auto taken =
      ExtractFrames(task_, [](int64_t, int64_t) { return absl::CancelledError("enough"); });
  EXPECT_STATUS(taken, absl::StatusCode::kCancelled, "enough");
}

// Returns stripes with a square of 40 pixels of one colour at the top left.
std::vector<Image> WithSquare(const std::array<uint8_t, 3>& colour) {
  std::vector<Image> frames;
  for (int i = 0; i < 6; ++i) {
    Image frame = Stripes(5 * i, 0);
    for (int y = 0; y < 40; ++y) {
      for (int x = 0; x < 40; ++x) {
        std::copy(colour.begin(), colour.end(), &frame.pixels[3 * (y * frame.width + x)]);
      }
    }
    frames.push_back(std::move(frame));
  }
  return frames;
}

struct ShownCase {
  testing::Mp4Header header;
  int width, height;  // as shown
  int x, y;           // of the square's centre
};

// The matrices are those that phones write for 90, 180 and 270 degrees, and mirrored. OpenCV 4.6
// turns frames the other way.
TEST_F(VideoFramesTest, ShowsFramesByTheDisplayMatrix) {
  const ShownCase cases[] = {{{1, 0, 0, 1}, 160, 112, 20, 20},
                             {{0, 1, -1, 0}, 112, 160, 91, 20},
                             {{-1, 0, 0, -1}, 160, 112, 139, 91},
                             {{0, -1, 1, 0}, 112, 160, 20, 139},
                             {{-1, 0, 0, 1}, 160, 112, 139, 20}};
  for (const ShownCase& c : cases) {
    testing::WriteMp4(folder_ / "blob.mp4", WithSquare({200, 50, 50}), c.header);
    std::filesystem::rename(folder_ / "blob.mp4", task_.path);
    ASSERT_OK_AND_ASSIGN(const std::vector<VideoFrame> taken, Extract());
    ASSERT_OK_AND_ASSIGN(const Image shown, DecodePhoto(taken[0].path, "frame"));
    ASSERT_EQ(shown.width, c.width) << c.header.a << c.header.b;
    ASSERT_EQ(shown.height, c.height);
    const uint8_t* pixel = &shown.pixels[3 * (c.y * shown.width + c.x)];
    EXPECT_NEAR(pixel[0], 200, 6) << c.header.a << c.header.b;
    EXPECT_NEAR(pixel[1], 50, 6);
  }
}

// A square of (200, 50, 50) in BT.709 reads as (186, 31, 49) in BT.601.
TEST_F(VideoFramesTest, DecodesColoursByTheMatrixOfTheHeader) {
  for (const auto& [coefficients, colour] :
       std::map<int, std::array<int, 3>>{{1, {200, 50, 50}}, {6, {186, 31, 49}}}) {
    testing::WriteMp4(folder_ / "blob.mp4", WithSquare({186, 31, 49}), {1, 0, 0, 1, coefficients});
    std::filesystem::rename(folder_ / "blob.mp4", task_.path);
    ASSERT_OK_AND_ASSIGN(const std::vector<VideoFrame> taken, Extract());
    ASSERT_OK_AND_ASSIGN(const Image shown, DecodePhoto(taken[0].path, "frame"));
    const uint8_t* pixel = &shown.pixels[3 * (20 * shown.width + 20)];
    for (size_t i = 0; i < 3; ++i) EXPECT_NEAR(pixel[i], colour[i], 6) << coefficients;
  }
}

TEST_F(VideoFramesTest, HaveTheirNumberAndSizeInTheHeader) {
  const std::vector<Image> frames(37, Stripes(0, 0));
  testing::WriteMp4(folder_ / "blob.mp4", frames, {});
  const MovieSize size = ReadMovieSize(folder_ / "blob.mp4");
  EXPECT_EQ(size.num_frames, 37);
  EXPECT_EQ(size.width, 160);
  EXPECT_EQ(size.height, 112);
  Write(frames);  // AVI
  const MovieSize avi = ReadMovieSize(task_.path);
  EXPECT_EQ(avi.num_frames, 37);
  EXPECT_EQ(avi.width, 160);
  EXPECT_EQ(avi.height, 112);
  EXPECT_EQ(ReadMovieSize(folder_ / "none").num_frames, 0);
}

TEST(ExpectedFrames, AreLimitedByTheVideosLength) {
  EXPECT_EQ(ExpectedFrames(90, 120), 90);
  EXPECT_EQ(ExpectedFrames(900, 120), 120);
  EXPECT_EQ(ExpectedFrames(0, 120), 120);
}

}  // namespace
}  // namespace pepeseg
