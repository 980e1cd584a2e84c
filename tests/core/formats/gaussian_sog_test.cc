#include "core/formats/gaussian_sog.h"

#include <gtest/gtest.h>
#include <webp/decode.h>

#include <Eigen/Geometry>
#include <cmath>
#include <map>

#include "core/formats/codebook.h"
#include "nlohmann/json.hpp"
#include "tests/testing/gaussian_file.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/unzipped.h"

namespace pepeseg {
namespace {

using testing::AllOf;

absl::Status GoOn() { return absl::OkStatus(); }

std::string SogOf(const Gaussians& gaussians, std::vector<uint32_t> indices, int num_threads = 2) {
  ThreadPool pool(num_threads);
  const auto blocks = MakeGaussianSog(gaussians, std::move(indices), pool, GoOn);
  EXPECT_OK(blocks);
  return blocks.ok() ? testing::FileOf(**blocks) : std::string();
}

// Small Gaussians, some of them far away.
Gaussians SogGaussians(int64_t count, int sh_degree) {
  Gaussians gaussians = testing::RandomGaussians(count, sh_degree);
  for (int k = 0; k < 3; ++k) {
    for (float& value : gaussians.Plane(kLogScalePlane + k)) value -= 4;
    for (int64_t i = 7; i < count; i += 100) gaussians.Plane(kMeanPlane + k)[i] *= 50;
  }
  for (int k = 3; k < 3 * NumShCoefficients(sh_degree); ++k) {
    for (float& value : gaussians.Plane(kShPlane + k)) value *= 0.1f;
  }
  return gaussians;
}

// An SOG read as the description of the format says, and, of the order of a rotation's components
// and of scales, as programs do.
struct Sog {
  struct Pixels {
    int width = 0, height = 0;
    std::vector<uint8_t> bytes;
    int At(size_t pixel, int channel) const {
      return bytes.at(4 * pixel + static_cast<size_t>(channel));
    }
  };
  nlohmann::json meta;
  std::map<std::string, Pixels> images;
  size_t num_bytes = 0;

  explicit Sog(const std::string& file) : num_bytes(file.size()) {
    for (const auto& [name, bytes] : testing::Unzipped(file)) {
      if (name == "meta.json") {
        meta = nlohmann::json::parse(bytes);
        continue;
      }
      Pixels& pixels = images[name];
      const auto* const data = reinterpret_cast<const uint8_t*>(bytes.data());
      WebPBitstreamFeatures features{};
      EXPECT_EQ(WebPGetFeatures(data, bytes.size(), &features), VP8_STATUS_OK);
      EXPECT_EQ(features.format, 2) << name << " is lossy";
      uint8_t* const decoded = WebPDecodeRGBA(data, bytes.size(), &pixels.width, &pixels.height);
      EXPECT_NE(decoded, nullptr);
      if (decoded == nullptr) continue;
      pixels.bytes.assign(decoded, decoded + 4 * pixels.width * pixels.height);
      WebPFree(decoded);
    }
    EXPECT_EQ(meta.at("version"), 2);
    for (const char* const part : {"means", "scales", "quats", "sh0"}) {
      for (const std::string name : meta.at(part).at("files")) {
        EXPECT_GE(images.at(name).width * images.at(name).height, meta.at("count").get<int>());
      }
    }
  }

  double Position(size_t row, int axis) const {
    const int value =
        images.at("means_l.webp").At(row, axis) + 256 * images.at("means_u.webp").At(row, axis);
    const double min = meta["means"]["mins"][axis], max = meta["means"]["maxs"][axis];
    const double log = min + (max - min) * value / 65535;
    return std::copysign(std::expm1(std::abs(log)), log);
  }
  double LogScale(size_t row, int axis) const {
    return meta["scales"]["codebook"].at(images.at("scales.webp").At(row, axis));
  }
  Eigen::Quaterniond Rotation(size_t row) const {
    const Pixels& quats = images.at("quats.webp");
    const int largest = quats.At(row, 3) - 252;
    EXPECT_GE(largest, 0);
    double values[4] = {}, squares = 0;
    int channel = 0;
    for (int k = 0; k < 4; ++k) {
      if (k == largest) continue;
      values[k] = (quats.At(row, channel++) / 255.0 - 0.5) * std::sqrt(2);
      squares += values[k] * values[k];
    }
    values[largest] = std::sqrt(std::max(0.0, 1 - squares));
    return {values[0], values[1], values[2], values[3]};
  }
  double Color(size_t row, int channel) const {
    return meta["sh0"]["codebook"].at(images.at("sh0.webp").At(row, channel));
  }
  double Opacity(size_t row) const { return images.at("sh0.webp").At(row, 3) / 255.0; }
  double Sh(size_t row, int coefficient, int channel) const {
    const Pixels& labels = images.at("shN_labels.webp");
    const size_t entry = static_cast<size_t>(labels.At(row, 0)) +
                         size_t{256} * static_cast<size_t>(labels.At(row, 1));
    EXPECT_LT(entry, meta["shN"]["count"].get<size_t>());
    const auto bands = meta["shN"]["bands"].get<int>();
    const auto num_coefficients = static_cast<size_t>(NumShCoefficients(bands)) - 1;
    const Pixels& centroids = images.at("shN_centroids.webp");
    EXPECT_EQ(centroids.width, static_cast<int>(64 * num_coefficients));
    const size_t x = entry % 64 * num_coefficients + static_cast<size_t>(coefficient) - 1;
    const size_t pixel = entry / 64 * static_cast<size_t>(centroids.width) + x;
    return meta["shN"]["codebook"].at(centroids.At(pixel, channel));
  }
};

// Returns for each of the Gaussians the pixel that has it: one with its position.
std::vector<size_t> PixelsOf(const Sog& sog, const Gaussians& gaussians) {
  std::map<std::array<int, 3>, size_t> pixels;
  const auto count = static_cast<size_t>(gaussians.count);
  const auto key = [&sog](auto&& position) {
    std::array<int, 3> parts{};
    for (int k = 0; k < 3; ++k) {
      const double log = std::copysign(std::log1p(std::abs(position(k))), position(k));
      const double min = sog.meta["means"]["mins"][k], max = sog.meta["means"]["maxs"][k];
      parts[k] = static_cast<int>(std::lround((log - min) / (max - min) * 65535));
    }
    return parts;
  };
  for (size_t i = 0; i < count; ++i) {
    pixels[key([&](int k) { return sog.Position(i, k); })] = i;
  }
  std::vector<size_t> of(count);
  for (size_t i = 0; i < count; ++i) {
    const auto found =
        pixels.find(key([&](int k) { return double{gaussians.Plane(kMeanPlane + k)[i]}; }));
    EXPECT_NE(found, pixels.end()) << i;
    if (found != pixels.end()) of[i] = found->second;
  }
  return of;
}

void ExpectNearestCode(const std::vector<double>& codebook, double value, double code) {
  ASSERT_EQ(codebook.size(), 256u);
  for (const double other : codebook) {
    ASSERT_LE(std::abs(code - value), std::abs(other - value) + 1e-6);
  }
}

TEST(GaussianSog, HoldsParametersToTheirPrecision) {
  for (int degree = 0; degree <= kMaxShDegree; ++degree) {
    const Gaussians gaussians = SogGaussians(900, degree);
    const Sog sog(SogOf(gaussians, AllOf(gaussians)));
    ASSERT_EQ(sog.meta.at("count"), 900);
    ASSERT_EQ(sog.meta.contains("shN"), degree > 0);
    const std::vector<size_t> pixels = PixelsOf(sog, gaussians);
    double squares = 0;
    for (size_t i = 0; i < 900; ++i) {
      const auto value = [&](int plane) { return double{gaussians.Plane(plane)[i]}; };
      const size_t row = pixels[i];
      for (int k = 0; k < 3; ++k) {
        // Logs are within about 5 of 0, so a step is 10 / 65535 of the distance from the origin.
        EXPECT_NEAR(sog.Position(row, k), value(kMeanPlane + k),
                    1e-4 * (1 + std::abs(value(kMeanPlane + k))));
        const double scale = value(kLogScalePlane + k), color = value(kShPlane + k);
        ExpectNearestCode(sog.meta["scales"]["codebook"], scale, sog.LogScale(row, k));
        ExpectNearestCode(sog.meta["sh0"]["codebook"], color, sog.Color(row, k));
        squares +=
            std::pow(sog.LogScale(row, k) - scale, 2) + std::pow(sog.Color(row, k) - color, 2);
      }
      EXPECT_NEAR(sog.Opacity(row), 1 / (1 + std::exp(-value(kOpacityPlane))), 0.5001 / 255);
      const Eigen::Quaterniond want(value(kRotationPlane), value(kRotationPlane + 1),
                                    value(kRotationPlane + 2), value(kRotationPlane + 3));
      EXPECT_LT(sog.Rotation(row).angularDistance(want.normalized()), 0.02);
      // There is an entry for each, and 256 codes for all coefficients.
      for (int k = 1; k < NumShCoefficients(degree); ++k) {
        for (int c = 0; c < 3; ++c) {
          EXPECT_NEAR(sog.Sh(row, k, c), value(kShPlane + 3 * k + c), 0.05) << k;
        }
      }
    }
    // 2,700 normally distributed numbers each: even steps within +-3.5 would have 0.008.
    EXPECT_LT(std::sqrt(squares / (2 * 2700)), 0.008) << degree;
  }
}

TEST(GaussianSog, KeepsColorsOfTransparentGaussians) {
  Gaussians gaussians = SogGaussians(200, 0);
  for (float& opacity : gaussians.Plane(kOpacityPlane)) opacity = -20;
  const Sog sog(SogOf(gaussians, AllOf(gaussians)));
  const std::vector<size_t> pixels = PixelsOf(sog, gaussians);
  for (size_t i = 0; i < 200; ++i) {
    EXPECT_EQ(sog.Opacity(pixels[i]), 0);
    ExpectNearestCode(sog.meta["sh0"]["codebook"], gaussians.Plane(kShPlane + 1)[i],
                      sog.Color(pixels[i], 1));
  }
}

TEST(GaussianSog, HasTheSameBytesForAnyNumberOfThreads) {
  const Gaussians gaussians = SogGaussians(40'000, 3);
  const std::string one = SogOf(gaussians, AllOf(gaussians), 1);
  EXPECT_EQ(SogOf(gaussians, AllOf(gaussians), 4), one);
  const Sog sog(one);
  EXPECT_EQ(sog.meta["shN"]["count"], 40'000 / 16);
  EXPECT_LT(sog.num_bytes, static_cast<size_t>(BytesOfSog(40'000, 3)));
  EXPECT_LT(sog.num_bytes, 40'000u * 62 * 4 / 12) << "a PLY has 62 floats each";
}

TEST(GaussianSog, HoldsNoneAndOne) {
  for (const int degree : {0, 3}) {
    const Gaussians gaussians = SogGaussians(3, degree);
    const Sog none(SogOf(gaussians, {}));
    EXPECT_EQ(none.meta.at("count"), 0);
    EXPECT_FALSE(none.meta.contains("shN"));
    const Sog one(SogOf(gaussians, {1}));
    EXPECT_EQ(one.meta.at("count"), 1);
    for (int k = 0; k < 3; ++k) {
      EXPECT_NEAR(one.Position(0, k), gaussians.Plane(kMeanPlane + k)[1], 1e-5);
      EXPECT_FLOAT_EQ(one.LogScale(0, k), gaussians.Plane(kLogScalePlane + k)[1]);
      EXPECT_FLOAT_EQ(one.Color(0, k), gaussians.Plane(kShPlane + k)[1]);
      if (degree > 0) {
        EXPECT_FLOAT_EQ(one.Sh(0, 15, k), gaussians.Plane(kShPlane + 45 + k)[1]);
      }
    }
  }
}

TEST(GaussianSog, ChoosesASubset) {
  const Gaussians gaussians = SogGaussians(10, 1);
  const Sog sog(SogOf(gaussians, {3, 8}));
  ASSERT_EQ(sog.meta.at("count"), 2);
  const bool swapped = sog.Position(0, 0) > sog.Position(1, 0);
  const auto x = gaussians.Plane(kMeanPlane);
  EXPECT_NEAR(sog.Position(swapped ? 1 : 0, 0), std::min(x[3], x[8]), 1e-4);
  EXPECT_NEAR(sog.Position(swapped ? 0 : 1, 0), std::max(x[3], x[8]), 1e-4);
}

TEST(GaussianSog, EndsWithTheErrorOfTheCheck) {
  const Gaussians gaussians = SogGaussians(100, 1);
  ThreadPool pool(1);
  int num_calls = 0;
  const auto made = MakeGaussianSog(gaussians, AllOf(gaussians), pool, [&num_calls] {
    return ++num_calls == 3 ? absl::CancelledError("enough") : absl::OkStatus();
  });
  EXPECT_EQ(made.status(), absl::CancelledError("enough"));
  EXPECT_EQ(num_calls, 3);
}

TEST(Codebook, HasFewValuesExactly) {
  std::vector<float> values;
  values.reserve(2560);
  for (int i = 0; i < 2560; ++i) values.push_back(std::sqrt(static_cast<float>(i % 256)));
  const Codebook codebook = MakeCodebook(values);
  for (const float value : values) EXPECT_EQ(codebook[NearestCode(codebook, value)], value);
}

TEST(Codebook, IsFinerThanEvenSteps) {
  const Gaussians gaussians = testing::RandomGaussians(20'000, 0);
  const auto span = gaussians.Plane(kMeanPlane);
  std::vector<float> values(span.begin(), span.end());
  values.push_back(1000);  // one that would make even steps as wide as 4
  const Codebook codebook = MakeCodebook(values);
  EXPECT_TRUE(std::ranges::is_sorted(codebook));
  double squares = 0;
  for (const float value : values) {
    const float code = codebook[NearestCode(codebook, value)];
    for (const float other : codebook) {
      ASSERT_LE(std::abs(code - value), std::abs(other - value) + 1e-6f);
    }
    squares += (code - value) * (code - value);
  }
  // The best for 256 codes of a normal distribution is 2.72 / 256^2.
  EXPECT_LT(squares / 20'000, 1.5 * 2.72 / 65536);
}

TEST(Codebook, HasFewCodesForEqualValues) {
  const Gaussians gaussians = testing::RandomGaussians(2'000, 0);
  const auto span = gaussians.Plane(kMeanPlane);
  std::vector<float> values(20'000, 0.25f);
  std::ranges::copy(span, values.begin());
  const Codebook codebook = MakeCodebook(values);
  const auto is_near = [](float code) { return std::abs(code - 0.25f) < 1e-4f; };
  EXPECT_TRUE(is_near(codebook[NearestCode(codebook, 0.25f)]));
  EXPECT_LE(std::ranges::count_if(codebook, is_near), 3);
  for (const float value : span) {
    EXPECT_NEAR(codebook[NearestCode(codebook, value)], value, 0.02 + 0.1 * std::abs(value));
  }
}

TEST(Palette, FindsClusters) {
  std::vector<float> vectors;
  const Gaussians noise = testing::RandomGaussians(6000, 0);
  for (size_t i = 0; i < 6000; ++i) {
    const auto cluster = static_cast<float>(i % 37);
    vectors.push_back(10 * cluster + 0.1f * noise.Plane(0)[i]);
    vectors.push_back(10 * std::sin(cluster) + 0.1f * noise.Plane(1)[i]);
  }
  ThreadPool pool(2);
  const Palette palette = MakePalette(vectors, 2, 37, pool);
  ASSERT_EQ(palette.num_entries(), 37u);
  for (size_t i = 0; i < 6000; ++i) {
    EXPECT_EQ(palette.labels[i], palette.labels[i % 37]);
    EXPECT_NEAR(palette.entries[2 * palette.labels[i]], 10.0 * (i % 37), 0.1);
  }
}

TEST(Palette, EndsAtWhatIsDifferent) {
  const std::vector<float> vectors = {1, 2, 1, 2, 3, 4, 1, 2};
  ThreadPool pool(1);
  const Palette palette = MakePalette(vectors, 2, 100, pool);
  EXPECT_EQ(palette.num_entries(), 2u);
  EXPECT_EQ(palette.labels[0], palette.labels[3]);
  EXPECT_NE(palette.labels[0], palette.labels[2]);
  EXPECT_EQ(palette.entries[2 * palette.labels[2] + 1], 4);
}

}  // namespace
}  // namespace pepeseg
