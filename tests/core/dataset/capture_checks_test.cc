#include "core/dataset/capture_checks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "tests/testing/small_dataset.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using ::testing::HasSubstr;
using testing::Png;
using testing::SmallDataset;
using testing::WriteBytes;

const Eigen::Quaterniond kTurn(0, 1, 0, 0);  // half a turn about x

Pose Inverted(const Pose& pose) {
  const Eigen::Quaterniond rotation = pose.rotation.conjugate();
  return {rotation, -(rotation * pose.translation)};
}
Pose TurnedCamera(const Pose& pose) { return {kTurn * pose.rotation, kTurn * pose.translation}; }
Pose TurnedWorld(const Pose& pose) { return {pose.rotation * kTurn, pose.translation}; }

// Cameras around points, all of which each of them sees.
struct Orbit {
  Orbit() {
    Lens lens;
    lens.width = 40, lens.height = 30;
    lens.fx = lens.fy = 30, lens.cx = 20, lens.cy = 15;
    for (int i = 0; i < 12; ++i) {
      const double angle = 0.5 * i;
      const Eigen::Quaterniond rotation(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitY()) *
                                        Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitX()));
      cameras.push_back({lens, {rotation, {0.1, 0.2, 6}}});
    }
    for (int i = 0; i < 60; ++i) {
      const auto f = static_cast<float>(i);
      points.push_back({{std::sin(f), std::cos(2 * f), std::sin(3 * f)}, {0, 0, 0}});
    }
  }
  // Returns the convention that fits after each pose was read as `written` from its true value.
  std::optional<PoseConvention> Find(PoseFormat format,
                                     const std::function<Pose(const Pose&)>& written) {
    std::vector<PosedLens> as_written = cameras;
    for (PosedLens& camera : as_written) camera.cam_from_world = written(camera.cam_from_world);
    const auto found = FindConvention(format, as_written, points);
    if (!found) return found;
    for (size_t i = 0; i < cameras.size(); ++i) {
      const Pose corrected = found->corrected(as_written[i].cam_from_world);
      EXPECT_LT(corrected.rotation.angularDistance(cameras[i].cam_from_world.rotation), 1e-7);
      EXPECT_LT((corrected.translation - cameras[i].cam_from_world.translation).norm(), 1e-9);
    }
    return found;
  }

  std::vector<PosedLens> cameras;
  std::vector<ScenePoint> points;
};

TEST(PoseConvention, OfPosesThatFitIsNotInQuestion) {
  Orbit orbit;
  EXPECT_FALSE(FindConvention(PoseFormat::kColmap, orbit.cameras, orbit.points));
  EXPECT_FALSE(FindConvention(PoseFormat::kTransformsJson, orbit.cameras, {}));
  EXPECT_FALSE(WarnOfUnseenPoints(orbit.cameras, orbit.points));
}

TEST(PoseConvention, OfTransformsJsonMayBeOpenCvsOrInverted) {
  Orbit orbit;
  const auto opencv = orbit.Find(PoseFormat::kTransformsJson, TurnedCamera);
  ASSERT_TRUE(opencv);
  EXPECT_THAT(opencv->name, HasSubstr("OpenCV's camera axes"));
  EXPECT_GT(opencv->seen, 0.9);
  EXPECT_LT(opencv->as_written, 0.02);
  const auto inverted = orbit.Find(PoseFormat::kTransformsJson, [](const Pose& pose) {
    return TurnedCamera(TurnedWorld(Inverted(pose)));
  });
  ASSERT_TRUE(inverted);
  EXPECT_THAT(inverted->name, HasSubstr("world to camera"));
  const auto both = orbit.Find(PoseFormat::kTransformsJson,
                               [](const Pose& pose) { return TurnedCamera(Inverted(pose)); });
  ASSERT_TRUE(both);
  EXPECT_THAT(both->name, HasSubstr("world to camera) with OpenCV's"));
}

TEST(PoseConvention, OfColmapMayBeOpenGlsOrInverted) {
  Orbit orbit;
  const auto opengl = orbit.Find(PoseFormat::kColmap, TurnedCamera);
  ASSERT_TRUE(opengl);
  EXPECT_THAT(opengl->name, HasSubstr("OpenGL's camera axes"));
  const auto inverted = orbit.Find(PoseFormat::kColmap, Inverted);
  ASSERT_TRUE(inverted);
  EXPECT_THAT(inverted->name, HasSubstr("camera to world"));
  const auto both =
      orbit.Find(PoseFormat::kColmap, [](const Pose& pose) { return TurnedWorld(Inverted(pose)); });
  ASSERT_TRUE(both);
}

TEST(PoseConvention, IsNotGuessedWherePointsAreElsewhere) {
  Orbit orbit;
  for (ScenePoint& point : orbit.points) point.position += Eigen::Vector3f(0, 1e4f, 0);
  EXPECT_FALSE(FindConvention(PoseFormat::kColmap, orbit.cameras, orbit.points));
  const auto warning = WarnOfUnseenPoints(orbit.cameras, orbit.points);
  ASSERT_TRUE(warning);
  EXPECT_THAT(*warning, HasSubstr("a camera sees 0.0 % of them"));
}

TEST(AxesTurnedAway, AreWarnedOfWithoutPoints) {
  Orbit orbit;
  const auto warn = [&] {
    return WarnOfAxesTurnedAway(PoseFormat::kTransformsJson, orbit.cameras, {});
  };
  EXPECT_FALSE(warn()) << "the cameras look at one place";
  for (PosedLens& camera : orbit.cameras) {
    camera.cam_from_world = TurnedCamera(camera.cam_from_world);
  }
  const auto warning = warn();
  ASSERT_TRUE(warning);
  EXPECT_THAT(*warning, HasSubstr("behind 12 of 12 of them"));
  EXPECT_THAT(*warning, HasSubstr("OpenCV's camera axes"));
  EXPECT_FALSE(WarnOfAxesTurnedAway(PoseFormat::kTransformsJson, orbit.cameras, orbit.points))
      << "points decide";
}

TEST(AxesTurnedAway, AreNotGuessedWhereAxesDoNotMeet) {
  Orbit forward, walk;
  for (size_t i = 0; i < forward.cameras.size(); ++i) {
    const auto x = static_cast<double>(i);
    // Parallel axes; and axes in many directions from places far apart.
    forward.cameras[i].cam_from_world = {Eigen::Quaterniond::Identity(), {x, 0, 0}};
    walk.cameras[i].cam_from_world.translation = {50 * std::sin(7 * x), 0, 50 * std::cos(5 * x)};
  }
  EXPECT_FALSE(WarnOfAxesTurnedAway(PoseFormat::kColmap, forward.cameras, {}));
  EXPECT_FALSE(WarnOfAxesTurnedAway(PoseFormat::kColmap, walk.cameras, {}));
}

// Returns a grey PNG of 40x30 pixels that is 255 up to column `width`.
std::string LeftOf(int width) {
  Image image{40, 30, 1, std::vector<uint8_t>(40 * 30, 0)};
  for (int i = 0; i < 40 * 30; ++i) image.pixels[static_cast<size_t>(i)] = i % 40 < width ? 255 : 0;
  return Png(image);
}

TEST(IgnoredScene, IsWarnedOfFromHalfOfThePixelsOn) {
  for (const int width : {10, 30}) {
    SmallDataset dataset;
    WriteBytes(dataset.folder / "ignore_mask.png", LeftOf(width));
    dataset.points.clear();
    dataset.Write();
    ASSERT_OK_AND_ASSIGN(const Capture capture, dataset.Import());
    EXPECT_EQ(WarnOfIgnoredScene(capture, true).has_value(), width == 30);
    EXPECT_FALSE(WarnOfIgnoredScene(capture, false)) << "a large transparent background";
    if (width == 30) {
      EXPECT_THAT(capture.warnings,
                  ::testing::Contains(HasSubstr("75 % of the pixels are ignored")));
    }
  }
}

TEST(IgnoredScene, IsWarnedOfWhereMostPointsAreIgnored) {
  SmallDataset dataset;
  WriteBytes(dataset.folder / "ignore_mask.png", LeftOf(12));
  dataset.points.clear();
  dataset.Write();
  ASSERT_OK_AND_ASSIGN(Capture capture, dataset.Import());
  EXPECT_FALSE(WarnOfIgnoredScene(capture, true));
  // At (5, 15) of each view, which are ignored.
  for (const View& view : capture.views) {
    const Pose world_from_cam = Inverted(view.cam_from_world);
    const Eigen::Vector3d at((5 - view.camera.cx) / view.camera.fx, 0, 1);
    capture.points.push_back({(world_from_cam * at).cast<float>(), {0, 0, 0}});
  }
  EXPECT_TRUE(WarnOfIgnoredScene(capture, true));
  const auto transparent = WarnOfIgnoredScene(capture, false);
  ASSERT_TRUE(transparent);
  EXPECT_THAT(*transparent, HasSubstr("alpha"));
}

TEST(IgnoredScene, IsRefusedIfNothingIsLeft) {
  SmallDataset dataset;
  WriteBytes(dataset.folder / "ignore_mask.png", LeftOf(40));
  dataset.Write();
  EXPECT_STATUS(dataset.Import(), absl::StatusCode::kInvalidArgument,
                "all pixels of 3 of 3 photographs are ignored");
}

// Scoring such a view fails, after the training.
TEST(IgnoredScene, LosesViewsThatAreIgnoredAsAWhole) {
  SmallDataset dataset;
  WriteBytes(dataset.folder / "ignore/b.png", LeftOf(40));
  dataset.Write();
  ASSERT_OK_AND_ASSIGN(const Capture capture, dataset.Import());
  ASSERT_EQ(capture.views.size(), 2u);
  EXPECT_EQ(capture.views[0].name, "a.jpg");
  EXPECT_THAT(capture.warnings, ::testing::Contains(HasSubstr("ignored as a whole and are left "
                                                              "out: b.jpg")));
}

TEST(DarkPhotographs, AreWarnedOf) {
  SmallDataset dataset;
  dataset.Write();
  ASSERT_OK_AND_ASSIGN(Capture capture, dataset.Import());
  EXPECT_FALSE(WarnOfDarkPhotographs(capture));
  // 12 bits in files of 16 bits.
  for (const char* name : {"images/a.jpg", "images/b.jpg", "images/sub/c.png"}) {
    Image photo = testing::Picture(40, 30);
    for (uint8_t& value : photo.pixels) value = static_cast<uint8_t>(value / 16);
    const bool png = std::string(name).ends_with("png");
    WriteBytes(dataset.folder / name, png ? Png(photo) : testing::Jpeg(photo));
  }
  ASSERT_OK_AND_ASSIGN(capture, dataset.Import());
  EXPECT_THAT(capture.warnings, ::testing::Contains(HasSubstr("nearly black")));
}

// COLMAP's masks, whose white says what to use, in masks/.
TEST(KeepMasks, AreWarnedOfWhereTheyAreTakenForSegments) {
  for (const int width : {15, 30}) {
    SmallDataset dataset;
    for (const char* name : {"masks/a.jpg.png", "masks/b.jpg.png"}) {
      WriteBytes(dataset.folder / name, LeftOf(width));
    }
    dataset.Write();
    std::filesystem::remove(dataset.folder / "masks/a.json");
    ASSERT_OK_AND_ASSIGN(const Capture capture, dataset.Import());
    EXPECT_THAT(capture.views[0].masks.num_masks, 1);
    EXPECT_EQ(WarnOfKeepMasks(capture).has_value(), width == 30);
    if (width == 30) {
      EXPECT_THAT(capture.warnings,
                  ::testing::Contains(HasSubstr("2 photographs have one mask each, which covers")));
    }
  }
}

}  // namespace
}  // namespace pepeseg
