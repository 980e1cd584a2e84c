#include "core/formats/gaussian_glb.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>

#include "nlohmann/json.hpp"
#include "tests/testing/gaussian_file.h"

namespace pepeseg {
namespace {

using nlohmann::json;
using testing::AllOf;
using testing::RandomGaussians;

// A GLB as a reader of glTF sees it.
struct Glb {
  json scene;
  std::string rows;

  explicit Glb(const GaussianGlbBlocks& blocks) {
    const std::string file = testing::FileOf(blocks);
    EXPECT_EQ(static_cast<int64_t>(file.size()), blocks.num_bytes());
    EXPECT_EQ(file.substr(0, 4), "glTF");
    EXPECT_EQ(NumberAt(file, 4), 2u);
    EXPECT_EQ(NumberAt(file, 8), file.size());
    const size_t json_bytes = NumberAt(file, 12);
    EXPECT_EQ(json_bytes % 4, 0u);
    EXPECT_EQ(file.substr(16, 4), "JSON");
    scene = json::parse(file.substr(20, json_bytes));
    if (20 + json_bytes == file.size()) return;
    EXPECT_EQ(NumberAt(file, 20 + json_bytes), file.size() - 28 - json_bytes);
    EXPECT_EQ(file.substr(24 + json_bytes, 4), std::string("BIN\0", 4));
    rows = file.substr(28 + json_bytes);
  }

  static uint32_t NumberAt(const std::string& bytes, size_t at) {
    uint32_t number = 0;
    std::memcpy(&number, bytes.data() + at, sizeof(number));
    return number;
  }
  const json& Accessor(const std::string& attribute) const {
    const json& names = scene["meshes"][0]["primitives"][0]["attributes"];
    return scene["accessors"][names.at(attribute).get<size_t>()];
  }
  size_t PositionOf(const std::string& attribute, size_t row) const {
    return Accessor(attribute)["byteOffset"].get<size_t>() +
           row * scene["bufferViews"][0]["byteStride"].get<size_t>();
  }
  float At(const std::string& attribute, size_t row, size_t component) const {
    float value = 0;
    std::memcpy(&value, rows.data() + PositionOf(attribute, row) + 4 * component, sizeof(value));
    return value;
  }
};

TEST(GaussianGlbBlocks, HaveTheAttributesOfTheExtension) {
  for (int degree = 0; degree <= kMaxShDegree; ++degree) {
    const Gaussians gaussians = RandomGaussians(20, degree);
    const Glb glb{GaussianGlbBlocks(gaussians, AllOf(gaussians))};
    EXPECT_EQ(glb.scene["extensionsUsed"], json::array({"KHR_gaussian_splatting"}));
    const json& primitive = glb.scene["meshes"][0]["primitives"][0];
    EXPECT_EQ(primitive["mode"], 0);
    EXPECT_EQ(primitive["extensions"]["KHR_gaussian_splatting"]["kernel"], "ellipse");
    EXPECT_EQ(primitive["attributes"].size(), 5u + NumShCoefficients(degree));
    const size_t stride = glb.scene["bufferViews"][0]["byteStride"];
    EXPECT_LE(stride, 252u);
    EXPECT_EQ(stride % 4, 0u);
    EXPECT_EQ(glb.rows.size(), 20 * stride);
    EXPECT_EQ(glb.scene["buffers"][0]["byteLength"], glb.rows.size());
    for (const json& accessor : glb.scene["accessors"]) EXPECT_EQ(accessor["count"], 20);
    EXPECT_FALSE(glb.scene["nodes"][0].contains("translation"));
  }
}

TEST(GaussianGlbBlocks, HoldActivatedParameters) {
  const Gaussians gaussians = RandomGaussians(50, 0);
  const Glb glb{GaussianGlbBlocks(gaussians, AllOf(gaussians))};
  for (size_t i = 0; i < 50; ++i) {
    EXPECT_EQ(glb.At("POSITION", i, 0), gaussians.Plane(kMeanPlane)[i]);
    EXPECT_EQ(glb.At("POSITION", i, 1), -gaussians.Plane(kMeanPlane + 1)[i]);
    EXPECT_EQ(glb.At("POSITION", i, 2), -gaussians.Plane(kMeanPlane + 2)[i]);
    double squares = 0;
    for (size_t k = 0; k < 4; ++k) {
      squares += std::pow(glb.At("KHR_gaussian_splatting:ROTATION", i, k), 2);
    }
    EXPECT_NEAR(squares, 1, 1e-6);
    EXPECT_FLOAT_EQ(glb.At("KHR_gaussian_splatting:SCALE", i, 2),
                    std::exp(gaussians.Plane(kLogScalePlane + 2)[i]));
    EXPECT_NEAR(glb.At("KHR_gaussian_splatting:OPACITY", i, 0),
                1 / (1 + std::exp(-double{gaussians.Plane(kOpacityPlane)[i]})), 1e-6);
    EXPECT_EQ(glb.At("KHR_gaussian_splatting:SH_DEGREE_0_COEF_0", i, 1),
              gaussians.Plane(kShPlane + 1)[i]);
  }
  const json& position = glb.Accessor("POSITION");
  for (int axis = 0; axis < 3; ++axis) {
    float least = std::numeric_limits<float>::infinity(), most = -least;
    for (size_t i = 0; i < 50; ++i) {
      least = std::min(least, glb.At("POSITION", i, axis));
      most = std::max(most, glb.At("POSITION", i, axis));
    }
    EXPECT_EQ(position["min"][axis].get<float>(), least);
    EXPECT_EQ(position["max"][axis].get<float>(), most);
  }
}

// COLOR_0 is linear: programs that show points only turn it into sRGB.
TEST(GaussianGlbBlocks, HaveALinearColourForPoints) {
  Gaussians gaussians = Gaussians::Zero(1, 0);
  gaussians.Plane(kRotationPlane)[0] = 1;
  gaussians.Plane(kShPlane)[0] = 0;      // 0.5 in sRGB
  gaussians.Plane(kShPlane + 1)[0] = 9;  // more than 1
  gaussians.Plane(kShPlane + 2)[0] = -9;
  const Glb glb{GaussianGlbBlocks(gaussians, {0})};
  EXPECT_EQ(glb.Accessor("COLOR_0")["normalized"], true);
  const size_t at = glb.PositionOf("COLOR_0", 0);
  EXPECT_EQ(static_cast<uint8_t>(glb.rows[at]), 55);  // 255 * ((0.5 + 0.055) / 1.055)^2.4 = 54.6
  EXPECT_EQ(static_cast<uint8_t>(glb.rows[at + 1]), 255);
  EXPECT_EQ(static_cast<uint8_t>(glb.rows[at + 2]), 0);
  EXPECT_EQ(static_cast<uint8_t>(glb.rows[at + 3]), 128);  // a logit of 0
}

// Returns the colour of a Gaussian from a direction, by the basis of the specification.
double ColourOf(const std::vector<double>& sh, double x, double y, double z) {
  const double xx = x * x, yy = y * y, zz = z * z;
  const double basis[] = {0.2820947917738781,
                          -0.4886025119029199 * y,
                          0.4886025119029199 * z,
                          -0.4886025119029199 * x,
                          1.092548430592079 * x * y,
                          -1.092548430592079 * y * z,
                          0.3153915652525200 * (2 * zz - xx - yy),
                          -1.092548430592079 * x * z,
                          0.5462742152960395 * (xx - yy),
                          -0.5900435899266435 * y * (3 * xx - yy),
                          2.890611442640554 * x * y * z,
                          -0.4570457994644657 * y * (4 * zz - xx - yy),
                          0.3731763325901154 * z * (2 * zz - 3 * xx - 3 * yy),
                          -0.4570457994644657 * x * (4 * zz - xx - yy),
                          1.445305721320277 * z * (xx - yy),
                          -0.5900435899266435 * x * (xx - 3 * yy)};
  double sum = 0;
  for (size_t k = 0; k < sh.size(); ++k) sum += sh[k] * basis[k];
  return sum;
}

TEST(GaussianGlbBlocks, TurnColoursWithTheWorld) {
  const Gaussians gaussians = RandomGaussians(1, 3);
  const Glb glb{GaussianGlbBlocks(gaussians, {0})};
  std::vector<double> before, after;
  for (int degree = 0; degree <= 3; ++degree) {
    for (int i = 0; i < 2 * degree + 1; ++i) {
      before.push_back(gaussians.Plane(kShPlane + 3 * (degree * degree + i) + 2)[0]);
      after.push_back(glb.At("KHR_gaussian_splatting:SH_DEGREE_" + std::to_string(degree) +
                                 "_COEF_" + std::to_string(i),
                             0, 2));
    }
  }
  for (const auto& [x, y, z] : {std::array{0.6, 0.0, 0.8}, {0.0, 1.0, 0.0}, {0.36, -0.48, 0.8}}) {
    EXPECT_NEAR(ColourOf(before, x, y, z), ColourOf(after, x, -y, -z), 1e-5);
  }
}

// The ellipsoid of a Gaussian: R S S R^T.
Eigen::Matrix3d Ellipsoid(const Eigen::Quaterniond& rotation, const Eigen::Vector3d& scales) {
  const Eigen::Matrix3d axes = rotation.normalized().toRotationMatrix() * scales.asDiagonal();
  return axes * axes.transpose();
}

TEST(GaussianGlbBlocks, TurnEllipsoidsWithTheWorld) {
  const Gaussians gaussians = RandomGaussians(1, 0);
  const Glb glb{GaussianGlbBlocks(gaussians, {0})};
  const auto value = [&](int plane) { return double{gaussians.Plane(plane)[0]}; };
  const Eigen::Vector3d scales(std::exp(value(kLogScalePlane)), std::exp(value(kLogScalePlane + 1)),
                               std::exp(value(kLogScalePlane + 2)));
  const Eigen::Quaterniond rotation(value(kRotationPlane), value(kRotationPlane + 1),
                                    value(kRotationPlane + 2), value(kRotationPlane + 3));
  const auto written = [&](size_t k) { return glb.At("KHR_gaussian_splatting:ROTATION", 0, k); };
  const Eigen::Quaterniond turned(written(3), written(0), written(1), written(2));
  const Eigen::DiagonalMatrix<double, 3> turn(1, -1, -1);
  EXPECT_LT((turn * Ellipsoid(rotation, scales) * turn - Ellipsoid(turned, scales)).norm(), 1e-5);
}

TEST(GaussianGlbBlocks, MoveTheNodeToTheWorld) {
  const Gaussians gaussians = RandomGaussians(3, 0);
  const Glb glb{GaussianGlbBlocks(gaussians, {2}, Eigen::Vector3d(4e5, 5.3e6, 100.125))};
  EXPECT_EQ(glb.scene["nodes"][0]["translation"], json::array({4e5, -5.3e6, -100.125}));
  EXPECT_EQ(glb.At("POSITION", 0, 0), gaussians.Plane(kMeanPlane)[2]);
}

TEST(GaussianGlbBlocks, HaveNoMeshWithoutGaussians) {
  const Gaussians gaussians = RandomGaussians(3, 1);
  const Glb glb{GaussianGlbBlocks(gaussians, {})};
  EXPECT_FALSE(glb.scene.contains("meshes"));
  EXPECT_EQ(glb.scene["asset"]["version"], "2.0");
}

TEST(GaussianGlbBlocks, JoinBlocksOfThousands) {
  const Gaussians gaussians = RandomGaussians(10'000, 3);
  const GaussianGlbBlocks blocks(gaussians, AllOf(gaussians));
  EXPECT_GT(blocks.num_blocks(), 3);
  const Glb glb(blocks);
  EXPECT_EQ(glb.At("POSITION", 9'999, 0), gaussians.Plane(kMeanPlane)[9'999]);
}

}  // namespace
}  // namespace pepeseg
