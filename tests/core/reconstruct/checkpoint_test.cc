#include "core/reconstruct/checkpoint.h"

#include <cmath>
#include <limits>
#include <set>

#include "core/reconstruct/trainer.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/synthetic_capture.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

using testing::SyntheticCapture;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInf = std::numeric_limits<float>::infinity();

// Options of a short run with every part: photographs at a quarter of their size until step 15, at
// half until step 30, refinement until 39, density control at 25, 50 and 75, opacity reset at 40.
ReconstructOptions Options() {
  ReconstructOptions options;
  options.num_steps = 90;
  options.coarse_until = 1.0 / 3;
  options.densify_from = 0.1;
  options.densify_until = 0.9;
  options.densify_every = 25;
  options.opacity_reset_every = 40;
  options.max_gaussians = 4000;
  options.depth_weight = -1;
  options.refine_keep = RefineKeep::kSplit;
  options.refine_length = 0.1;
  return options;
}

std::unique_ptr<GaussianTrainer> Fresh(Backend& backend) {
  return GaussianTrainer::Create(backend, SyntheticCapture(), Options()).value();
}

void StepTo(GaussianTrainer& trainer, int step, int from = 0) {
  for (int i = from; i < step; ++i) ASSERT_OK(trainer.Step());
}

GaussianCheckpoint CheckpointAt(int step) {
  const auto backend = MakeCpuBackend(2);
  const auto trainer = Fresh(*backend);
  StepTo(*trainer, step);
  return trainer->Save().value();
}

// Writes the checkpoint to a file and reads it, as another process would.
GaussianCheckpoint WriteAndRead(const GaussianCheckpoint& checkpoint) {
  const testing::TempFolder folder;
  const std::filesystem::path path = folder.path() / "checkpoint";
  EXPECT_OK(WriteCheckpoint(path, {"reconstruct", "", 0}, SectionsOf(checkpoint)));
  const auto file = ReadCheckpoint(path);
  EXPECT_OK(file);
  auto read = GaussianCheckpoint::Read(file->sections);
  EXPECT_OK(read);
  return *std::move(read);
}

TEST(GaussianCheckpoint, ResumesToTheSameBytesAsAnUnbrokenRun) {
  const auto backend = MakeCpuBackend(2);
  const auto unbroken = Fresh(*backend);
  StepTo(*unbroken, 90);
  const Gaussians expected = unbroken->Result();
  EXPECT_GT(expected.count, 700);  // density control took part
  // Breaks at the start, inside and at the end of both coarse phases, around each kind of density
  // control, and at the end.
  for (const int step : {0, 7, 15, 16, 24, 25, 26, 30, 31, 38, 39, 40, 41, 75, 89, 90}) {
    const GaussianCheckpoint checkpoint = WriteAndRead(CheckpointAt(step));
    // Resumes with another number of threads, as on another machine.
    const auto other = MakeCpuBackend(1);
    ASSERT_OK_AND_ASSIGN(const auto resumed, GaussianTrainer::Resume(*other, SyntheticCapture(),
                                                                     Options(), checkpoint));
    StepTo(*resumed, 90, step);
    EXPECT_TRUE(resumed->done());
    EXPECT_EQ(resumed->Result().planes, expected.planes) << "broken off after step " << step;
  }
}

// The limit on pixels raises coarse_until from a third to two thirds, both before and after a
// break.
TEST(GaussianCheckpoint, ResumesWithTheSameLimitOnPixels) {
  const Capture capture = SyntheticCapture();
  const Camera& camera = capture.views[0].camera;
  ReconstructOptions options = Options();
  options.megapixels_per_step = 1e-6 * camera.width * camera.height * (1 - 2.0 / 3 * 27 / 32);
  options.full_size_visits = 0;
  const auto backend = MakeCpuBackend(2);
  ASSERT_OK_AND_ASSIGN(const auto unbroken, GaussianTrainer::Create(*backend, capture, options));
  StepTo(*unbroken, 45);
  const GaussianCheckpoint checkpoint = WriteAndRead(unbroken->Save().value());
  StepTo(*unbroken, 90, 45);
  ASSERT_OK_AND_ASSIGN(const auto resumed,
                       GaussianTrainer::Resume(*backend, capture, options, checkpoint));
  StepTo(*resumed, 90, 45);
  EXPECT_EQ(resumed->Result().planes, unbroken->Result().planes);
  const auto unlimited = Fresh(*backend);
  StepTo(*unlimited, 90);
  EXPECT_NE(resumed->Result().planes, unlimited->Result().planes);
}

TEST(GaussianCheckpoint, ContinuesTheReports) {
  const auto backend = MakeCpuBackend(2);
  ASSERT_OK_AND_ASSIGN(const auto resumed, GaussianTrainer::Resume(*backend, SyntheticCapture(),
                                                                   Options(), CheckpointAt(33)));
  ASSERT_OK_AND_ASSIGN(const StepReports reports, resumed->Step());
  const StepReport& report = reports.back();
  EXPECT_EQ(report.step, 34);
  const auto unbroken = Fresh(*backend);
  StepTo(*unbroken, 33);
  ASSERT_OK_AND_ASSIGN(const StepReports wanted, unbroken->Step());
  const StepReport& expected = wanted.back();
  EXPECT_EQ(report.loss, expected.loss);
  EXPECT_EQ(report.psnr, expected.psnr);
  EXPECT_EQ(report.num_gaussians, expected.num_gaussians);
  EXPECT_GT(report.num_refined, 0);
  EXPECT_EQ(report.num_refined, expected.num_refined);
  EXPECT_EQ(report.num_refine_split, expected.num_refine_split);
}

TEST(GaussianCheckpoint, SavingDoesNotChangeTheRun) {
  const auto backend = MakeCpuBackend(2);
  const auto saved = Fresh(*backend);
  for (int step = 0; step < 60; ++step) {
    ASSERT_OK(saved->Step());
    ASSERT_OK(saved->Save());
  }
  const auto untouched = Fresh(*backend);
  StepTo(*untouched, 60);
  EXPECT_EQ(saved->Result().planes, untouched->Result().planes);
}

TEST(GaussianCheckpoint, RequiresExactlyItsSections) {
  const GaussianCheckpoint checkpoint = CheckpointAt(3);
  const std::vector<CheckpointSection> sections = SectionsOf(checkpoint);
  std::set<std::string> names;
  for (size_t i = 0; i < sections.size(); ++i) {
    EXPECT_TRUE(names.insert(sections[i].name).second) << sections[i].name;
    std::vector<CheckpointSection> without = sections;
    without.erase(without.begin() + static_cast<std::ptrdiff_t>(i));
    EXPECT_STATUS(GaussianCheckpoint::Read(without), absl::StatusCode::kDataLoss, sections[i].name);
    std::vector<CheckpointSection> newer = sections;
    newer[i].version += 1;
    EXPECT_STATUS(GaussianCheckpoint::Read(newer), absl::StatusCode::kDataLoss, "version");
  }
  std::vector<CheckpointSection> more = sections;
  more.push_back({"from_the_future", 1, ""});
  EXPECT_STATUS(GaussianCheckpoint::Read(more), absl::StatusCode::kDataLoss, "knows");
  std::vector<CheckpointSection> twice = sections;
  twice.push_back(sections[0]);
  EXPECT_STATUS(GaussianCheckpoint::Read(twice), absl::StatusCode::kDataLoss, "knows");
}

TEST(GaussianCheckpoint, RefusesSectionsOfAnotherSize) {
  const GaussianCheckpoint checkpoint = CheckpointAt(33);
  const std::vector<CheckpointSection> sections = SectionsOf(checkpoint);
  for (size_t i = 0; i < sections.size(); ++i) {
    // These two may have any size; Resume checks their content.
    if (sections[i].name == "random" || sections[i].name == "views_left") continue;
    for (const size_t cut : {1, 4}) {
      std::vector<CheckpointSection> shorter = sections;
      shorter[i].bytes.remove_suffix(cut);
      SCOPED_TRACE(sections[i].name);
      EXPECT_STATUS(GaussianCheckpoint::Read(shorter), absl::StatusCode::kDataLoss,
                    sections[i].name);
    }
  }
}

TEST(GaussianCheckpoint, RefusesNumbersThatAreNotFinite) {
  const GaussianCheckpoint good = CheckpointAt(3);
  EXPECT_OK(Validate(good));
  const auto backend = MakeCpuBackend(1);
  for (const float bad : {kNan, kInf, -kInf}) {
    for (std::vector<float> GaussianRows::*plane :
         {&GaussianRows::parameters, &GaussianRows::moment1, &GaussianRows::moment2,
          &GaussianRows::grad_sum, &GaussianRows::square_sum}) {
      GaussianCheckpoint checkpoint = good;
      (checkpoint.gaussians.*plane).back() = bad;
      EXPECT_STATUS(Validate(checkpoint), absl::StatusCode::kDataLoss, "not finite");
      EXPECT_STATUS(GaussianCheckpoint::Read(SectionsOf(checkpoint)), absl::StatusCode::kDataLoss,
                    "not finite");
      EXPECT_STATUS(GaussianTrainer::Resume(*backend, SyntheticCapture(), Options(), checkpoint),
                    absl::StatusCode::kDataLoss, "not finite");
    }
  }
}

TEST(GaussianCheckpoint, RefusesToResumeAnotherRun) {
  const GaussianCheckpoint good = CheckpointAt(60);
  const auto backend = MakeCpuBackend(1);
  const auto expect = [&](const GaussianCheckpoint& checkpoint, const ReconstructOptions& options,
                          const char* why) {
    EXPECT_STATUS(GaussianTrainer::Resume(*backend, SyntheticCapture(), options, checkpoint),
                  absl::StatusCode::kDataLoss, why);
  };
  ReconstructOptions shorter = Options();
  shorter.num_steps = 59;
  expect(good, shorter, "step 60 exceeds the num_steps of the options, 59");
  ReconstructOptions flatter = Options();
  flatter.sh_degree = 1;
  expect(good, flatter, "degree");
  for (const std::vector<int32_t>& views : {std::vector<int32_t>{-1}, {10}, {3, 4, 3}}) {
    GaussianCheckpoint bad = good;
    bad.views_left = views;
    expect(bad, Options(), "view");
  }
  for (const char* random : {"", "1 2 3", "x"}) {
    GaussianCheckpoint bad = good;
    bad.random = random;
    expect(bad, Options(), "the state of the random numbers is damaged");
  }
}

}  // namespace
}  // namespace pepeseg
