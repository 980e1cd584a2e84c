#include "core/train/early_field.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "core/dataset/dataset_files.h"
#include "core/dataset/import.h"
#include "core/model_files/model_file.h"
#include "core/train/model_writing.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

struct LoggingObserver : TrainingObserver {
  void Log(const std::string& message) override { log.push_back(message); }
  std::optional<double> FirstSnapshotSeconds() const override { return first_snapshot; }

  std::optional<double> first_snapshot = 1;
  std::vector<std::string> log;
};

// Stage one of the scene in tests/data at 80x60 pixels. A second CPU backend stands for the second
// queue of a GPU.
class EarlyFieldTest : public ::testing::Test {
 protected:
  EarlyFieldTest() {
    ImportOptions import;
    import.image_scale = 0.125;
    capture_ =
        ImportCapture(ListDataset(PEPESEG_TEST_DATA "/apc_shelf").value(), import, 2).value();
    options_.num_steps = 100;
    options_.num_random_points = 500;
    features_.num_pixels = 200;
    features_.steps_per_chunk = 20;
    trainer_ = MakeTrainer();
  }

  std::unique_ptr<GaussianTrainer> MakeTrainer() {
    return GaussianTrainer::Create(*backend_, capture_, options_).value();
  }
  std::unique_ptr<EarlyField> MakeField(std::unique_ptr<Backend> twin) {
    return std::make_unique<EarlyField>(
        EarlyField::Scene{capture_, DescribeModel({}, capture_, *backend_), features_, folder()},
        *trainer_, std::move(twin), observer_);
  }
  std::filesystem::path folder() const { return folder_ / "early"; }
  // Does a step, and reports it to the field.
  StepReport Step(EarlyField& field) {
    const StepReport report = trainer_->Step().value().back();
    field.Advance(report);
    return report;
  }
  void TrainToTheEnd(EarlyField& field) {
    while (!trainer_->done()) Step(field);
  }

  testing::TempFolder folder_;
  const std::unique_ptr<Backend> backend_ = MakeCpuBackend(1);
  Capture capture_;
  ReconstructOptions options_;
  FeatureOptions features_;
  LoggingObserver observer_;
  std::unique_ptr<GaussianTrainer> trainer_;
};

TEST_F(EarlyFieldTest, IsWrittenAsAModelOfTheGaussiansSoFar) {
  features_.num_steps = 20;
  const auto field = MakeField(MakeCpuBackend(1));
  StepReport last;
  while (observer_.log.empty() && !trainer_->done()) {
    last = Step(*field);
    if (last.step < 55) {
      EXPECT_FALSE(std::filesystem::exists(folder()));
    }
  }
  // The stage may be faster than the field.
  for (int i = 0; i < 600 && observer_.log.empty(); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    field->Advance(last);
  }
  EXPECT_EQ(observer_.log, std::vector<std::string>{"the early field answers clicks"});
  ASSERT_OK_AND_ASSIGN(const Model model, ReadModel(folder()));
  EXPECT_EQ(model.metrics.at(kEarlyStep), 55);
  EXPECT_EQ(model.metrics.at(kEarlyNumSteps), 100);
  EXPECT_EQ(model.views.size(), capture_.views.size());
  EXPECT_LE(model.gaussians.sh_degree, 1);
  EXPECT_LE(model.gaussians.count, trainer_->Result().count);
  const auto logits = model.gaussians.Plane(kOpacityPlane);
  EXPECT_GE(*std::ranges::min_element(logits), std::log(0.04f / 0.96f) - 1e-3);
  EXPECT_EQ(model.field.features.size(), static_cast<size_t>(model.gaussians.count) * kFeatureDim);
  EXPECT_FALSE(model.field.scale_quantiles.empty());
}

TEST_F(EarlyFieldTest, ChangesNothingOfTheStage) {
  features_.num_steps = 20;
  TrainToTheEnd(*MakeField(MakeCpuBackend(1)));
  const Gaussians with = trainer_->Result();
  trainer_ = MakeTrainer();
  TrainToTheEnd(*MakeField(nullptr));
  EXPECT_EQ(with.planes, trainer_->Result().planes);
}

TEST_F(EarlyFieldTest, IsNotMadeWithoutASecondQueueOrAnObserver) {
  TrainToTheEnd(*MakeField(nullptr));
  EXPECT_EQ(QueueForEarlyField(*backend_, capture_, options_, features_), nullptr);
  trainer_ = MakeTrainer();
  observer_.first_snapshot.reset();
  TrainToTheEnd(*MakeField(MakeCpuBackend(1)));
  EXPECT_FALSE(std::filesystem::exists(folder()));
  EXPECT_TRUE(observer_.log.empty());
}

TEST_F(EarlyFieldTest, IsGivenUpWhenTheStageEnds) {
  features_.num_steps = 100'000;
  features_.num_pixels = 3'000;  // takes many times as long as what follows
  auto field = MakeField(MakeCpuBackend(1));
  while (trainer_->step() < 56) Step(*field);
  field.reset();
  EXPECT_FALSE(std::filesystem::exists(folder()));
}

TEST_F(EarlyFieldTest, LogsWhyThereIsNone) {
  for (View& view : capture_.views) view.masks = {};
  const auto field = MakeField(MakeCpuBackend(1));
  StepReport last;
  while (!trainer_->done()) last = Step(*field);
  for (int i = 0; i < 600 && observer_.log.empty(); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    field->Advance(last);
  }
  ASSERT_EQ(observer_.log.size(), 1u);
  EXPECT_THAT(observer_.log[0], ::testing::HasSubstr("no early field: FAILED_PRECONDITION"));
}

}  // namespace
}  // namespace pepeseg
