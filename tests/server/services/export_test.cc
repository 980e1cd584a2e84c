#include <gtest/gtest.h>

#include <cstring>
#include <fstream>
#include <utility>

#include "core/base/digest.h"
#include "core/formats/gaussian_ply.h"
#include "tests/server/shelf_model.h"

namespace pepeseg {
namespace {

struct ExportTest : ShelfModel {
  ExportTest() { request.set_model(kModel); }
  grpc::Status Export() {
    grpc::ClientContext context;
    const auto stream = running.renders->ExportGaussians(&context, request);
    v1::ExportGaussiansResponse part;
    header.Clear();
    ply.clear();
    while (stream->Read(&part)) {
      if (part.has_header()) header = part.header();
      if (!part.has_chunk()) continue;
      EXPECT_LE(part.chunk().size(), size_t{1} << 20);
      ply += part.chunk();
    }
    return stream->Finish();
  }
  // Reads it as a viewer of splats does.
  Gaussians Read() const {
    const auto path = running.folder / "export.ply";
    std::ofstream(path, std::ios::binary) << ply;
    auto gaussians = ReadGaussianPly(path, "export.ply");
    EXPECT_OK(gaussians);
    return gaussians.ok() ? *gaussians : Gaussians();
  }

  v1::ExportGaussiansRequest request;
  v1::ExportGaussiansResponse::Header header;
  std::string ply;
};

TEST_F(ExportTest, ExportsASegmentAsAPly) {
  SetSegment(1, 2, *request.mutable_subset());
  ASSERT_OK(Export());
  EXPECT_EQ(header.model(), "scenes/shelf/models/1");
  EXPECT_EQ(header.num_gaussians(), 10'000);
  EXPECT_EQ(header.num_bytes(), static_cast<int64_t>(ply.size()));
  EXPECT_EQ(header.sha256(), Sha256Hex(ply));
  const Gaussians blue = Read();
  ASSERT_EQ(blue.count, 10'000);
  for (const float x : blue.Plane(kMeanPlane)) ASSERT_GT(x, 0) << "the blue square is on the right";
}

TEST_F(ExportTest, ExportsTheComplementAsTheRest) {
  ASSERT_OK(Export());
  const Gaussians all = Read();
  EXPECT_EQ(all.count, 20'000);
  SetSegment(1, 2, *request.mutable_subset());
  request.mutable_subset()->set_complement(true);
  ASSERT_OK(Export());
  const Gaussians red = Read();
  ASSERT_EQ(red.count, 10'000);
  for (int64_t i = 0; i < red.count; ++i) {  // in the model's order, every plane
    for (int k = 0; k < NumPlanes(red.sh_degree); ++k) ASSERT_EQ(red.Plane(k)[i], all.Plane(k)[i]);
  }
}

TEST_F(ExportTest, ExportsASelectionAndItsComplement) {
  ASSERT_OK_AND_ASSIGN(const v1::Selection selection, Call(&SelectionStub::CreateSelection,
                                                           Click<v1::CreateSelectionRequest>(30)));
  request.mutable_subset()->set_selection(selection.name());
  ASSERT_OK(Export());
  const Gaussians red = Read();
  EXPECT_EQ(red.count, selection.num_gaussians());
  EXPECT_GT(red.count, 9'000);
  for (const float x : red.Plane(kMeanPlane)) ASSERT_LT(x, 0) << "the red square is on the left";
  request.mutable_subset()->set_complement(true);
  ASSERT_OK(Export());
  EXPECT_EQ(Read().count, 20'000 - red.count);
}

TEST_F(ExportTest, ExportsTheStoredFileForAnEmptySubset) {
  ASSERT_OK(Export());
  EXPECT_EQ(header.num_gaussians(), 20'000);
  EXPECT_EQ(header.num_bytes(), static_cast<int64_t>(ply.size()));
  EXPECT_EQ(header.sha256(), Sha256Hex(ply));
  EXPECT_GT(ply.size(), size_t{1} << 20) << "more than a chunk";
  EXPECT_EQ(ply.substr(0, 3), "ply");
  const std::string whole = ply;
  request.mutable_subset();
  ASSERT_OK(Export());
  EXPECT_EQ(ply, whole);
}

TEST_F(ExportTest, RefusesInvalidSubsets) {
  SetSegment(1, 3, *request.mutable_subset());
  EXPECT_ERROR(Export(), grpc::INVALID_ARGUMENT, "subset.segment.id", "'3': no segment");
  SetSegment(-1, 1, *request.mutable_subset());
  EXPECT_ERROR(Export(), grpc::INVALID_ARGUMENT, "subset.segment.level", "'-1': no level");
  request.mutable_subset()->set_selection("nonsense");
  EXPECT_ERROR(Export(), grpc::INVALID_ARGUMENT, "subset.selection", "nonsense");
  request.mutable_subset()->clear_selection();
  request.mutable_subset()->set_complement(true);
  EXPECT_ERROR(Export(), grpc::INVALID_ARGUMENT, "subset.complement", "of neither");
  EXPECT_TRUE(ply.empty());
}

TEST_F(ExportTest, FreesMemoryOfCancelledExports) {
  for (int i = 0; i < 15; ++i) {
    if (i == 10) SetSegment(0, 1, *request.mutable_subset());
    grpc::ClientContext context;
    const auto stream = running.renders->ExportGaussians(&context, request);
    v1::ExportGaussiansResponse part;
    EXPECT_TRUE(stream->Read(&part));
    context.TryCancel();
    while (stream->Read(&part)) {
    }
    EXPECT_ERROR(stream->Finish(), grpc::CANCELLED);
  }
  EXPECT_OK(Export());
}

TEST_F(ExportTest, ExportsTheSameInBothCoordinatesNearZero) {
  ASSERT_OK(Export());
  const std::string stored = ply;
  request.set_coordinates(v1::COORDINATES_LOCAL);
  ASSERT_OK(Export());
  EXPECT_EQ(ply, stored);
  EXPECT_FALSE(header.has_origin());
}

TEST_F(ExportTest, ExportsOtherFormatsOfAllAndOfASegment) {
  for (const auto& [format, magic] :
       {std::pair(v1::GAUSSIAN_FORMAT_GLB, "glTF"), std::pair(v1::GAUSSIAN_FORMAT_SPZ, "\x1f\x8b"),
        std::pair(v1::GAUSSIAN_FORMAT_SOG, "PK\3\4"),
        std::pair(v1::GAUSSIAN_FORMAT_HTML, "<!doctype html>")}) {
    request.set_format(format);
    request.clear_subset();
    ASSERT_OK(Export());
    EXPECT_EQ(header.num_gaussians(), 20'000);
    EXPECT_EQ(header.num_bytes(), static_cast<int64_t>(ply.size()));
    EXPECT_EQ(header.sha256(), Sha256Hex(ply));
    EXPECT_TRUE(ply.starts_with(magic));
    EXPECT_FALSE(header.has_origin());
    const size_t whole = ply.size();
    SetSegment(1, 2, *request.mutable_subset());
    ASSERT_OK(Export());
    EXPECT_EQ(header.num_gaussians(), 10'000);
    EXPECT_EQ(header.sha256(), Sha256Hex(ply));
    EXPECT_TRUE(ply.starts_with(magic));
    EXPECT_LT(ply.size(), whole);
  }
}

TEST_F(ExportTest, NamesAPageAfterItsScene) {
  request.set_format(v1::GAUSSIAN_FORMAT_HTML);
  ASSERT_OK(Export());
  EXPECT_NE(ply.find("<title>shelf</title>"), std::string::npos);
  EXPECT_NE(ply.find(">20,000 Gaussians"), std::string::npos);
}

TEST_F(ExportTest, NamesTheSegmentsOfEachGaussian) {
  const auto id_of = [this](size_t row, size_t rows) {  // the last property
    const size_t row_bytes = (ply.size() - ply.find("end_header\n") - 11) / rows;
    int32_t id = 0;
    std::memcpy(&id, ply.data() + ply.size() - row_bytes * (rows - 1 - row) - sizeof(id),
                sizeof(id));
    return id;
  };
  SetSegment(1, 2, *request.mutable_subset());
  request.mutable_segment_ids()->add_scales(0.01);
  request.mutable_segment_ids()->add_scales(0.5);
  ASSERT_OK(Export());
  EXPECT_NE(ply.find("property int segment_1\nend_header\n"), std::string::npos);
  for (const size_t row : {0, 5'000, 9'999}) EXPECT_EQ(id_of(row, 10'000), 2);
  EXPECT_EQ(Read().count, 10'000);
  // All of the model, at the default scales.
  request.clear_subset();
  request.mutable_segment_ids()->clear_scales();
  ASSERT_OK(Export());
  EXPECT_EQ(header.num_gaussians(), 20'000);
  EXPECT_NE(ply.find("property int segment_2\nend_header\n"), std::string::npos);
  request.set_format(v1::GAUSSIAN_FORMAT_SPZ);
  EXPECT_ERROR(Export(), grpc::INVALID_ARGUMENT, "segment_ids", "only a PLY has them");
  request.set_format(v1::GAUSSIAN_FORMAT_PLY);
  request.mutable_segment_ids()->add_scales(2);
  EXPECT_ERROR(Export(), grpc::INVALID_ARGUMENT, "segment_ids.scales[0]", "not in [0, 1]");
}

TEST_F(ExportTest, RefusesAFormatThatItDoesNotHave) {
  request.set_format(static_cast<v1::GaussianFormat>(99));
  EXPECT_ERROR(Export(), grpc::INVALID_ARGUMENT, "format", "'99': no format");
}

}  // namespace
}  // namespace pepeseg
