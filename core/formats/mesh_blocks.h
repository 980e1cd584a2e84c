#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <string>

#include "core/formats/gaussian_ply.h"
#include "core/scene/triangle_mesh.h"

namespace pepeseg {

// Encodes a mesh as a file of some format, in blocks, as GaussianBlocks does: a header, then a row
// for each vertex, then a row for each triangle. A block has the same bytes each time that it is
// encoded. Thread safe.
class MeshBlocks {
 public:
  static constexpr int64_t kMaxBlockBytes = int64_t{1} << 20;

  virtual ~MeshBlocks() = default;

  const TriangleMesh& mesh() const { return mesh_; }
  int64_t num_blocks() const;
  // Sum over all blocks.
  int64_t num_bytes() const;
  // Returns a block, 0 <= block < num_blocks(), of at most kMaxBlockBytes. Block 0 is the header.
  std::string Encode(int64_t block) const;

 protected:
  explicit MeshBlocks(TriangleMesh mesh);
  // Sets what the file consists of. The constructor of each format calls it.
  void SetLayout(std::string header, int64_t vertex_bytes, int64_t triangle_bytes);
  // Writes the row of a vertex or of a triangle, which is zeros, to `row`.
  virtual void EncodeVertex(int64_t vertex, char* row) const = 0;
  virtual void EncodeTriangle(int64_t triangle, char* row) const = 0;

 private:
  int64_t NumVertexBlocks() const;

  const TriangleMesh mesh_;
  std::string header_;
  int64_t vertex_bytes_ = 1, triangle_bytes_ = 1;
};

// Returns the mesh as a binary little-endian PLY: vertices x y z nx ny nz red green blue, and faces
// with the list vertex_indices. `origin` and `coordinates`: as in GaussianPlyBlocks.
std::unique_ptr<const MeshBlocks> MeshPly(TriangleMesh mesh, const Eigen::Vector3d& origin,
                                          PlyCoordinates coordinates = PlyCoordinates::kWorld);

// Returns the mesh as a binary glTF 2.0: POSITION, NORMAL, COLOR_0 (linear) and indices, with a
// rough material that is seen from both sides. The axes are those of glTF (y_up.h), the positions
// relative to the model's origin; `translation`, in the axes of the dataset, moves the node to the
// world.
std::unique_ptr<const MeshBlocks> MeshGlb(TriangleMesh mesh, const Eigen::Vector3d& translation);

}  // namespace pepeseg
