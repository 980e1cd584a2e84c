#include "core/train/run_stage.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <vector>

#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

// State of a trainer that counts.
struct Count {
  int64_t steps = 0;

  static absl::StatusOr<Count> Read(std::span<const CheckpointSection> sections) {
    Count count;
    const SectionReader reader(sections);
    reader("steps", 1, count.steps);
    RETURN_IF_ERROR(reader.Finish());
    return count;
  }
};
std::vector<CheckpointSection> SectionsOf(const Count& count) {
  std::vector<CheckpointSection> sections;
  SectionWriter{sections}("steps", 1, count.steps);
  return sections;
}
absl::Status Validate(const Count&) { return absl::OkStatus(); }

// A trainer that counts to ten, two steps at a time.
struct CountingTrainer {
  using State = Count;
  using Product = int64_t;

  static absl::StatusOr<std::unique_ptr<CountingTrainer>> Create(Backend&, int) {
    return std::make_unique<CountingTrainer>();
  }
  static absl::StatusOr<std::unique_ptr<CountingTrainer>> Resume(Backend&, int,
                                                                 const Count& count) {
    if (count.steps > 10) return absl::DataLossError("too far");
    auto trainer = std::make_unique<CountingTrainer>();
    trainer->count = count;
    return trainer;
  }

  int64_t step() const { return count.steps; }
  bool done() const { return count.steps == 10; }
  const std::vector<SkippedPart>& skipped() const { return skipped_parts; }
  absl::StatusOr<StepReports> Step() {
    StepReports reports;
    for (int i = 0; i < 2; ++i) reports.push_back({.step = ++count.steps, .num_steps = 10});
    if (count.steps == 6) skipped_parts.push_back({Part::kSteps, "enough", 6});
    return reports;
  }
  absl::StatusOr<Count> Save() { return count; }
  int64_t Result() const { return count.steps; }

  Count count;
  std::vector<SkippedPart> skipped_parts;
};

// Keeps the checkpoints of a stage in a folder, one for each call of Save.
struct FolderCheckpoints final : StageCheckpoints {
  void Resume(absl::FunctionRef<absl::Status(const Checkpoint&)> use) override {
    for (auto step = steps.rbegin(); step != steps.rend(); ++step) {
      const auto file = ReadCheckpoint(PathOf(*step));
      if (!file.ok() || !use(*file).ok()) continue;
      first = *step;
      return;
    }
  }
  int64_t first_step() const override { return first; }
  void SaveIfDue(int64_t step, WriteState write) override {
    if (step % 4 == 0) Save(step, write);
  }
  void Save(int64_t step, WriteState write) override {
    EXPECT_OK(write(PathOf(step), {"reconstruct", "", step}));
    if (steps.empty() || steps.back() != step) steps.push_back(step);
  }
  void Remove() const override {}
  std::filesystem::path PathOf(int64_t step) const { return folder / std::to_string(step); }

  testing::TempFolder folder;
  std::vector<int64_t> steps;
  int64_t first = 0;
};

struct Observer final : TrainingObserver {
  absl::Status Step(const StepReport& report) override {
    steps.push_back(report.step);
    cancelled = report.step == cancel_at;
    return absl::OkStatus();
  }
  absl::Status SkipPart(const SkippedPart& part) override {
    skipped_at.push_back(part.step);
    return absl::OkStatus();
  }
  void ResumeStage(int64_t step) override { resumed_at = step; }
  bool IsCancelled() const override { return cancelled; }
  void SetPolling(bool value) override { polling = value; }

  std::vector<int64_t> steps, skipped_at;
  int64_t cancel_at = 0, resumed_at = 0;
  bool cancelled = false, polling = false;
};

class RunStageTest : public ::testing::Test {
 protected:
  RunStageTest() { EXPECT_OK(log_.Start(Stage::kReconstruct)); }

  absl::StatusOr<int64_t> Run() {
    ASSIGN_OR_RETURN(const auto trainer,
                     ResumeOrCreate<CountingTrainer>(&checkpoints_, log_, *backend_, 0));
    return RunStage(*trainer, &checkpoints_, log_);
  }

  const std::unique_ptr<Backend> backend_ = MakeCpuBackend(1);
  Observer observer_;
  StageLog log_{observer_};
  FolderCheckpoints checkpoints_;
};

TEST_F(RunStageTest, ReportsEachStepAndSavesWhatIsDue) {
  ASSERT_OK_AND_ASSIGN(const int64_t result, Run());
  EXPECT_EQ(result, 10);
  EXPECT_EQ(observer_.steps, (std::vector<int64_t>{1, 2, 3, 4, 5, 6, 7, 8, 9, 10}));
  EXPECT_EQ(observer_.skipped_at, (std::vector<int64_t>{6}));
  EXPECT_EQ(observer_.resumed_at, 0);
  EXPECT_EQ(checkpoints_.steps, (std::vector<int64_t>{4, 8}));
  EXPECT_FALSE(observer_.polling);
}

TEST_F(RunStageTest, SavesTheTrainersStepWhenCancelled) {
  observer_.cancel_at = 5;
  EXPECT_STATUS(Run(), absl::StatusCode::kCancelled, "at step 6 of 10");
  EXPECT_EQ(checkpoints_.steps, (std::vector<int64_t>{4, 6}));
  EXPECT_FALSE(observer_.polling);
}

TEST_F(RunStageTest, ResumesFromTheFarthestCheckpointThatFits) {
  observer_.cancel_at = 5;
  EXPECT_EQ(Run().status().code(), absl::StatusCode::kCancelled);
  ASSERT_OK(
      WriteCheckpoint(checkpoints_.PathOf(99), {"reconstruct", "", 99}, SectionsOf(Count{99})));
  checkpoints_.steps.push_back(99);
  observer_ = {};
  ASSERT_OK_AND_ASSIGN(const int64_t result, Run());
  EXPECT_EQ(result, 10);
  EXPECT_EQ(observer_.resumed_at, 6);
  EXPECT_EQ(observer_.steps.front(), 7);
  EXPECT_EQ(log_.metrics().resumed_from_step, 6);
}

TEST_F(RunStageTest, NeedsNoCheckpoints) {
  CountingTrainer trainer;
  ASSERT_OK_AND_ASSIGN(const int64_t result, RunStage(trainer, nullptr, log_));
  EXPECT_EQ(result, 10);
}

}  // namespace
}  // namespace pepeseg
