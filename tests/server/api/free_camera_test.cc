#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "server/api/convert.h"
#include "server/api/segment_request.h"
#include "server/store/error_detail.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

v1::Viewpoint::FreeCamera GoodCamera() {
  v1::Viewpoint::FreeCamera free;
  free.mutable_camera()->set_width(64);
  free.mutable_camera()->set_height(48);
  free.mutable_camera()->set_fx(50);
  free.mutable_camera()->set_fy(51);
  free.mutable_camera()->set_cx(32);
  free.mutable_camera()->set_cy(24);
  v1::RigidTransform& pose = *free.mutable_cam_from_world();
  pose.mutable_rotation()->set_w(0.6);
  pose.mutable_rotation()->set_y(0.8);
  pose.mutable_translation()->set_x(1);
  pose.mutable_translation()->set_y(2);
  pose.mutable_translation()->set_z(3);
  return free;
}

TEST(FreeCamera, IsReadFieldByField) {
  ASSERT_OK_AND_ASSIGN(const auto view, FreeViewFromProto(GoodCamera(), "prompt.view.free"));
  EXPECT_EQ(view.camera.width, 64);
  EXPECT_EQ(view.camera.height, 48);
  EXPECT_EQ(view.camera.fy, 51);
  EXPECT_EQ(view.camera.cx, 32);
  EXPECT_EQ(view.cam_from_world.rotation.y(), 0.8);
  EXPECT_EQ(view.cam_from_world.translation.z(), 3.0);
  // Back to the contract.
  const v1::View proto = ToProto(view);
  EXPECT_EQ(proto.camera().DebugString(), GoodCamera().camera().DebugString());
  EXPECT_EQ(proto.cam_from_world().DebugString(), GoodCamera().cam_from_world().DebugString());
}

void ExpectRefused(const v1::Viewpoint::FreeCamera& camera, const std::string& field) {
  const auto view = FreeViewFromProto(camera, "viewpoint.free");
  ASSERT_TRUE(absl::IsInvalidArgument(view.status())) << field;
  EXPECT_EQ(DetailOf(view.status()).field, "viewpoint.free." + field);
  EXPECT_EQ(view.status().message().find("viewpoint.free." + field + ": "), 0u) << view.status();
}

TEST(FreeCamera, RefusesInvalidCameras) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  auto camera = GoodCamera();
  camera.mutable_camera()->set_fx(kNan);
  ExpectRefused(camera, "camera.fx");
  camera = GoodCamera();
  camera.mutable_camera()->set_fy(-1);
  ExpectRefused(camera, "camera.fy");
  camera = GoodCamera();
  camera.mutable_camera()->set_cx(kInfinity);
  ExpectRefused(camera, "camera.cx");
  camera = GoodCamera();
  camera.mutable_camera()->set_width(0);
  ExpectRefused(camera, "camera");
  camera = GoodCamera();
  camera.mutable_camera()->set_width(16384);
  camera.mutable_camera()->set_height(16384);
  ExpectRefused(camera, "camera");
  camera = GoodCamera();
  camera.mutable_cam_from_world()->mutable_translation()->set_y(kNan);
  ExpectRefused(camera, "cam_from_world.translation.y");
  camera = GoodCamera();
  camera.mutable_cam_from_world()->mutable_rotation()->set_x(kInfinity);
  ExpectRefused(camera, "cam_from_world.rotation.x");
  camera = GoodCamera();
  camera.mutable_cam_from_world()->mutable_rotation()->set_w(0.9);
  ExpectRefused(camera, "cam_from_world.rotation");
}

TEST(FreeCamera, NeedsARotationAndATranslation) {
  auto camera = GoodCamera();
  camera.mutable_cam_from_world()->clear_rotation();
  ExpectRefused(camera, "cam_from_world.rotation");
  camera = GoodCamera();
  camera.mutable_cam_from_world()->clear_translation();
  ExpectRefused(camera, "cam_from_world.translation");
  camera.clear_cam_from_world();
  ExpectRefused(camera, "cam_from_world.rotation");
}

}  // namespace
}  // namespace pepeseg
