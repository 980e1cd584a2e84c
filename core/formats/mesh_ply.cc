#include <cstring>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/formats/mesh_blocks.h"

namespace pepeseg {
namespace {

class MeshPlyBlocks final : public MeshBlocks {
 public:
  MeshPlyBlocks(TriangleMesh of, const Eigen::Vector3d& origin, PlyCoordinates coordinates)
      : MeshBlocks(std::move(of)) {
    std::string header = "ply\nformat binary_little_endian 1.0\n";
    if (coordinates == PlyCoordinates::kWorld) {
      added_ = origin;
    } else if (!origin.isZero(0)) {
      absl::StrAppendFormat(&header, "comment pepeseg_origin %.17g %.17g %.17g\n", origin.x(),
                            origin.y(), origin.z());
    }
    const char* const type = HasDoubles() ? "double" : "float";
    absl::StrAppend(&header, "element vertex ", mesh().num_vertices(), "\n");
    for (const char* name : {"x", "y", "z"}) {
      absl::StrAppend(&header, "property ", type, " ", name, "\n");
    }
    for (const char* name : {"nx", "ny", "nz"}) {
      absl::StrAppend(&header, "property float ", name, "\n");
    }
    for (const char* name : {"red", "green", "blue"}) {
      absl::StrAppend(&header, "property uchar ", name, "\n");
    }
    absl::StrAppend(&header, "element face ", mesh().num_triangles(),
                    "\nproperty list uchar int vertex_indices\nend_header\n");
    SetLayout(std::move(header), static_cast<int64_t>(PositionBytes() + 3 * sizeof(float) + 3),
              1 + 3 * sizeof(int32_t));
  }

 private:
  // Positions far from zero need doubles once the origin is added to them.
  bool HasDoubles() const { return !added_.isZero(0); }
  size_t PositionBytes() const { return 3 * (HasDoubles() ? sizeof(double) : sizeof(float)); }

  void EncodeVertex(int64_t vertex, char* row) const override {
    const auto at = static_cast<size_t>(vertex);
    const Eigen::Vector3f& position = mesh().positions[at];
    if (HasDoubles()) {
      const Eigen::Vector3d in_world = position.cast<double>() + added_;
      std::memcpy(row, in_world.data(), 3 * sizeof(double));
    } else {
      std::memcpy(row, position.data(), 3 * sizeof(float));
    }
    row += PositionBytes();
    std::memcpy(row, mesh().normals[at].data(), 3 * sizeof(float));
    std::memcpy(row + 3 * sizeof(float), mesh().colors[at].data(), 3);
  }
  void EncodeTriangle(int64_t triangle, char* row) const override {
    *row = 3;
    std::memcpy(row + 1, mesh().triangles[static_cast<size_t>(triangle)].data(),
                3 * sizeof(uint32_t));
  }

  Eigen::Vector3d added_ = Eigen::Vector3d::Zero();  // to the positions
};

}  // namespace

std::unique_ptr<const MeshBlocks> MeshPly(TriangleMesh mesh, const Eigen::Vector3d& origin,
                                          PlyCoordinates coordinates) {
  return std::make_unique<MeshPlyBlocks>(std::move(mesh), origin, coordinates);
}

}  // namespace pepeseg
