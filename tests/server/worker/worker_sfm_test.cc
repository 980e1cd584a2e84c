#include <algorithm>
#include <csignal>
#include <fstream>
#include <map>
#include <string>

#include "absl/strings/str_cat.h"
#include "core/model_files/model_file.h"
#include "tests/server/worker/worker_sfm_fixture.h"
#include "tests/testing/eventually.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/time_limit.h"

namespace pepeseg {
namespace {

using ::testing::HasSubstr;
using ::testing::Pair;
using ::testing::UnorderedElementsAre;

// Returns whether the process runs. One that has ended may still wait to be reaped.
bool IsThere(pid_t pid) {
  std::ifstream stat(absl::StrCat("/proc/", pid, "/stat"));
  std::string word, state;
  stat >> word >> word >> state;
  return stat.good() && state != "Z";
}

bool HasBegun(const std::vector<v1::JobEvent>& events, v1::JobStage stage) {
  return std::any_of(events.begin(), events.end(), [&](const v1::JobEvent& event) {
    return event.has_stage_started() && event.stage_started().stage() == stage;
  });
}

TEST_F(WorkerSfmTest, MakesAModelOfPhotographsAlone) {
  AddPlace(6, 1);
  ExpectExit(Run(), WorkerExit::kSucceeded);
  ASSERT_OK_AND_ASSIGN(const auto model, ReadModel(job_.attempt(1)));
  EXPECT_THAT(model.facts.at("poses"), ::testing::StartsWith("COLMAP "));
  EXPECT_EQ(model.views.size(), 6u);
  EXPECT_EQ(model.metrics.at("num_registered"), 6);
  EXPECT_EQ(model.metrics.at("num_photographs"), 6);
  EXPECT_LT(model.metrics.at("reprojection_error"), 1);
  EXPECT_GT(model.metrics.at("seconds_sfm"), 0);
  std::map<std::string, std::string> last;  // by activity
  for (const v1::JobEvent& event : Events()) {
    const v1::JobProgress& progress = event.progress();
    if (progress.stage() != v1::JOB_STAGE_SFM) continue;
    EXPECT_EQ(progress.stage_number(), 2);
    EXPECT_EQ(progress.num_stages(), 7);
    last[progress.activity()] =
        absl::StrCat(progress.step(), " of ", progress.num_steps(), " ", progress.unit());
  }
  EXPECT_THAT(last, UnorderedElementsAre(Pair("finding features in", "6 of 6 photographs"),
                                         Pair("matching", "15 of 15 pairs"),
                                         Pair("placing", "6 of 6 photographs")));
  EXPECT_FALSE(std::filesystem::exists(job_.poses(1)));
  EXPECT_TRUE(std::filesystem::exists(job_.sfm_log()));
}

TEST_F(WorkerSfmTest, UsesPosesOfAnEarlierAttempt) {
  AddPlace(6, 1);
  // The state that an attempt leaves which was stopped during the next stage.
  spec_.options.mutable_reconstruct()->set_num_steps(1'000'000);
  const auto first = Launch(getpid());
  ASSERT_TRUE(testing::Eventually([&] { return HasBegun(Events(), v1::JOB_STAGE_RECONSTRUCT); },
                                  absl::Minutes(2)));
  first->Signal(SIGTERM);
  ExpectExit(WaitFor(*first), WorkerExit::kCancelled);
  ASSERT_TRUE(std::filesystem::exists(job_.poses(1) / "manifest.json"));
  spec_.options.mutable_reconstruct()->set_num_steps(60);
  spec_.fence = 2;
  spec_.worker.colmap = PathOf("nowhere");
  ExpectExit(Run(), WorkerExit::kSucceeded);
  EXPECT_THAT(ReadFileTail(job_.worker_log(), 100000),
              HasSubstr("poses were estimated by attempt-1"));
  ASSERT_OK_AND_ASSIGN(const auto model, ReadModel(job_.attempt(2)));
  EXPECT_EQ(model.metrics.at("num_registered"), 6);
}

TEST_F(WorkerSfmTest, MakesAModelOfAVideo) {
  std::vector<Image> frames;
  for (const View& view : testing::PhotographPlace(testing::PlaceArc(6), 1)) {
    frames.push_back(testing::Blurred(view.photo, 1));
    frames.push_back(view.photo);
  }
  AddVideo(frames);
  spec_.options.mutable_sfm()->set_max_video_frames(6);
  ExpectExit(Run(), WorkerExit::kSucceeded);
  ASSERT_OK_AND_ASSIGN(const auto model, ReadModel(job_.attempt(1)));
  ASSERT_EQ(model.views.size(), 6u);
  EXPECT_EQ(model.views.front().name, "walk_000001.jpg");
  EXPECT_EQ(model.views.back().name, "walk_000011.jpg");
  EXPECT_FALSE(std::filesystem::exists(job_.frames(1)));
}

TEST_F(WorkerSfmTest, RefusesAVideoWithoutMotion) {
  const View view = testing::PhotographPlace(testing::PlaceArc(1), 1).front();
  AddVideo(std::vector<Image>(30, view.photo));
  ExpectRefused("videos/walk.avi: the camera hardly moves");
}

TEST_F(WorkerSfmTest, RefusesOnePhotographAHundredTimes) {
  AddPlace(1, 1);
  for (int i = 1; i < 100; ++i) {
    spec_.files.push_back(spec_.files.front());
    spec_.files.back().name = absl::StrCat("images/", i, ".jpg");
  }
  ExpectRefused("100 photographs, of which only 1 is different");
}

TEST_F(WorkerSfmTest, ReportsThatColmapIsMissing) {
  AddPlace(3, 1);
  spec_.worker.colmap = PathOf("nowhere");
  ExpectRefused("or upload poses");
}

TEST_F(WorkerSfmTest, RefusesPointsWithoutTheirPoses) {
  AddPlace(3, 1);
  std::ofstream(PathOf("points.ply")) << "ply\n";
  spec_.files.push_back({"points.ply", v1::FILE_KIND_POINTS, PathOf("points.ply"), ""});
  ExpectBadFile("points.ply");
}

TEST_F(WorkerSfmTest, NamesAFileThatIsNotAPhotograph) {
  AddPlace(3, 1);
  Replace("images/1.jpg", "GIF89a no photograph");
  ExpectBadFile("images/1.jpg");
}

TEST_F(WorkerSfmTest, StopsColmapWithinASecond) {
  AddPlace(4, 1);
  UseEndlessColmap();
  const auto worker = Launch(getpid());
  const pid_t colmap = WaitForColmap();
  ASSERT_TRUE(IsThere(colmap));
  const absl::Time start = absl::Now();
  worker->Signal(SIGTERM);
  ExpectExit(WaitFor(*worker), WorkerExit::kCancelled);
  EXPECT_LT(absl::Now() - start, testing::TimeLimit(absl::Seconds(1)));
  EXPECT_FALSE(IsThere(colmap));
}

TEST_F(WorkerSfmTest, LeavesNoColmapBehindWhenItIsKilled) {
  AddPlace(4, 1);
  UseEndlessColmap();
  const auto worker = Launch(getpid());
  const pid_t colmap = WaitForColmap();
  ASSERT_TRUE(IsThere(colmap));
  worker->Signal(SIGKILL);
  WaitFor(*worker);
  EXPECT_TRUE(testing::Eventually([&] { return !IsThere(colmap); }, absl::Seconds(1)));
}

}  // namespace
}  // namespace pepeseg
