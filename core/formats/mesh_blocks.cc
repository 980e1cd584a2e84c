#include "core/formats/mesh_blocks.h"

#include <algorithm>
#include <utility>

namespace pepeseg {
namespace {

int64_t BlocksOf(int64_t rows, int64_t row_bytes) {
  const int64_t per_block = MeshBlocks::kMaxBlockBytes / row_bytes;
  return (rows + per_block - 1) / per_block;
}

}  // namespace

MeshBlocks::MeshBlocks(TriangleMesh mesh) : mesh_(std::move(mesh)) {}

void MeshBlocks::SetLayout(std::string header, int64_t vertex_bytes, int64_t triangle_bytes) {
  header_ = std::move(header);
  vertex_bytes_ = vertex_bytes;
  triangle_bytes_ = triangle_bytes;
}

int64_t MeshBlocks::NumVertexBlocks() const {
  return BlocksOf(mesh_.num_vertices(), vertex_bytes_);
}

int64_t MeshBlocks::num_blocks() const {
  return 1 + NumVertexBlocks() + BlocksOf(mesh_.num_triangles(), triangle_bytes_);
}

int64_t MeshBlocks::num_bytes() const {
  return static_cast<int64_t>(header_.size()) + mesh_.num_vertices() * vertex_bytes_ +
         mesh_.num_triangles() * triangle_bytes_;
}

std::string MeshBlocks::Encode(int64_t block) const {
  if (block == 0) return header_;
  --block;
  const bool of_vertices = block < NumVertexBlocks();
  if (!of_vertices) block -= NumVertexBlocks();
  const int64_t row_bytes = of_vertices ? vertex_bytes_ : triangle_bytes_;
  const int64_t num_rows = of_vertices ? mesh_.num_vertices() : mesh_.num_triangles();
  const int64_t first = block * (kMaxBlockBytes / row_bytes);
  const int64_t count = std::min(kMaxBlockBytes / row_bytes, num_rows - first);
  std::string rows(static_cast<size_t>(count * row_bytes), '\0');
  for (int64_t i = 0; i < count; ++i) {
    char* const row = rows.data() + i * row_bytes;
    if (of_vertices) {
      EncodeVertex(first + i, row);
    } else {
      EncodeTriangle(first + i, row);
    }
  }
  return rows;
}

}  // namespace pepeseg
