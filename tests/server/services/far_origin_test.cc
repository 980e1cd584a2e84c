#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "core/base/digest.h"
#include "core/formats/gaussian_ply.h"
#include "tests/server/service_test.h"

// A model whose origin is far from zero in its dataset's world: callers see coordinates of the
// dataset, as for any other model.

namespace pepeseg {
namespace {

const Eigen::Vector3d kOrigin(4e5, 5.3e6, 100);
constexpr char kModel[] = "scenes/town/models/live";

struct FarOriginTest : ServiceTest {
  FarOriginTest() : ServiceTest(PEPESEG_MODEL_WORKER) {
    running.CreateScene("town");
    TrainToTheEnd("town", "far.model");
  }

  v1::View ListedView(const std::string& name) {
    const v1::ListViewsResponse response = *Call(&SceneStub::ListViews, Under{kModel});
    for (const v1::View& view : response.views()) {
      if (view.view() == name) return view;
    }
    ADD_FAILURE() << "no view " << name;
    return {};
  }
  std::string Render(const v1::Viewpoint& viewpoint) {
    v1::RenderViewRequest request;
    request.set_model(kModel);
    *request.mutable_viewpoint() = viewpoint;
    return Call(&RenderStub::RenderView, request)->png();
  }
  std::string Export(bool only_blue, v1::Coordinates coordinates = v1::COORDINATES_UNSPECIFIED,
                     v1::GaussianFormat format = v1::GAUSSIAN_FORMAT_PLY) {
    grpc::ClientContext context;
    v1::ExportGaussiansRequest request;
    request.set_model(kModel);
    request.set_coordinates(coordinates);
    request.set_format(format);
    if (only_blue) {
      request.mutable_subset()->mutable_segment()->set_level(1);
      request.mutable_subset()->mutable_segment()->set_id(2);
    }
    const auto stream = running.renders->ExportGaussians(&context, request);
    std::string ply;
    for (v1::ExportGaussiansResponse part; stream->Read(&part);) {
      if (part.has_header()) header = part.header();
      ply += part.chunk();
    }
    EXPECT_OK(stream->Finish());
    EXPECT_EQ(header.sha256(), Sha256Hex(ply));
    return ply;
  }
  bool HasOrigin() const { return header.origin().y() == kOrigin[1]; }
  v1::ExportGaussiansResponse::Header header;  // of the last export

  // Returns the mesh, and sets `mesh_header`.
  std::string Mesh(v1::Coordinates coordinates, v1::MeshFormat format) {
    grpc::ClientContext context;
    v1::ExportMeshRequest request;
    request.set_model(kModel);
    request.set_coordinates(coordinates);
    request.set_format(format);
    request.set_voxels(32);
    const auto stream = running.renders->ExportMesh(&context, request);
    std::string file;
    for (v1::ExportMeshResponse part; stream->Read(&part);) {
      if (part.has_header()) mesh_header = part.header();
      file += part.chunk();
    }
    EXPECT_OK(stream->Finish());
    return file;
  }
  v1::ExportMeshResponse::Header mesh_header;
};

TEST_F(FarOriginTest, ExportsMeshesInTheWorldAndRelativeToTheOrigin) {
  const std::string world = Mesh(v1::COORDINATES_WORLD, v1::MESH_FORMAT_PLY);
  EXPECT_NE(world.find("property double x\n"), std::string::npos);
  EXPECT_FALSE(mesh_header.has_origin());
  const std::string local = Mesh(v1::COORDINATES_LOCAL, v1::MESH_FORMAT_PLY);
  EXPECT_NE(local.find("comment pepeseg_origin "), std::string::npos);
  EXPECT_EQ(mesh_header.origin().y(), kOrigin[1]);
  EXPECT_NE(Mesh(v1::COORDINATES_WORLD, v1::MESH_FORMAT_GLB).find("\"translation\":["),
            std::string::npos);
  EXPECT_EQ(Mesh(v1::COORDINATES_LOCAL, v1::MESH_FORMAT_GLB).find("\"translation\":["),
            std::string::npos);
  EXPECT_EQ(mesh_header.origin().x(), kOrigin[0]);
}

TEST_F(FarOriginTest, ListsViewsAndReadsFreeCamerasInTheWorld) {
  const v1::View listed = ListedView("middle.jpg");
  // Its camera looks along the axes, from the origin.
  const v1::Vector3& translation = listed.cam_from_world().translation();
  EXPECT_NEAR(translation.x(), -kOrigin[0], 1e-6);
  EXPECT_NEAR(translation.y(), -kOrigin[1], 1e-6);
  EXPECT_NEAR(translation.z(), -kOrigin[2], 1e-6);
  v1::Viewpoint named, free;
  named.set_view("middle.jpg");
  *free.mutable_free()->mutable_camera() = listed.camera();
  *free.mutable_free()->mutable_cam_from_world() = listed.cam_from_world();
  const std::string want = Render(named);
  EXPECT_FALSE(want.empty());
  EXPECT_EQ(Render(free), want);
}

TEST_F(FarOriginTest, ExportsInTheWorld) {
  for (const bool only_blue : {false, true}) {
    const std::string ply = Export(only_blue);
    const auto path = running.folder / "export.ply";
    std::ofstream(path, std::ios::binary) << ply;
    EXPECT_NE(ply.find("property double x\n"), std::string::npos);
    ASSERT_OK_AND_ASSIGN(const auto relative, ReadGaussianPly(path, "export.ply", kOrigin));
    EXPECT_EQ(relative.count, only_blue ? 10'000 : 20'000);
    for (const float z : relative.Plane(kMeanPlane + 2)) ASSERT_NEAR(z, 2, 1e-6);
    for (const float x : relative.Plane(kMeanPlane)) ASSERT_LT(std::abs(x), 1.2);
  }
}

// None of these formats has doubles for positions.
TEST_F(FarOriginTest, MovesTheNodeOfAGlb) {
  const std::string local = Export(true, v1::COORDINATES_LOCAL, v1::GAUSSIAN_FORMAT_GLB);
  EXPECT_TRUE(HasOrigin());
  EXPECT_EQ(local.find("translation"), std::string::npos);
  const std::string world = Export(true, v1::COORDINATES_WORLD, v1::GAUSSIAN_FORMAT_GLB);
  EXPECT_FALSE(header.has_origin());
  EXPECT_NE(world.find("\"translation\":[400000.0,-5300000.0,-100.0]"), std::string::npos);
  for (const auto format :
       {v1::GAUSSIAN_FORMAT_SPZ, v1::GAUSSIAN_FORMAT_SOG, v1::GAUSSIAN_FORMAT_HTML}) {
    Export(false, v1::COORDINATES_WORLD, format);
    EXPECT_TRUE(HasOrigin());
  }
}

// Viewers read doubles wrongly or not at all.
TEST_F(FarOriginTest, ExportsFloatsRelativeToTheOrigin) {
  for (const bool only_blue : {false, true}) {
    const auto path = running.folder / "export.ply";
    const auto write = [&](const std::string& ply) {
      std::ofstream(path, std::ios::binary) << ply;
      return ply;
    };
    const std::string world = write(Export(only_blue, v1::COORDINATES_WORLD));
    EXPECT_FALSE(header.has_origin());
    ASSERT_OK_AND_ASSIGN(const Gaussians want, ReadGaussianPly(path, "export.ply", kOrigin));
    const std::string local = write(Export(only_blue, v1::COORDINATES_LOCAL));
    EXPECT_EQ(header.origin().x(), kOrigin[0]);
    EXPECT_EQ(header.origin().z(), kOrigin[2]);
    EXPECT_LT(local.size(), world.size());
    EXPECT_NE(local.find("comment pepeseg_origin "), std::string::npos);
    EXPECT_NE(local.find("property float x\n"), std::string::npos);
    // The comment is added again when it is read, as at an upload.
    ASSERT_OK_AND_ASSIGN(const Gaussians got, ReadGaussianPly(path, "export.ply", kOrigin));
    ASSERT_EQ(got.count, want.count);
    EXPECT_EQ(got.count, header.num_gaussians());
    for (int64_t i = 0; i < got.count; ++i) {
      for (int k = 0; k < 3; ++k) {
        ASSERT_NEAR(got.Plane(kMeanPlane + k)[i], want.Plane(kMeanPlane + k)[i], 1e-6);
      }
    }
  }
}

}  // namespace
}  // namespace pepeseg
