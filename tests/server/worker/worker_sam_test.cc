#include <algorithm>
#include <csignal>
#include <cstdlib>

#include "absl/strings/str_format.h"
#include "absl/time/time.h"
#include "core/dataset/dataset_index.h"
#include "core/model_files/model_file.h"
#include "core/priors/sam/sam_embedding.h"
#include "core/priors/sam/sam_networks.h"
#include "tests/server/worker/worker_sfm_fixture.h"
#include "tests/testing/colmap_files.h"
#include "tests/testing/eventually.h"
#include "tests/testing/fake_sam.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/time_limit.h"

// The stage "priors" with SAM, by a fake of ONNX Runtime.
namespace pepeseg {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::Pair;
using testing::ReplaceSamFile;

template <class Test>
class WithSam : public Test {
 protected:
  using Test::Events;
  using Test::folder_;
  using Test::job_;
  using Test::spec_;

  WithSam() : sam_(folder_.path() / "sam") {
    spec_.options.mutable_reconstruct()->set_num_steps(5);
    spec_.options.mutable_features()->set_num_steps(5);
    (*spec_.options.mutable_advanced())["features.steps_per_chunk"] = "5";
    testing::MakeFakeSam(sam_);
    spec_.worker.sam = sam_;
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
  std::filesystem::path MasksOf(const std::string& photograph) const {
    return job_.priors() / "sam" / ("upright" + photograph + ".json");
  }

  const std::filesystem::path sam_;
};

class WorkerSamTest : public WithSam<WorkerTest> {
 protected:
  WorkerSamTest() {
    std::erase_if(spec_.files, [](const JobSpecFile& file) {
      return file.kind != v1::FILE_KIND_IMAGE && file.kind != v1::FILE_KIND_POSES;
    });
  }

  void ExpectEmbeddedBecause(const std::string& why) {
    ExpectExit(Run(), WorkerExit::kSucceeded);
    EXPECT_THAT(Sources(), Contains(Pair("masks", "embedded")));
    EXPECT_THAT(Warnings(),
                ElementsAre(AllOf(HasSubstr("SAM: "), HasSubstr(why),
                                  HasSubstr("The job continues with the built-in masks.")),
                            HasSubstr("segments may be poor")));
    ASSERT_OK_AND_ASSIGN(const auto model, ReadModel(job_.attempt(spec_.fence)));
    EXPECT_EQ(model.facts.at("masks"), "embedded");
    EXPECT_FALSE(model.field.features.empty());
  }
};

TEST_F(WorkerSamTest, MakesMasksOfTheTrainingViews) {
  ExpectExit(Run(), WorkerExit::kSucceeded);
  EXPECT_THAT(Sources(), AllOf(Contains(Pair("masks", "sam")), Contains(Pair("depth", "none"))));
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

TEST_F(WorkerSamTest, KeepsTheEmbeddingsOfTheTrainingViewsWithTheModel) {
  ExpectExit(Run(), WorkerExit::kSucceeded);
  ASSERT_OK_AND_ASSIGN(const std::string encoder, SamEncoderDigest(sam_));
  ASSERT_OK_AND_ASSIGN(const auto model, ReadModel(job_.attempt(spec_.fence)));
  int num_kept = 0;
  for (const ModelView& view : model.views) {
    const auto photograph = std::ranges::find_if(spec_.files, [&](const JobSpecFile& file) {
      return file.kind == v1::FILE_KIND_IMAGE && PhotoKey(file.name) == view.name;
    });
    ASSERT_NE(photograph, spec_.files.end()) << view.name;
    const auto embedding = ReadEmbedding(job_.attempt(spec_.fence) / EmbeddingFileName(view.name),
                                         {encoder, photograph->sha256});
    if (view.held_out) {
      EXPECT_TRUE(absl::IsNotFound(embedding.status())) << view.name;
      continue;
    }
    ASSERT_OK(embedding) << view.name;
    EXPECT_EQ(embedding->width, view.camera.width);
    EXPECT_EQ(embedding->height, view.camera.height);
    ++num_kept;
  }
  EXPECT_EQ(num_kept, 13);
  ASSERT_OK_AND_ASSIGN(const JobResult result, job_.ReadResult(spec_.fence));
  EXPECT_GT(result.num_bytes, 13 * kEmbeddingFileBytes);
  EXPECT_LT(result.num_bytes, 14 * kEmbeddingFileBytes);
  EXPECT_THAT(ReadFileTail(job_.worker_log(), 100000),
              HasSubstr("the embeddings of 13 photographs are kept with the model: 27 MB"));
}

TEST_F(WorkerSamTest, KeepsNoEmbeddingsIfTheOperatorDoesNotWantThem) {
  spec_.worker.keep_embeddings = false;
  ExpectExit(Run(), WorkerExit::kSucceeded);
  EXPECT_THAT(Sources(), Contains(Pair("masks", "sam")));
  for (const auto& entry : std::filesystem::directory_iterator(job_.attempt(spec_.fence))) {
    EXPECT_THAT(entry.path().filename().string(), Not(HasSubstr("embedding")));
  }
}

TEST_F(WorkerSamTest, AddsItsMasksToEmbeddedOnesIfRequested) {
  spec_.options.mutable_priors()->set_masks(v1::PRIOR_MAKER_SAM_AND_EMBEDDED);
  ExpectExit(Run(), WorkerExit::kSucceeded);
  EXPECT_THAT(Sources(), Contains(Pair("masks", "sam and embedded")));
}

TEST_F(WorkerSamTest, FallsBackIfItIsRequestedAndMissing) {
  spec_.options.mutable_priors()->set_masks(v1::PRIOR_MAKER_SAM);
  spec_.worker.sam.clear();
  ExpectEmbeddedBecause("this server no longer has it");
}

TEST_F(WorkerSamTest, IsNotUsedIfEmbeddedMasksAreRequested) {
  spec_.options.mutable_priors()->set_masks(v1::PRIOR_MAKER_EMBEDDED);
  ExpectExit(Run(), WorkerExit::kSucceeded);
  EXPECT_THAT(Sources(), Contains(Pair("masks", "embedded")));
  EXPECT_EQ(NumSegmentingSteps(), 0);
}

TEST_F(WorkerSamTest, FallsBackIfTheLibraryDoesNotLoad) {
  ReplaceSamFile(sam_, "libonnxruntime.so.1", "a text");
  ExpectEmbeddedBecause("does not load");
}

TEST_F(WorkerSamTest, FallsBackIfTheModelIsTruncated) {
  ReplaceSamFile(sam_, "sam.onnx", testing::FakeDecoder().substr(0, 20));
  ExpectEmbeddedBecause("sam.onnx: not an ONNX model, or cut off");
}

TEST_F(WorkerSamTest, FallsBackIfADigestDiffers) {
  std::ofstream(sam_ / "encoder.onnx", std::ios::app) << "x";
  ExpectEmbeddedBecause("encoder.onnx: its SHA-256 is ");
}

TEST_F(WorkerSamTest, FallsBackIfTheFolderIsGone) {
  std::filesystem::remove_all(sam_);
  ExpectEmbeddedBecause("does not exist");
}

TEST_F(WorkerSamTest, FallsBackIfMemoryIsShort) {
  ReplaceSamFile(sam_, "encoder.onnx", "out of memory");
  ExpectEmbeddedBecause("out of memory: it needs about ");
}

TEST_F(WorkerSamTest, SegmentsDuringStageOneAndKeepsFinishedPhotographs) {
  spec_.options.mutable_reconstruct()->set_num_steps(1'000'000);
  const auto first = Launch(getpid());
  // Next to stage one the networks run at a low priority: on a busy machine they take their time.
  ASSERT_TRUE(testing::Eventually(
      [&] {
        return std::filesystem::exists(MasksOf("000002")) ||
               std::filesystem::exists(MasksOf("000003"));
      },
      absl::Minutes(4)));
  first->Signal(SIGTERM);
  const WorkerEnd end = WaitFor(*first);
  EXPECT_EQ(end.exit_code, static_cast<int>(WorkerExit::kCancelled));
  // The first view is held out; the next two are segmented in parallel.
  const bool has_second = std::filesystem::exists(MasksOf("000002"));
  const auto kept = MasksOf(has_second ? "000002" : "000003");
  ASSERT_TRUE(std::filesystem::exists(kept));
  const auto written = std::filesystem::last_write_time(kept);
  // Masks in a damaged file are made again.
  std::ofstream(MasksOf("000015")) << "[{";

  EXPECT_EQ(NumSegmentingSteps(), 0) << "stage one was to run still";
  spec_.options.mutable_reconstruct()->set_num_steps(5);
  spec_.fence = 2;
  const auto second = Launch(getpid());
  EXPECT_TRUE(testing::Eventually([&] {
    if (std::filesystem::exists(kept)) {
      EXPECT_EQ(std::filesystem::last_write_time(kept), written);
    }
    return NumSegmentingSteps() > 0;
  }));
  ExpectExit(WaitFor(*second), WorkerExit::kSucceeded);
  EXPECT_THAT(Sources(), Contains(Pair("masks", "sam")));
  // The checkpoints of stage one, of every 1,000 steps and of the end, had another number of steps.
  EXPECT_THAT(Warnings(), Not(IsEmpty()));
  EXPECT_THAT(Warnings(), Each(HasSubstr("is of other files or options")));
  EXPECT_THAT(ReadFileTail(job_.worker_log(), 100000),
              HasSubstr("were segmented by an earlier attempt"));
}

// Photographs without poses, which COLMAP or a fake of it estimates.
class WorkerSamWithoutPosesTest : public WithSam<WorkerSfmTest> {
 protected:
  // `commands`: shell commands that run for each of COLMAP's commands.
  void UseColmap(const std::string& commands) {
    spec_.worker.colmap = PathOf("colmap");
    std::ofstream(spec_.worker.colmap)
        << "#!/bin/sh\nif [ $1 = help ]; then echo 'COLMAP 9.9 -- x'; exit; fi\n"
        << commands << "\n";
    std::filesystem::permissions(spec_.worker.colmap, std::filesystem::perms::owner_all);
  }
  // Uses a COLMAP that finds the true poses of `placed`, which are all but the first photograph, so
  // that it is certain which photographs get one.
  void UseColmapThatPlacesAllButTheFirst(const std::vector<View>& placed) {
    const Camera& camera = placed.front().camera;
    std::vector<testing::ImageRecord> images;
    for (const View& view : placed) {
      const Eigen::Quaterniond& q = view.cam_from_world.rotation;
      const Eigen::Vector3d& t = view.cam_from_world.translation;
      const auto number = static_cast<uint32_t>(images.size() + 2);
      images.push_back({.id = number,
                        .q = {q.w(), q.x(), q.y(), q.z()},
                        .t = {t.x(), t.y(), t.z()},
                        .name = absl::StrFormat("c1/%06d.jpg", number)});
    }
    std::vector<testing::PointRecord> points;
    for (int i = 0; i < 27; ++i) {
      points.push_back({.id = points.size() + 1,
                        .xyz = {0.5 * (i % 3 - 1), 0.5 * (i / 3 % 3 - 1), 0.5 * (i / 9 - 1)}});
    }
    std::filesystem::create_directory(PathInJob("model"));
    const auto write = [&](const std::string& name, const std::string& bytes) {
      std::ofstream(PathInJob("model/" + name), std::ios::binary) << bytes;
    };
    write("cameras.bin",
          testing::CamerasBinary({{.width = static_cast<uint64_t>(camera.width),
                                   .height = static_cast<uint64_t>(camera.height),
                                   .parameters = {camera.fx, camera.fy, camera.cx, camera.cy}}}));
    write("images.bin", testing::ImagesBinary(images));
    write("points3D.bin", testing::PointsBinary(points));
    const size_t num_photographs = placed.size() + 1;
    UseColmap(absl::StrCat("if [ $1 = feature_extractor ]; then for i in $(seq ", num_photographs,
                           "); do printf 'Name: c1/%06d.jpg\\nFeatures: 1000\\n' $i; done; fi\n",
                           "while [ $# != 0 ]; do if [ $1 = --output_path ]; then cp -r ",
                           PathInJob("model"), " $2/0; fi; shift; done"));
  }
  static std::string WaitingFor(const std::filesystem::path& file) {
    return absl::StrCat("n=0; until [ -e ", file.string(),
                        " ] || [ $n = 600 ]; do n=$((n+1)); sleep 0.1; done");
  }
};

TEST_F(WorkerSamWithoutPosesTest, SegmentsPhotographsWhileColmapRuns) {
  AddPlace(4, 1);
  UseColmap(WaitingFor(MasksOf("000002")) + "; exit 1");
  ExpectExit(Run(), WorkerExit::kFailed);
  EXPECT_TRUE(std::filesystem::exists(MasksOf("000002")));
  // That photograph would be held out.
  EXPECT_FALSE(std::filesystem::exists(MasksOf("000001")));
}

TEST_F(WorkerSamWithoutPosesTest, GivesMasksToTheTrainingViewsOnly) {
  AddPlace(6, 1);
  ExpectExit(Run(), WorkerExit::kSucceeded);
  EXPECT_THAT(Sources(), Contains(Pair("masks", "sam")));
  EXPECT_THAT(Warnings(), IsEmpty());
  v1::JobProgress last;
  for (const v1::JobEvent& event : Events()) {
    if (event.progress().activity() == "segmenting") last = event.progress();
  }
  EXPECT_EQ(last.step(), 5);  // the first of 6 is held out
  EXPECT_EQ(last.num_steps(), 5);
  ASSERT_OK_AND_ASSIGN(const auto model, ReadModel(job_.attempt(1)));
  EXPECT_GE(model.metrics.at("num_masks"), 5);
}

// The first photograph gets no pose, so the second is held out in its place. The ninth would have
// been held out and is a training view now.
TEST_F(WorkerSamWithoutPosesTest, SegmentsTheViewThatReplacesAPhotographWithoutPose) {
  AddPlace(1, 7);
  AddPlace(9, 1);
  UseColmapThatPlacesAllButTheFirst(testing::PhotographPlace(testing::PlaceArc(9), 1));
  ExpectExit(Run(), WorkerExit::kSucceeded);
  ASSERT_OK_AND_ASSIGN(const auto model, ReadModel(job_.attempt(1)));
  ASSERT_EQ(model.views.size(), 9u);
  EXPECT_EQ(model.views[0].name, "1.jpg");
  EXPECT_TRUE(model.views[0].held_out);
  EXPECT_EQ(model.views[7].name, "8.jpg");
  EXPECT_FALSE(model.views[7].held_out);
  EXPECT_THAT(Sources(), Contains(Pair("masks", "sam")));
  EXPECT_THAT(ReadFileTail(job_.worker_log(), 100000), Not(HasSubstr("upright000009.json")));
}

TEST_F(WorkerSamWithoutPosesTest, StopsAtOnceIfColmapFails) {
  AddPlace(4, 1);
  ReplaceSamFile(sam_, "encoder.onnx", "endless");
  UseColmap("sleep 1; exit 1");
  const auto worker = Launch(getpid());
  ExpectExit(WaitFor(*worker), WorkerExit::kFailed);
  EXPECT_FALSE(std::filesystem::exists(MasksOf("000002")));
}

TEST_F(WorkerSamWithoutPosesTest, StopsBothWithinASecond) {
  AddPlace(4, 1);
  ReplaceSamFile(sam_, "encoder.onnx", "endless");
  UseEndlessColmap();
  const auto worker = Launch(getpid());
  ASSERT_GT(WaitForColmap(), 0);
  const absl::Time start = absl::Now();
  worker->Signal(SIGTERM);
  ExpectExit(WaitFor(*worker), WorkerExit::kCancelled);
  EXPECT_LT(absl::Now() - start, testing::TimeLimit(absl::Seconds(1)));
}

TEST_F(WorkerSamWithoutPosesTest, KeepsMasksMadeBeforeAKill) {
  AddPlace(6, 1);
  UseEndlessColmap();
  const auto first = Launch(getpid());
  // The first photograph would be held out. Several are segmented at a time, in no certain order.
  const auto has_all_masks = [this] {
    return std::ranges::all_of(
        std::vector{"000002", "000003", "000004", "000005", "000006"},
        [this](const char* number) { return std::filesystem::exists(MasksOf(number)); });
  };
  // Networks run at idle priority while COLMAP does: on a busy machine they take their time.
  ASSERT_TRUE(testing::Eventually(has_all_masks, absl::Minutes(4)));
  first->Signal(SIGKILL);
  WaitFor(*first);
  ASSERT_TRUE(has_all_masks());
  spec_.fence = 2;
  spec_.worker.colmap = "colmap";
  ExpectExit(Run(), WorkerExit::kSucceeded);
  EXPECT_THAT(Sources(), Contains(Pair("masks", "sam")));
  EXPECT_THAT(ReadFileTail(job_.worker_log(), 100000),
              HasSubstr("5 photographs were segmented by an earlier attempt"));
}

TEST_F(WorkerSamWithoutPosesTest, FallsBackIfTheLibraryDoesNotLoad) {
  AddPlace(6, 1);
  ReplaceSamFile(sam_, "libonnxruntime.so.1", "a text");
  ExpectExit(Run(), WorkerExit::kSucceeded);
  EXPECT_THAT(Sources(), Contains(Pair("masks", "embedded")));
  EXPECT_THAT(Warnings(), Contains(AllOf(HasSubstr("does not load"),
                                         HasSubstr("continues with the built-in masks."))));
}

// Uses the files that deploy/sam.sh installs, in the sandbox. `make sam-test` runs it.
TEST_F(WorkerSamTest, RunsTheRealModel) {
  const char* real = std::getenv("PEPESEG_SAM");
  if (real == nullptr) GTEST_SKIP() << "PEPESEG_SAM names no folder";
  spec_.worker.sam = real;
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
