#include "core/formats/mesh_blocks.h"

#include <gtest/gtest.h>

#include <cstring>
#include <random>

#include "nlohmann/json.hpp"

namespace pepeseg {
namespace {

// A mesh whose file has several blocks.
TriangleMesh ManyTriangles() {
  TriangleMesh mesh;
  std::mt19937 random(7);
  std::normal_distribution<float> normal;
  for (int i = 0; i < 90'000; ++i) {
    mesh.positions.emplace_back(normal(random), normal(random), normal(random));
    mesh.normals.push_back(Eigen::Vector3f(normal(random), 1, normal(random)).normalized());
    mesh.colors.push_back({static_cast<uint8_t>(random()), static_cast<uint8_t>(random()), 255});
  }
  for (uint32_t i = 0; i + 2 < 90'000; ++i) mesh.triangles.push_back({i, i + 1, i + 2});
  return mesh;
}

std::string FileOfMesh(const MeshBlocks& blocks) {
  std::string file;
  for (int64_t i = 0; i < blocks.num_blocks(); ++i) {
    const std::string block = blocks.Encode(i);
    EXPECT_LE(static_cast<int64_t>(block.size()), MeshBlocks::kMaxBlockBytes);
    EXPECT_EQ(block, blocks.Encode(i));
    file += block;
  }
  EXPECT_EQ(static_cast<int64_t>(file.size()), blocks.num_bytes());
  return file;
}

template <typename T>
T ValueIn(const std::string& bytes, size_t at) {
  T value;
  std::memcpy(&value, bytes.data() + at, sizeof(value));
  return value;
}

TEST(MeshPly, HasVerticesAndFaces) {
  const TriangleMesh mesh = ManyTriangles();
  const auto blocks = MeshPly(mesh, {0, 0, 0});
  EXPECT_GT(blocks->num_blocks(), 3);
  const std::string file = FileOfMesh(*blocks);
  const std::string header =
      "ply\nformat binary_little_endian 1.0\nelement vertex 90000\n"
      "property float x\nproperty float y\nproperty float z\n"
      "property float nx\nproperty float ny\nproperty float nz\n"
      "property uchar red\nproperty uchar green\nproperty uchar blue\n"
      "element face 89998\nproperty list uchar int vertex_indices\nend_header\n";
  ASSERT_EQ(file.substr(0, header.size()), header);
  constexpr size_t kVertexBytes = 27, kFaceBytes = 13;
  ASSERT_EQ(file.size(), header.size() + 90'000 * kVertexBytes + 89'998 * kFaceBytes);
  for (const size_t i : {size_t{0}, size_t{45'001}, size_t{89'997}}) {
    const size_t vertex = header.size() + i * kVertexBytes;
    for (int k = 0; k < 3; ++k) {
      EXPECT_EQ(ValueIn<float>(file, vertex + 4 * k), mesh.positions[i][k]);
      EXPECT_EQ(ValueIn<float>(file, vertex + 12 + 4 * k), mesh.normals[i][k]);
      EXPECT_EQ(ValueIn<uint8_t>(file, vertex + 24 + k), mesh.colors[i][k]);
    }
    const size_t face = header.size() + 90'000 * kVertexBytes + i * kFaceBytes;
    EXPECT_EQ(file[face], 3);
    for (int k = 0; k < 3; ++k) {
      EXPECT_EQ(ValueIn<uint32_t>(file, face + 1 + 4 * k), mesh.triangles[i][k]);
    }
  }
}

TEST(MeshPly, HasDoublesFarFromZero) {
  TriangleMesh mesh;
  mesh.positions = {{1, 2, 3}, {0, 0, 0}, {1, 0, 0}};
  mesh.normals.assign(3, {0, 0, 1});
  mesh.colors.assign(3, {1, 2, 3});
  mesh.triangles = {{0, 1, 2}};
  const Eigen::Vector3d origin(500'000.25, 4e6, 100);
  const std::string world = FileOfMesh(*MeshPly(mesh, origin));
  EXPECT_NE(world.find("property double x\n"), std::string::npos);
  const size_t first = world.find("end_header\n") + 11;
  EXPECT_EQ(ValueIn<double>(world, first), 500'001.25);
  EXPECT_EQ(ValueIn<double>(world, first + 16), 103);
  EXPECT_EQ(ValueIn<uint8_t>(world, first + 36 + 2), 3);
  const std::string local = FileOfMesh(*MeshPly(mesh, origin, PlyCoordinates::kLocal));
  EXPECT_NE(local.find("comment pepeseg_origin 500000.25 4000000 100\n"), std::string::npos);
  EXPECT_EQ(ValueIn<float>(local, local.find("end_header\n") + 11 + 8), 3);
}

TEST(MeshGlb, HasAttributesAndIndices) {
  using nlohmann::json;
  const TriangleMesh mesh = ManyTriangles();
  const std::string file = FileOfMesh(*MeshGlb(mesh, {1, 2, 3}));
  EXPECT_EQ(file.substr(0, 4), "glTF");
  EXPECT_EQ(ValueIn<uint32_t>(file, 8), file.size());
  const size_t json_bytes = ValueIn<uint32_t>(file, 12);
  const json scene = json::parse(file.substr(20, json_bytes));
  const size_t buffer = 28 + json_bytes;
  EXPECT_EQ(buffer % 4, 0u);
  EXPECT_EQ(scene["buffers"][0]["byteLength"], file.size() - buffer);
  EXPECT_EQ(scene["nodes"][0]["translation"], json({1, -2, -3}));
  const json& primitive = scene["meshes"][0]["primitives"][0];
  EXPECT_EQ(primitive["attributes"], json({{"POSITION", 0}, {"NORMAL", 1}, {"COLOR_0", 2}}));
  const json& accessors = scene["accessors"];
  EXPECT_EQ(accessors[0]["count"], 90'000);
  EXPECT_EQ(accessors[3]["count"], 3 * 89'998);
  EXPECT_EQ(accessors[2]["normalized"], true);
  const json& views = scene["bufferViews"];
  EXPECT_EQ(views[0]["byteStride"], 32);
  EXPECT_EQ(views[1]["byteOffset"], 90'000 * 32);
  float least = 0;
  for (const Eigen::Vector3f& position : mesh.positions) least = std::min(least, -position.y());
  EXPECT_EQ(accessors[0]["min"][1].get<float>(), least);
  for (const size_t i : {size_t{0}, size_t{50'000}, size_t{89'997}}) {
    const size_t vertex = buffer + 32 * i;
    EXPECT_EQ(ValueIn<float>(file, vertex), mesh.positions[i].x());
    EXPECT_EQ(ValueIn<float>(file, vertex + 4), -mesh.positions[i].y());
    EXPECT_EQ(ValueIn<float>(file, vertex + 20), -mesh.normals[i].z());
    const double srgb = mesh.colors[i][0] / 255.0;
    const double linear = srgb <= 0.04045 ? srgb / 12.92 : std::pow((srgb + 0.055) / 1.055, 2.4);
    EXPECT_NEAR(ValueIn<uint16_t>(file, vertex + 24), 65535 * linear, 1);
    EXPECT_EQ(ValueIn<uint16_t>(file, vertex + 28), 65535);
    EXPECT_EQ(ValueIn<uint16_t>(file, vertex + 30), 65535);
    for (int k = 0; k < 3; ++k) {
      EXPECT_EQ(ValueIn<uint32_t>(file, buffer + 90'000 * 32 + 12 * i + 4 * k),
                mesh.triangles[i][k]);
    }
  }
}

TEST(MeshGlb, HasNoMeshWithoutTriangles) {
  const std::string file = FileOfMesh(*MeshGlb({}, {0, 0, 0}));
  EXPECT_EQ(ValueIn<uint32_t>(file, 8), file.size());
  const auto scene = nlohmann::json::parse(file.substr(20));
  EXPECT_FALSE(scene.contains("meshes"));
}

}  // namespace
}  // namespace pepeseg
