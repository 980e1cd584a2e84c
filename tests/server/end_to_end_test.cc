// The server program and its worker, over a socket: what a newcomer does.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/types.h>

#include <csignal>
#include <set>

#include "absl/time/clock.h"
#include "tests/server/pepesegd_process.h"
#include "tests/server/service_client.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

using ::testing::HasSubstr;
using testing::PepesegdProcess;
using testing::ServiceClient;

// A quarter of the size and few steps: the way that a full training takes, in seconds.
v1::TrainingOptions QuickOptions() {
  v1::TrainingOptions options;
  options.mutable_import()->set_image_scale(0.25);
  options.mutable_reconstruct()->set_num_steps(150);
  options.mutable_features()->set_num_steps(100);
  options.mutable_features()->set_num_pixels(300);
  options.mutable_features()->set_steps_per_chunk(50);
  return options;
}

v1::TrainingOptions EndlessOptions() {
  v1::TrainingOptions options = QuickOptions();
  options.mutable_reconstruct()->set_num_steps(1'000'000);
  return options;
}

class EndToEndTest : public ::testing::Test {
 protected:
  EndToEndTest() { Restart(); }

  void Restart() {
    client_.reset();
    server_.reset();
    server_ = std::make_unique<PepesegdProcess>(folder_ / "data");
    client_ = std::make_unique<ServiceClient>(server_->channel());
  }

  // The name of the shelf as a dataset of the scene.
  std::string UploadShelf(const std::string& scene) {
    EXPECT_OK(client_->CreateScene(scene));
    const auto dataset =
        client_->Upload(scene, testing::ReadDataset(PEPESEG_TEST_DATA "/apc_shelf"));
    EXPECT_OK(dataset);
    return dataset.value_or("");
  }

  std::string Train(const std::string& scene, const std::string& dataset,
                    const v1::TrainingOptions& options) {
    const auto job = client_->Train(scene, dataset, options);
    EXPECT_OK(job);
    return job.ok() ? job->name() : "";
  }

  pid_t WorkerOf(const std::string& job) {
    return testing::FindProcess("--job=" + (folder_ / "data" / job).string());
  }

  testing::TempFolder folder_;
  std::unique_ptr<PepesegdProcess> server_;
  std::unique_ptr<ServiceClient> client_;
};

void ExpectWholeStory(const std::vector<v1::JobEvent>& events) {
  std::set<std::string> stages;
  int64_t sequence = 0;
  for (size_t i = 1; i < events.size(); ++i) {  // the first is the snapshot
    EXPECT_GT(events[i].sequence(), sequence);
    sequence = events[i].sequence();
    if (events[i].has_stage_ended()) stages.insert(events[i].stage_ended().stage());
  }
  EXPECT_TRUE(events.front().has_snapshot());
  EXPECT_EQ(events.back().state_changed().state(), v1::JOB_STATE_SUCCEEDED);
  EXPECT_THAT(stages,
              ::testing::ElementsAre("evaluate", "features", "index", "prepare", "reconstruct"));
}

TEST_F(EndToEndTest, FromPhotographsToASegment) {
  const std::string job = Train("shelf", UploadShelf("shelf"), QuickOptions());
  ASSERT_OK_AND_ASSIGN(const auto events, client_->Watch(job));
  ExpectWholeStory(events);
  ASSERT_OK_AND_ASSIGN(const v1::Model model, client_->GetModel("scenes/shelf/models/live"));
  EXPECT_EQ(model.name(), "scenes/shelf/models/1");
  EXPECT_GT(model.metrics().at("psnr"), 10);
  ASSERT_OK_AND_ASSIGN(const auto views, client_->ListViews(model.name()));
  ASSERT_EQ(views.size(), 15u);
  const v1::View& view = views[0];
  EXPECT_TRUE(view.held_out());
  ASSERT_OK_AND_ASSIGN(const auto picture, client_->Render(model.name(), view.view()));
  EXPECT_EQ(picture.width(), view.camera().width());
  EXPECT_EQ(picture.png().substr(1, 3), "PNG");

  v1::SegmentRequest request;
  request.set_model("scenes/shelf/models/live");
  request.mutable_prompt_view()->set_view(view.view());
  v1::PointsPrompt::Point& point = *request.mutable_points()->add_points();
  point.set_x(view.camera().width() * 0.5);
  point.set_y(view.camera().height() * 0.5);
  request.mutable_targets()->set_group(v1::SegmentRequest::Targets::GROUP_HELD_OUT);
  ASSERT_OK_AND_ASSIGN(const auto answer, client_->Segment(request));
  ASSERT_EQ(answer.masks_size(), 2);
  EXPECT_EQ(answer.masks(0).view(), view.view());
  EXPECT_GT(answer.masks(0).area(), 0);
  EXPECT_LT(answer.masks(0).area(), int64_t{picture.width()} * picture.height());
  EXPECT_GE(answer.masks(0).score(), answer.threshold());

  ASSERT_OK_AND_ASSIGN(const std::string ply, client_->Export(model.name()));
  EXPECT_EQ(ply.substr(0, 4), "ply\n");
  EXPECT_THAT(ply.substr(0, 300),
              HasSubstr("element vertex " + std::to_string(model.num_gaussians()) + "\n"));
}

TEST_F(EndToEndTest, KilledWorkerFailsItsJobAndTheNextOneRuns) {
  const std::string dataset = UploadShelf("shelf");
  const std::string job = Train("shelf", dataset, EndlessOptions());
  ASSERT_OK(client_->WaitForStep(job));
  ASSERT_GT(WorkerOf(job), 0);
  ASSERT_EQ(kill(WorkerOf(job), SIGKILL), 0);
  ASSERT_OK_AND_ASSIGN(const v1::Job ended, client_->WaitForJob(job));
  EXPECT_EQ(ended.state(), v1::JOB_STATE_FAILED);
  EXPECT_THAT(ended.error().message(), HasSubstr("signal 9"));
  EXPECT_THAT(ended.error().message(), HasSubstr("stage 'reconstruct'"));
  ASSERT_OK_AND_ASSIGN(const v1::Job next,
                       client_->WaitForJob(Train("shelf", dataset, QuickOptions())));
  EXPECT_EQ(next.state(), v1::JOB_STATE_SUCCEEDED) << next.error().message();
}

TEST_F(EndToEndTest, CancelsARunningJobWithinASecond) {
  const std::string job = Train("shelf", UploadShelf("shelf"), EndlessOptions());
  ASSERT_OK(client_->WaitForStep(job));
  const absl::Time start = absl::Now();
  ASSERT_OK(client_->CancelJob(job));
  ASSERT_OK_AND_ASSIGN(const v1::Job ended, client_->WaitForJob(job));
  // A second, and as much again for a machine that is busy with other tests.
  EXPECT_LT(absl::Now() - start, absl::Seconds(2));
  EXPECT_EQ(ended.state(), v1::JOB_STATE_CANCELLED);
  EXPECT_EQ(WorkerOf(job), 0);
}

TEST_F(EndToEndTest, SigtermQueuesTheJobForTheNextServer) {
  const std::string job = Train("shelf", UploadShelf("shelf"), QuickOptions());
  ASSERT_OK(client_->WaitForStep(job));
  const auto end = server_->Terminate();
  ASSERT_TRUE(end.has_value());
  EXPECT_EQ(end->signal, 0);
  EXPECT_EQ(end->exit_code, 0) << server_->Log();
  EXPECT_EQ(WorkerOf(job), 0);
  Restart();
  ASSERT_OK_AND_ASSIGN(const v1::Job ended, client_->WaitForJob(job));
  EXPECT_EQ(ended.state(), v1::JOB_STATE_SUCCEEDED) << ended.error().message();
}

TEST_F(EndToEndTest, KilledServerTakesItsWorkerAlongAndItsJobRunsAgain) {
  const std::string job = Train("shelf", UploadShelf("shelf"), QuickOptions());
  ASSERT_OK(client_->WaitForStep(job));
  server_->Kill();
  for (int i = 0; i < 200 && WorkerOf(job) != 0; ++i) absl::SleepFor(absl::Milliseconds(10));
  EXPECT_EQ(WorkerOf(job), 0);
  Restart();
  ASSERT_OK_AND_ASSIGN(const v1::Job ended, client_->WaitForJob(job));
  EXPECT_EQ(ended.state(), v1::JOB_STATE_SUCCEEDED) << ended.error().message();
}

}  // namespace
}  // namespace pepeseg
