// The server program and its worker over a socket, used as a new user does.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/types.h>

#include <algorithm>
#include <csignal>
#include <set>

#include "absl/time/clock.h"
#include "tests/server/pepesegd_process.h"
#include "tests/server/service_client.h"
#include "tests/testing/eventually.h"
#include "tests/testing/fake_sam.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"
#include "tests/testing/time_limit.h"

namespace pepeseg {
namespace {

using ::testing::HasSubstr;
using testing::PepesegdProcess;
using testing::ServiceClient;

// A quarter of the size and few steps: all stages of a training, in seconds.
v1::TrainingOptions QuickOptions() {
  v1::TrainingOptions options;
  options.mutable_import()->set_image_scale(0.25);
  options.mutable_reconstruct()->set_num_steps(150);
  options.mutable_features()->set_num_steps(100);
  (*options.mutable_advanced())["features.num_pixels"] = "300";
  (*options.mutable_advanced())["features.steps_per_chunk"] = "50";
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

  void Restart(const std::vector<std::string>& more = {}) {
    client_.reset();
    server_.reset();
    server_ = std::make_unique<PepesegdProcess>(folder_ / "data", more);
    client_ = std::make_unique<ServiceClient>(server_->channel());
  }

  // Uploads the shelf, and returns the name of the dataset.
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
  std::vector<v1::JobStage> stages;
  int64_t sequence = 0;
  for (size_t i = 1; i < events.size(); ++i) {  // the first is the snapshot
    EXPECT_GT(events[i].sequence(), sequence);
    sequence = events[i].sequence();
    if (events[i].has_stage_ended()) stages.push_back(events[i].stage_ended().stage());
  }
  EXPECT_TRUE(events.front().has_snapshot());
  EXPECT_EQ(events.back().state_changed().state(), v1::JOB_STATE_SUCCEEDED);
  EXPECT_THAT(stages,
              ::testing::ElementsAre(v1::JOB_STAGE_PREPARE, v1::JOB_STAGE_SFM, v1::JOB_STAGE_PRIORS,
                                     v1::JOB_STAGE_RECONSTRUCT, v1::JOB_STAGE_EVALUATE,
                                     v1::JOB_STAGE_FEATURES, v1::JOB_STAGE_INDEX));
}

// Checks that there are previews within the contract's limits, from the first steps of stage one to
// its last.
void ExpectPreviews(const std::vector<v1::JobEvent>& events) {
  std::vector<v1::JobEvent::Preview> previews;
  for (const v1::JobEvent& event : events) {
    if (event.has_preview()) previews.push_back(event.preview());
  }
  ASSERT_GE(previews.size(), 2u);
  EXPECT_LT(previews.front().step(), previews.front().num_steps() / 2);
  EXPECT_EQ(previews.back().step(), previews.back().num_steps());
  for (const v1::JobEvent::Preview& preview : previews) {
    EXPECT_EQ(preview.stage(), v1::JOB_STAGE_RECONSTRUCT);
    EXPECT_EQ(preview.view(), previews.front().view());
    EXPECT_TRUE(preview.jpeg().starts_with("\xff\xd8\xff"));
    EXPECT_LE(preview.jpeg().size(), 30'000u);
    EXPECT_LE(std::max(preview.width(), preview.height()), 640);
  }
}

const v1::JobEvent::StageEnded& EndOf(v1::JobStage stage, const std::vector<v1::JobEvent>& events) {
  for (const v1::JobEvent& event : events) {
    if (event.stage_ended().stage() == stage) return event.stage_ended();
  }
  ADD_FAILURE() << "no end of stage " << v1::JobStage_Name(stage);
  return v1::JobEvent::StageEnded::default_instance();
}

// Checks that the events have the scores of each held-out view by name.
void ExpectScores(const v1::JobEvent::StageEnded& evaluate, const std::vector<v1::View>& views) {
  ASSERT_EQ(evaluate.views_size(), 2);
  EXPECT_EQ(evaluate.views(0).view(), "frame-000000.jpg");
  EXPECT_EQ(evaluate.views(1).view(), "frame-000008.jpg");
  double psnr = 0, ssim = 0;
  for (const v1::JobEvent::ViewScores& scored : evaluate.views()) {
    psnr += scored.scores().psnr() / 2;
    ssim += scored.scores().ssim() / 2;
    EXPECT_FALSE(scored.scores().has_lpips());
    for (const v1::View& view : views) {
      if (view.view() != scored.view()) continue;
      EXPECT_EQ(view.scores().DebugString(), scored.scores().DebugString());
    }
  }
  EXPECT_DOUBLE_EQ(evaluate.metrics().at("psnr"), psnr);
  EXPECT_DOUBLE_EQ(evaluate.metrics().at("ssim"), ssim);
  for (const v1::View& view : views) EXPECT_EQ(view.has_scores(), view.held_out()) << view.view();
}

TEST_F(EndToEndTest, SegmentsAModelTrainedFromPhotographs) {
  const std::string job = Train("shelf", UploadShelf("shelf"), QuickOptions());
  ASSERT_OK_AND_ASSIGN(const auto events, client_->Watch(job));
  ExpectWholeStory(events);
  ExpectPreviews(events);
  ASSERT_OK_AND_ASSIGN(const v1::Model model, client_->GetModel("scenes/shelf/models/live"));
  EXPECT_EQ(model.name(), "scenes/shelf/models/1");
  EXPECT_GT(model.metrics().at("psnr"), 10);
  ASSERT_OK_AND_ASSIGN(const auto views, client_->ListViews(model.name()));
  ASSERT_EQ(views.size(), 15u);
  ExpectScores(EndOf(v1::JOB_STAGE_EVALUATE, events), views);
  const v1::View& view = views[0];
  EXPECT_TRUE(view.held_out());
  ASSERT_OK_AND_ASSIGN(const auto picture, client_->Render(model.name(), view.view()));
  EXPECT_EQ(view.photograph_width(), 640);
  EXPECT_EQ(view.camera().width(), 160);
  EXPECT_EQ(picture.width(), view.photograph_width());
  EXPECT_EQ(picture.png().substr(1, 3), "PNG");

  v1::SegmentViewsRequest request;
  request.set_model("scenes/shelf/models/live");
  request.mutable_prompt()->mutable_view()->set_view(view.view());
  v1::PointsPrompt::Point& point = *request.mutable_prompt()->mutable_points()->add_points();
  point.set_x(view.photograph_width() * 0.5);
  point.set_y(view.photograph_height() * 0.5);
  request.mutable_targets()->set_group(v1::SegmentViewsRequest::Targets::GROUP_HELD_OUT);
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

// Returns a click into the middle of the first view.
v1::SegmentViewsRequest ClickOn(const std::string& model) {
  v1::SegmentViewsRequest request;
  request.set_model(model);
  request.mutable_prompt()->mutable_view()->set_view("frame-000000.jpg");
  v1::PointsPrompt::Point& point = *request.mutable_prompt()->mutable_points()->add_points();
  point.set_x(320);
  point.set_y(240);
  return request;
}

TEST_F(EndToEndTest, AnswersClicksWhileItTrains) {
  v1::TrainingOptions options = QuickOptions();
  options.mutable_features()->set_num_steps(1'000'000);
  (*options.mutable_advanced())["features.min_loss_fall"] = "0";
  const std::string job = Train("shelf", UploadShelf("shelf"), options);
  v1::SegmentViewsResponse answer;
  // A test of a server that is busy with a training: its answers are late, and none is missing.
  const auto click = [&] {
    const auto now = client_->Segment(ClickOn(job));
    EXPECT_TRUE(now.ok() || absl::IsUnavailable(now.status())) << now.status();
    if (now.ok()) answer = *now;
    return now.ok();
  };
  ASSERT_TRUE(testing::Eventually(click, absl::Minutes(2)));
  const int64_t first = answer.snapshot().step();
  EXPECT_GE(first, 1);
  EXPECT_EQ(answer.snapshot().num_steps(), 1'000'000);
  EXPECT_EQ(answer.snapshot().job(), job);
  EXPECT_EQ(answer.model(), job);
  EXPECT_GT(answer.masks(0).area(), 0);
  ASSERT_TRUE(testing::Eventually([&] { return click() && answer.snapshot().step() > first; }));
  ASSERT_OK_AND_ASSIGN(const auto views, client_->ListViews(job));
  EXPECT_EQ(views.size(), 15u);
  ASSERT_OK(client_->Render(job, views[0].view()));

  ASSERT_OK(client_->CancelJob(job));
  ASSERT_OK_AND_ASSIGN(const v1::Job ended, client_->WaitForJob(job));
  EXPECT_EQ(ended.state(), v1::JOB_STATE_CANCELLED);
  const auto none = client_->Segment(ClickOn(job));
  EXPECT_EQ(none.status().code(), absl::StatusCode::kFailedPrecondition) << none.status();
}

TEST_F(EndToEndTest, AnswersForAJobByTheModelThatItHasMade) {
  const std::string job = Train("shelf", UploadShelf("shelf"), QuickOptions());
  ASSERT_OK(client_->WaitForJob(job));
  ASSERT_OK_AND_ASSIGN(const auto answer, client_->Segment(ClickOn(job)));
  EXPECT_EQ(answer.model(), "scenes/shelf/models/1");
  EXPECT_FALSE(answer.has_snapshot());
}

TEST_F(EndToEndTest, UsesUploadedGaussiansInsteadOfStageOne) {
  const std::string job = Train("shelf", UploadShelf("shelf"), QuickOptions());
  ASSERT_OK_AND_ASSIGN(const auto events, client_->Watch(job));
  ASSERT_OK_AND_ASSIGN(const std::string ply, client_->Export("scenes/shelf/models/1"));

  auto files = testing::ReadDataset(PEPESEG_TEST_DATA "/apc_shelf");
  files.push_back({"gaussians.ply", v1::FILE_KIND_GAUSSIANS, ply});
  ASSERT_OK(client_->CreateScene("given"));
  ASSERT_OK_AND_ASSIGN(const std::string dataset, client_->Upload("given", files));
  const std::string second = Train("given", dataset, QuickOptions());
  ASSERT_OK_AND_ASSIGN(const auto given_events, client_->Watch(second));
  ExpectWholeStory(given_events);
  EXPECT_EQ(EndOf(v1::JOB_STAGE_RECONSTRUCT, events).skipped(), "");
  EXPECT_EQ(EndOf(v1::JOB_STAGE_RECONSTRUCT, given_events).skipped(), "given");
  for (const v1::JobEvent& event : given_events) {
    EXPECT_NE(event.progress().stage(), v1::JOB_STAGE_RECONSTRUCT);
  }
  EXPECT_EQ(EndOf(v1::JOB_STAGE_EVALUATE, events).metrics().at("psnr"),
            EndOf(v1::JOB_STAGE_EVALUATE, given_events).metrics().at("psnr"));
  ASSERT_OK_AND_ASSIGN(const std::string again, client_->Export("scenes/given/models/1"));
  EXPECT_TRUE(again == ply);
}

TEST_F(EndToEndTest, MeasuresLpipsIfThereAreWeights) {
  server_->Terminate();
  const testing::TempFolder lpips;
  Restart({"--lpips-weights=" + testing::MakeLpips(lpips.path()).string()});
  v1::TrainingOptions options = QuickOptions();
  options.mutable_features()->set_num_steps(10);
  const std::string job = Train("shelf", UploadShelf("shelf"), options);
  ASSERT_OK_AND_ASSIGN(const auto events, client_->Watch(job));
  const v1::JobEvent::StageEnded& evaluate = EndOf(v1::JOB_STAGE_EVALUATE, events);
  ASSERT_EQ(evaluate.views_size(), 2);
  const double first = evaluate.views(0).scores().lpips();
  const double second = evaluate.views(1).scores().lpips();
  EXPECT_GT(first, 0);
  EXPECT_GT(second, 0);
  ASSERT_TRUE(evaluate.metrics().contains("lpips"));
  EXPECT_DOUBLE_EQ(evaluate.metrics().at("lpips"), (first + second) / 2);
  ASSERT_OK_AND_ASSIGN(const v1::Model model, client_->GetModel("scenes/shelf/models/live"));
  EXPECT_EQ(model.metrics().at("lpips"), evaluate.metrics().at("lpips"));
}

TEST_F(EndToEndTest, EstimateBoundsTheTrainingAndAdaptsToItsPace) {
  const std::string dataset = UploadShelf("shelf");
  v1::TrainingOptions options = QuickOptions();
  options.mutable_reconstruct()->set_max_gaussians(20'000);
  ASSERT_OK_AND_ASSIGN(const auto before, client_->Estimate("scenes/shelf", dataset, options));
  const auto stage_of = [](const v1::EstimateTrainingResponse& estimate, v1::JobStage wanted) {
    for (const auto& stage : estimate.stages()) {
      if (stage.stage() == wanted) return stage;
    }
    ADD_FAILURE() << v1::JobStage_Name(wanted);
    return v1::EstimateTrainingResponse::Stage();
  };
  ASSERT_OK(client_->WaitForJob(Train("shelf", dataset, options)));
  ASSERT_OK_AND_ASSIGN(const v1::Model model, client_->GetModel("scenes/shelf/models/live"));
  EXPECT_LE(model.metrics().at("peak_device_bytes"),
            std::max(stage_of(before, v1::JOB_STAGE_RECONSTRUCT).device_bytes(),
                     stage_of(before, v1::JOB_STAGE_FEATURES).device_bytes()));
  EXPECT_LE(model.metrics().at("num_gaussians"), 20'000);

  options.mutable_reconstruct()->set_num_steps(300);  // twice as many as before
  ASSERT_OK_AND_ASSIGN(const auto after, client_->Estimate("scenes/shelf", dataset, options));
  const auto seconds = [](const google::protobuf::Duration& duration) {
    return static_cast<double>(duration.seconds()) + duration.nanos() * 1e-9;
  };
  EXPECT_NEAR(seconds(stage_of(after, v1::JOB_STAGE_RECONSTRUCT).duration()),
              2 * model.metrics().at("seconds_reconstruct"), 1e-3);
  EXPECT_NEAR(seconds(stage_of(after, v1::JOB_STAGE_FEATURES).duration()),
              model.metrics().at("seconds_features"), 1e-3);
  options.mutable_import()->set_image_scale(0.5);  // no training at this scale was measured
  ASSERT_OK_AND_ASSIGN(const auto other, client_->Estimate("scenes/shelf", dataset, options));
  EXPECT_NE(seconds(stage_of(other, v1::JOB_STAGE_FEATURES).duration()),
            model.metrics().at("seconds_features"));
}

// The worker is killed each time before it has anything to save.
TEST_F(EndToEndTest, FailsAJobWhoseWorkerIsKilledThreeTimesAndRunsTheNext) {
  const std::string dataset = UploadShelf("shelf");
  const std::string job = Train("shelf", dataset, EndlessOptions());
  ASSERT_OK(client_->WaitForStep(job));
  pid_t worker = 0;
  for (int i = 0; i < 3; ++i) {
    const pid_t before = worker;
    ASSERT_TRUE(testing::Eventually([&] {
      worker = WorkerOf(job);
      return worker != before && worker != 0;
    }));
    ASSERT_EQ(kill(worker, SIGKILL), 0);
  }
  ASSERT_OK_AND_ASSIGN(const v1::Job ended, client_->WaitForJob(job));
  EXPECT_EQ(ended.state(), v1::JOB_STATE_FAILED);
  EXPECT_THAT(ended.error().message(), HasSubstr("signal 9"));
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
  EXPECT_LT(absl::Now() - start, testing::TimeLimit(absl::Seconds(1)));
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

TEST_F(EndToEndTest, KillsTheWorkerOfAKilledServerAndRunsTheJobAgain) {
  const std::string job = Train("shelf", UploadShelf("shelf"), QuickOptions());
  ASSERT_OK(client_->WaitForStep(job));
  server_->Kill();
  EXPECT_TRUE(testing::Eventually([&] { return WorkerOf(job) == 0; }, absl::Seconds(2)));
  Restart();
  ASSERT_OK_AND_ASSIGN(const v1::Job ended, client_->WaitForJob(job));
  EXPECT_EQ(ended.state(), v1::JOB_STATE_SUCCEEDED) << ended.error().message();
}

}  // namespace
}  // namespace pepeseg
