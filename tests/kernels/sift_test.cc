#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <set>
#include <tuple>

#include "tests/kernels/backend_test.h"
#include "tests/kernels/sift_reference.h"

// Features of photographs against known blobs, against a plain reference in double precision, and
// of the backends against each other.

namespace pepeseg {
namespace {

class SiftTest : public BackendTest {};
INSTANTIATE_TEST_SUITE_P(Backends, SiftTest, AllBackends(), BackendName);

constexpr int kAll = 1 << 20;  // more features than a photograph has

struct Features {
  std::vector<SiftKeypoint> keypoints;
  std::vector<uint8_t> descriptors;

  bool operator==(const Features&) const = default;
};

Features Extract(Backend& backend, const GreyImage& image, int max_features,
                 const std::vector<uint8_t>& ignore = {}, SiftScratch* scratch = nullptr) {
  const Buffer<uint8_t> grey(backend, std::span<const uint8_t>(image.pixels));
  const Buffer<uint8_t> ignored(backend, std::span<const uint8_t>(ignore));
  SiftScratch own;
  Buffer<SiftKeypoint> keypoints;
  Buffer<uint8_t> descriptors;
  backend.ExtractSift({.grey = grey.span(),
                       .width = image.width,
                       .height = image.height,
                       .ignore = ignored.span(),
                       .max_features = max_features,
                       .scratch = scratch == nullptr ? &own : scratch,
                       .keypoints = &keypoints,
                       .descriptors = &descriptors});
  Features features;
  features.keypoints.resize(keypoints.size());
  features.descriptors.resize(descriptors.size());
  keypoints.Download(features.keypoints);
  descriptors.Download(features.descriptors);
  return features;
}

// Noise at several scales: means over squares of noise.
GreyImage Textured(int width, int height, uint32_t seed) {
  std::mt19937 engine(seed);
  std::vector<double> sum(static_cast<size_t>(width) * height);
  for (const int side : {1, 3, 7, 15}) {
    const int across = width / side + 2;
    std::vector<double> noise(static_cast<size_t>(across) * (height / side + 2));
    for (double& value : noise) value = engine() % 1000 / 1000.0 - 0.5;
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        // Linear between the values at the corners of the square.
        const double fx = x % side / static_cast<double>(side);
        const double fy = y % side / static_cast<double>(side);
        const double* at = &noise[static_cast<size_t>(y / side) * across + x / side];
        sum[static_cast<size_t>(y) * width + x] +=
            (1 - fy) * ((1 - fx) * at[0] + fx * at[1]) +
            fy * ((1 - fx) * at[across] + fx * at[across + 1]);
      }
    }
  }
  GreyImage image = {width, height, {}};
  for (const double value : sum) {
    image.pixels.push_back(static_cast<uint8_t>(std::clamp(128 + 90 * value, 0.0, 255.0)));
  }
  return image;
}

GreyImage Flat(int width, int height, uint8_t value) {
  return {width, height, std::vector<uint8_t>(static_cast<size_t>(width) * height, value)};
}

// Bright and dark blobs: Gaussians of a standard deviation at a centre, in pixels whose first has
// its centre at (0.5, 0.5).
struct Blob {
  double x, y, sigma, height;
};
GreyImage Blobs(int width, int height, const std::vector<Blob>& blobs) {
  GreyImage image = {width, height, {}};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      double value = 128;
      for (const Blob& blob : blobs) {
        const double dx = x + 0.5 - blob.x, dy = y + 0.5 - blob.y;
        value += blob.height * std::exp(-(dx * dx + dy * dy) / (2 * blob.sigma * blob.sigma));
      }
      image.pixels.push_back(static_cast<uint8_t>(std::lround(std::clamp(value, 0.0, 255.0))));
    }
  }
  return image;
}

double AngleBetween(double a, double b) { return std::abs(std::remainder(a - b, 2 * M_PI)); }

// Returns the index of the feature nearest to one with this place, scale and angle, or -1 if none
// is within 0.3 pixels, a tenth of the scale and 0.1 radians.
template <class Feature>
int Find(const Features& in, const Feature& feature) {
  int found = -1;
  double nearest = 0.3;
  for (size_t i = 0; i < in.keypoints.size(); ++i) {
    const SiftKeypoint& k = in.keypoints[i];
    const double distance = std::hypot(k.x - feature.x, k.y - feature.y);
    if (distance > nearest || std::abs(std::log(k.scale / feature.scale)) > 0.1 ||
        AngleBetween(k.angle, feature.angle) > 0.1) {
      continue;
    }
    nearest = distance;
    found = static_cast<int>(i);
  }
  return found;
}

TEST_P(SiftTest, FindsBlobsAtTheirCentersAndScales) {
  const std::vector<Blob> blobs = {{40.2, 30.7, 2, 90},
                                   {95.45, 41.1, 3.1, -100},
                                   {50, 100.25, 5, 80},
                                   {110.8, 105.5, 1.6, 110},
                                   {150.33, 70.6, 8, -90}};
  const Features features = Extract(*backend_, Blobs(200, 150, blobs), kAll);
  for (const Blob& blob : blobs) {
    SCOPED_TRACE(blob.sigma);
    const auto nearest = std::min_element(features.keypoints.begin(), features.keypoints.end(),
                                          [&](const SiftKeypoint& a, const SiftKeypoint& b) {
                                            return std::hypot(a.x - blob.x, a.y - blob.y) <
                                                   std::hypot(b.x - blob.x, b.y - blob.y);
                                          });
    ASSERT_NE(nearest, features.keypoints.end());
    EXPECT_NEAR(nearest->x, blob.x, 0.05);
    EXPECT_NEAR(nearest->y, blob.y, 0.05);
    // The difference of blurs k apart is extreme at sigma / sqrt(k).
    EXPECT_NEAR(nearest->scale / (blob.sigma / std::exp2(1 / 6.0)), 1, 0.05);
  }
}

TEST_P(SiftTest, AgreesWithPlainLoopsInDouble) {
  const GreyImage image = Textured(131, 104, 7);
  const std::vector<ReferenceFeature> want = ReferenceSift(image);
  const Features got = Extract(*backend_, image, kAll);
  ASSERT_GT(want.size(), 100);
  EXPECT_NEAR(got.keypoints.size(), want.size(), 0.01 * want.size());
  int num_found = 0, num_far = 0;
  for (const ReferenceFeature& feature : want) {
    const int found = Find(got, feature);
    if (found < 0) continue;
    ++num_found;
    const SiftKeypoint& k = got.keypoints[found];
    double largest = 0;
    for (int i = 0; i < kSiftDescriptorSize; ++i) {
      const double value = got.descriptors[found * kSiftDescriptorSize + i];
      largest = std::max(largest, std::abs(value - std::min(255.0, feature.descriptor[i])));
    }
    num_far += std::hypot(k.x - feature.x, k.y - feature.y) > 0.01 || largest > 4;
  }
  EXPECT_GT(num_found, 0.99 * want.size());
  EXPECT_LT(num_far, 0.01 * want.size());
}

TEST_P(SiftTest, OrdersFeaturesByPlaceScaleAndAngle) {
  const Features features = Extract(*backend_, Textured(120, 90, 3), kAll);
  ASSERT_GT(features.keypoints.size(), 100);
  EXPECT_EQ(features.descriptors.size(), features.keypoints.size() * kSiftDescriptorSize);
  const auto order = [](const SiftKeypoint& k) { return std::tuple(k.y, k.x, k.scale, k.angle); };
  for (size_t i = 1; i < features.keypoints.size(); ++i) {
    EXPECT_LT(order(features.keypoints[i - 1]), order(features.keypoints[i])) << i;
  }
}

TEST_P(SiftTest, AcceptsAnySize) {
  for (const auto& [width, height] : {std::pair(1, 1), std::pair(1, 4000), std::pair(4000, 2)}) {
    EXPECT_TRUE(Extract(*backend_, Textured(width, height, 1), kAll).keypoints.empty());
  }
  for (const auto& [width, height] : {std::pair(3, 3), std::pair(17, 33), std::pair(500, 5)}) {
    SCOPED_TRACE(width);
    const GreyImage image = Textured(width, height, 2);
    const std::vector<ReferenceFeature> want = ReferenceSift(image);
    const Features got = Extract(*backend_, image, kAll);
    EXPECT_NEAR(got.keypoints.size(), want.size(), 1 + 0.04 * want.size());
  }
}

TEST_P(SiftTest, FindsNothingInFlatPhotographs) {
  for (const uint8_t value : {0, 17, 255}) {
    EXPECT_TRUE(Extract(*backend_, Flat(100, 80, value), kAll).keypoints.empty());
  }
}

// Black and white pixels at random are the strongest gradients that there can be.
TEST_P(SiftTest, DescribesBlackAndWhiteNoise) {
  std::mt19937 engine(4);
  GreyImage image = Flat(150, 110, 0);
  for (uint8_t& pixel : image.pixels) pixel = engine() % 2 == 0 ? 0 : 255;
  const Features features = Extract(*backend_, image, kAll);
  ASSERT_GT(features.keypoints.size(), 100);
  for (size_t i = 0; i < features.keypoints.size(); ++i) {
    const SiftKeypoint& k = features.keypoints[i];
    ASSERT_TRUE(k.x >= 0.5f && k.x <= 150 && k.y >= 0.5f && k.y <= 110) << k.x << " " << k.y;
    ASSERT_TRUE(k.scale > 0.8f && k.scale < 20 && k.angle >= 0 && k.angle < 6.2832f);
    double squares = 0;
    for (int j = 0; j < kSiftDescriptorSize; ++j) {
      const double value = features.descriptors[i * kSiftDescriptorSize + j];
      squares += value * value;
    }
    // The squares of the roots sum to 1, but for rounding and for values over 255.
    ASSERT_NEAR(std::sqrt(squares), 512, 5);
  }
}

TEST_P(SiftTest, LeavesIgnoredPixelsOut) {
  const GreyImage image = Textured(120, 90, 5);
  const Features all = Extract(*backend_, image, kAll);
  std::vector<uint8_t> ignore(image.pixels.size());
  EXPECT_EQ(Extract(*backend_, image, kAll, ignore), all);
  for (int y = 20; y < 70; ++y) std::fill_n(ignore.begin() + y * 120 + 30, 60, 1);
  const auto is_ignored = [&](const SiftKeypoint& k) {
    return ignore[static_cast<int>(k.y) * 120 + static_cast<int>(k.x)] != 0;
  };
  std::vector<SiftKeypoint> want = all.keypoints;
  std::erase_if(want, is_ignored);
  ASSERT_LT(want.size(), all.keypoints.size());
  EXPECT_EQ(Extract(*backend_, image, kAll, ignore).keypoints, want);
  std::fill(ignore.begin(), ignore.end(), 1);
  EXPECT_TRUE(Extract(*backend_, image, kAll, ignore).keypoints.empty());
}

// Thirds of octaves are kept as a whole, from the largest on, until there are more points than
// asked for. A refined scale may lie in a neighbouring third, so a scale does not name its third.
TEST_P(SiftTest, KeepsTheLargestScales) {
  const GreyImage image = Textured(160, 120, 6);
  const Features all = Extract(*backend_, image, kAll);
  const auto points_of = [](const Features& features) {
    std::set<std::tuple<float, float, float>> points;
    for (const SiftKeypoint& k : features.keypoints) points.emplace(k.scale, k.y, k.x);
    return points;
  };
  const auto all_points = points_of(all);
  size_t before = 0;
  for (const int max_features : {1, 20, 60, 110}) {
    SCOPED_TRACE(max_features);
    const auto kept = points_of(Extract(*backend_, image, max_features));
    EXPECT_GT(kept.size(), max_features);
    EXPECT_LT(kept.size(), all_points.size());
    EXPECT_TRUE(std::includes(all_points.begin(), all_points.end(), kept.begin(), kept.end()));
    // All points of at least an octave's third above the least scale that was kept are kept.
    const float safe = std::get<0>(*kept.begin()) * 2;
    EXPECT_EQ(std::distance(kept.lower_bound({safe, 0, 0}), kept.end()),
              std::distance(all_points.lower_bound({safe, 0, 0}), all_points.end()));
    EXPECT_GE(kept.size(), before);
    before = kept.size();
  }
}

TEST_P(SiftTest, ReusesItsScratch) {
  SiftScratch scratch;
  const GreyImage small = Textured(60, 44, 8), large = Textured(180, 130, 9);
  const Features want = Extract(*backend_, small, 100);
  EXPECT_EQ(Extract(*backend_, small, 100, {}, &scratch), want);
  Extract(*backend_, large, kAll, {}, &scratch);
  EXPECT_EQ(Extract(*backend_, small, 100, {}, &scratch), want);
}

TEST(SiftThreads, DoNotChangeFeatures) {
  const GreyImage image = Textured(211, 157, 10);
  const auto one = MakeCpuBackend(1), four = MakeCpuBackend(4);
  for (const int max_features : {200, kAll}) {
    const Features want = Extract(*one, image, max_features);
    ASSERT_GT(want.keypoints.size(), 200);
    EXPECT_EQ(Extract(*four, image, max_features), want);
  }
}

using CudaSiftTest = CudaAndCpuTest;

TEST_F(CudaSiftTest, FindsTheFeaturesOfTheCpu) {
  const GreyImage image = Textured(640, 480, 11);
  for (const int max_features : {1000, kAll}) {
    const Features want = Extract(*cpu_, image, max_features);
    const Features got = Extract(*cuda_, image, max_features);
    const auto count = static_cast<double>(want.keypoints.size());
    EXPECT_NEAR(got.keypoints.size(), count, 0.005 * count);
    int num_found = 0, num_alike = 0;
    for (size_t i = 0; i < want.keypoints.size(); ++i) {
      const int found = Find(got, want.keypoints[i]);
      if (found < 0) continue;
      ++num_found;
      double squares = 0;
      for (int k = 0; k < kSiftDescriptorSize; ++k) {
        const double difference = got.descriptors[found * kSiftDescriptorSize + k] -
                                  want.descriptors[i * kSiftDescriptorSize + k];
        squares += difference * difference;
      }
      num_alike += squares < 10 * 10;
    }
    EXPECT_GT(num_found, 0.99 * count);
    EXPECT_GT(num_alike, 0.99 * count);
  }
}

TEST_F(CudaSiftTest, RepeatsItsBytes) {
  const GreyImage image = Textured(333, 257, 12);
  const Features first = Extract(*cuda_, image, kAll);
  for (int run = 0; run < 3; ++run) EXPECT_EQ(Extract(*cuda_, image, kAll), first);
}

}  // namespace
}  // namespace pepeseg
