#include <sys/stat.h>

#include <algorithm>
#include <csignal>
#include <fstream>

#include "absl/time/time.h"
#include "core/formats/images.h"
#include "core/model_files/model_file.h"
#include "core/scene/capture.h"
#include "tests/server/worker/worker_fixture.h"
#include "tests/testing/eventually.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/time_limit.h"

// The stage "priors" with a priors command.
namespace pepeseg {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Pair;
using ::testing::UnorderedElementsAre;

// Matches the warning about built-in masks.
auto AdvisesOtherMasks() {
  return AllOf(HasSubstr("segments may be poor"), HasSubstr("pepeseg-priors"),
               HasSubstr("--priors-command"));
}

// A script that writes the upper half of each photograph as its mask.
constexpr char kMakeMasks[] = R"(
mkdir -p "$out/masks"
n=0
for photo in "$photos"/*; do
  n=$((n + 1))
  stem=$(basename "$photo" | sed 's/\.[^.]*$//')
  echo '[{"segmentation": {"size": [480, 640], "counts": ['$(
    seq 640 | sed "s/.*/240,240,/" | tr -d '\n' | sed 's/^/0,/; s/,$//')']}}]' \
    > "$out/masks/$stem.json"
  echo "progress $n 15"
done
)";

class WorkerPriorsTest : public WorkerTest {
 protected:
  // `given`: the scene keeps its own masks and depth.
  explicit WorkerPriorsTest(bool given = false) {
    std::erase_if(spec_.files, [given](const JobSpecFile& file) {
      return !given && file.kind != v1::FILE_KIND_IMAGE && file.kind != v1::FILE_KIND_POSES;
    });
    spec_.options.mutable_reconstruct()->set_num_steps(5);
    spec_.options.mutable_features()->set_num_steps(5);
    (*spec_.options.mutable_advanced())["features.steps_per_chunk"] = "5";
    std::filesystem::create_directories(Shared(""));
  }

  // Uses a shell script as priors command. Its arguments are in `photos`, `out` and `want`.
  void SetCommand(const std::string& script) {
    const std::filesystem::path path = folder_.path() / "make_priors";
    std::ofstream(path) << "#!/bin/sh\n"
                        << "echo x >> '" << Shared("runs") << "'\n"
                        << "photos=$2 out=$4 want=$6\n[ \"$1 $3 $5\" = '--photos --out --want' ] "
                        << "|| exit 9\n"
                        << script;
    ASSERT_EQ(chmod(path.c_str(), 0700), 0);
    spec_.worker.priors_command = path.string();
  }
  // Returns a path that the script may read and write.
  std::string Shared(const std::string& name) { return (job_.work() / "shared" / name).string(); }
  std::string Text(const std::string& name) {
    return ReadFile(Shared(name), name, 1 << 20).value_or("");
  }
  int NumRuns() { return static_cast<int>(Text("runs").size() / 2); }

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
  absl::Status Error() { return job_.ReadResult(spec_.fence).value_or(JobResult()).status; }
  // Waits until the process ends whose id the script has written to the file.
  void ExpectEnds(const std::string& name) {
    AwaitFile(name);
    const std::string stat = absl::StrCat("/proc/", std::stoi(Text(name)), "/stat");
    // Until its new parent reaps it, it is still in the process table.
    const auto runs = [&stat] {
      std::ifstream file(stat);
      std::string id, program, state;
      return file >> id >> program >> state && state != "Z" && state != "X";
    };
    EXPECT_TRUE(testing::Eventually([&] { return !runs(); }));
  }
  void AwaitFile(const std::string& name) {
    ASSERT_TRUE(testing::Eventually([&] { return !Text(name).empty(); })) << name;
  }
};

TEST_F(WorkerPriorsTest, MakesEmbeddedPriorsWithoutACommand) {
  (*spec_.options.mutable_advanced())["reconstruct.depth_weight"] = "-1";
  ExpectExit(Run(), WorkerExit::kSucceeded);
  EXPECT_THAT(Sources(), UnorderedElementsAre(Pair("poses", "given"), Pair("masks", "embedded"),
                                              Pair("depth", "embedded")));
  EXPECT_THAT(Warnings(), ElementsAre(AdvisesOtherMasks()));
  ASSERT_OK_AND_ASSIGN(const auto model, ReadModel(job_.attempt(1)));
  EXPECT_GT(model.metrics.at("num_masks"), 100);
  EXPECT_EQ(model.metrics.at("num_depth_maps"), 13);  // of 15, 2 are held out
  EXPECT_FALSE(model.field.features.empty());
  bool shows_progress = false, skips_depth = false;
  for (const v1::JobEvent& event : Events()) {
    shows_progress |=
        event.progress().stage() == v1::JOB_STAGE_PRIORS && event.progress().step() == 13;
    if (event.term_skipped().term() == v1::JobEvent::TermSkipped::TERM_DEPTH) {
      skips_depth = true;
      // Made after stage one: it comes from the points that stage one starts from.
      EXPECT_EQ(event.term_skipped().reason(), "no training view has a depth prior");
    }
  }
  EXPECT_TRUE(shows_progress);
  EXPECT_TRUE(skips_depth);
}

TEST_F(WorkerPriorsTest, MakesNoneIfTheOptionsExcludeThem) {
  spec_.options.mutable_priors()->set_masks(v1::PRIOR_MAKER_NONE);
  spec_.options.mutable_priors()->set_depth(v1::PRIOR_MAKER_NONE);
  ExpectExit(Run(), WorkerExit::kSucceeded);
  EXPECT_THAT(Sources(), UnorderedElementsAre(Pair("poses", "given"), Pair("masks", "none"),
                                              Pair("depth", "none")));
  ASSERT_OK_AND_ASSIGN(const auto model, ReadModel(job_.attempt(1)));
  EXPECT_TRUE(model.field.features.empty());  // it can be rendered, not segmented
}

// The scene with its own masks and depth.
class WorkerGivenPriorsTest : public WorkerPriorsTest {
 protected:
  WorkerGivenPriorsTest() : WorkerPriorsTest(/*given=*/true) {
    spec_.options.mutable_priors()->set_masks(v1::PRIOR_MAKER_NONE);
    spec_.options.mutable_priors()->set_depth(v1::PRIOR_MAKER_NONE);
  }
};

TEST_F(WorkerGivenPriorsTest, AreUsedWithAWarningWhateverTheMakerIs) {
  ExpectExit(Run(), WorkerExit::kSucceeded);
  EXPECT_THAT(Sources(), UnorderedElementsAre(Pair("poses", "given"), Pair("masks", "given"),
                                              Pair("depth", "given")));
  EXPECT_THAT(Warnings(), ElementsAre(HasSubstr("import.use_masks=false leaves it out"),
                                      HasSubstr("import.use_depth=false leaves it out")));
}

TEST_F(WorkerGivenPriorsTest, AreLeftOutOnRequest) {
  spec_.options.mutable_import()->set_use_masks(false);
  spec_.options.mutable_import()->set_use_depth(false);
  ExpectExit(Run(), WorkerExit::kSucceeded);
  EXPECT_THAT(Sources(), UnorderedElementsAre(Pair("poses", "given"), Pair("masks", "none"),
                                              Pair("depth", "none")));
  EXPECT_THAT(Warnings(),
              ElementsAre("the masks of 15 photographs are left out: import.use_masks is false",
                          "the depth maps of 15 photographs are left out: import.use_depth is "
                          "false"));
  ASSERT_OK_AND_ASSIGN(const auto model, ReadModel(job_.attempt(1)));
  EXPECT_TRUE(model.field.features.empty());
}

TEST_F(WorkerPriorsTest, RunsACommandForMasksAndDepth) {
  Image ramp{64, 48, 1, {}};
  for (int i = 0; i < 64 * 48; ++i) ramp.pixels.push_back(static_cast<uint8_t>(i % 64 * 4));
  std::ofstream(Shared("ramp.png"), std::ios::binary) << EncodePng(ramp).value_or("");
  SetCommand(absl::StrCat("ls $photos > ", Shared("photos"), "; echo $want > ", Shared("want"),
                          "\n", kMakeMasks, "mkdir $out/disparity; for i in 000001 000004; do cp ",
                          Shared("ramp.png"), " $out/disparity/$i.png; done"));
  ExpectExit(Run(), WorkerExit::kSucceeded);
  EXPECT_THAT(Sources(),
              UnorderedElementsAre(Pair("poses", "given"), Pair("masks", "command make_priors"),
                                   Pair("depth", "command make_priors")));
  EXPECT_EQ(Text("photos").substr(0, 22), "000001.jpg\n000002.jpg\n");
  EXPECT_EQ(Text("want"), "masks,depth\n");
  EXPECT_THAT(Warnings(),
              ElementsAre(HasSubstr("2 maps of disparity/"),
                          "the priors command make_priors made depth for 2 of 15 photographs"));
  ASSERT_OK_AND_ASSIGN(const auto model, ReadModel(job_.attempt(1)));
  EXPECT_EQ(model.facts.at("masks"), "command make_priors");
  EXPECT_EQ(model.metrics.at("num_masks"), 15);
  EXPECT_EQ(model.metrics.at("num_depth_maps"), 2);
  EXPECT_FALSE(model.field.features.empty());
  std::vector<int64_t> steps;
  for (const v1::JobEvent& event : Events()) {
    if (event.has_progress() && event.progress().stage() == v1::JOB_STAGE_PRIORS) {
      steps.push_back(event.progress().step());
    }
  }
  EXPECT_THAT(steps, Contains(15));
  EXPECT_FALSE(std::filesystem::exists(job_.priors()));
}

TEST_F(WorkerPriorsTest, MakesOnlyWhatIsRequested) {
  spec_.options.mutable_priors()->set_depth(v1::PRIOR_MAKER_NONE);
  SetCommand(absl::StrCat("echo $want > ", Shared("want"), "\n", kMakeMasks));
  ExpectExit(Run(), WorkerExit::kSucceeded);
  EXPECT_EQ(Text("want"), "masks\n");
  EXPECT_THAT(Warnings(), IsEmpty());
  spec_.options.mutable_priors()->set_masks(v1::PRIOR_MAKER_EMBEDDED);
  spec_.fence = 2;
  ExpectExit(Run(), WorkerExit::kSucceeded);
  EXPECT_EQ(NumRuns(), 1);
}

TEST_F(WorkerPriorsTest, WarnsOfAFailureWithTheEndOfItsLog) {
  SetCommand("echo weights are missing >&2; exit 3");
  ExpectExit(Run(), WorkerExit::kSucceeded);
  EXPECT_THAT(Warnings(),
              ElementsAre(AllOf(HasSubstr("the priors command make_priors: exited with code 3"),
                                HasSubstr("weights are missing")),
                          AdvisesOtherMasks()));
  EXPECT_THAT(Sources(), Contains(Pair("masks", "embedded")));
}

TEST_F(WorkerPriorsTest, FailsTheJobIfRequiredPriorsFail) {
  spec_.options.mutable_priors()->set_masks(v1::PRIOR_MAKER_COMMAND);
  SetCommand("echo weights are missing; kill -9 $$");
  ExpectExit(Run(), WorkerExit::kFailed);
  EXPECT_EQ(Error().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(Error().message()),
              AllOf(HasSubstr("killed by signal 9"), HasSubstr("weights are missing")));
}

TEST_F(WorkerPriorsTest, TreatsNoOutputAsAFailure) {
  spec_.options.mutable_priors()->set_masks(v1::PRIOR_MAKER_COMMAND);
  // Links are not followed, and files with unknown names are ignored.
  SetCommand("mkdir $out/masks; ln -s /etc/hostname $out/masks/000001.json; : > $out/masks/a.json");
  ExpectExit(Run(), WorkerExit::kFailed);
  EXPECT_THAT(std::string(Error().message()), HasSubstr("wrote no masks,depth"));
}

TEST_F(WorkerPriorsTest, FailsIfACommandIsRequiredAndMissing) {
  spec_.options.mutable_priors()->set_depth(v1::PRIOR_MAKER_COMMAND);
  ExpectExit(Run(), WorkerExit::kFailed);
  EXPECT_EQ(Error().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(Error().message()), HasSubstr("--priors-command"));
}

TEST_F(WorkerPriorsTest, NamesABrokenMaskAndUsesNone) {
  const std::string script = absl::StrCat(kMakeMasks, "echo '[{' > $out/masks/000002.json");
  SetCommand(script);
  ExpectExit(Run(), WorkerExit::kSucceeded);
  EXPECT_THAT(Warnings(), ElementsAre(AllOf(HasSubstr("made files that cannot be used"),
                                            HasSubstr("masks/frame-000001.json")),
                                      AdvisesOtherMasks()));
  EXPECT_THAT(Sources(), Contains(Pair("masks", "embedded")));
}

TEST_F(WorkerPriorsTest, StopsTheCommandAtItsTimeLimit) {
  SetCommand("sleep 600");
  spec_.worker.priors_seconds = 1;
  ExpectExit(Run(), WorkerExit::kSucceeded);
  EXPECT_THAT(Warnings(), ElementsAre(HasSubstr("time limit"), AdvisesOtherMasks()));
}

TEST_F(WorkerPriorsTest, KillsTheCommandAndItsChildrenWithinASecondOfACancel) {
  SetCommand(absl::StrCat("trap '' TERM; sleep 600 & echo $! > ", Shared("child"), "; wait"));
  const auto worker = Launch(getpid());
  AwaitFile("child");
  const absl::Time before = absl::Now();
  worker->Signal(SIGTERM);
  ExpectExit(WaitFor(*worker), WorkerExit::kCancelled);
  EXPECT_LT(absl::Now() - before, testing::TimeLimit(absl::Seconds(1)));
  EXPECT_EQ(Error().code(), absl::StatusCode::kCancelled);
  ExpectEnds("child");
}

// Twice forked, so that it is no child of the command, and in a group of its own if it can be.
constexpr char kLeave[] =
    R"(perl -e 'fork && exit; setpgrp(0, 0); fork && exit; open(F, ">$ARGV[0].new"); )"
    R"(print F $$; close F; rename("$ARGV[0].new", $ARGV[0]); sleep 600' )";

TEST_F(WorkerPriorsTest, LeavesNoProcessThatLeftTheCommandsGroup) {
  SetCommand(absl::StrCat(kLeave, Shared("child"), "; echo no masks"));
  ExpectExit(Run(), WorkerExit::kSucceeded);
  ExpectEnds("child");
}

TEST_F(WorkerPriorsTest, LeavesNoProcessWhenTheWorkerIsKilled) {
  SetCommand(absl::StrCat(kLeave, Shared("child"), "; sleep 600"));
  const auto worker = Launch(getpid());
  AwaitFile("child");
  worker->Kill();
  WaitFor(*worker);
  ExpectEnds("child");
}

TEST_F(WorkerPriorsTest, ReusesPriorsOfAnEarlierAttempt) {
  SetCommand(kMakeMasks);
  spec_.options.mutable_reconstruct()->set_num_steps(1'000'000);
  const auto first = Launch(getpid());
  const auto reconstructs = [this] {
    const auto events = Events();
    return std::any_of(events.begin(), events.end(), [](const v1::JobEvent& event) {
      return event.progress().stage() == v1::JOB_STAGE_RECONSTRUCT;
    });
  };
  ASSERT_TRUE(testing::Eventually(reconstructs));
  first->Signal(SIGTERM);
  ExpectExit(WaitFor(*first), WorkerExit::kCancelled);
  spec_.options.mutable_reconstruct()->set_num_steps(5);
  spec_.fence = 2;
  ExpectExit(Run(), WorkerExit::kSucceeded);
  EXPECT_EQ(NumRuns(), 1);
  EXPECT_THAT(Sources(), Contains(Pair("masks", "command make_priors")));
  EXPECT_EQ(ReadModel(job_.attempt(2))->metrics.at("num_masks"), 15);
}

}  // namespace
}  // namespace pepeseg
