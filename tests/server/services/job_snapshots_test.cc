// Queries of a job that trains. The worker hangs, and the test writes the files of a worker.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <numeric>
#include <set>
#include <string>
#include <vector>

#include "core/model_files/model_file.h"
#include "server/store/layout.h"
#include "server/worker_protocol/job_folder.h"
#include "server/worker_protocol/snapshot_file.h"
#include "tests/server/access/keyed_server.h"
#include "tests/server/shelf_model.h"

namespace pepeseg {
namespace {

namespace fs = std::filesystem;

// Job 1 has made the model of scene "shelf"; the other jobs take it as what their worker trains.
struct JobSnapshotsTest : EmptyScene {
  explicit JobSnapshotsTest(const ServerOptions& options = WithAdmin())
      : EmptyScene(PEPESEG_MODEL_WORKER, options) {
    TrainToTheEnd("shelf", "file");
    auto made = ReadModel(FolderOf("jobs/j1").model(1));
    EXPECT_OK(made);
    model = *std::move(made);
    job = running.Train("shelf", "hang").name();
    EXPECT_TRUE(Eventually(
        [&] { return Call(&JobStub::GetJob, Named{job})->state() == v1::JOB_STATE_RUNNING; }));
  }

  JobFolder FolderOf(const std::string& name) const {
    return JobFolder(JobsFolder(running.options.data) / name.substr(name.find('/') + 1));
  }
  // Ends stage one, as a worker does.
  void WriteGaussians(const std::string& folder = "reconstruct") const {
    Model without = model;
    without.field = {};
    const fs::path to = FolderOf(job).attempt(1) / folder;
    fs::create_directories(to);
    EXPECT_OK(WriteModel(to, without));
  }
  // Writes the model of an unfinished stage one, as a worker does.
  void WriteEarlyModel() const {
    Model early = model;
    early.metrics[kEarlyStep] = 15;
    early.metrics[kEarlyNumSteps] = 90;
    fs::create_directories(FolderOf(job).early(1));
    EXPECT_OK(WriteModel(FolderOf(job).early(1), early));
  }
  SnapshotFile At(int64_t step) const { return {job.substr(5), 1, step, 100, model.field}; }
  void Write(const SnapshotFile& snapshot) const {
    EXPECT_OK(WriteSnapshotFile(FolderOf(job).snapshot(1), snapshot));
  }

  v1::SegmentViewsRequest Click(double x = 30) const {
    v1::SegmentViewsRequest request = pepeseg::Click<v1::SegmentViewsRequest>(x);
    request.set_model(job);
    return request;
  }
  Reply<v1::SegmentViewsResponse> Segment() const {
    return Call(&SegmentationStub::SegmentViews, Click());
  }
  // Returns the step of the snapshot that answers now; -1: none.
  int64_t StepNow() const {
    const auto answer = Segment();
    return answer->has_snapshot() ? answer->snapshot().step() : -1;
  }
  std::set<std::string> Resident() const {
    std::set<std::string> names;
    const auto list = Call(&AdminStub::ListResidentModels, {});
    for (const v1::ResidentModel& resident : list->models()) names.insert(resident.name());
    EXPECT_EQ(static_cast<int>(names.size()), list->models_size());
    return names;
  }
  void ExpectNoSnapshot(const std::string& words) const {
    const auto answer = Segment();
    EXPECT_ERROR(answer, grpc::UNAVAILABLE,
                 {.reason = "NO_SNAPSHOT", .resource = job, .message = words});
    EXPECT_TRUE(DetailOf(answer.status()).has_retry_after());
  }

  Model model;
  std::string job;
};

TEST_F(JobSnapshotsTest, AnswerByTheNewestOne) {
  ExpectNoSnapshot(job + " is in stage prepare");
  WriteGaussians();
  ExpectNoSnapshot("about a second after the first step of stage features");
  Write(At(10));
  ASSERT_OK_AND_ASSIGN(const auto answer, Segment());
  EXPECT_EQ(answer.model(), job);
  EXPECT_EQ(answer.snapshot().job(), job);
  EXPECT_EQ(answer.snapshot().stage(), v1::JOB_STAGE_FEATURES);
  EXPECT_EQ(answer.snapshot().step(), 10);
  EXPECT_EQ(answer.snapshot().num_steps(), 100);
  EXPECT_GE(answer.masks(0).area(), 29 * 29);  // the red square
  EXPECT_LE(answer.masks(0).area(), 35 * 35);
  Write(At(20));
  EXPECT_EQ(StepNow(), 20);
  EXPECT_EQ(StepNow(), 20);
  EXPECT_EQ(Resident(), std::set<std::string>{job});
}

TEST_F(JobSnapshotsTest, AnswerByAnEarlyModelUntilStageTwoHasOne) {
  WriteEarlyModel();
  ASSERT_OK_AND_ASSIGN(const auto early, Segment());
  EXPECT_EQ(early.snapshot().stage(), v1::JOB_STAGE_RECONSTRUCT);
  EXPECT_EQ(early.snapshot().step(), 15);
  EXPECT_EQ(early.snapshot().num_steps(), 90);
  EXPECT_GE(early.masks(0).area(), 29 * 29);
  WriteGaussians();
  EXPECT_EQ(StepNow(), 15);
  // Those of stage two are other Gaussians, one less here.
  std::vector<int64_t> rows(static_cast<size_t>(model.gaussians.count - 1));
  std::iota(rows.begin(), rows.end(), 0);
  model.gaussians = model.gaussians.Select(rows);
  model.field.features.resize(rows.size() * kFeatureDim);
  WriteGaussians();
  Write(At(10));
  ASSERT_OK_AND_ASSIGN(const auto answer, Segment());
  EXPECT_EQ(answer.snapshot().stage(), v1::JOB_STAGE_FEATURES);
  EXPECT_EQ(answer.snapshot().step(), 10);
  EXPECT_EQ(Resident(), std::set<std::string>{job});
}

TEST_F(JobSnapshotsTest, RefuseAnEarlyModelWithoutFeatures) {
  model.field = {};
  WriteEarlyModel();
  ExpectNoSnapshot(job);
  EXPECT_TRUE(fs::is_empty(ScratchFolder(running.options.data)));
}

TEST_F(JobSnapshotsTest, AnswerForGaussiansOfTheDataset) {
  WriteGaussians("given");
  Write(At(10));
  EXPECT_EQ(StepNow(), 10);
}

TEST_F(JobSnapshotsTest, AnswerWhateverOnlyReadsAModel) {
  WriteGaussians();
  Write(At(30));
  v1::ProposeScalesRequest propose;
  propose.set_model(job);
  *propose.mutable_prompt() = ClickAt(30);
  EXPECT_EQ(Call(&SegmentationStub::ProposeScales, propose)->snapshot().step(), 30);
  v1::DecomposeModelRequest decompose;
  decompose.set_model(job);
  const auto decomposed = Call(&SegmentationStub::DecomposeModel, decompose);
  EXPECT_EQ(decomposed->snapshot().step(), 30);
  EXPECT_EQ(decomposed->levels(0).segments_size(), 2);
  v1::RenderViewRequest render;
  render.set_model(job);
  render.mutable_viewpoint()->set_view("middle.jpg");
  render.set_content(v1::RenderViewRequest::CONTENT_FEATURES);
  EXPECT_EQ(Call(&RenderStub::RenderView, render)->snapshot().step(), 30);
  EXPECT_EQ(Call(&SceneStub::ListViews, Under{job})->views_size(), 3);

  grpc::ClientContext context;
  const auto stream = running.segmentation->StreamSegments(&context);
  v1::StreamSegmentsRequest request;
  *request.mutable_segment() = Click();
  ASSERT_TRUE(stream->Write(request));
  v1::StreamSegmentsResponse answer;
  ASSERT_TRUE(stream->Read(&answer));
  EXPECT_EQ(answer.segment().snapshot().step(), 30) << answer.DebugString();
  EXPECT_TRUE(stream->WritesDone());
  EXPECT_FALSE(stream->Read(&answer));
  EXPECT_OK(stream->Finish());
}

TEST_F(JobSnapshotsTest, AreNoModelsForOtherCalls) {
  WriteGaussians();
  Write(At(30));
  v1::CreateSelectionRequest select;
  select.set_model(job);
  *select.mutable_prompt() = ClickAt(30);
  EXPECT_ERROR(Call(&SelectionStub::CreateSelection, select), grpc::INVALID_ARGUMENT, "model");
  v1::FindSegmentsRequest find;
  find.set_model(job);
  find.set_text("book");
  EXPECT_ERROR(Call(&SegmentationStub::FindSegments, find), grpc::INVALID_ARGUMENT, "model");
  v1::SegmentViewsRequest by_sam = Click();
  by_sam.set_sam_borders(true);
  EXPECT_ERROR(Call(&SegmentationStub::SegmentViews, by_sam), grpc::FAILED_PRECONDITION);
}

TEST_F(JobSnapshotsTest, StayWhenAFileIsDamagedOrForeign) {
  WriteGaussians();
  Write(At(10));
  EXPECT_EQ(StepNow(), 10);
  const fs::path file = FolderOf(job).snapshot(1);

  Write(At(20));
  {
    std::fstream bytes(file, std::ios::binary | std::ios::in | std::ios::out);
    bytes.seekp(1000);
    bytes.put('x').put('y');
  }
  EXPECT_EQ(StepNow(), 10);
  SnapshotFile foreign = At(21);
  foreign.job = "j1";
  Write(foreign);
  EXPECT_EQ(StepNow(), 10);
  SnapshotFile earlier = At(22);
  earlier.fence = 7;
  Write(earlier);
  EXPECT_EQ(StepNow(), 10);
  SnapshotFile smaller = At(23);
  smaller.field.features.resize(32);
  Write(smaller);
  EXPECT_EQ(StepNow(), 10);
  fs::remove(file);
  EXPECT_EQ(StepNow(), 10);
  fs::create_symlink(FolderOf("jobs/j1").model(1) / "features.bin", file);
  EXPECT_EQ(StepNow(), 10);
  fs::remove(file);
  Write(At(30));
  EXPECT_EQ(StepNow(), 30);
  EXPECT_EQ(Resident(), std::set<std::string>{job});
}

TEST_F(JobSnapshotsTest, FollowNoLinkToOtherGaussians) {
  WriteGaussians();
  const fs::path ply = FolderOf(job).attempt(1) / "reconstruct/gaussians.ply";
  fs::remove(ply);
  fs::create_symlink(FolderOf("jobs/j1").model(1) / "gaussians.ply", ply);
  Write(At(10));
  ExpectNoSnapshot(job);
  EXPECT_EQ(Resident(), std::set<std::string>{});
  EXPECT_TRUE(fs::is_empty(ScratchFolder(running.options.data)));
}

TEST_F(JobSnapshotsTest, GoWithACancelledJob) {
  WriteGaussians();
  Write(At(10));
  EXPECT_EQ(StepNow(), 10);
  EXPECT_OK(Call(&JobStub::CancelJob, Named{job}));
  EXPECT_EQ(running.Await(job).state(), v1::JOB_STATE_CANCELLED);
  EXPECT_ERROR(Segment(), grpc::FAILED_PRECONDITION,
               {.reason = "NO_MODEL", .resource = job, .message = "was cancelled"});
  EXPECT_TRUE(Eventually([&] { return Resident().empty(); }));
}

TEST_F(JobSnapshotsTest, EndWithTheModel) {
  v1::SegmentViewsRequest request = Click();
  request.set_model("jobs/j1");
  ASSERT_OK_AND_ASSIGN(const auto answer, Call(&SegmentationStub::SegmentViews, request));
  EXPECT_EQ(answer.model(), "scenes/shelf/models/1");
  EXPECT_FALSE(answer.has_snapshot());
  EXPECT_OK(Call(&SceneStub::DeleteModel, Named{"scenes/shelf/models/1"}));
  EXPECT_ERROR(Call(&SegmentationStub::SegmentViews, request), grpc::NOT_FOUND);
}

TEST_F(JobSnapshotsTest, AreOfJobsOnly) {
  v1::SegmentViewsRequest request = Click();
  request.set_model("jobs/j99");
  EXPECT_ERROR(Call(&SegmentationStub::SegmentViews, request), grpc::NOT_FOUND,
               {.reason = "NO_SUCH_JOB", .resource = "jobs/j99"});
  request.set_model("jobs/../j1");
  EXPECT_ERROR(Call(&SegmentationStub::SegmentViews, request), grpc::INVALID_ARGUMENT, "model");
}

struct JobSnapshotsOfProjects : KeyedServer {};

TEST_F(JobSnapshotsOfProjects, AnswerTheProjectOfTheJobOnly) {
  v1::SegmentViewsRequest request = pepeseg::Click<v1::SegmentViewsRequest>(30);
  request.set_model(job);
  EXPECT_OK(CallAs(reader, &SegmentationStub::SegmentViews, request));
  EXPECT_ERROR(CallAs(stranger, &SegmentationStub::SegmentViews, request), grpc::PERMISSION_DENIED,
               "model");
  EXPECT_ERROR(CallAs("", &SegmentationStub::SegmentViews, request), grpc::UNAUTHENTICATED);
}

// A budget for one model, but not for two.
ServerOptions RoomForOne() {
  ServerOptions options = WithAdmin();
  const MemoryBytes bytes = BytesOfModel(*MakeCpuBackend(1), {20'000, 0, int64_t{96} * 64});
  options.model_bytes = (bytes.host + bytes.device) * 3 / 2;
  return options;
}

struct JobSnapshotsInLittleMemory : JobSnapshotsTest {
  JobSnapshotsInLittleMemory() : JobSnapshotsTest(RoomForOne()) {}
};

TEST_F(JobSnapshotsInLittleMemory, GiveWayToTheNextOne) {
  WriteGaussians();
  for (const int64_t step : {10, 20, 30}) {
    Write(At(step));
    EXPECT_EQ(StepNow(), step);
    EXPECT_EQ(Resident(), std::set<std::string>{job});
  }
  // Another model evicts the snapshot, which is then read again.
  v1::SegmentViewsRequest request = Click();
  request.set_model("scenes/shelf/models/1");
  EXPECT_OK(Call(&SegmentationStub::SegmentViews, request));
  EXPECT_EQ(Resident(), std::set<std::string>{"scenes/shelf/models/1"});
  EXPECT_EQ(StepNow(), 30);
}

}  // namespace
}  // namespace pepeseg
