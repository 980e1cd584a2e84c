#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "core/base/file_io.h"
#include "core/model_files/model_file.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

using absl::StatusCode::kInvalidArgument;

FeatureField MakeField(int num_gaussians) {
  FeatureField field;
  for (int i = 0; i < num_gaussians * kFeatureDim; ++i) {
    field.features.push_back(std::sin(0.1f * static_cast<float>(i)) / 4);
  }
  for (size_t i = 0; i < field.gate.size(); ++i) field.gate[i] = 0.1f * static_cast<float>(i) - 3;
  for (int i = 0; i < 1000; ++i) field.scale_quantiles.push_back(0.01f * static_cast<float>(i));
  return field;
}

TEST(FeatureFile, RoundTripsInHalfPrecision) {
  const testing::TempFolder folder;
  const FeatureField field = MakeField(50);
  ASSERT_OK(WriteFeatureFile(folder / "f", field));
  ASSERT_OK_AND_ASSIGN(const FeatureField read, ReadFeatureFile(folder / "f", "f"));
  EXPECT_EQ(read.gate, field.gate);
  EXPECT_EQ(read.scale_quantiles, field.scale_quantiles);
  ASSERT_EQ(read.features.size(), field.features.size());
  for (size_t i = 0; i < read.features.size(); ++i) {
    EXPECT_NEAR(read.features[i], field.features[i],
                std::abs(field.features[i]) * 0x1p-11f + 1e-7f);
  }
}

TEST(FeatureFile, RoundTripsConfidencesIfThereAreAny) {
  const testing::TempFolder folder;
  FeatureField field = MakeField(3);
  ASSERT_OK(WriteFeatureFile(folder / "f", field));
  ASSERT_OK_AND_ASSIGN(const FeatureField without, ReadFeatureFile(folder / "f", "f"));
  EXPECT_TRUE(without.confidence.empty());
  field.confidence = {1, 0.375f, 0.0200042725f};  // of half precision
  ASSERT_OK(WriteFeatureFile(folder / "f", field));
  ASSERT_OK_AND_ASSIGN(const FeatureField with, ReadFeatureFile(folder / "f", "f"));
  EXPECT_EQ(with.confidence, field.confidence);
  EXPECT_EQ(with.features, without.features);
}

TEST(FeatureFile, RoundTripsAGateOfTwoLayersAsVersion2) {
  const testing::TempFolder folder;
  FeatureField field = MakeField(3);
  ASSERT_OK(WriteFeatureFile(folder / "one", field));
  field.gate.assign(1120, 0.25f);
  field.gate[1119] = -3;
  ASSERT_OK(WriteFeatureFile(folder / "two", field));
  ASSERT_OK_AND_ASSIGN(const FeatureField read, ReadFeatureFile(folder / "two", "two"));
  EXPECT_EQ(read.gate, field.gate);
  EXPECT_EQ(read.scale_quantiles, field.scale_quantiles);
  const auto version = [&](const char* name) {
    const std::string bytes = ReadFile(folder / name, name, 1 << 20).value();
    return int{bytes[8]};
  };
  EXPECT_EQ(version("one"), 1);  // a gate of one layer
  EXPECT_EQ(version("two"), 2);
  field.gate.pop_back();
  EXPECT_STATUS(WriteFeatureFile(folder / "two", field), kInvalidArgument,
                "the gate has 1119 numbers");
}

TEST(FeatureFile, RejectsInvalidFields) {
  const testing::TempFolder folder;
  FeatureField field = MakeField(3);
  field.features[40] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_STATUS(WriteFeatureFile(folder / "f", field), kInvalidArgument, "Gaussian 1");
  field = MakeField(3);
  field.features.pop_back();
  EXPECT_STATUS(WriteFeatureFile(folder / "f", field), kInvalidArgument, "whole rows");
  field = MakeField(3);
  std::swap(field.scale_quantiles[4], field.scale_quantiles[5]);
  EXPECT_STATUS(WriteFeatureFile(folder / "f", field), kInvalidArgument, "descend");
  field = MakeField(3);
  field.confidence = {1, 1};
  EXPECT_STATUS(WriteFeatureFile(folder / "f", field), kInvalidArgument,
                "2 confidences of 3 Gaussians");
  for (const float bad : {0.0f, -1.0f, 1.5f, std::numeric_limits<float>::quiet_NaN()}) {
    field.confidence = {1, bad, 1};
    EXPECT_STATUS(WriteFeatureFile(folder / "f", field), kInvalidArgument,
                  "the confidence of Gaussian 1 is");
  }
  EXPECT_FALSE(std::filesystem::exists(folder / "f"));
}

TEST(FeatureFile, RejectsCountsThatTheFileCannotHold) {
  const testing::TempFolder folder;
  ASSERT_OK(WriteFeatureFile(folder / "f", MakeField(3)));
  ASSERT_OK_AND_ASSIGN(const std::string good, ReadFile(folder / "f", "f", 1 << 20));
  const auto expect_refused = [&](size_t at, char value, const std::string& why) {
    std::string bytes = good;
    bytes[at] = value;
    ASSERT_OK(WriteFileAtomically(folder / "f", bytes));
    EXPECT_STATUS(ReadFeatureFile(folder / "f", "feat.bin"), kInvalidArgument, why);
  };
  expect_refused(0, 'X', "feat.bin: is not a feature file");
  expect_refused(8, 3, "version 3");
  expect_refused(8, 2, "declares");  // a gate of two layers that is not there
  expect_refused(12, 16, "16 dimensions");
  expect_refused(16, 4, "declares 4 Gaussians");
  expect_refused(23, 127, "declares");
  expect_refused(28, 1, "declares");  // confidences that are not there
  expect_refused(28, 2, "has 2 where 1 stands for confidences");
  expect_refused(27, 127, "quantiles");
}

}  // namespace
}  // namespace pepeseg
