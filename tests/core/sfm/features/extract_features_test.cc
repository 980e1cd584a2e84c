#include "core/sfm/features/extract_features.h"

#include <algorithm>
#include <cmath>
#include <fstream>

#include "core/formats/images.h"
#include "tests/kernels/backend_test.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"
#include "tests/testing/textured_place.h"

// From photograph files to features in pixels of the stored photographs.

namespace pepeseg {
namespace {

// Where blobs are in their squares, in sides. Not in the middle, where four pixels would be equal.
constexpr double kBlobX = 0.507, kBlobY = 0.494;

// A grey photograph with Gaussian blobs on a grid of squares of `side` pixels.
Image Blobs(int columns, int rows, int side) {
  Image image{columns * side, rows * side, 1, {}};
  const double sigma = side / 8.0;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const double dx = x % side + 0.5 - kBlobX * side, dy = y % side + 0.5 - kBlobY * side;
      const double blob = std::exp(-(dx * dx + dy * dy) / (2 * sigma * sigma));
      image.pixels.push_back(static_cast<uint8_t>(std::lround(60 + 180 * blob)));
    }
  }
  return image;
}

class ExtractFeaturesTest : public ::testing::Test {
 protected:
  void Add(const Image& image) {
    const std::filesystem::path path = folder_ / std::to_string(photographs_.size());
    std::ofstream(path, std::ios::binary) << EncodePng(image).value_or("");
    photographs_.push_back({"images/" + path.filename().string() + ".png", path, nullptr});
  }
  absl::StatusOr<std::vector<SfmFeatures>> Extract(const SfmFeatureOptions& options = {}) {
    num_done_.clear();
    std::vector<SfmFeatures> all;
    const auto take = [&](size_t index, const SfmFeatures& features) {
      EXPECT_EQ(index, all.size());
      all.push_back(features);
      const auto done = static_cast<int64_t>(all.size());
      num_done_.push_back(done);
      return done == cancel_at_ ? absl::CancelledError("enough") : absl::OkStatus();
    };
    const absl::Status status = ExtractFeatures(*backend_, photographs_, options, take);
    if (!status.ok()) return status;
    return all;
  }

  testing::TempFolder folder_;
  std::unique_ptr<Backend> backend_ = MakeCpuBackend(2);
  std::vector<FeaturePhotograph> photographs_;
  std::vector<int64_t> num_done_;
  int64_t cancel_at_ = -1;
};

// Counts the features at the blobs, of their scale: the difference of blurs is extreme at 0.89
// sigma.
int CountBlobs(const SfmFeatures& features, double side) {
  int count = 0;
  for (const Keypoint& k : features.keypoints) {
    const double dx = std::remainder(k.x - kBlobX * side, side);
    const double dy = std::remainder(k.y - kBlobY * side, side);
    count += std::hypot(dx, dy) < 0.25 && std::abs(k.scale / (side / 8.0) - 0.89) < 0.05;
  }
  return count;
}

TEST_F(ExtractFeaturesTest, FindsFeaturesOfEachPhotographInOrder) {
  Add(Blobs(6, 4, 32));
  Add(Blobs(3, 3, 40));
  Add(Blobs(5, 2, 24));
  ASSERT_OK_AND_ASSIGN(const std::vector<SfmFeatures> features, Extract());
  ASSERT_EQ(features.size(), 3);
  EXPECT_GE(CountBlobs(features[0], 32), 24);
  EXPECT_GE(CountBlobs(features[1], 40), 9);
  EXPECT_GE(CountBlobs(features[2], 24), 10);
  for (const SfmFeatures& one : features) {
    EXPECT_EQ(one.descriptors.size(), one.size() * SfmFeatures::kDescriptorSize);
  }
  EXPECT_THAT(num_done_, ::testing::ElementsAre(1, 2, 3));
}

TEST_F(ExtractFeaturesTest, GivesPositionsInPixelsOfTheStoredPhotograph) {
  Add(Blobs(10, 6, 64));
  ASSERT_OK_AND_ASSIGN(const std::vector<SfmFeatures> features, Extract({.max_side = 320}));
  EXPECT_GE(CountBlobs(features[0], 64), 60);
}

TEST_F(ExtractFeaturesTest, LeavesIgnoredPixelsOut) {
  Add(Blobs(10, 6, 64));
  // The left half, of the stored photograph.
  photographs_[0].ignored = []() -> absl::StatusOr<std::vector<uint8_t>> {
    std::vector<uint8_t> ignored(640 * 384);
    for (size_t i = 0; i < ignored.size(); ++i) ignored[i] = i % 640 < 320;
    return ignored;
  };
  for (const int max_side : {0, 320}) {
    ASSERT_OK_AND_ASSIGN(const std::vector<SfmFeatures> features, Extract({.max_side = max_side}));
    ASSERT_GE(CountBlobs(features[0], 64), 30);
    for (const Keypoint& k : features[0].keypoints) EXPECT_GE(k.x, 320);
  }
}

TEST_F(ExtractFeaturesTest, DoesNotDependOnTheNumberOfThreads) {
  for (int i = 0; i < 12; ++i) Add(Blobs(4 + i % 3, 4, 24 + 4 * (i % 5)));
  ASSERT_OK_AND_ASSIGN(const std::vector<SfmFeatures> one, Extract({.num_threads = 1}));
  ASSERT_OK_AND_ASSIGN(const std::vector<SfmFeatures> six, Extract({.num_threads = 6}));
  for (size_t i = 0; i < one.size(); ++i) EXPECT_EQ(one[i].descriptors, six[i].descriptors) << i;
}

TEST_F(ExtractFeaturesTest, RefusesIgnoredPixelsOfAnotherSize) {
  Add(Blobs(2, 2, 32));
  photographs_[0].ignored = [] { return std::vector<uint8_t>(7); };
  EXPECT_EQ(Extract().status().code(), absl::StatusCode::kInvalidArgument);
}

TEST_F(ExtractFeaturesTest, NamesThePhotographThatDoesNotDecode) {
  for (int i = 0; i < 4; ++i) Add(Blobs(2, 2, 32));
  std::ofstream(photographs_[2].path, std::ios::binary) << "not a photograph";
  const absl::Status status = Extract().status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(status.message(), ::testing::HasSubstr("images/2.png"));
}

TEST_F(ExtractFeaturesTest, StopsWhereProgressReturnsAnError) {
  for (int i = 0; i < 20; ++i) Add(Blobs(2, 2, 32));
  cancel_at_ = 3;
  EXPECT_EQ(Extract().status().code(), absl::StatusCode::kCancelled);
  EXPECT_EQ(num_done_.back(), 3);
}

// Photographs of a place, more than are decoded at a time.
TEST(ExtractFeatures, FindsOnCudaWhatItFindsOnTheCpu) {
  const auto cuda = MakeCuda();
  if (cuda == nullptr) {
    if (HasFailure()) FAIL();
    GTEST_SKIP() << "this machine has no Cuda";
  }
  const auto cpu = MakeCpuBackend(2);
  const testing::TempFolder folder;
  std::vector<FeaturePhotograph> photographs;
  for (const View& view : testing::PhotographPlace(testing::PlaceArc(8), 1)) {
    const std::string name = std::to_string(photographs.size()) + ".jpg";
    std::ofstream(folder / name, std::ios::binary) << EncodeJpeg(view.photo, 90).value();
    photographs.push_back({name, folder / name, nullptr});
  }
  std::vector<SfmFeatures> found[2];
  for (const bool on_cuda : {false, true}) {
    const auto take = [&](size_t, SfmFeatures features) {
      found[on_cuda].push_back(std::move(features));
      return absl::OkStatus();
    };
    SfmFeatureOptions options;
    options.num_threads = 2;
    ASSERT_OK(ExtractFeatures(on_cuda ? *cuda : *cpu, photographs, options, take));
  }
  ASSERT_EQ(found[1].size(), photographs.size());
  for (size_t i = 0; i < photographs.size(); ++i) {
    int num_same = 0;
    for (const Keypoint& k : found[0][i].keypoints) {
      num_same += std::ranges::any_of(found[1][i].keypoints, [&](const Keypoint& other) {
        return std::hypot(other.x - k.x, other.y - k.y) < 0.1 &&
               std::abs(other.scale / k.scale - 1) < 0.02;
      });
    }
    EXPECT_GT(found[0][i].size(), 500u);
    EXPECT_GT(num_same, 0.99 * static_cast<double>(found[0][i].size())) << i;
  }
}

}  // namespace
}  // namespace pepeseg
