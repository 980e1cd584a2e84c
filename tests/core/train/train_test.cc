#include "core/train/train.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "core/base/digest.h"
#include "core/base/file_io.h"
#include "core/formats/images.h"
#include "core/model_files/model_file.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

namespace fs = std::filesystem;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Pair;

// Records the reports of a training, and cancels it in a given stage.
struct RecordingObserver final : TrainingObserver {
  absl::Status StartStage(Stage stage) override {
    stages.emplace_back(NameOf(stage));
    return absl::OkStatus();
  }
  absl::Status Step(const StepReport& report) override {
    last_step = report;
    cancelled = stages.back() == cancel_in && report.step == 10;
    return absl::OkStatus();
  }
  bool WantsPreviews() const override { return wants_previews; }
  absl::Status ShowPreview(const Preview& preview) override {
    EXPECT_EQ(stages.back(), "reconstruct");
    previews.push_back(preview);
    return absl::OkStatus();
  }
  std::optional<double> FirstSnapshotSeconds() const override { return first_snapshot; }
  absl::Status KeepSnapshot(FieldSnapshot snapshot) override {
    EXPECT_EQ(stages.back(), "features");
    EXPECT_EQ(snapshot.step, last_step.step);
    EXPECT_EQ(snapshot.num_steps, last_step.num_steps);
    snapshots.push_back(std::move(snapshot));
    return absl::OkStatus();
  }
  absl::Status EndStage(const StageEnd& end) override {
    ends.push_back(end);
    return absl::OkStatus();
  }
  void Log(const std::string& message) override { log.push_back(message); }
  void ReportDamagedFile(const std::string& sha256) override { damaged.push_back(sha256); }
  bool IsCancelled() const override { return cancelled; }
  void SetPolling(bool value) override { polling = value; }

  std::string cancel_in;
  bool cancelled = false, polling = false, wants_previews = false;
  std::optional<double> first_snapshot;
  std::vector<Preview> previews;
  std::vector<FieldSnapshot> snapshots;
  StepReport last_step;
  std::vector<std::string> stages, log, damaged;
  std::vector<StageEnd> ends;
};

// Trains on the scene in tests/data as a user of the library would: 80x60 pixels and few steps.
class TrainTest : public ::testing::Test {
 protected:
  TrainTest() {
    inputs_.files = ListDataset(PEPESEG_TEST_DATA "/apc_shelf").value();
    inputs_.folders = {.run = folder_ / "run-1", .priors = folder_ / "priors"};
    inputs_.tools.num_threads = 2;
    settings_.import.image_scale = 0.125;
    settings_.reconstruct.num_steps = 60;
    settings_.reconstruct.num_random_points = 500;
    settings_.features.num_steps = 20;
    settings_.features.num_pixels = 200;
    settings_.features.steps_per_chunk = 20;
  }

  absl::StatusOr<TrainedModel> Run() { return Train(inputs_, settings_, *backend_, observer_); }
  void StartSecondRun() {
    inputs_.folders.run = folder_ / "run-2";
    inputs_.folders.earlier = {folder_ / "run-1"};
    observer_ = {};
  }
  static std::string Gaussians(const fs::path& run) {
    return ReadFile(run / "gaussians.ply", "gaussians.ply", 1 << 30).value_or("");
  }
  static std::string Features(const fs::path& run) {
    return ReadFile(run / "features.bin", "features.bin", 1 << 30).value_or("");
  }

  const testing::TempFolder folder_;
  const std::unique_ptr<Backend> backend_ = MakeCpuBackend(2);
  TrainingInputs inputs_;
  TrainingSettings settings_;
  RecordingObserver observer_;
};

TEST_F(TrainTest, RunsTheStagesInOrderAndWritesTheModel) {
  inputs_.facts["job"] = "j1";
  ASSERT_OK_AND_ASSIGN(const TrainedModel trained, Run());
  EXPECT_THAT(observer_.stages, ElementsAre("prepare", "sfm", "priors", "reconstruct", "evaluate",
                                            "features", "index"));
  EXPECT_THAT(ByName(trained.sources), Contains(Pair("masks", "given")));
  ASSERT_OK_AND_ASSIGN(const Model stored, ReadModel(inputs_.folders.run));
  EXPECT_EQ(stored.gaussians.planes, trained.model.gaussians.planes);
  EXPECT_EQ(stored.field.features.size(),
            trained.model.field.features.size());  // stored in half precision
  EXPECT_EQ(stored.facts.at("job"), "j1");
  EXPECT_GT(stored.metrics.at("psnr"), 5);
  for (const auto& entry : fs::directory_iterator(inputs_.folders.run)) {
    EXPECT_TRUE(entry.is_regular_file()) << entry.path() << " is left of a stage";
  }
  EXPECT_FALSE(observer_.polling);
}

TEST_F(TrainTest, GivesSnapshotsAndTrainsTheSameModel) {
  ASSERT_OK(Run());
  EXPECT_TRUE(observer_.snapshots.empty());
  const std::string without = Features(inputs_.folders.run);
  observer_ = {};
  observer_.first_snapshot = 0;
  inputs_.folders.run = folder_ / "run-2";
  ASSERT_OK_AND_ASSIGN(const TrainedModel trained, Run());
  EXPECT_EQ(Features(inputs_.folders.run), without);
  ASSERT_GE(observer_.snapshots.size(), 1u);
  EXPECT_EQ(observer_.snapshots.front().step, 1);
  const FeatureField& field = observer_.snapshots.back().field;
  EXPECT_EQ(field.features.size(), trained.model.field.features.size());
  EXPECT_NE(field.features, trained.model.field.features);
  EXPECT_EQ(field.scale_quantiles, trained.model.field.scale_quantiles);
}

TEST_F(TrainTest, ReportsHowEachStageEnded) {
  ASSERT_OK(Run());
  ASSERT_EQ(observer_.ends.size(), 7u);
  EXPECT_EQ(observer_.ends[1].skipped, "given");
  EXPECT_TRUE(observer_.ends[1].metrics.ByName().empty());
  EXPECT_EQ(observer_.ends[4].stage, Stage::kEvaluate);
  EXPECT_EQ(observer_.ends[4].views.size(), 2u);
  for (const StageEnd& end : {observer_.ends[0], observer_.ends[3], observer_.ends[5]}) {
    const std::string stage(NameOf(end.stage));
    EXPECT_TRUE(end.metrics.ByName().contains("seconds_" + stage)) << stage;
    EXPECT_TRUE(end.metrics.ByName().contains("core_seconds_" + stage)) << stage;
  }
}

TEST_F(TrainTest, ShowsStageOneFromItsFirstStepToItsLast) {
  observer_.wants_previews = true;
  ASSERT_OK(Run());
  const std::vector<Preview>& previews = observer_.previews;
  ASSERT_GE(previews.size(), 2u);
  EXPECT_EQ(previews.front().step, 1);
  EXPECT_EQ(previews.back().step, 60);
  for (const Preview& preview : previews) {
    EXPECT_EQ(preview.num_steps, 60);
    EXPECT_EQ(preview.view, previews.front().view);
    const std::span bytes(reinterpret_cast<const uint8_t*>(preview.jpeg.data()),
                          preview.jpeg.size());
    ASSERT_OK_AND_ASSIGN(const Image image, DecodePhoto(bytes, "preview"));
    EXPECT_EQ(image.width, preview.width);
    EXPECT_EQ(image.height, preview.height);
    EXPECT_LE(bytes.size(), kMaxPreviewBytes);
  }
  EXPECT_NE(previews.front().jpeg, previews.back().jpeg);
}

TEST_F(TrainTest, MakesTheSameModelWithPreviews) {
  ASSERT_OK(Run());
  const std::string without = Gaussians(inputs_.folders.run);
  StartSecondRun();
  inputs_.folders.earlier = {};
  observer_.wants_previews = true;
  ASSERT_OK(Run());
  EXPECT_FALSE(observer_.previews.empty());
  ASSERT_FALSE(without.empty());
  EXPECT_EQ(Gaussians(inputs_.folders.run), without);
}

TEST_F(TrainTest, StopsAtTheNextStepWhenCancelled) {
  observer_.cancel_in = "reconstruct";
  EXPECT_STATUS(Run(), absl::StatusCode::kCancelled, "stopped in stage reconstruct at step 11");
  EXPECT_FALSE(observer_.polling);
  EXPECT_FALSE(fs::exists(inputs_.folders.run / "manifest.json"));
}

TEST_F(TrainTest, ReusesStageOneOfAnEarlierRun) {
  observer_.cancel_in = "features";
  EXPECT_STATUS(Run(), absl::StatusCode::kCancelled, "stage features");
  const std::string earlier = Gaussians(inputs_.folders.run / kReconstructFolder);
  ASSERT_FALSE(earlier.empty());
  StartSecondRun();
  ASSERT_OK(Run());
  EXPECT_THAT(observer_.log, Contains("stage one was done by run-1"));
  EXPECT_EQ(Gaussians(inputs_.folders.run), earlier);
  EXPECT_FALSE(fs::exists(folder_ / "run-1")) << "the model is all that is left";
}

TEST_F(TrainTest, RefusesFilesThatDifferFromTheirDigests) {
  for (const DatasetFile& file : inputs_.files) {
    inputs_.sha256.push_back(Sha256OfFile(file.path).value());
  }
  const std::string declared = std::string(64, '0');
  inputs_.sha256[3] = declared;
  EXPECT_STATUS(Run(), absl::StatusCode::kDataLoss,
                inputs_.files[3].name + ": its stored bytes are damaged");
  EXPECT_THAT(observer_.damaged, ElementsAre(declared));
  EXPECT_THAT(observer_.stages, ElementsAre("prepare"));
}

TEST_F(TrainTest, RefusesLpipsWeightsBeforeReadingTheDataset) {
  inputs_.tools.lpips_weights = folder_ / "none.onnx";
  EXPECT_STATUS(Run(), absl::StatusCode::kNotFound, "none.onnx");
  EXPECT_TRUE(observer_.stages.empty());
}

}  // namespace
}  // namespace pepeseg
