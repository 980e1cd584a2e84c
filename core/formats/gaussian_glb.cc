#include "core/formats/gaussian_glb.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/formats/glb_parts.h"
#include "core/formats/y_up.h"
#include "nlohmann/json.hpp"

namespace pepeseg {
namespace {

using Json = nlohmann::ordered_json;

constexpr char kExtension[] = "KHR_gaussian_splatting";
constexpr int kPoints = 0;              // a mode of glTF 2.0
constexpr float kShBase = 0.28209479f;  // the basis function of degree 0

// The attributes of a row, in their order.
struct Attribute {
  std::string name;
  const char* type;
  int num_values;
  bool is_bytes = false;  // else floats

  int num_bytes() const { return is_bytes ? num_values : num_values * 4; }
};

// At most 240 bytes: glTF allows 252.
std::vector<Attribute> AttributesOf(int sh_degree) {
  const std::string prefix = absl::StrCat(kExtension, ":");
  std::vector<Attribute> attributes = {{"POSITION", "VEC3", 3},
                                       {prefix + "ROTATION", "VEC4", 4},
                                       {prefix + "SCALE", "VEC3", 3},
                                       {prefix + "OPACITY", "SCALAR", 1},
                                       {"COLOR_0", "VEC4", 4, /*is_bytes=*/true}};
  for (int degree = 0; degree <= sh_degree; ++degree) {
    for (int i = 0; i < 2 * degree + 1; ++i) {
      attributes.push_back({absl::StrCat(prefix, "SH_DEGREE_", degree, "_COEF_", i), "VEC3", 3});
    }
  }
  return attributes;
}

int64_t RowBytesOf(const std::vector<Attribute>& attributes) {
  int64_t bytes = 0;
  for (const Attribute& attribute : attributes) bytes += attribute.num_bytes();
  return bytes;
}

struct Box {
  std::array<float, 3> min, max;
};

// The description of a file without Gaussians: glTF has no empty arrays.
Json EmptyScene() { return {{"asset", {{"version", "2.0"}, {"generator", "pepeseg"}}}}; }

// The description of a file with `count` rows, at least one.
Json SceneOf(const std::vector<Attribute>& attributes, int64_t count, const Box& box,
             const Eigen::Vector3d& translation) {
  const int64_t row_bytes = RowBytesOf(attributes);
  Json names, accessors = Json::array();
  int offset = 0;
  for (const Attribute& attribute : attributes) {
    names[attribute.name] = accessors.size();
    Json accessor = {{"bufferView", 0},
                     {"byteOffset", offset},
                     {"componentType", attribute.is_bytes ? kGltfUnsignedByte : kGltfFloat},
                     {"count", count},
                     {"type", attribute.type}};
    if (attribute.is_bytes) accessor["normalized"] = true;
    if (offset == 0) {  // the positions, of which glTF wants the bounds
      accessor["min"] = box.min;
      accessor["max"] = box.max;
    }
    accessors.push_back(std::move(accessor));
    offset += attribute.num_bytes();
  }
  Json node = {{"name", "gaussians"}, {"mesh", 0}};
  if (!translation.isZero(0)) {
    node["translation"] = {kYUpMean[0] * translation.x(), kYUpMean[1] * translation.y(),
                           kYUpMean[2] * translation.z()};
  }
  const Json splats = {{"kernel", "ellipse"},
                       {"colorSpace", "srgb_rec709_display"},
                       {"sortingMethod", "cameraDistance"},
                       {"projection", "perspective"}};
  Json scene = EmptyScene();
  scene.update({{"extensionsUsed", {kExtension}},
                {"scene", 0},
                {"scenes", {{{"nodes", {0}}}}},
                {"nodes", {std::move(node)}},
                {"meshes",
                 {{{"primitives",
                    {{{"attributes", std::move(names)},
                      {"mode", kPoints},
                      {"extensions", {{kExtension, splats}}}}}}}}},
                {"accessors", std::move(accessors)},
                {"bufferViews",
                 {{{"buffer", 0},
                   {"byteLength", count * row_bytes},
                   {"byteStride", row_bytes},
                   {"target", kGltfArrayBuffer}}}},
                {"buffers", {{{"byteLength", count * row_bytes}}}}});
  return scene;
}

// Returns the byte of a value in [0, 1].
uint8_t ByteOf(float value) {
  return static_cast<uint8_t>(std::lround(255 * std::clamp(value, 0.0f, 1.0f)));
}

// Writes the values of a row one after the other.
struct RowWriter {
  char* to;

  void Float(float value) {
    std::memcpy(to, &value, sizeof(value));
    to += sizeof(value);
  }
  void Byte(uint8_t value) { *to++ = static_cast<char>(value); }
};

}  // namespace

GaussianGlbBlocks::GaussianGlbBlocks(const Gaussians& gaussians, std::vector<uint32_t> indices,
                                     const Eigen::Vector3d& translation)
    : GaussianRowBlocks(gaussians, std::move(indices)) {
  const std::vector<Attribute> attributes = AttributesOf(gaussians.sh_degree);
  const int64_t row_bytes = RowBytesOf(attributes);
  if (num_gaussians() == 0) {
    SetLayout(GlbHeader(EmptyScene().dump(), 0), row_bytes);
    return;
  }
  Box box;
  for (int axis = 0; axis < 3; ++axis) {
    box.min[axis] = std::numeric_limits<float>::infinity();
    box.max[axis] = -box.min[axis];
    for (int64_t row = 0; row < num_gaussians(); ++row) {
      const float value = kYUpMean[axis] * ValueOf(kMeanPlane + axis, row);
      box.min[axis] = std::min(box.min[axis], value);
      box.max[axis] = std::max(box.max[axis], value);
    }
  }
  SetLayout(GlbHeader(SceneOf(attributes, num_gaussians(), box, translation).dump(),
                      static_cast<size_t>(num_gaussians() * row_bytes)),
            row_bytes);
}

std::string GaussianGlbBlocks::EncodeRows(int64_t first, int64_t count) const {
  std::string rows(static_cast<size_t>(count * row_bytes()), '\0');
  RowWriter out = {rows.data()};
  for (int64_t row = first; row < first + count; ++row) {
    for (int k = 0; k < 3; ++k) out.Float(kYUpMean[k] * ValueOf(kMeanPlane + k, row));
    std::array<float, 4> rotation;  // w, x, y, z
    for (int k = 0; k < 4; ++k) rotation[k] = kYUpRotation[k] * ValueOf(kRotationPlane + k, row);
    const float length =
        std::hypot(std::hypot(rotation[0], rotation[1]), std::hypot(rotation[2], rotation[3]));
    for (const int k : {1, 2, 3, 0}) out.Float(rotation[k] / length);
    for (int k = 0; k < 3; ++k) out.Float(std::exp(ValueOf(kLogScalePlane + k, row)));
    const float opacity = OpacityOf(row);
    out.Float(opacity);
    for (int k = 0; k < 3; ++k) {
      out.Byte(ByteOf(LinearOfSrgb(0.5f + kShBase * ValueOf(kShPlane + k, row))));
    }
    out.Byte(ByteOf(opacity));
    for (int k = 0; k < NumShCoefficients(gaussians_.sh_degree); ++k) {
      for (int c = 0; c < 3; ++c) out.Float(kYUpSh[k] * ValueOf(kShPlane + 3 * k + c, row));
    }
  }
  return rows;
}

}  // namespace pepeseg
