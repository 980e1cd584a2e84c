#include "core/model_files/model_file.h"

#include <gtest/gtest.h>

#include <limits>

#include "core/base/file_io.h"
#include "core/model_files/model_facts.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

using absl::StatusCode::kDataLoss;
using testing::TempFolder;

Model MakeModel(bool with_features) {
  Model model;
  model.gaussians = Gaussians::Zero(4, 1);
  for (size_t i = 0; i < model.gaussians.planes.size(); ++i) {
    model.gaussians.planes[i] = 0.25f * static_cast<float>(i + 1);
  }
  if (with_features) {
    model.field.features.assign(4 * 32, 0.125f);
    model.field.gate[3] = 2;
    model.field.scale_quantiles = {0.5f, 1, 2};
  }
  ModelView view;
  view.name = "images/\xC3\xA4 1.jpg";
  view.camera = {640, 480, 601.25, 1.0 / 3, 320.1, 240.7};
  view.cam_from_world.rotation = Eigen::Quaterniond(0.1, 0.7, -0.3, 0.2).normalized();
  view.cam_from_world.translation = {1.0 / 7, -2e-9, 3e5};
  view.held_out = true;
  model.views = {view, view};
  model.views[0].scores = {24.25, 0.8125, 0.1};
  model.views[1].scores = {1.0 / 3, -0.5, {}};
  model.views.push_back(view);
  Photograph& photograph = model.views[1].photograph.emplace();
  photograph.lens = {LensModel::kSimpleRadial, 1280, 960, 1203.5, 1.0 / 7, 640.25, 479, {-0.1}};
  photograph.orientation = 6;
  photograph.left = 3, photograph.top = 1, photograph.width = 1270, photograph.height = 955;
  model.scene_radius = 1.0 / 9;
  model.metrics = {{"psnr", 23.456789012345}, {"none", std::numeric_limits<double>::quiet_NaN()}};
  model.facts = {{"seed", "1"}, {"odd", "\xFF\"\n"}};
  return model;
}

TEST(ModelFile, RoundTripsFarFromZero) {
  const TempFolder folder;
  Model model = MakeModel(true);
  model.origin = {4e5, 1.0 / 3, -5.3e6};
  ASSERT_OK(WriteModel(folder.path(), model));
  ASSERT_OK_AND_ASSIGN(const Model read, ReadModel(folder.path()));
  EXPECT_EQ(read.origin, model.origin);
  EXPECT_EQ(read.views[0].cam_from_world.translation, model.views[0].cam_from_world.translation);
  for (size_t i = 0; i < read.gaussians.planes.size(); ++i) {
    EXPECT_NEAR(read.gaussians.planes[i], model.gaussians.planes[i], i < 12 ? 1e-8 : 0);
  }
}

TEST(ModelFile, RoundTrips) {
  const TempFolder folder;
  const Model model = MakeModel(true);
  ASSERT_OK(WriteModel(folder.path(), model));
  ASSERT_OK_AND_ASSIGN(const Model read, ReadModel(folder.path()));
  EXPECT_EQ(read.gaussians.planes, model.gaussians.planes);
  EXPECT_EQ(read.field.features, model.field.features);
  EXPECT_EQ(read.field.gate, model.field.gate);
  EXPECT_EQ(read.field.scale_quantiles, model.field.scale_quantiles);
  ASSERT_EQ(read.views.size(), 3u);
  ASSERT_TRUE(read.views[0].scores && read.views[1].scores);
  EXPECT_EQ(read.views[0].scores->psnr, 24.25);
  EXPECT_EQ(read.views[0].scores->lpips, 0.1);
  EXPECT_EQ(read.views[1].scores->psnr, 1.0 / 3);
  EXPECT_EQ(read.views[1].scores->ssim, -0.5);
  EXPECT_FALSE(read.views[1].scores->lpips.has_value());
  EXPECT_FALSE(read.views[2].scores.has_value());
  EXPECT_FALSE(read.views[0].photograph.has_value());
  EXPECT_EQ(read.views[1].photograph, model.views[1].photograph);
  EXPECT_EQ(read.views[0].name, model.views[0].name);
  EXPECT_EQ(read.views[0].camera.fy, 1.0 / 3);
  EXPECT_EQ(read.views[0].camera.width, 640);
  EXPECT_EQ(read.views[0].cam_from_world.rotation.coeffs(),
            model.views[0].cam_from_world.rotation.coeffs());
  EXPECT_EQ(read.views[0].cam_from_world.translation, model.views[0].cam_from_world.translation);
  EXPECT_TRUE(read.views[0].held_out);
  EXPECT_EQ(read.scene_radius, 1.0 / 9);
  EXPECT_EQ(read.origin, Eigen::Vector3d::Zero());
  EXPECT_EQ(read.metrics, (std::map<std::string, double>{{"psnr", 23.456789012345}}));
  EXPECT_EQ(read.facts.at("seed"), "1");
}

TEST(ModelFile, RejectsInvalidPhotographs) {
  Model model = MakeModel(true);
  const std::string text = FormatModelFacts(model);
  for (const auto& [good, bad] : std::vector<std::pair<std::string, std::string>>{
           {"SIMPLE_RADIAL", "SIMPLE"},
           {"\"orientation\": 6", "\"orientation\": 9"},
           {"1270,", "1270e300,"},
           {"1270,", "1280,"}}) {
    std::string changed = text;
    ASSERT_NE(changed.find(good), std::string::npos) << good;
    changed.replace(changed.find(good), good.size(), bad);
    Model read;
    SCOPED_TRACE(bad);
    EXPECT_STATUS(ParseModelFacts(changed, read), kDataLoss, "view 1");
  }
}

TEST(ModelFile, ReadsItsShapeFromTheHeaders) {
  const TempFolder folder;
  ASSERT_OK(WriteModel(folder.path(), MakeModel(true)));
  ASSERT_OK_AND_ASSIGN(const ModelShape shape, ReadModelShape(folder.path()));
  EXPECT_EQ(shape.num_gaussians, 4);
  EXPECT_EQ(shape.sh_degree, 1);
  EXPECT_EQ(shape.max_view_pixels, 640 * 480);
  std::filesystem::remove(folder / "model.json");
  EXPECT_STATUS(ReadModelShape(folder.path()), kDataLoss, "model.json");
}

TEST(ModelFile, MayHaveNoFeatures) {
  const TempFolder folder;
  ASSERT_OK(WriteModel(folder.path(), MakeModel(false)));
  EXPECT_FALSE(std::filesystem::exists(folder / "features.bin"));
  ASSERT_OK_AND_ASSIGN(const Model read, ReadModel(folder.path()));
  EXPECT_TRUE(read.field.empty());
  EXPECT_EQ(read.gaussians.count, 4);
}

TEST(ModelFile, RejectsChangedFilesByName) {
  for (const std::string name : {"gaussians.ply", "features.bin", "model.json"}) {
    const TempFolder folder;
    ASSERT_OK(WriteModel(folder.path(), MakeModel(true)));
    ASSERT_OK_AND_ASSIGN(std::string bytes, ReadFile(folder / name, name, 1 << 20));
    bytes[bytes.size() / 2] ^= 1;
    ASSERT_OK(WriteFileAtomically(folder / name, bytes));
    EXPECT_STATUS(ReadModel(folder.path()), kDataLoss, name);
    std::filesystem::remove(folder / name);
    EXPECT_STATUS(ReadModel(folder.path()), kDataLoss, name);
  }
}

TEST(ModelFile, IsNotFoundWithoutAManifest) {
  const TempFolder folder;
  ASSERT_OK(WriteModel(folder.path(), MakeModel(true)));
  std::filesystem::remove(folder / "manifest.json");
  EXPECT_EQ(ReadModel(folder.path()).status().code(), absl::StatusCode::kNotFound);
}

TEST(ModelFile, IsNotWrittenWithAnotherNumberOfFeatures) {
  const TempFolder folder;
  Model model = MakeModel(true);
  model.field.features.resize(3 * 32);
  EXPECT_STATUS(WriteModel(folder.path(), model), absl::StatusCode::kInvalidArgument,
                "4 Gaussians has 3 features");
}

}  // namespace
}  // namespace pepeseg
