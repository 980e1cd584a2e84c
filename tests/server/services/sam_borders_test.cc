#include "core/priors/sam/sam_borders.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <span>

#include "core/base/digest.h"
#include "core/base/file_io.h"
#include "core/formats/images.h"
#include "core/formats/rle.h"
#include "core/priors/sam/sam_embedding.h"
#include "core/priors/sam/sam_networks.h"
#include "server/store/layout.h"
#include "tests/server/access/keyed_server.h"
#include "tests/server/shelf_model.h"
#include "tests/testing/fake_sam.h"
#include "tests/testing/unzipped.h"

namespace pepeseg {
namespace {

// A photograph of view middle.jpg, twice as large. Its red square lies `right` pixels of the view
// to the right of the model's, which is from 15 to 45.
std::string MovedSquare(int right = 2) {
  Image image{2 * kWidth, 2 * kHeight, 3, {}};
  for (int i = 0; i < image.width * image.height; ++i) {
    const int x = i % image.width / 2, y = i / image.width / 2;
    const bool red = x >= 15 + right && x < 45 + right && y >= 17 && y < 47;
    for (const int value : {red ? 250 : 10, 20, red ? 10 : 250}) {
      image.pixels.push_back(static_cast<uint8_t>(value));
    }
  }
  return EncodeJpeg(image, 95).value();
}

int64_t NumPixels(const v1::CocoRle& rle) {
  const auto counts = ParseCocoCounts(rle.counts());
  if (!counts.ok()) return -1;
  const auto pixels = PixelsOfRuns(*counts, rle.width(), rle.height());
  return pixels.ok() ? static_cast<int64_t>(pixels->size()) : -1;
}

// "scenes/shelf/models/2" has a photograph of its view, models/1 has none. The server has a fake of
// SAM, which segments by colour in cells of 1.5 pixels.
struct SamBordersOfModel : ShelfModel {
  SamBordersOfModel() {
    testing::MakeFakeSam(sam);
    running.options.workers.sam = sam;
    running.Restart();
    Train("half.model");
    request = Click<v1::SegmentViewsRequest>(30);
    request.mutable_granularity()->set_scale_quantile(0.5);
    request.mutable_granularity()->set_threshold(0.75);
    request.set_frame(v1::PIXEL_FRAME_VIEW);
  }
  // Trains the next model, which has a photograph.
  void Train(const std::string& what) {
    v1::TrainSceneRequest train;
    train.set_scene("scenes/shelf");
    train.set_dataset(running.UploadAndSeal(
        "shelf", {{what, "bytes", v1::FILE_KIND_POSES}, {"images/middle.jpg", MovedSquare()}}));
    const v1::Job job = *Call(&JobStub::TrainScene, train);
    EXPECT_EQ(running.Await(job.name()).state(), v1::JOB_STATE_SUCCEEDED);
  }
  // Clicks into the middle of the photograph's square, which is not the middle of the model's.
  void ClickInThePhotograph() {
    request.clear_granularity();
    request.mutable_prompt()->mutable_points()->mutable_points(0)->set_x(33.5);
    request.mutable_prompt()->mutable_points()->mutable_points(0)->set_y(32.5);
  }
  Reply<v1::SegmentViewsResponse> Segment() {
    return Call(&SegmentationStub::SegmentViews, request);
  }

  const std::filesystem::path sam = running.folder / "sam";
  v1::SegmentViewsRequest request;
};

TEST_F(SamBordersOfModel, LieWhereThePhotographShowsThem) {
  ASSERT_OK_AND_ASSIGN(const auto plain, Segment());
  EXPECT_EQ(plain.masks(0).border_image(), v1::SegmentViewsResponse::BORDER_IMAGE_UNSPECIFIED);
  request.set_sam_borders(true);
  for (const char* which : {"computed", "cached"}) {
    ASSERT_OK_AND_ASSIGN(const auto answer, Segment());
    ASSERT_EQ(answer.masks_size(), 1);
    const auto &mask = answer.masks(0), &before = plain.masks(0);
    EXPECT_EQ(mask.border_image(), v1::SegmentViewsResponse::BORDER_IMAGE_PHOTOGRAPH) << which;
    EXPECT_NEAR(mask.box().x(), 17, 1);
    EXPECT_NEAR(mask.box().x() + mask.box().width(), 47, 1);
    EXPECT_GE(mask.box().x(), before.box().x() + 2);
    EXPECT_EQ(mask.area(), NumPixels(mask.rle()));
    EXPECT_NEAR(mask.score(), before.score(), 0.05);
    EXPECT_FALSE(mask.has_similarity());
  }
}

TEST_F(SamBordersOfModel, LieWhereTheRenderingShowsThemWithoutAPhotograph) {
  request.set_model("scenes/shelf/models/1");
  request.set_sam_borders(true);
  request.set_want_similarity(true);
  ASSERT_OK_AND_ASSIGN(const auto answer, Segment());
  EXPECT_EQ(answer.masks(0).border_image(), v1::SegmentViewsResponse::BORDER_IMAGE_RENDERING);
  EXPECT_NEAR(answer.masks(0).box().x(), 15, 2);
  EXPECT_TRUE(answer.masks(0).has_similarity());
}

// The photograph's square is not where the rendering shows it, so a mask says which was looked at.
TEST_F(SamBordersOfModel, LieWhereTheRenderingOfAnEditedModelShowsThem) {
  v1::EditModelRequest edit;
  edit.set_model(kModel);
  SetSegment(1, 2, *edit.mutable_subset());
  edit.mutable_remove();
  grpc::ClientContext context;
  const auto stream = running.edits->EditModel(&context, edit);
  for (v1::EditModelResponse part; stream->Read(&part);) {
  }
  ASSERT_OK(stream->Finish());
  request.set_sam_borders(true);
  ASSERT_OK_AND_ASSIGN(const auto answer, Segment());
  EXPECT_EQ(answer.masks(0).border_image(), v1::SegmentViewsResponse::BORDER_IMAGE_RENDERING);
  EXPECT_NEAR(answer.masks(0).box().x(), 15, 1);
}

TEST_F(SamBordersOfModel, AnswerClicksWithTheModel) {
  ClickInThePhotograph();
  request.set_sam_clicks(true);
  ASSERT_OK_AND_ASSIGN(const auto answer, Segment());
  ASSERT_EQ(answer.masks_size(), 1);
  const auto& mask = answer.masks(0);
  EXPECT_EQ(mask.border_image(), v1::SegmentViewsResponse::BORDER_IMAGE_PHOTOGRAPH);
  EXPECT_NEAR(mask.box().x(), 17, 1);  // the square of the photograph
  EXPECT_NEAR(mask.box().x() + mask.box().width(), 47, 1);
  // The rendering shows nothing that the model does not have, and the model's masks are exact.
  request.set_model("scenes/shelf/models/1");
  ASSERT_OK_AND_ASSIGN(const auto rendered, Segment());
  EXPECT_EQ(rendered.masks(0).border_image(), v1::SegmentViewsResponse::BORDER_IMAGE_UNSPECIFIED);
  EXPECT_NEAR(rendered.masks(0).box().x(), 15, 1);
}

// By default SAM answers where the model has learnt from its masks.
TEST_F(SamBordersOfModel, AnswerClicksWithTheModelWhereItsMasksWereSams) {
  const auto image = [&] {
    const auto answer = Segment();
    EXPECT_OK(answer);
    return answer.ok() ? answer->masks(0).border_image()
                       : v1::SegmentViewsResponse::BORDER_IMAGE_RENDERING;
  };
  ClickInThePhotograph();
  request.set_sam_borders(false);
  EXPECT_EQ(image(), v1::SegmentViewsResponse::BORDER_IMAGE_UNSPECIFIED);
  Train("by_sam.model");  // is live
  EXPECT_EQ(image(), v1::SegmentViewsResponse::BORDER_IMAGE_PHOTOGRAPH);
  request.set_sam_clicks(false);
  EXPECT_EQ(image(), v1::SegmentViewsResponse::BORDER_IMAGE_UNSPECIFIED);
  request.clear_sam_clicks();
  request.mutable_granularity()->set_scale_quantile(0.5);
  EXPECT_EQ(image(), v1::SegmentViewsResponse::BORDER_IMAGE_UNSPECIFIED);
  request.clear_granularity();
  running.options.workers.sam.clear();
  running.Restart();
  EXPECT_EQ(image(), v1::SegmentViewsResponse::BORDER_IMAGE_UNSPECIFIED);
}

// The same holds for borders, of any prompt.
TEST_F(SamBordersOfModel, AreThereByDefaultWhereTheMasksWereSams) {
  const auto left_edge = [&] {
    const auto answer = Segment();
    EXPECT_OK(answer);
    return answer.ok() ? answer->masks(0).box().x() : -1;
  };
  EXPECT_NEAR(left_edge(), 15, 1);
  Train("by_sam.model");
  EXPECT_NEAR(left_edge(), 17, 1);
  request.set_refine_borders(false);
  EXPECT_NEAR(left_edge(), 15, 1);
  request.clear_refine_borders();
  request.set_sam_borders(false);
  EXPECT_NEAR(left_edge(), 15, 1);
  // Where SAM fails, an answer without it is better than none, unless it was asked for.
  request.clear_sam_borders();
  running.Restart();
  testing::ReplaceSamFile(sam, "sam.onnx", "another model");
  EXPECT_NEAR(left_edge(), 15, 1);
  request.set_sam_borders(true);
  EXPECT_ERROR(Segment(), grpc::FAILED_PRECONDITION, {.message = "SAM cannot be loaded"});
}

TEST_F(SamBordersOfModel, AnswerOnlyPointsAndBoxesOfNoGranularity) {
  request.set_sam_clicks(true);
  EXPECT_ERROR(Segment(), grpc::INVALID_ARGUMENT, {.field = "sam_clicks"});
  request.clear_granularity();
  v1::BoxPrompt& box = *request.mutable_prompt()->mutable_box();
  box.set_x(17), box.set_y(17), box.set_width(30), box.set_height(30);
  ASSERT_OK_AND_ASSIGN(const auto answer, Segment());
  EXPECT_EQ(answer.masks(0).border_image(), v1::SegmentViewsResponse::BORDER_IMAGE_PHOTOGRAPH);
  EXPECT_NEAR(answer.masks(0).box().x(), 17, 1);
  EXPECT_GT(answer.box_agreement(), 0.8);
  *request.mutable_prompt()->mutable_mask()->mutable_rle() = answer.masks(0).rle();
  EXPECT_ERROR(Segment(), grpc::INVALID_ARGUMENT, {.field = "sam_clicks"});
}

// The photograph's square has no part of the model's at its left and its lower edge.
TEST_F(SamBordersOfModel, PlaceSelections) {
  v1::CreateSelectionRequest select = Click<v1::CreateSelectionRequest>(33.5);
  select.mutable_prompt()->mutable_points()->mutable_points(0)->set_y(32.5);
  select.set_frame(v1::PIXEL_FRAME_VIEW);
  select.set_model("scenes/shelf/models/2");
  const auto num_gaussians = [&] {
    const auto made = Call(&SelectionStub::CreateSelection, select);
    EXPECT_OK(made);
    return made.ok() ? static_cast<double>(made->num_gaussians()) : 0;
  };
  const double by_model = num_gaussians();
  select.set_sam_clicks(true);
  const double by_both = num_gaussians();
  EXPECT_LT(by_both, 0.93 * by_model);
  EXPECT_GT(by_both, 0.8 * by_model);
  select.mutable_granularity()->set_scale_quantile(0.5);
  EXPECT_ERROR(Call(&SelectionStub::CreateSelection, select), grpc::INVALID_ARGUMENT,
               {.field = "sam_clicks"});
  select.clear_granularity();
  running.options.workers.sam.clear();
  running.Restart();
  EXPECT_ERROR(Call(&SelectionStub::CreateSelection, select), grpc::FAILED_PRECONDITION,
               {.reason = "NO_SAM"});
  select.clear_sam_clicks();
  EXPECT_EQ(num_gaussians(), by_model);
}

// The label's own view has no photograph; that of middle.jpg shows the square further to the right.
TEST_F(SamBordersOfModel, PlaceTheMasksOfAnnotations) {
  Train("by_sam.model");
  request.mutable_prompt()->mutable_view()->set_view("left/0.jpg");
  request.set_sam_borders(false);
  ASSERT_OK_AND_ASSIGN(const auto answer, Segment());
  v1::CreateLabelRequest label;
  label.set_parent("scenes/shelf");
  label.set_label_id("red");
  label.set_frame(v1::PIXEL_FRAME_VIEW);
  label.mutable_label()->set_view("left/0.jpg");
  *label.mutable_label()->mutable_mask()->mutable_rle() = answer.masks(0).rle();
  ASSERT_OK(Call(&LabelStub::CreateLabel, label));
  v1::ExportAnnotationsRequest annotations;
  annotations.set_model(kModel);
  annotations.mutable_targets()->add_views("middle.jpg");
  const auto left_edge = [&] {
    grpc::ClientContext context;
    const auto stream =
        v1::LabelService::NewStub(running.channel)->ExportAnnotations(&context, annotations);
    std::string zip;
    for (v1::ExportAnnotationsResponse part; stream->Read(&part);) zip += part.chunk();
    EXPECT_OK(stream->Finish());
    const std::string json = testing::Unzipped(zip)["annotations.json"];
    return nlohmann::json::parse(json)["annotations"][0]["bbox"][0].get<int>();
  };
  EXPECT_NEAR(left_edge(), 2 * 17, 2);
  annotations.set_sam_borders(false);
  EXPECT_NEAR(left_edge(), 2 * 15, 2);
}

TEST_F(SamBordersOfModel, AreCountedInTheMemoryOfModels) {
  constexpr int64_t kSamBytes = 350'000'000 + int64_t{32} * (2 << 20);
  running.options.admin = "127.0.0.1:0";
  running.Restart();
  const auto reserved = [this] {
    return Call(&AdminStub::ListResidentModels, {})->host().reserved_bytes();
  };
  ASSERT_OK(Segment());
  const int64_t of_model = reserved();
  request.set_sam_borders(true);
  for (int i = 0; i < 2; ++i) {
    ASSERT_OK(Segment());
    EXPECT_EQ(reserved(), of_model + kSamBytes);
  }
  running.options.model_bytes = (of_model + kSamBytes / 2) * 20 / 19;
  running.Restart();
  EXPECT_ERROR(Segment(), grpc::UNAVAILABLE, {.reason = "NO_ROOM_NOW"});
  EXPECT_EQ(reserved(), of_model);
  request.set_sam_borders(false);
  EXPECT_OK(Segment());
}

// The model's folder has an embedding of a photograph whose square lies three pixels to the left.
struct KeptEmbeddings : SamBordersOfModel {
  KeptEmbeddings() {
    for (const auto& entry :
         std::filesystem::recursive_directory_iterator(JobsFolder(running.options.data))) {
      if (entry.path().filename() != "model.json") continue;
      const auto facts = ReadFile(entry.path(), "model.json", 1 << 20);
      EXPECT_OK(facts);
      // Only models/2 has a photograph.
      if (facts->find("\"photograph\"") != facts->npos) model = entry.path().parent_path();
    }
    request.set_sam_borders(true);
  }
  void Write(const EmbeddingOrigin& origin) const {
    const auto borders = SamBorders::Open(sam, {});
    ASSERT_OK(borders);
    const std::string jpeg = MovedSquare(-3);
    ASSERT_OK_AND_ASSIGN(
        const Image photo,
        DecodePhoto(std::span(reinterpret_cast<const uint8_t*>(jpeg.data()), jpeg.size()),
                    "moved"));
    ASSERT_OK_AND_ASSIGN(SamEmbedding embedding, (*borders)->Embed(photo));
    ASSERT_OK(WriteEmbedding(model / EmbeddingFileName("middle.jpg"), embedding, origin));
  }
  // Returns the left edge of the mask, as a server that has seen no photograph places it.
  int LeftEdge() {
    running.Restart();
    const auto answer = Segment();
    if (!answer.ok()) return -1;
    EXPECT_EQ(answer->masks(0).border_image(), v1::SegmentViewsResponse::BORDER_IMAGE_PHOTOGRAPH);
    return answer->masks(0).box().x();
  }

  std::filesystem::path model;  // folder of models/2
};

TEST_F(KeptEmbeddings, AreUsedIfTheyAreWholeAndOfThePhotograph) {
  ASSERT_OK_AND_ASSIGN(const std::string encoder, SamEncoderDigest(sam));
  const EmbeddingOrigin origin = {encoder, Sha256Hex(MovedSquare())};
  EXPECT_NEAR(LeftEdge(), 17, 1);  // there is none
  Write(origin);
  EXPECT_NEAR(LeftEdge(), 12, 1);
  for (const EmbeddingOrigin& other : {EmbeddingOrigin{Sha256Hex("another"), origin.photograph},
                                       EmbeddingOrigin{encoder, Sha256Hex("another")}}) {
    Write(other);
    EXPECT_NEAR(LeftEdge(), 17, 1);
  }
  Write(origin);
  std::filesystem::resize_file(model / EmbeddingFileName("middle.jpg"), 1'000'000);
  EXPECT_NEAR(LeftEdge(), 17, 1);
}

TEST_F(SamBordersOfModel, AreNotInStreams) {
  grpc::ClientContext context;
  const auto stream = running.segmentation->StreamSegments(&context);
  v1::StreamSegmentsRequest first;
  *first.mutable_segment() = request;
  first.mutable_segment()->set_sam_borders(true);
  v1::StreamSegmentsResponse answer;
  ASSERT_TRUE(stream->Write(first));
  ASSERT_TRUE(stream->Read(&answer));
  EXPECT_EQ(answer.error().code(), grpc::INVALID_ARGUMENT);
  EXPECT_EQ(answer.error().field(), "segment.sam_borders");
  stream->WritesDone();
  EXPECT_OK(stream->Finish());
}

TEST_F(SamBordersOfModel, AreThereAgainWhenSamIs) {
  request.set_sam_borders(true);
  testing::ReplaceSamFile(sam, "encoder.onnx", "out of memory");
  EXPECT_ERROR(Segment(), grpc::RESOURCE_EXHAUSTED, {.message = "SAM does not fit"});
  testing::ReplaceSamFile(sam, "sam.onnx", "another model");
  testing::ReplaceSamFile(sam, "encoder.onnx", "an encoder");
  const auto refused = Segment();
  EXPECT_ERROR(refused, grpc::FAILED_PRECONDITION, {.message = "SAM cannot be loaded"});
  EXPECT_EQ(refused.status().error_message().find(sam.string()), std::string::npos);
  testing::ReplaceSamFile(sam, "sam.onnx", testing::FakeDecoder());
  EXPECT_OK(Segment());
}

// Two projects have a scene of one name.
struct TwoProjects : KeyedServer {
  TwoProjects() {
    testing::MakeFakeSam(running.folder / "sam");
    running.options.workers.sam = running.folder / "sam";
    running.Restart();
  }
  // Trains a model of scene "mug" whose photograph has the square moved.
  void Train(const std::string& secret, int right) {
    v1::CreateSceneRequest create;
    create.set_scene_id("mug");
    ASSERT_OK(CallAs(secret, &SceneStub::CreateScene, create));
    const std::vector<TestFile> files = {{"half.model", "bytes", v1::FILE_KIND_POSES},
                                         {"images/middle.jpg", MovedSquare(right)}};
    v1::CreateUploadRequest declare = Under{"scenes/mug"};
    for (const TestFile& file : files) *declare.add_files() = Declare(file);
    const v1::Upload upload = *CallAs(secret, &DatasetStub::CreateUpload, declare);
    for (const TestFile& file : files) {
      const auto context = With(secret);
      v1::WriteFilesResponse response;
      const auto stream = running.datasets->WriteFiles(context.get(), &response);
      for (const auto& part : FileParts(upload.name(), file)) stream->Write(part);
      stream->WritesDone();
      ASSERT_OK(stream->Finish());
    }
    v1::TrainSceneRequest train;
    train.set_scene("scenes/mug");
    train.set_dataset(CallAs(secret, &DatasetStub::SealUpload, Named{upload.name()})->name());
    const std::string job = CallAs(secret, &JobStub::TrainScene, train)->name();
    ASSERT_TRUE(Eventually([&] {
      return CallAs(secret, &JobStub::GetJob, Named{job})->state() == v1::JOB_STATE_SUCCEEDED;
    }));
  }
  // Returns the left edge of the mask whose border SAM places.
  int LeftEdge(const std::string& secret) {
    auto request = Click<v1::SegmentViewsRequest>(30);
    request.set_model("scenes/mug/models/1");
    request.mutable_granularity()->set_scale_quantile(0.5);
    request.mutable_granularity()->set_threshold(0.75);
    request.set_frame(v1::PIXEL_FRAME_VIEW);
    request.set_sam_borders(true);
    const auto answer = CallAs(secret, &SegmentationStub::SegmentViews, request);
    return answer.ok() ? answer->masks(0).box().x() : -1;
  }
};

TEST_F(TwoProjects, KeepTheirPhotographsApart) {
  const std::string theirs = MakeKey("other", {v1::SCOPE_READ, v1::SCOPE_WRITE, v1::SCOPE_TRAIN});
  Train(full, 2);
  Train(theirs, -2);
  const int ours = LeftEdge(full);
  EXPECT_GE(ours, 16);
  EXPECT_LT(LeftEdge(theirs), ours);
  EXPECT_EQ(LeftEdge(full), ours);
}

struct ServerWithoutSam : ShelfModel {};

TEST_F(ServerWithoutSam, RefusesSamBorders) {
  auto request = Click<v1::SegmentViewsRequest>(30);
  request.set_sam_borders(true);
  EXPECT_ERROR(Call(&SegmentationStub::SegmentViews, request), grpc::FAILED_PRECONDITION,
               {.message = "deploy/sam.sh"});
}

}  // namespace
}  // namespace pepeseg
