#include <gtest/gtest.h>

#include <string>

#include "absl/strings/str_cat.h"
#include "core/base/digest.h"
#include "tests/server/shelf_model.h"

namespace pepeseg {
namespace {

struct ExportMeshTest : ShelfModel {
  ExportMeshTest() {
    request.set_model(kModel);
    request.set_voxels(64);
  }
  grpc::Status Export() {
    grpc::ClientContext context;
    const auto stream = running.renders->ExportMesh(&context, request);
    v1::ExportMeshResponse part;
    header.Clear();
    file.clear();
    while (stream->Read(&part)) {
      if (part.has_header()) header = part.header();
      EXPECT_LE(part.chunk().size(), size_t{1} << 20);
      file += part.chunk();
    }
    return stream->Finish();
  }

  v1::ExportMeshRequest request;
  v1::ExportMeshResponse::Header header;
  std::string file;
};

TEST_F(ExportMeshTest, ExportsTheSceneAndASegment) {
  ASSERT_OK(Export());
  EXPECT_EQ(header.model(), "scenes/shelf/models/1");
  EXPECT_EQ(header.num_bytes(), static_cast<int64_t>(file.size()));
  EXPECT_EQ(header.sha256(), Sha256Hex(file));
  EXPECT_FALSE(header.has_origin());
  EXPECT_EQ(file.substr(0, 4), "ply\n");
  EXPECT_NE(file.find(absl::StrCat("element face ", header.num_triangles(), "\n")),
            std::string::npos);
  EXPECT_GT(header.num_triangles(), 1000);
  const std::string whole = file;
  ASSERT_OK(Export());
  EXPECT_EQ(file, whole);
  SetSegment(1, 2, *request.mutable_subset());
  request.set_format(v1::MESH_FORMAT_GLB);
  request.set_watertight(true);
  ASSERT_OK(Export());
  EXPECT_EQ(file.substr(0, 4), "glTF");
  EXPECT_EQ(header.sha256(), Sha256Hex(file));
  EXPECT_GT(header.num_triangles(), 200);
  request.set_max_triangles(header.num_triangles() / 2);
  ASSERT_OK(Export());
  EXPECT_LE(header.num_triangles(), request.max_triangles());
  EXPECT_EQ(header.sha256(), Sha256Hex(file));
}

TEST_F(ExportMeshTest, RefusesWhatItCannotMake) {
  for (const int voxels : {-1, 31, 1025}) {
    request.set_voxels(voxels);
    EXPECT_ERROR(Export(), grpc::INVALID_ARGUMENT, "voxels", "32..1024");
  }
  request.set_voxels(0);
  for (const int64_t triangles : {-1, 99}) {
    request.set_max_triangles(triangles);
    EXPECT_ERROR(Export(), grpc::INVALID_ARGUMENT, "max_triangles", "at least 100");
  }
  request.set_max_triangles(0);
  request.set_format(static_cast<v1::MeshFormat>(9));
  EXPECT_ERROR(Export(), grpc::INVALID_ARGUMENT, "format", "no format");
  request.set_format(v1::MESH_FORMAT_PLY);
  SetSegment(1, 3, *request.mutable_subset());
  EXPECT_ERROR(Export(), grpc::INVALID_ARGUMENT, "subset.segment.id", "'3': no segment");
  request.mutable_subset()->set_selection("nonsense");
  EXPECT_ERROR(Export(), grpc::INVALID_ARGUMENT, "subset.selection", "nonsense");
  EXPECT_TRUE(file.empty());
}

TEST_F(ExportMeshTest, FreesMemoryOfCancelledExports) {
  for (int i = 0; i < 15; ++i) {
    grpc::ClientContext context;
    const auto stream = running.renders->ExportMesh(&context, request);
    v1::ExportMeshResponse part;
    if (i % 2 == 0) {
      EXPECT_TRUE(stream->Read(&part));
    }
    context.TryCancel();
    while (stream->Read(&part)) {
    }
    EXPECT_ERROR(stream->Finish(), grpc::CANCELLED);
  }
  EXPECT_OK(Export());
}

}  // namespace
}  // namespace pepeseg
