#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "core/base/digest.h"
#include "core/formats/rle.h"
#include "core/query/scene_model.h"
#include "tests/server/shelf_model.h"
#include "tests/testing/unzipped.h"

namespace pepeseg {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Key;
using ::testing::StartsWith;

struct ExportAnnotationsTest : ShelfModel {
  ExportAnnotationsTest() {
    request.set_model(kModel);
    Label("a-red", "square.2", Square(18, 42));
    Label("b-blue", "square", Square(54, 78));
  }
  // Returns a square of 24 pixels with a hole of one.
  static BinaryMask Square(int left, int right) {
    BinaryMask mask = {std::vector<uint8_t>(size_t{kWidth} * kHeight)};
    for (int y = 20; y < 44; ++y) {
      for (int x = left; x < right; ++x) mask.pixels[y * kWidth + x] = 1;
    }
    mask.pixels[32 * kWidth + (left + right) / 2] = 0;
    return mask;
  }
  void Label(const std::string& id, const std::string& text, const BinaryMask& mask,
             const std::string& view = "middle.jpg") const {
    v1::CreateLabelRequest create;
    create.set_parent("scenes/shelf");
    create.set_label_id(id);
    create.mutable_label()->set_text(text);
    create.mutable_label()->set_view(view);
    v1::CocoRle& rle = *create.mutable_label()->mutable_mask()->mutable_rle();
    rle.set_width(kWidth);
    rle.set_height(kHeight);
    rle.set_counts(EncodeCocoRle(mask, kWidth, kHeight));
    EXPECT_OK(Call(&LabelStub::CreateLabel, create));
  }
  grpc::Status Export() {
    grpc::ClientContext context;
    const auto stream =
        v1::LabelService::NewStub(running.channel)->ExportAnnotations(&context, request);
    v1::ExportAnnotationsResponse part;
    header.reset();
    zip.clear();
    progress.clear();
    while (stream->Read(&part)) {
      if (part.has_progress()) {
        EXPECT_FALSE(header.has_value()) << "progress after the header";
        progress.push_back(part.progress().num_masks_done());
        EXPECT_EQ(part.progress().num_masks(), num_masks);
      }
      if (part.has_header()) header = part.header();
      EXPECT_LE(part.chunk().size(), size_t{1} << 20);
      zip += part.chunk();
    }
    const grpc::Status status = stream->Finish();
    if (status.ok()) files = testing::Unzipped(zip);
    return status;
  }
  // Returns the run lengths of a label in a view as SegmentViews answers.
  std::string Counts(const std::string& label, const std::string& view) const {
    v1::SegmentViewsRequest segment;
    segment.set_model(kModel);
    segment.mutable_prompt()->set_label(label);
    segment.mutable_targets()->add_views(view);
    const auto answer = Call(&SegmentationStub::SegmentViews, segment);
    EXPECT_OK(answer);
    return answer->masks(0).rle().counts();
  }

  v1::ExportAnnotationsRequest request;
  std::optional<v1::ExportAnnotationsResponse::Header> header;
  int64_t num_masks = 6;
  std::vector<int64_t> progress;
  std::string zip;
  std::map<std::string, std::string> files;
};

TEST_F(ExportAnnotationsTest, HasTheMasksOfSegmentViewsAndTheAcceptedOnes) {
  ASSERT_OK(Export());
  EXPECT_EQ(header->model(), "scenes/shelf/models/1");
  EXPECT_EQ(header->num_things(), 2);
  EXPECT_EQ(header->num_views(), 3);
  EXPECT_EQ(header->num_bytes(), static_cast<int64_t>(zip.size()));
  EXPECT_EQ(header->sha256(), Sha256Hex(zip));
  EXPECT_THAT(progress, ElementsAre(3, 6));
  ASSERT_THAT(files, ElementsAre(Key("annotations.json")));
  const auto json = nlohmann::json::parse(files["annotations.json"]);
  EXPECT_EQ(json["info"]["description"], "pepeseg: scenes/shelf");
  std::map<int, std::string> views;
  for (const auto& image : json["images"]) {
    views[image["id"]] = image["file_name"];
    EXPECT_EQ(image["width"], kWidth);
    EXPECT_EQ(image["height"], kHeight);
  }
  ASSERT_EQ(views.size(), 3U);
  ASSERT_EQ(json["annotations"].size(), 6U);
  for (const auto& annotation : json["annotations"]) {
    const std::string label = annotation["label"], view = views[annotation["image_id"]];
    const BinaryMask accepted = label == "a-red" ? Square(18, 42) : Square(54, 78);
    const std::string want =
        view == "middle.jpg" ? EncodeCocoRle(accepted, kWidth, kHeight) : Counts(label, view);
    EXPECT_EQ(annotation["segmentation"]["counts"], want) << label << " in " << view;
    EXPECT_EQ(annotation["track_id"], label == "a-red" ? 1 : 2);
    EXPECT_EQ(annotation["instance_id"], label == "a-red" ? 2 : 1);
  }
  const std::string first = zip;
  for (const char* name :
       {kModel, "scenes/shelf/models/1", "jobs/j1", "projects/default/scenes/shelf/models/live"}) {
    request.set_model(name);
    ASSERT_OK(Export()) << name;
    EXPECT_EQ(zip, first) << name;
  }
}

TEST_F(ExportAnnotationsTest, WritesEachFormat) {
  const std::map<v1::AnnotationFormat, std::string> kFiles = {
      {v1::ANNOTATION_FORMAT_COCO, "annotations.json"},
      {v1::ANNOTATION_FORMAT_YOLO, "labels/middle.txt"},
      {v1::ANNOTATION_FORMAT_LABELME, "middle.json"},
      {v1::ANNOTATION_FORMAT_MASKS, "b-blue/middle.png"},
      {v1::ANNOTATION_FORMAT_CVAT, "annotations.xml"},
      {v1::ANNOTATION_FORMAT_IDS, "middle.png"}};
  for (const auto& [format, file] : kFiles) {
    request.set_format(format);
    ASSERT_OK(Export());
    EXPECT_TRUE(files.contains(file)) << file;
  }
}

TEST_F(ExportAnnotationsTest, HasSomeLabelsInSomeViewsOnly) {
  request.set_format(v1::ANNOTATION_FORMAT_MASKS);
  request.add_labels("b-blue");
  request.mutable_targets()->add_views("middle.jpg");
  num_masks = 1;
  ASSERT_OK(Export());
  EXPECT_THAT(files, ElementsAre(Key("b-blue/middle.png"), Key("things.json")));
  EXPECT_EQ(header->num_things(), 1);
  // The thing has the numbers that it has among all labels.
  const auto things = nlohmann::json::parse(files["things.json"]);
  ASSERT_EQ(things.size(), 1U);
  EXPECT_EQ(things[0]["track_id"], 2);
  EXPECT_EQ(things[0]["instance_id"], 1);
}

TEST_F(ExportAnnotationsTest, AddsATableOfTheThings) {
  request.set_table(true);
  ASSERT_OK(Export());
  const std::vector<std::string> lines = absl::StrSplit(files["things.csv"], '\n');
  ASSERT_EQ(lines.size(), 4U);
  EXPECT_THAT(lines[0], StartsWith("id,parent,name,category,instance_id,track_id,gaussians,"));
  EXPECT_THAT(lines[1], StartsWith("a-red,,square.2,square,2,1,"));
  const std::vector<std::string> cells = absl::StrSplit(lines[2], ',');
  ASSERT_EQ(cells.size(), 15U);
  EXPECT_EQ(cells[0], "b-blue");
  v1::CreateSelectionRequest select;
  select.set_model(kModel);
  select.mutable_prompt()->set_label("b-blue");
  ASSERT_OK_AND_ASSIGN(const v1::Selection selection,
                       Call(&SelectionStub::CreateSelection, select));
  EXPECT_EQ(cells[6], absl::StrCat(selection.num_gaussians()));
  EXPECT_GT(selection.num_gaussians(), 5000);
  EXPECT_EQ(cells[7], "3");
  EXPECT_NEAR(std::stod(cells[9]), selection.box().min().x(), 1e-6);
  EXPECT_NEAR(std::stod(cells[14]), selection.box().max().z(), 1e-6);
}

TEST_F(ExportAnnotationsTest, SegmentsManyViewsInParts) {
  TrainToTheEnd("shelf", "many.model");
  Label("on-many", "square.3", Square(18, 42), "0.jpg");
  request.add_labels("on-many");
  request.mutable_targets()->set_group(v1::SegmentViewsRequest::Targets::GROUP_HELD_OUT);
  num_masks = 60;
  ASSERT_OK(Export());
  EXPECT_EQ(header->num_views(), 60);
  EXPECT_THAT(progress, ElementsAre(8, 16, 24, 32, 40, 48, 56, 60));
}

TEST_F(ExportAnnotationsTest, HasAllSegmentsOfALevel) {
  Label("c-large", "scenery", BinaryMask{std::vector<uint8_t>(size_t{kWidth} * kHeight, 1)});
  request.mutable_segments()->set_level(1);
  request.set_table(true);
  ASSERT_OK(Export());
  EXPECT_EQ(header->num_things(), 2);
  EXPECT_THAT(progress, ElementsAre(2, 4, 6));
  const std::vector<std::string> lines = absl::StrSplit(files["things.csv"], '\n');
  ASSERT_EQ(lines.size(), 4U);
  // The labels of both squares fit, that of everything does not.
  EXPECT_THAT(lines[1], StartsWith("1-1,2-1,square.2,square,2,1,10000,3,"));
  EXPECT_THAT(lines[2], StartsWith("1-2,2-2,square,square,1,2,10000,3,"));
  const auto json = nlohmann::json::parse(files["annotations.json"]);
  ASSERT_EQ(json["annotations"].size(), 6U);
  EXPECT_EQ(json["annotations"][0]["label"], "1-1");
  int64_t area = 0;
  for (const auto& annotation : json["annotations"]) {
    if (annotation["image_id"] == 1) area += annotation["area"].get<int64_t>();
  }
  EXPECT_GT(area, 2 * 24 * 24);
  EXPECT_OK(Call(&LabelStub::DeleteLabel, Named{"scenes/shelf/labels/a-red"}));
  request.mutable_segments()->set_level(2);
  ASSERT_OK(Export());
  EXPECT_THAT(files["things.csv"], HasSubstr("\n2-1,,segment,segment,1,1,"));
  request.mutable_segments()->set_level(3);
  EXPECT_ERROR(Export(), grpc::INVALID_ARGUMENT, "segments.level");
  request.mutable_segments()->add_scales(2);
  EXPECT_ERROR(Export(), grpc::INVALID_ARGUMENT, "segments.scales[0]");
  request.mutable_segments()->Clear();
  request.add_labels("b-blue");
  EXPECT_ERROR(Export(), grpc::INVALID_ARGUMENT, "labels", "next to segments");
  request.clear_labels();
  request.set_sam_borders(false);
  EXPECT_ERROR(Export(), grpc::INVALID_ARGUMENT, "sam_borders");
}

TEST_F(ExportAnnotationsTest, RefusesWhatItCannotWrite) {
  request.set_format(static_cast<v1::AnnotationFormat>(9));
  EXPECT_ERROR(Export(), grpc::INVALID_ARGUMENT, "format", "no format");
  request.clear_format();
  request.add_labels("green");
  EXPECT_ERROR(Export(), grpc::NOT_FOUND,
               {.reason = "NO_SUCH_LABEL", .resource = "scenes/shelf/labels/green"});
  request.clear_labels();
  request.mutable_targets()->add_views("none.jpg");
  EXPECT_ERROR(Export(), grpc::INVALID_ARGUMENT, "targets.views[0]", "none.jpg");
  request.clear_targets();
  request.set_sam_borders(true);
  EXPECT_ERROR(Export(), grpc::FAILED_PRECONDITION);
  request.set_model("scenes/shelf");
  EXPECT_ERROR(Export(), grpc::INVALID_ARGUMENT, "model");
  request.set_model(kModel);
  request.clear_sam_borders();
  for (const char* id : {"a-red", "b-blue"}) {
    EXPECT_OK(Call(&LabelStub::DeleteLabel, Named{absl::StrCat("scenes/shelf/labels/", id)}));
  }
  EXPECT_ERROR(Export(), grpc::FAILED_PRECONDITION,
               {.reason = "NO_LABELS", .resource = "scenes/shelf"});
  EXPECT_TRUE(zip.empty());
}

// There is room for the model, and not for a zip next to it.
TEST_F(ExportAnnotationsTest, TakesItsMemoryFromThatOfTheModels) {
  const MemoryBytes bytes = BytesOfModel(*MakeCpuBackend(1), {20'000, 0, int64_t{96} * 64});
  running.options.model_bytes = (bytes.host + bytes.device + (int64_t{8} << 20)) * 20 / 19;
  running.Restart();
  EXPECT_ERROR(Export(), grpc::UNAVAILABLE);
  Counts("a-red", "right.jpg");  // the model does fit
}

TEST_F(ExportAnnotationsTest, FreesMemoryOfCancelledExports) {
  for (int i = 0; i < 20; ++i) {
    grpc::ClientContext context;
    const auto stream =
        v1::LabelService::NewStub(running.channel)->ExportAnnotations(&context, request);
    v1::ExportAnnotationsResponse part;
    for (int read = 0; read < i % 3; ++read) EXPECT_TRUE(stream->Read(&part));
    context.TryCancel();
    while (stream->Read(&part)) {
    }
    EXPECT_ERROR(stream->Finish(), grpc::CANCELLED);
  }
  EXPECT_OK(Export());
}

}  // namespace
}  // namespace pepeseg
