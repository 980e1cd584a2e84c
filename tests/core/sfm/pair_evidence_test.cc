#include "core/sfm/pair_evidence.h"

#include <Eigen/Geometry>

#include "tests/core/sfm/compared_scene.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using ::testing::ElementsAre;

TEST(JudgePairs, CountsVerifiedPairs) {
  ComparedDatabase compared = testing::CompareScene();
  EXPECT_THAT(JudgePairs(compared).num_partners, ElementsAre(4, 4, 4, 4, 4));
  for (ComparedPair& pair : compared.pairs) {
    if (pair.first == 2 || pair.second == 2) pair.geometry.inliers.clear();
  }
  const PairEvidence evidence = JudgePairs(compared);
  EXPECT_THAT(evidence.num_partners, ElementsAre(3, 3, 0, 3, 3));
  EXPECT_EQ(evidence.names[2], "c1/000003.jpg");
  EXPECT_FALSE(evidence.turns_on_the_spot);
}

// Replaces the geometries by turns of a camera whose focal length is not known.
TEST(JudgePairs, NoticesATurnOnTheSpot) {
  ComparedDatabase compared = testing::CompareScene();
  const DatabaseCamera& camera = compared.features.cameras[0];
  Eigen::Matrix3d k = Eigen::Vector3d(1.1 * camera.width, 1.1 * camera.width, 1).asDiagonal();
  k(0, 2) = camera.width / 2.0;
  k(1, 2) = camera.height / 2.0;
  for (ComparedPair& pair : compared.pairs) {
    const double angle = 0.15 * static_cast<double>(pair.second - pair.first);
    const Eigen::AngleAxisd turn(angle, Eigen::Vector3d(0.2, 1, 0.1).normalized());
    pair.geometry.kind = TwoViewKind::kPlanarOrPanoramic;
    pair.geometry.homography = (k * turn.toRotationMatrix() * k.inverse()).normalized();
  }
  EXPECT_TRUE(JudgePairs(compared).turns_on_the_spot);
  // A plane seen from other places has no such focal length.
  for (ComparedPair& pair : compared.pairs) pair.geometry.homography(0, 0) *= 1.5;
  EXPECT_FALSE(JudgePairs(compared).turns_on_the_spot);
}

}  // namespace
}  // namespace pepeseg
