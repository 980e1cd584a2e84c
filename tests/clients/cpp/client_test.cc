// Tests the client library against a server whose worker makes the model of model_worker.cc: a red
// square around pixel (30, 32) of view middle.jpg, and a blue one around (66, 32).
#include "clients/cpp/client.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "clients/cpp/answer_status.h"
#include "clients/cpp/mask.h"
#include "clients/cpp/resource_names.h"
#include "tests/server/running_server.h"
#include "tests/testing/fake_sam.h"
#include "tests/testing/status_testing.h"

namespace pepeseg::client {
namespace {

namespace fs = std::filesystem;

struct ClientTest : ::testing::Test {
  ClientTest() : running(PEPESEG_MODEL_WORKER), client(running.channel) {
    fs::create_directories(photos / "images");
    std::ofstream(photos / "images/file") << "for the worker of tests, these bytes are photographs";
    folder.files = {{"file", v1::FILE_KIND_IMAGE, photos / "images/file"}};
  }

  // Trains with a file of that name, by which the worker decides what to make.
  v1::Job TrainShelf(const std::string& file = "file") {
    folder.files.front().name = file;
    EXPECT_OK(client.EnsureScene("shelf"));
    const auto dataset = client.Upload("shelf", folder);
    EXPECT_OK(dataset);
    v1::TrainSceneRequest request;
    request.set_scene("shelf");
    request.set_dataset(dataset->name());
    const auto job = client.Train(request);
    EXPECT_OK(job);
    const auto ended = client.WatchJob(job->name(), [](const v1::JobEvent& /*event*/) {});
    EXPECT_OK(ended);
    return *ended;
  }

  static v1::Prompt ClickAt(double x, double y) {
    v1::Prompt prompt;
    prompt.mutable_view()->set_view("middle.jpg");
    auto* point = prompt.mutable_points()->add_points();
    point->set_x(x);
    point->set_y(y);
    return prompt;
  }

  RunningServer running;
  Client client;
  fs::path photos = running.folder / "photos";
  DatasetFolder folder;
};

TEST_F(ClientTest, TrainsAndSegments) {
  ASSERT_EQ(TrainShelf().state(), v1::JOB_STATE_SUCCEEDED);
  v1::SegmentViewsRequest request;
  request.set_model(ModelName("shelf"));
  *request.mutable_prompt() = ClickAt(30, 32);
  request.set_mask_encoding(v1::MASK_ENCODING_COCO_RLE);
  const auto answer = client.Segment(request);
  ASSERT_OK(answer);
  ASSERT_EQ(answer->masks_size(), 1);
  const auto mask = DecodeRle(answer->masks(0).rle());
  ASSERT_OK(mask);
  const int width = answer->masks(0).rle().width();
  EXPECT_EQ((*mask)[32 * width + 30], 1);  // red
  EXPECT_EQ((*mask)[32 * width + 66], 0);  // blue
}

// The server refuses more than 100 views with SAM's borders.
TEST_F(ClientTest, SegmentsAnyNumberOfViewsWithBordersBySam) {
  constexpr int kNumViews = 120;
  const fs::path sam = running.folder / "sam";
  testing::MakeFakeSam(sam);
  running.options.workers.sam = sam;
  running.Restart();
  client = Client(running.channel);
  ASSERT_EQ(TrainShelf("many.model").state(), v1::JOB_STATE_SUCCEEDED);
  v1::SegmentViewsRequest request;
  request.set_model(ModelName("shelf"));
  *request.mutable_prompt() = ClickAt(30, 32);
  request.mutable_prompt()->mutable_view()->set_view("0.jpg");
  request.mutable_granularity()->set_scale_quantile(0.5);
  request.mutable_granularity()->set_threshold(0.75);
  request.mutable_targets()->set_group(v1::SegmentViewsRequest::Targets::GROUP_ALL);
  request.set_sam_borders(true);
  const auto refused = running.Call(&SegmentationStub::SegmentViews, request);
  ASSERT_EQ(refused.status().error_code(), grpc::INVALID_ARGUMENT);
  const auto all = client.Segment(request);
  ASSERT_OK(all);
  ASSERT_EQ(all->masks_size(), kNumViews);
  std::set<std::string> views;
  for (const auto& mask : all->masks()) {
    views.insert(mask.view());
    EXPECT_EQ(mask.border_image(), v1::SegmentViewsResponse::BORDER_IMAGE_RENDERING);
    EXPECT_GT(mask.area(), 0);
  }
  EXPECT_EQ(views.size(), static_cast<size_t>(kNumViews));
  EXPECT_EQ(all->model(), "scenes/shelf/models/1");
  EXPECT_EQ(all->scale_quantile(), 0.5);

  v1::SegmentViewsRequest clicks = request;
  clicks.set_sam_borders(false);
  clicks.set_sam_clicks(true);
  clicks.clear_granularity();
  ASSERT_OK_AND_ASSIGN(const auto clicked, client.Segment(clicks));
  EXPECT_EQ(clicked.masks_size(), kNumViews);

  request.mutable_targets()->set_group(v1::SegmentViewsRequest::Targets::GROUP_HELD_OUT);
  ASSERT_OK_AND_ASSIGN(const auto held_out, client.Segment(request));
  EXPECT_EQ(held_out.masks_size(), kNumViews / 2);

  request.mutable_targets()->Clear();
  for (int i = kNumViews - 1; i >= 0; --i) {  // backwards, and each twice
    for (int k = 0; k < 2; ++k) request.mutable_targets()->add_views(absl::StrCat(i, ".jpg"));
  }
  ASSERT_OK_AND_ASSIGN(const auto named, client.Segment(request));
  ASSERT_EQ(named.masks_size(), kNumViews);
  for (int i = 0; i < kNumViews; ++i) {
    EXPECT_EQ(named.masks(i).view(), absl::StrCat(kNumViews - 1 - i, ".jpg"));
  }
}

TEST_F(ClientTest, OnlyLooksUpASceneThatIsNamedWithItsProject) {
  const std::string name = "projects/default/scenes/shelf";
  EXPECT_TRUE(absl::IsNotFound(client.EnsureScene(name)));
  ASSERT_OK(client.EnsureScene("shelf"));
  EXPECT_OK(client.EnsureScene(name));
}

TEST_F(ClientTest, SendsTheSameFilesOnlyOnce) {
  ASSERT_OK(client.EnsureScene("shelf"));
  ASSERT_OK(client.EnsureScene("scenes/shelf"));  // it exists already
  std::vector<int64_t> reported;
  std::vector<std::string> notes;
  UploadProgress progress;
  progress.bytes = [&](int64_t num_there, int64_t /*num_bytes*/) { reported.push_back(num_there); };
  progress.note = [&](const std::string& note) { notes.push_back(note); };
  const auto first = client.Upload("shelf", folder, progress);
  ASSERT_OK(first);
  EXPECT_EQ(reported.back(), static_cast<int64_t>(fs::file_size(photos / "images/file")));
  EXPECT_TRUE(notes.empty());
  const auto second = client.Upload("shelf", folder, progress);
  ASSERT_OK(second);
  ASSERT_EQ(notes.size(), 1u);
  EXPECT_EQ(notes[0], "the server has every file already");
  const auto newest = client.NewestDataset("shelf");
  ASSERT_OK(newest);
  EXPECT_EQ(newest->name(), second->name());
}

TEST_F(ClientTest, DeletesUploadsThatAreNotSealed) {
  ASSERT_OK(client.EnsureScene("shelf"));
  const v1::Upload open = running.CreateUpload("shelf", {{"images/other.jpg", "bytes"}});
  EXPECT_OK(client.DeleteUpload(open.name()));
  EXPECT_TRUE(absl::IsNotFound(client.DeleteUpload(open.name())));
  const auto dataset = client.Upload("shelf", folder);
  ASSERT_OK(dataset);
  EXPECT_EQ(client.GetDataset(dataset->name())->num_files(), 1);
  EXPECT_EQ(client.ListDatasets("shelf")->datasets_size(), 1);
  EXPECT_TRUE(absl::IsFailedPrecondition(client.DeleteUpload("scenes/shelf/uploads/2")));
}

TEST_F(ClientTest, ReturnsTheMaskOfALabel) {
  ASSERT_EQ(TrainShelf().state(), v1::JOB_STATE_SUCCEEDED);
  v1::SegmentViewsRequest query;
  query.set_model(ModelName("shelf"));
  *query.mutable_prompt() = ClickAt(30, 32);
  const auto answer = client.Segment(query);
  ASSERT_OK(answer);
  v1::CreateLabelRequest request;
  request.set_parent("shelf");
  request.set_label_id("red");
  request.mutable_label()->set_view("middle.jpg");
  *request.mutable_label()->mutable_mask()->mutable_rle() = answer->masks(0).rle();
  ASSERT_OK(client.CreateLabel(request));
  const auto label = client.GetLabel("scenes/shelf/labels/red", v1::PIXEL_FRAME_PHOTOGRAPH);
  ASSERT_OK(label);
  EXPECT_EQ(label->mask().rle().counts(), answer->masks(0).rle().counts());
  EXPECT_TRUE(absl::IsNotFound(
      client.GetLabel("scenes/shelf/labels/blue", v1::PIXEL_FRAME_PHOTOGRAPH).status()));

  v1::ExportAnnotationsRequest annotations;
  annotations.set_model(ModelName("shelf"));
  int64_t num_done = 0, num_masks = -1;
  const auto on_progress = [&](const v1::ExportAnnotationsResponse::Progress& progress) {
    num_done = progress.num_masks_done();
    num_masks = progress.num_masks();
  };
  const auto header = client.ExportAnnotations(annotations, photos / "things.zip", on_progress);
  ASSERT_OK(header);
  EXPECT_EQ(num_done, header->num_views());
  EXPECT_EQ(num_masks, num_done);
  EXPECT_EQ(static_cast<int64_t>(fs::file_size(photos / "things.zip")), header->num_bytes());
  annotations.add_labels("blue");
  EXPECT_TRUE(absl::IsNotFound(
      client.ExportAnnotations(annotations, photos / "none.zip", on_progress).status()));
  EXPECT_FALSE(fs::exists(photos / "none.zip"));
}

TEST_F(ClientTest, SelectsCombinesAndExports) {
  ASSERT_EQ(TrainShelf().state(), v1::JOB_STATE_SUCCEEDED);
  v1::CreateSelectionRequest request;
  request.set_model(ModelName("shelf"));
  *request.mutable_prompt() = ClickAt(30, 32);
  const auto red = client.Select(request);
  ASSERT_OK(red);
  *request.mutable_prompt() = ClickAt(66, 32);
  const auto blue = client.Select(request);
  ASSERT_OK(blue);
  v1::CombineSelectionsRequest both;
  both.set_first(red->name());
  both.set_second(blue->name());
  both.set_operation(v1::SET_OPERATION_UNION);
  const auto combined = client.CombineSelections(both);
  ASSERT_OK(combined);
  EXPECT_EQ(combined->num_gaussians(), red->num_gaussians() + blue->num_gaussians());
  EXPECT_EQ(client.UndoSelection(combined->name())->name(), red->name());
  EXPECT_EQ(client.ListSelections("shelf")->selections_size(), 3);

  const auto with_gaussians = client.GetSelection(red->name(), /*want_gaussians=*/true);
  ASSERT_OK(with_gaussians);
  EXPECT_FALSE(client.GetSelection(red->name())->has_gaussians());
  v1::CreateSelectionRequest given;
  given.set_model(ModelName("shelf"));
  given.set_display_name("red again");
  *given.mutable_gaussians() = with_gaussians->gaussians();
  const auto again = client.Select(given);
  ASSERT_OK(again);
  EXPECT_EQ(again->num_gaussians(), red->num_gaussians());
  EXPECT_EQ(again->display_name(), "red again");

  v1::ExportGaussiansRequest wanted;
  wanted.set_model(ModelName("shelf"));
  wanted.mutable_subset()->set_selection(red->name());
  const std::string ply = photos / "red.ply";
  const auto header = client.Export(wanted, ply);
  ASSERT_OK(header);
  EXPECT_EQ(header->num_gaussians(), red->num_gaussians());
  EXPECT_EQ(static_cast<int64_t>(fs::file_size(ply)), header->num_bytes());

  v1::ExportMeshRequest mesh;
  mesh.set_model(ModelName("shelf"));
  mesh.mutable_subset()->set_selection(red->name());
  mesh.set_voxels(32);
  const auto meshed = client.ExportMesh(mesh, photos / "mesh.ply");
  ASSERT_OK(meshed);
  EXPECT_GT(meshed->num_triangles(), 0);
  EXPECT_EQ(static_cast<int64_t>(fs::file_size(photos / "mesh.ply")), meshed->num_bytes());
  EXPECT_OK(client.DeleteSelection(red->name()));
  EXPECT_TRUE(absl::IsNotFound(client.GetSelection(red->name()).status()));
}

TEST_F(ClientTest, EditsAndUndoes) {
  ASSERT_EQ(TrainShelf().state(), v1::JOB_STATE_SUCCEEDED);
  v1::CreateSelectionRequest wanted;
  wanted.set_model(ModelName("shelf"));
  *wanted.mutable_prompt() = ClickAt(30, 32);
  const auto red = client.Select(wanted);
  ASSERT_OK(red);
  v1::EditModelRequest request;
  request.set_model(ModelName("shelf"));
  request.mutable_subset()->set_selection(red->name());
  request.mutable_move()->mutable_translation()->set_y(0.5);
  const auto ignore = [](const v1::EditModelResponse::Progress& /*progress*/) {};
  const auto moved = client.Edit(request, ignore);
  ASSERT_OK(moved);
  EXPECT_EQ(moved->model(), "scenes/shelf/models/2");
  EXPECT_EQ(moved->edited_from(), "scenes/shelf/models/1");
  EXPECT_EQ(moved->num_changed(), red->num_gaussians());
  const auto there = client.GetSelection(moved->selection());
  ASSERT_OK(there);
  EXPECT_NEAR(there->box().min().y(), red->box().min().y() + 0.5, 1e-5);
  EXPECT_EQ(client.GetModel(moved->model())->edited_from(), "scenes/shelf/models/1");
  // The selection is of the former model.
  EXPECT_TRUE(absl::IsFailedPrecondition(client.Edit(request, ignore).status()));
  EXPECT_EQ(client.SetLiveModel(moved->edited_from())->live_model(), "scenes/shelf/models/1");
  request.mutable_remove();
  const auto removed = client.Edit(request, ignore);
  ASSERT_OK(removed);
  EXPECT_EQ(removed->num_removed(), red->num_gaussians());
  EXPECT_EQ(removed->selection(), "");
}

TEST_F(ClientTest, LeavesNoFileOfAFailedExport) {
  ASSERT_OK(client.EnsureScene("shelf"));
  v1::ExportGaussiansRequest wanted;
  wanted.set_model(ModelName("shelf"));
  const auto header = client.Export(wanted, photos / "none.ply");
  EXPECT_FALSE(header.ok());
  EXPECT_FALSE(fs::exists(photos / "none.ply"));
  v1::ExportMeshRequest mesh;
  mesh.set_model(ModelName("shelf"));
  EXPECT_FALSE(client.ExportMesh(mesh, photos / "none.ply").ok());
  EXPECT_FALSE(fs::exists(photos / "none.ply"));
  EXPECT_FALSE(fs::exists(photos / "none.ply.part"));
}

TEST_F(ClientTest, ReturnsTheErrorDetailsOfTheServer) {
  const auto scene = client.GetScene("nowhere");
  EXPECT_TRUE(absl::IsNotFound(scene.status())) << scene.status();
  const auto detail = DetailOf(scene.status());
  ASSERT_TRUE(detail.has_value());
  EXPECT_EQ(detail->resource, "scenes/nowhere");
  EXPECT_TRUE(absl::IsFailedPrecondition(client.NewestDataset("nowhere").status()) ||
              absl::IsNotFound(client.NewestDataset("nowhere").status()));
}

// The worker of tests never finishes a dataset with a file "hang".
TEST_F(ClientTest, WatchesAJobUntilItIsCancelled) {
  folder.files[0].name = "hang";
  ASSERT_OK(client.EnsureScene("shelf"));
  const auto dataset = client.Upload("shelf", folder);
  ASSERT_OK(dataset);
  v1::TrainSceneRequest request;
  request.set_scene("shelf");
  request.set_dataset(dataset->name());
  const auto job = client.Train(request);
  ASSERT_OK(job);
  absl::StatusOr<v1::Job> ended = absl::UnknownError("");
  std::thread watcher(
      [&] { ended = client.WatchJob(job->name(), [](const v1::JobEvent& /*event*/) {}); });
  EXPECT_EQ(client.ListJobs("shelf")->jobs_size(), 1);
  EXPECT_OK(client.CancelJob(job->name()));
  watcher.join();
  ASSERT_OK(ended);
  EXPECT_EQ(ended->state(), v1::JOB_STATE_CANCELLED);
}

}  // namespace
}  // namespace pepeseg::client
