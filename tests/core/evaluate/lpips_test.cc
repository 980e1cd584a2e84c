#include "core/evaluate/lpips.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>

#include "tests/testing/fake_sam.h"
#include "tests/testing/small_dataset.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using Features = std::array<double, 2>;

// Computes what the network of tests/data/lpips/tiny.txtpb computes for one image in [0, 1].
struct TinyFeatures {
  int width, height;
  std::vector<Features> fine, coarse;

  TinyFeatures(int width, int height, std::span<const float> pixels)
      : width(width), height(height) {
    const auto relu = [](double value) { return std::max(0.0, value); };
    for (size_t i = 0; i < pixels.size(); i += 3) {
      const double r = 2 * (2.0 * pixels[i] - 1) + 0.0625;
      const double g = 2.25 * (2.0 * pixels[i + 1] - 1) + 0.1875;
      const double b = 2.5 * (2.0 * pixels[i + 2] - 1) + 0.375;
      fine.push_back({relu(0.5 * r - 0.25 * g + 0.125 * b + 0.25),
                      relu(-0.375 * r + 0.5 * g + 0.25 * b + 0.125)});
    }
    for (int y = 0; y + 1 < height; y += 2) {
      for (int x = 0; x + 1 < width; x += 2) {
        Features most = {};
        for (const int i : {0, 1, width, width + 1}) {
          for (int k = 0; k < 2; ++k) most[k] = std::max(most[k], fine[y * width + x + i][k]);
        }
        coarse.push_back({relu(0.75 * most[0] - 0.5 * most[1] + 0.0625),
                          relu(0.25 * most[0] + 0.5 * most[1] + 0.125)});
      }
    }
  }
};

double MeanError(const std::vector<Features>& a, const std::vector<Features>& b, Features weights) {
  double sum = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    const double norm_a = std::hypot(a[i][0], a[i][1]) + 1e-10;
    const double norm_b = std::hypot(b[i][0], b[i][1]) + 1e-10;
    for (int k = 0; k < 2; ++k) {
      sum += weights[k] * std::pow(a[i][k] / norm_a - b[i][k] / norm_b, 2);
    }
  }
  return sum / static_cast<double>(a.size());
}

std::vector<float> Rendering(const Image& photo) {
  std::vector<float> pixels;
  for (size_t i = 0; i < photo.pixels.size(); ++i) {
    const auto shade = static_cast<float>(i % 7) / 7;
    pixels.push_back(0.7f * static_cast<float>(photo.pixels[i]) / 255 + 0.3f * shade);
  }
  return pixels;
}

double Reference(const Image& photo, std::span<const float> rendering) {
  std::vector<float> pixels;
  for (const uint8_t value : photo.pixels) pixels.push_back(static_cast<float>(value) / 255);
  const TinyFeatures a(photo.width, photo.height, pixels);
  const TinyFeatures b(photo.width, photo.height, rendering);
  return MeanError(a.fine, b.fine, {0.5, 0.25}) + MeanError(a.coarse, b.coarse, {0.125, 1});
}

// The network of tests/data/lpips in the real library, which is in the folder PEPESEG_SAM.
TEST(RealLpips, MatchesTheNetworkAtEverySize) {
  const char* sam = std::getenv("PEPESEG_SAM");
  if (sam == nullptr) GTEST_SKIP() << "PEPESEG_SAM names no folder";
  const testing::TempFolder folder;
  ASSERT_OK_AND_ASSIGN(const Lpips lpips, Lpips::Open(testing::MakeLpips(folder.path(), sam), 2));
  for (const auto& [width, height] :
       {std::pair{64, 64}, {48, 32}, {640, 480}, {31, 75}, {64, 64}}) {
    const Image photo = testing::Picture(width, height);
    const std::vector<float> rendering = Rendering(photo);
    const double expected = Reference(photo, rendering);
    EXPECT_GT(expected, 0.005);
    ASSERT_OK_AND_ASSIGN(const double distance, lpips.Distance(photo, rendering));
    EXPECT_NEAR(distance, expected, 1e-5 * expected) << width << "x" << height;
  }
}

TEST(RealLpips, RefusesFilesThatAreNotSuchANetwork) {
  const char* sam = std::getenv("PEPESEG_SAM");
  if (sam == nullptr) GTEST_SKIP() << "PEPESEG_SAM names no folder";
  using absl::StatusCode::kInvalidArgument;
  const testing::TempFolder folder;
  const std::filesystem::path weights = testing::MakeLpips(folder.path(), sam);
  const auto open = [&](const std::string& bytes) {
    testing::WriteBytes(weights, bytes);
    return Lpips::Open(weights, 1).status();
  };
  std::string bytes = testing::ReadBytes(weights);
  EXPECT_STATUS(open("no network"), kInvalidArgument, "lpips.onnx: ");
  EXPECT_STATUS(open(bytes.substr(0, bytes.size() / 2)), kInvalidArgument, "lpips.onnx: ");
  // The input names of an export that does not name them.
  for (size_t at = 0; (at = bytes.find("photo", at)) != std::string::npos; ++at) {
    bytes.replace(at, 5, "input");
  }
  EXPECT_STATUS(open(bytes), kInvalidArgument, "photo");
}

// These run with a library in place of ONNX Runtime, whose distance is the mean difference.
class LpipsTest : public ::testing::Test {
 protected:
  const testing::TempFolder folder_;
  const std::filesystem::path weights_ = testing::MakeLpips(folder_.path());
};

TEST_F(LpipsTest, ComparesImagesBetweenMinusOneAndOne) {
  ASSERT_OK_AND_ASSIGN(const Lpips lpips, Lpips::Open(weights_, 1));
  const Image photo = testing::Picture(40, 30);
  std::vector<float> rendering;
  for (const uint8_t value : photo.pixels) rendering.push_back(static_cast<float>(value) / 255);
  ASSERT_OK_AND_ASSIGN(const double equal, lpips.Distance(photo, rendering));
  EXPECT_NEAR(equal, 0, 1e-6);
  for (float& value : rendering) value += 0.25f;
  ASSERT_OK_AND_ASSIGN(const double different, lpips.Distance(photo, rendering));
  EXPECT_NEAR(different, 0.5, 1e-4);
}

TEST_F(LpipsTest, NamesWhatIsMissing) {
  EXPECT_EQ(Lpips::Open(folder_ / "none.onnx", 1).status().code(), absl::StatusCode::kNotFound);
  testing::WriteBytes(weights_, "no network");
  EXPECT_STATUS(Lpips::Open(weights_, 1), absl::StatusCode::kInvalidArgument, "lpips.onnx: ");
  const testing::TempFolder without_library;
  testing::WriteBytes(without_library / "lpips.onnx", "no network");
  EXPECT_STATUS(Lpips::Open(without_library / "lpips.onnx", 1),
                absl::StatusCode::kFailedPrecondition, "deploy/sam.sh");
}

}  // namespace
}  // namespace pepeseg
