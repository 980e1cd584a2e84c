#include "core/model_files/model_version.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <limits>

#include "core/base/errors.h"
#include "core/model_files/model_file.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

namespace fs = std::filesystem;

struct CorrectedModelTest : ::testing::Test {
  void SetUp() override {
    model.gaussians = Gaussians::Zero(2, 0);
    model.gaussians.Plane(kMeanPlane)[1] = 5;
    for (float& w : model.gaussians.Plane(kRotationPlane)) w = 1;
    model.field.features.assign(64, 0.0f);
    model.field.features[0] = model.field.features[33] = 1;
    model.field.scale_quantiles = {1, 2};
    model.metrics["psnr"] = 30;
    fs::create_directory(from);
    ASSERT_OK(WriteModel(from, model));
    std::ofstream(from / "a.embedding") << "kept";
  }

  const testing::TempFolder folder;
  const fs::path from = folder / "attempt-1", to = folder / "models/1/2";
  Model model;
};

TEST_F(CorrectedModelTest, HasNewFeaturesAndOutlivesTheOldModel) {
  FeatureField field = model.field;
  field.features[0] = 0;
  field.features[5] = 1;
  ASSERT_OK_AND_ASSIGN(const int64_t size, WriteCorrectedModel(from, to, field, "models/1"));
  EXPECT_GT(size, static_cast<int64_t>(fs::file_size(to / "gaussians.ply")));
  EXPECT_EQ(fs::hard_link_count(to / "gaussians.ply"), 2u) << "not a copy";
  ASSERT_OK_AND_ASSIGN(const Model old, ReadModel(from));
  EXPECT_EQ(old.field.features, model.field.features) << "the old model is as it was";
  fs::remove_all(from);
  ASSERT_OK_AND_ASSIGN(const Model corrected, ReadModel(to));
  EXPECT_EQ(corrected.field.features, field.features);
  EXPECT_EQ(corrected.gaussians.planes, model.gaussians.planes);
  EXPECT_EQ(corrected.facts.at("corrected_from"), "models/1");
  EXPECT_EQ(corrected.metrics.at("psnr"), 30);
  EXPECT_TRUE(fs::exists(to / "a.embedding"));
}

TEST_F(CorrectedModelTest, LeavesNothingAfterAnError) {
  FeatureField field = model.field;
  field.features[0] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_STATUS(WriteCorrectedModel(from, to, field, "models/1"),
                absl::StatusCode::kInvalidArgument, "not finite");
  EXPECT_FALSE(fs::exists(to));
  EXPECT_FALSE(WriteCorrectedModel(folder / "none", to, model.field, "models/1").ok());
  EXPECT_FALSE(fs::exists(to));
}

TEST_F(CorrectedModelTest, LeavesAFolderThatExistsAsItIs) {
  fs::create_directories(to);
  std::ofstream(to / "theirs") << "kept";
  const auto size = WriteCorrectedModel(from, to, model.field, "models/1");
  EXPECT_STATUS(size, absl::StatusCode::kInternal, "exists");
  EXPECT_TRUE(IsPrivate(size.status())) << "it names a path of the server";
  EXPECT_TRUE(fs::exists(to / "theirs"));
  EXPECT_FALSE(fs::exists(to / "gaussians.ply"));
}

}  // namespace
}  // namespace pepeseg
