// Small files whose headers declare large videos, or that decode to large ones.
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <cstring>
#include <fstream>
#include <iterator>
#include <string>

#include "core/dataset/video_frames.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"
#include "tests/testing/test_video.h"

namespace pepeseg {
namespace {

constexpr auto kRefused = absl::StatusCode::kInvalidArgument;
constexpr int64_t kMebibyte = 1 << 20;

int64_t PeakBytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return int64_t{usage.ru_maxrss} << 10;
}

class VideoBomb : public ::testing::Test {
 protected:
  VideoBomb() { task_ = {folder_ / "walk.avi", "videos/walk.avi", folder_.path(), "v0", 5}; }

  // Writes a Motion JPEG video of `count` equal frames and returns its bytes.
  std::string Write(const Image& frame, size_t count) {
    testing::WriteVideo(task_.path, std::vector<Image>(count, frame));
    std::ifstream file(task_.path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  void Write(const std::string& bytes) const {
    std::ofstream(task_.path, std::ios::binary) << bytes;
  }
  absl::Status Extract() const {
    return ExtractFrames(task_, [](int64_t, int64_t) { return absl::OkStatus(); }).status();
  }

  testing::TempFolder folder_;
  VideoTask task_;
};

Image Grey(int width, int height) {
  return {width, height, 3, std::vector<uint8_t>(size_t{3} * width * height, 128)};
}

void Put(std::string& bytes, size_t at, uint32_t value) {
  ASSERT_LE(at + sizeof(value), bytes.size());
  std::memcpy(bytes.data() + at, &value, sizeof(value));
}

// Sets the number of frames in the headers of the file and of its stream.
void DeclareFrames(std::string& avi, uint32_t count) {
  Put(avi, avi.find("avih") + 8 + 16, count);
  Put(avi, avi.find("strh") + 8 + 32, count);
}

void DeclareSize(std::string& avi, uint32_t width, uint32_t height) {
  Put(avi, avi.find("avih") + 8 + 32, width);
  Put(avi, avi.find("avih") + 8 + 36, height);
  Put(avi, avi.find("strf") + 8 + 4, width);
  Put(avi, avi.find("strf") + 8 + 8, height);
}

TEST_F(VideoBomb, IsRejectedUnreadIfItDeclaresTwoBillionFrames) {
  std::string avi = Write(Grey(64, 48), 8);
  DeclareFrames(avi, 0x7fffffff);
  Write(avi);
  EXPECT_STATUS(Extract(), kRefused, "videos/walk.avi: over 108000 frames");
}

TEST_F(VideoBomb, IsRejectedIfItDeclaresGigapixels) {
  std::string avi = Write(Grey(64, 48), 8);
  DeclareSize(avi, 40'000, 30'000);
  // The size in the frames counts, too.
  for (size_t at = avi.find("\xff\xc0"); at != std::string::npos;
       at = avi.find("\xff\xc0", at + 1)) {
    avi.replace(at + 5, 4, "\x75\x30\x9c\x40");
  }
  Write(avi);
  const int64_t before = PeakBytes();
  EXPECT_STATUS(Extract(), kRefused, "videos/walk.avi: ");
  EXPECT_LT(PeakBytes() - before, 256 * kMebibyte);
}

TEST_F(VideoBomb, IsRejectedIfFramesExceedTheDeclaredSize) {
  std::string avi = Write(Grey(64, 48), 8);
  for (size_t at = avi.find("\xff\xc0"); at != std::string::npos;
       at = avi.find("\xff\xc0", at + 1)) {
    avi.replace(at + 5, 4, "\x24\x00\x24\x00", 4);  // 9216x9216
  }
  Write(avi);
  EXPECT_STATUS(Extract(), kRefused, "videos/walk.avi: ");
}

// A gibibyte of pixels must be read frame by frame without keeping the frames.
TEST_F(VideoBomb, TakesTheMemoryOfAFewFrames) {
  constexpr int kWidth = 1920, kHeight = 1080, kFrames = 175;
  static_assert(int64_t{3} * kWidth * kHeight * kFrames > 1024 * kMebibyte);
  const std::string avi = Write(Grey(kWidth, kHeight), 1);
  // Repeats one frame without an index: decoders read on to the end of the file.
  const size_t list = avi.find("movi"), frame = list + 4;
  uint32_t size = 0;
  std::memcpy(&size, avi.data() + frame + 4, sizeof(size));
  const std::string chunk = avi.substr(frame, 8 + size + size % 2);
  std::string many = avi.substr(0, frame);
  for (int i = 0; i < kFrames; ++i) many += chunk;
  Put(many, list - 4, static_cast<uint32_t>(many.size() - list));
  Put(many, 4, static_cast<uint32_t>(many.size() - 8));
  DeclareFrames(many, kFrames);
  EXPECT_LT(static_cast<int64_t>(many.size()), 16 * kMebibyte);
  Write(many);
  const int64_t before = PeakBytes();
  EXPECT_STATUS(Extract(), absl::StatusCode::kFailedPrecondition, "hardly moves: of 175 frames");
  EXPECT_LT(PeakBytes() - before, 200 * kMebibyte);
}

}  // namespace
}  // namespace pepeseg
