#include <algorithm>
#include <csignal>
#include <cstdlib>

#include "absl/time/time.h"
#include "core/io/model_file.h"
#include "tests/server/jobs/worker_fixture.h"
#include "tests/testing/fake_sam.h"

// The stage "priors" with SAM, through a library in place of ONNX Runtime.
namespace pepeseg {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Pair;
using testing::ReplaceSamFile;

class WorkerSamTest : public WorkerTest {
 protected:
  WorkerSamTest() : sam_(folder_.path() / "sam") {
    std::erase_if(spec_.files, [](const JobSpecFile& file) {
      return file.kind != v1::FILE_KIND_IMAGE && file.kind != v1::FILE_KIND_POSES;
    });
    spec_.options.mutable_reconstruct()->set_num_steps(5);
    spec_.options.mutable_features()->set_num_steps(5);
    spec_.options.mutable_features()->set_steps_per_chunk(5);
    testing::MakeFakeSam(sam_);
    flags_ = {"--sam=" + sam_.string()};
  }

  std::vector<std::string> Warnings() {
    std::vector<std::string> warnings;
    for (const v1::JobEvent& event : Events()) {
      if (event.has_warning()) warnings.push_back(event.warning().message());
    }
    return warnings;
  }
  std::map<std::string, std::string> Sources() {
    const auto result = job_.ReadResult(spec_.fence);
    EXPECT_TRUE(result.ok() && result->status.ok()) << result.status();
    return result.ok() ? result->sources : std::map<std::string, std::string>();
  }
  int NumSegmentingSteps() {
    int count = 0;
    for (const v1::JobEvent& event : Events()) {
      count += event.progress().activity() == "segmenting";
    }
    return count;
  }
  void ExpectEmbeddedBecause(const std::string& why) {
    ExpectExit(Run(), WorkerExit::kSucceeded);
    EXPECT_THAT(Sources(), Contains(Pair("masks", "embedded")));
    EXPECT_THAT(Warnings(),
                ElementsAre(AllOf(HasSubstr("SAM: "), HasSubstr(why),
                                  HasSubstr("The job goes on with the built-in masks.")),
                            HasSubstr("segments may be poor")));
    const auto model = ReadModel(job_.attempt(spec_.fence));
    ASSERT_TRUE(model.ok()) << model.status();
    EXPECT_EQ(model->facts.at("masks"), "embedded");
    EXPECT_FALSE(model->field.features.empty());
  }

  const std::filesystem::path sam_;
};

TEST_F(WorkerSamTest, MakesMasksOfTheTrainingViews) {
  ExpectExit(Run(), WorkerExit::kSucceeded);
  EXPECT_THAT(Sources(),
              AllOf(Contains(Pair("masks", "sam")), Contains(Pair("depth", "embedded"))));
  EXPECT_THAT(Warnings(), IsEmpty());
  std::vector<int64_t> steps;
  for (const v1::JobEvent& event : Events()) {
    if (event.progress().activity() != "segmenting") continue;
    EXPECT_EQ(event.progress().unit(), "photographs");
    EXPECT_EQ(event.progress().num_steps(), 13);  // of 15, 2 are held out
    steps.push_back(event.progress().step());
  }
  EXPECT_THAT(steps, Contains(13));
  EXPECT_FALSE(std::filesystem::exists(job_.priors()));
}

TEST_F(WorkerSamTest, JoinsItsMasksWithEmbeddedOnesWhereAsked) {
  spec_.options.mutable_priors()->set_masks(v1::PRIOR_MAKER_SAM_AND_EMBEDDED);
  ExpectExit(Run(), WorkerExit::kSucceeded);
  EXPECT_THAT(Sources(), Contains(Pair("masks", "sam and embedded")));
}

TEST_F(WorkerSamTest, IsMissedWhereItWasAskedFor) {
  spec_.options.mutable_priors()->set_masks(v1::PRIOR_MAKER_SAM);
  flags_.clear();
  ExpectEmbeddedBecause("this server has none any more");
}

TEST_F(WorkerSamTest, IsNotAskedWhereEmbeddedMasksAre) {
  spec_.options.mutable_priors()->set_masks(v1::PRIOR_MAKER_EMBEDDED);
  ExpectExit(Run(), WorkerExit::kSucceeded);
  EXPECT_THAT(Sources(), Contains(Pair("masks", "embedded")));
  EXPECT_EQ(NumSegmentingSteps(), 0);
}

TEST_F(WorkerSamTest, FallsBackWhereTheLibraryDoesNotLoad) {
  ReplaceSamFile(sam_, "libonnxruntime.so.1", "a text");
  ExpectEmbeddedBecause("does not load");
}

TEST_F(WorkerSamTest, FallsBackWhereTheModelIsTruncated) {
  ReplaceSamFile(sam_, "sam.onnx", testing::FakeDecoder().substr(0, 20));
  ExpectEmbeddedBecause("sam.onnx: not an ONNX model, or cut off");
}

TEST_F(WorkerSamTest, FallsBackWhereADigestDiffers) {
  std::ofstream(sam_ / "encoder.onnx", std::ios::app) << "x";
  ExpectEmbeddedBecause("encoder.onnx: its SHA-256 is ");
}

TEST_F(WorkerSamTest, FallsBackWhereTheFolderIsGone) {
  std::filesystem::remove_all(sam_);
  ExpectEmbeddedBecause("does not exist");
}

TEST_F(WorkerSamTest, FallsBackWhereMemoryIsShort) {
  ReplaceSamFile(sam_, "encoder.onnx", "out of memory");
  ExpectEmbeddedBecause("out of memory: it needs about ");
}

TEST_F(WorkerSamTest, KeepsThePhotographsThatAreDone) {
  spec_.options.mutable_reconstruct()->set_num_steps(1'000'000);
  const auto first = Launch(getpid());
  for (int i = 0; i < 6000 && NumSegmentingSteps() == 0; ++i) {
    absl::SleepFor(absl::Milliseconds(5));
  }
  first->Signal(SIGTERM);
  const WorkerEnd end = WaitFor(*first);
  EXPECT_EQ(end.exit_code, static_cast<int>(WorkerExit::kCancelled));
  const auto kept = job_.priors() / "sam" / "000002.json";  // the first view is held out
  ASSERT_TRUE(std::filesystem::exists(kept));
  const auto written = std::filesystem::last_write_time(kept);
  // A damaged file is made again.
  std::ofstream(job_.priors() / "sam" / "000003.json") << "[{";

  const int before = NumSegmentingSteps();
  spec_.options.mutable_reconstruct()->set_num_steps(5);
  spec_.fence = 2;
  const auto second = Launch(getpid());
  for (int i = 0; i < 6000 && NumSegmentingSteps() == before; ++i) {
    absl::SleepFor(absl::Milliseconds(1));
    if (std::filesystem::exists(kept)) {
      EXPECT_EQ(std::filesystem::last_write_time(kept), written);
    }
  }
  ExpectExit(WaitFor(*second), WorkerExit::kSucceeded);
  EXPECT_THAT(Sources(), Contains(Pair("masks", "sam")));
  EXPECT_THAT(Warnings(), IsEmpty());
  EXPECT_THAT(ReadFileTail(job_.worker_log(), 100000),
              HasSubstr("were segmented by an earlier attempt"));
}

// With the files that deploy/sam.sh installs, below the sandbox: `make sam-test`.
TEST_F(WorkerSamTest, RunsTheRealOne) {
  const char* real = std::getenv("PEPESEG_SAM");
  if (real == nullptr) GTEST_SKIP() << "PEPESEG_SAM names no folder";
  flags_ = {std::string("--sam=") + real};
  int num_photos = 0;
  std::erase_if(spec_.files, [&num_photos](const JobSpecFile& file) {
    return file.kind == v1::FILE_KIND_IMAGE && ++num_photos > 3;
  });
  ExpectExit(Run(), WorkerExit::kSucceeded);
  EXPECT_THAT(Sources(), Contains(Pair("masks", "sam")));
  const std::string log = ReadFileTail(job_.worker_log(), 100000);
  EXPECT_EQ(log.find("error"), log.npos) << log;
}

}  // namespace
}  // namespace pepeseg
