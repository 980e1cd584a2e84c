#include "server/collect/collector.h"

#include <gtest/gtest.h>

#include <atomic>
#include <fstream>
#include <thread>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "server/data/locked_file.h"
#include "server/store/layout.h"
#include "tests/server/store/scene_of.h"
#include "tests/server/store/test_database.h"
#include "tests/testing/eventually.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

namespace fs = std::filesystem;

std::string Digest(int number) {
  const std::string digits = absl::StrCat(number);
  return std::string(64 - digits.size(), '0') + digits;
}

struct CollectorTest : ::testing::Test {
  CollectorTest() : store(*Store::Open(testing::NewTestDatabase(folder.path()))) {
    fs::create_directories(data / "locks");
    options.data = data;
    MakeScene("a");
  }

  void MakeScene(const std::string& id) { ASSERT_OK(store->scenes().CreateScene(NewScene(id))); }
  // Writes a file whose modification time is `age` ago.
  fs::path Write(const fs::path& path, absl::Duration age, const std::string& bytes = "bytes") {
    std::error_code taken;  // a collector on another thread may remove it in between
    fs::create_directories(path.parent_path(), taken);
    std::ofstream(path) << bytes;
    fs::last_write_time(path, fs::file_time_type::clock::now() - absl::ToChronoSeconds(age), taken);
    return path;
  }
  fs::path WriteBlob(int number, absl::Duration age, const std::string& project = "default") {
    return Write(BlobPath(data, {project, Digest(number)}), age);
  }
  void Upload(const std::string& scene, int number, bool seal = false) {
    const auto made = store->datasets().CreateDataset(SceneOf(*store, scene), "",
                                                      {{"f", 1, 5, Digest(number), true}});
    ASSERT_OK(made);
    if (!seal) return;
    ASSERT_OK(store->datasets().SealDataset(SceneOf(*store, scene), made->number));
  }
  // Creates the job "j1" with a model.
  void MakeModel() {
    Upload("a", 7, true);
    JobRecord job;
    job.scene = SceneOf(*store, "a");
    job.dataset = 1;
    ASSERT_OK(store->jobs().CreateJob(job));
    ASSERT_TRUE(store->queue().ClaimJob("cpu")->has_value());
    ModelRecord model;
    model.folder = "jobs/j1/attempt-1";
    ASSERT_OK(store->queue().CommitModel("j1", 1, model));
  }
  Collected Run() {
    const auto run = Collector(*store, options).Run();
    EXPECT_OK(run);
    return run.value_or(Collected());
  }

  const testing::TempFolder folder;
  const fs::path data = folder / "data";
  std::unique_ptr<Store> store;
  CollectorOptions options;
};

TEST_F(CollectorTest, RemovesDamagedBlobsADayAfterTheyWereSetAside) {
  Upload("a", 1, true);
  const fs::path young = Write(DamagedPath(data, {"default", Digest(1)}), absl::Hours(23));
  const fs::path old = Write(DamagedPath(data, {"default", Digest(2)}), absl::Hours(25));
  EXPECT_EQ(Run().num_files, 1);
  EXPECT_TRUE(fs::exists(young));
  EXPECT_FALSE(fs::exists(old));
}

TEST_F(CollectorTest, RemovesCorrectedModelsWithoutARecordAfterADay) {
  MakeModel();
  const fs::path kept = data / "models/1/1", young = data / "models/1/2", old = data / "models/1/3";
  for (const fs::path& model : {kept, young, old}) Write(model / "features.bin", absl::Hours(30));
  const auto yesterday = fs::file_time_type::clock::now() - std::chrono::hours(25);
  fs::last_write_time(kept, yesterday);
  fs::last_write_time(old, yesterday);
  EXPECT_EQ(Run().num_files, 1);
  EXPECT_TRUE(fs::exists(kept)) << "a model has this number";
  EXPECT_TRUE(fs::exists(young));
  EXPECT_FALSE(fs::exists(old));
}

TEST_F(CollectorTest, RemovesUnnamedBlobsAfterADay) {
  Upload("a", 1, true);
  Upload("a", 2);
  const fs::path sealed = WriteBlob(1, absl::Hours(100)), open = WriteBlob(2, absl::Hours(100));
  const fs::path young = WriteBlob(3, absl::Hours(23)), old = WriteBlob(4, absl::Hours(25));
  const fs::path others = WriteBlob(1, absl::Hours(25), "other");
  const Collected collected = Run();
  EXPECT_TRUE(fs::exists(sealed) && fs::exists(open) && fs::exists(young));
  EXPECT_FALSE(fs::exists(old));
  EXPECT_FALSE(fs::exists(others)) << "named by another project only";
  EXPECT_EQ(collected.num_files, 2);
  EXPECT_EQ(collected.num_bytes, 10);
  EXPECT_EQ(Run().num_files, 0);
}

// Blobs that were in the store need no minimum age, and count in the quota until they are removed.
TEST_F(CollectorTest, RemovesDeletedBlobsAtOnceAndStopsCountingThem) {
  MakeScene("b");
  Upload("a", 1, true);
  Upload("b", 2, true);
  const fs::path deleted = WriteBlob(1, absl::ZeroDuration());
  const fs::path kept = WriteBlob(2, absl::ZeroDuration());
  ASSERT_OK(store->scenes().DeleteScene(SceneOf(*store, "a")));
  EXPECT_EQ(store->quotas().GetUsage("default")->stored_bytes, 10);
  EXPECT_EQ(Run().num_files, 1);
  EXPECT_FALSE(fs::exists(deleted));
  EXPECT_TRUE(fs::exists(kept));
  EXPECT_EQ(store->quotas().GetUsage("default")->stored_bytes, 5);
  // As after a crash between the removal of a blob and that of its record.
  ASSERT_OK(store->scenes().DeleteScene(SceneOf(*store, "b")));
  fs::remove_all(BlobFolder(data));
  Run();
  EXPECT_EQ(store->quotas().GetUsage("default")->stored_bytes, 0);
}

TEST_F(CollectorTest, RemovesPartialFilesOfUploadsThatAreGone) {
  Upload("a", 1, true);
  Upload("a", 2);
  const fs::path sealed = Write(PartialFolderOf(data, {SceneOf(*store, "a"), 1}) / Digest(1), {});
  const fs::path length = Write(LengthPath(sealed), {});
  const fs::path open = Write(PartialFolderOf(data, {SceneOf(*store, "a"), 2}) / Digest(2), {});
  const fs::path gone =
      Write(PartialFolderOf(data, {SceneOf(*store, "no-such"), 1}) / Digest(3), {});
  const fs::path busy =
      Write(PartialFolderOf(data, {SceneOf(*store, "no-such"), 2}) / Digest(3), {});
  {
    const auto writer = LockedFile::TryAlone(busy);
    ASSERT_OK(writer);
    Run();
    EXPECT_TRUE(fs::exists(busy));
  }
  EXPECT_FALSE(fs::exists(sealed.parent_path()));
  EXPECT_FALSE(fs::exists(gone.parent_path()));
  EXPECT_TRUE(fs::exists(open));
  Run();
  EXPECT_FALSE(fs::exists(busy));
}

TEST_F(CollectorTest, DeletesUploadsWithoutARecentWrite) {
  for (int i = 1; i <= 4; ++i) Upload("a", i, i == 4);
  options.upload_age = absl::Milliseconds(1);
  absl::SleepFor(absl::Milliseconds(50));
  // The first upload has had no recent write. A file of the second is being written, a file of the
  // third was stored just now, and the fourth is sealed.
  Write(PartialFolderOf(data, {SceneOf(*store, "a"), 1}) / Digest(1), absl::Hours(1));
  const fs::path busy =
      Write(PartialFolderOf(data, {SceneOf(*store, "a"), 2}) / Digest(2), absl::Hours(1));
  WriteBlob(3, -absl::Hours(1));
  const auto writer = LockedFile::TryAlone(busy);
  ASSERT_OK(writer);
  EXPECT_EQ(Run().num_uploads, 1);
  EXPECT_TRUE(absl::IsNotFound(store->datasets().GetDataset(SceneOf(*store, "a"), 1).status()));
  EXPECT_FALSE(fs::exists(PartialFolderOf(data, {SceneOf(*store, "a"), 1})));
  for (int i = 2; i <= 4; ++i)
    EXPECT_OK(store->datasets().GetDataset(SceneOf(*store, "a"), i)) << i;
  EXPECT_TRUE(fs::exists(busy));
}

TEST_F(CollectorTest, KeepsModelsAndLogsOfJobs) {
  MakeModel();
  const fs::path model = Write(data / "jobs/j1/attempt-1/gaussians.ply", {});
  const fs::path attempt = Write(data / "jobs/j1/attempt-2/gaussians.ply", {});
  const fs::path log = Write(data / "jobs/j1/worker.log", {});
  EXPECT_EQ(Run().num_files, 1);
  EXPECT_TRUE(fs::exists(model) && fs::exists(log));
  EXPECT_FALSE(fs::exists(attempt));
  ASSERT_OK(store->models().DeleteModel(SceneOf(*store, "a"), 1));
  Run();
  EXPECT_FALSE(fs::exists(model));
  EXPECT_TRUE(fs::exists(log));
  ASSERT_OK(store->scenes().DeleteScene(SceneOf(*store, "a")));
  Run();
  EXPECT_FALSE(fs::exists(data / "jobs/j1"));
}

TEST_F(CollectorTest, LeavesRunningJobsAlone) {
  Upload("a", 7, true);
  JobRecord job;
  job.scene = SceneOf(*store, "a");
  job.dataset = 1;
  ASSERT_OK(store->jobs().CreateJob(job));
  ASSERT_TRUE(store->queue().ClaimJob("cpu")->has_value());
  const fs::path attempt = Write(data / "jobs/j1/attempt-1/checkpoints/a.ckpt", absl::Hours(99));
  Run();
  EXPECT_TRUE(fs::exists(attempt));
}

TEST_F(CollectorTest, RemovesFilesWithoutARecord) {
  MakeModel();
  SelectionRecord selection;
  selection.scene = SceneOf(*store, "a");
  ASSERT_OK_AND_ASSIGN(selection.number,
                       store->selections().TakeSelectionNumber(SceneOf(*store, "a")));
  selection.model = 1;
  ASSERT_OK(store->selections().CreateSelection(selection));
  const absl::Duration old = absl::Hours(25);
  const fs::path kept = Write(data / "selections/1/1", old);
  const fs::path coming = Write(data / "selections/1/2", absl::Hours(1));
  const fs::path lost = Write(data / "selections/1/3", old);
  const fs::path manifest = Write(data / "datasets/1/1.json", old);
  const fs::path stray = Write(data / "datasets/2/1.json", old);
  const fs::path half = Write(data / "selections/1/3.tmp-abcdef", old);
  const fs::path writing = Write(data / "selections/1/4.tmp-abcdef", absl::Hours(1));
  EXPECT_EQ(Run().num_files, 3);
  EXPECT_TRUE(fs::exists(kept) && fs::exists(coming) && fs::exists(manifest) &&
              fs::exists(writing));
  EXPECT_FALSE(fs::exists(lost) || fs::exists(stray) || fs::exists(half));
}

TEST_F(CollectorTest, RemovesTemporariesOfADeadServerIfThereIsNoOther) {
  const fs::path dead = Write(data / "datasets/1/1.json.tmp-abcdef", absl::Minutes(1));
  const fs::path of_job = Write(data / "jobs/j0/spec-1.json.tmp-abcdef", absl::Minutes(1));
  Run();
  EXPECT_TRUE(fs::exists(dead)) << "another server may be writing it";
  options.alone = true;
  Collector collector(*store, options);
  const fs::path writing = Write(data / "datasets/1/2.json.tmp-abcdef", absl::ZeroDuration());
  ASSERT_OK(collector.Run());
  EXPECT_FALSE(fs::exists(dead));
  EXPECT_TRUE(fs::exists(of_job) && fs::exists(writing));
}

TEST_F(CollectorTest, RunsOnOneServerAtATime) {
  const auto other = LockedFile::TryAlone(CollectorLockPath(data));
  ASSERT_OK(other);
  EXPECT_TRUE(absl::IsAborted(Collector(*store, options).Run().status()));
}

TEST_F(CollectorTest, LeavesTheDirectoryOfAnotherDatabaseAlone) {
  const fs::path model = Write(data / "jobs/j1/attempt-1/gaussians.ply", absl::Hours(99));
  const fs::path blob = WriteBlob(4, absl::Hours(99));
  EXPECT_TRUE(absl::IsFailedPrecondition(Collector(*store, options).Run().status()));
  EXPECT_TRUE(fs::exists(model) && fs::exists(blob));
}

// Does what CreateUpload does: takes the lock, records the files, looks for blobs. From then on no
// blob that it found may be removed.
TEST_F(CollectorTest, KeepsBlobsThatUploadsRelyOn) {
  constexpr int kBlobs = 150;
  options.file_age = absl::ZeroDuration();
  std::atomic<bool> done = false;
  std::thread collecting([&] {
    while (!done) EXPECT_OK(Collector(*store, options).Run());
  });
  int num_kept = 0, num_collected = 0;
  for (int i = 1; i <= kBlobs; ++i) {
    const fs::path blob = WriteBlob(i, absl::Hours(1));
    if (i % 3 == 0) absl::SleepFor(absl::Milliseconds(i % 20));
    bool there = false;
    {
      const auto hold = LockedFile::WaitShared(BlobLockPath(data, "default"));
      EXPECT_OK(hold);
      if (!hold.ok()) break;
      Upload("a", i);
      there = fs::exists(blob);
    }
    num_kept += there ? 1 : 0;
    num_collected += there ? 0 : 1;
  }
  done = true;
  collecting.join();
  int num_there = 0;
  for (int i = 1; i <= kBlobs; ++i) {
    num_there += fs::exists(BlobPath(data, {"default", Digest(i)})) ? 1 : 0;
  }
  EXPECT_EQ(num_there, num_kept);
  RecordProperty("collected", num_collected);
}

TEST_F(CollectorTest, RunsAtTheStart) {
  const fs::path old = WriteBlob(4, absl::Hours(25));
  Collector collector(*store, options);
  collector.Start();
  EXPECT_TRUE(testing::Eventually([&] { return !fs::exists(old); }, absl::Seconds(20)));
  collector.Stop();
}

}  // namespace
}  // namespace pepeseg
