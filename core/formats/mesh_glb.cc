#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <utility>

#include "core/formats/glb_parts.h"
#include "core/formats/mesh_blocks.h"
#include "core/formats/y_up.h"
#include "nlohmann/json.hpp"

namespace pepeseg {
namespace {

using MeshJson = nlohmann::ordered_json;

constexpr int64_t kNormalOffset = 12, kColorOffset = 24;
constexpr int64_t kGlbVertexBytes = 32, kGlbTriangleBytes = 12;

std::array<float, 3> YUp(const Eigen::Vector3f& of) {
  return {kYUpMean[0] * of.x(), kYUpMean[1] * of.y(), kYUpMean[2] * of.z()};
}

// The description of a file. glTF has no empty arrays: without triangles there is no mesh.
MeshJson DescriptionOf(const TriangleMesh& mesh, const Eigen::Vector3d& translation) {
  MeshJson scene = {{"asset", {{"version", "2.0"}, {"generator", "pepeseg"}}}};
  if (mesh.num_triangles() == 0) return scene;
  std::array<float, 3> min = YUp(mesh.positions[0]), max = min;
  for (const Eigen::Vector3f& position : mesh.positions) {
    const std::array<float, 3> at = YUp(position);
    for (int k = 0; k < 3; ++k) {
      min[k] = std::min(min[k], at[k]);
      max[k] = std::max(max[k], at[k]);
    }
  }
  MeshJson node = {{"name", "mesh"}, {"mesh", 0}};
  if (!translation.isZero(0)) {
    node["translation"] = {kYUpMean[0] * translation.x(), kYUpMean[1] * translation.y(),
                           kYUpMean[2] * translation.z()};
  }
  const int64_t vertices = mesh.num_vertices() * kGlbVertexBytes;
  const int64_t triangles = mesh.num_triangles() * kGlbTriangleBytes;
  const auto attribute = [&mesh](int64_t offset, int type) {
    return MeshJson{{"bufferView", 0},
                    {"byteOffset", offset},
                    {"componentType", type},
                    {"count", mesh.num_vertices()},
                    {"type", type == kGltfFloat ? "VEC3" : "VEC4"}};
  };
  MeshJson accessors = MeshJson::array();
  accessors.push_back(attribute(0, kGltfFloat));
  accessors.back()["min"] = min;
  accessors.back()["max"] = max;
  accessors.push_back(attribute(kNormalOffset, kGltfFloat));
  accessors.push_back(attribute(kColorOffset, kGltfUnsignedShort));
  accessors.back()["normalized"] = true;
  accessors.push_back({{"bufferView", 1},
                       {"componentType", kGltfUnsignedInt},
                       {"count", 3 * mesh.num_triangles()},
                       {"type", "SCALAR"}});
  scene.update({{"scene", 0},
                {"scenes", {{{"nodes", {0}}}}},
                {"nodes", {std::move(node)}},
                {"meshes",
                 {{{"primitives",
                    {{{"attributes", {{"POSITION", 0}, {"NORMAL", 1}, {"COLOR_0", 2}}},
                      {"indices", 3},
                      {"material", 0}}}}}}},
                {"materials",
                 {{{"pbrMetallicRoughness", {{"metallicFactor", 0}, {"roughnessFactor", 1}}},
                   {"doubleSided", true}}}},
                {"accessors", std::move(accessors)},
                {"bufferViews",
                 {{{"buffer", 0},
                   {"byteLength", vertices},
                   {"byteStride", kGlbVertexBytes},
                   {"target", kGltfArrayBuffer}},
                  {{"buffer", 0},
                   {"byteOffset", vertices},
                   {"byteLength", triangles},
                   {"target", kGltfElementArrayBuffer}}}},
                {"buffers", {{{"byteLength", vertices + triangles}}}}});
  return scene;
}

class MeshGlbBlocks final : public MeshBlocks {
 public:
  MeshGlbBlocks(TriangleMesh of, const Eigen::Vector3d& translation) : MeshBlocks(std::move(of)) {
    for (int i = 0; i < 256; ++i) {
      linear_[i] =
          static_cast<uint16_t>(std::lround(65535 * LinearOfSrgb(static_cast<float>(i) / 255)));
    }
    const int64_t bytes =
        mesh().num_triangles() == 0
            ? 0
            : mesh().num_vertices() * kGlbVertexBytes + mesh().num_triangles() * kGlbTriangleBytes;
    SetLayout(GlbHeader(DescriptionOf(mesh(), translation).dump(), static_cast<size_t>(bytes)),
              kGlbVertexBytes, kGlbTriangleBytes);
  }

 private:
  void EncodeVertex(int64_t vertex, char* row) const override {
    const auto at = static_cast<size_t>(vertex);
    const std::array<float, 3> position = YUp(mesh().positions[at]);
    const std::array<float, 3> normal = YUp(mesh().normals[at]);
    std::array<uint16_t, 4> color = {0, 0, 0, 65535};
    for (int k = 0; k < 3; ++k) color[k] = linear_[mesh().colors[at][k]];
    std::memcpy(row, position.data(), sizeof(position));
    std::memcpy(row + kNormalOffset, normal.data(), sizeof(normal));
    std::memcpy(row + kColorOffset, color.data(), sizeof(color));
  }
  void EncodeTriangle(int64_t triangle, char* row) const override {
    // A turn by 180 degrees keeps what is counterclockwise.
    std::memcpy(row, mesh().triangles[static_cast<size_t>(triangle)].data(), kGlbTriangleBytes);
  }

  std::array<uint16_t, 256> linear_;  // of an sRGB value
};

}  // namespace

std::unique_ptr<const MeshBlocks> MeshGlb(TriangleMesh mesh, const Eigen::Vector3d& translation) {
  if (mesh.num_triangles() == 0) mesh = {};
  return std::make_unique<MeshGlbBlocks>(std::move(mesh), translation);
}

}  // namespace pepeseg
