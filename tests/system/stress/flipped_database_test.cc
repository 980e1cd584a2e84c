// One flipped bit in SQLite's file: 1,000 positions with PEPESEG_STRESS=full, 200 in `make test`.
// The server refuses to start, or a call returns an error, or all answers are unchanged. The rest
// are stored values, for which SQLite has no checksum: the test counts them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <iostream>
#include <map>
#include <random>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/base/digest.h"
#include "core/base/file_io.h"
#include "core/base/status_macros.h"
#include "server/store/store.h"
#include "tests/server/store/scene_of.h"
#include "tests/testing/full_stress.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

namespace fs = std::filesystem;

constexpr int kNumScenes = 12;
const PageRequest kAll{1000, ""};

// Makes a scene with a model, a label and a selection.
void Fill(Store& store, const std::string& name) {
  ASSERT_OK_AND_ASSIGN(const SceneRecord made, store.scenes().CreateScene(NewScene(
                                                   name, "the scene " + name, "make " + name)));
  const SceneRef& scene = made.scene;
  std::vector<DatasetFileRecord> files;
  for (int i = 0; i < 10; ++i) {
    const std::string path = absl::StrCat("images/", i, ".jpg");
    files.push_back({path, 1, 1000 + i, Sha256Hex(name + path), true});
  }
  ASSERT_OK(store.datasets().CreateDataset(scene, "upload", files));
  ASSERT_OK(store.datasets().SealDataset(scene, 1));
  JobRecord job;
  job.scene = scene;
  job.dataset = 1;
  job.effective_options = std::string(300, 'o');
  ASSERT_OK_AND_ASSIGN(job, store.jobs().CreateJob(job));
  ASSERT_OK(store.queue().ClaimJob("cpu"));
  ModelRecord model;
  model.folder = absl::StrCat("jobs/", job.id, "/attempt-1");
  model.metrics = R"({"psnr": 30.5})";
  model.num_gaussians = 20000;
  ASSERT_OK(store.queue().CommitModel(job.id, 1, model));
  ASSERT_OK(store.labels().CreateLabel(
      {scene, "cup", "the cup", "a.jpg", 96, 64, "0123456789", 10, "l", {}}));
  ASSERT_OK_AND_ASSIGN(const int64_t number, store.selections().TakeSelectionNumber(scene));
  SelectionRecord selection;
  selection.scene = scene;
  selection.number = number;
  selection.model = 1;
  selection.model_gaussians = 20000;
  selection.file = absl::StrCat("selections/", scene.id, "/", number);
  ASSERT_OK(store.selections().CreateSelection(selection));
  KeyRecord key;
  key.id = Sha256Hex(name).substr(0, 16);
  key.project = "lab";
  key.sha256 = Sha256Hex("key of " + name);
  key.scopes = 14;
  ASSERT_OK(store.keys().CreateKey(key));
}

absl::Status DescribeScene(Store& store, const SceneRef& scene, std::string& all) {
  ASSIGN_OR_RETURN(const auto datasets, store.datasets().ListDatasets(scene, kAll));
  for (const DatasetRecord& row : datasets.records) {
    absl::StrAppend(&all, row.scene.id, row.number, row.request_id, row.num_files, row.num_bytes,
                    absl::FormatTime(row.seal_time));
    ASSIGN_OR_RETURN(const auto files, store.files().ListDatasetFiles(scene, row.number));
    for (const DatasetFileRecord& file : files) {
      absl::StrAppend(&all, file.path, file.kind, file.size, file.sha256, file.stored);
    }
  }
  ASSIGN_OR_RETURN(const auto models, store.models().ListModels(scene, kAll));
  for (const ModelRecord& row : models.records) {
    absl::StrAppend(&all, row.scene.id, row.number, row.job, row.device, row.folder, row.metrics,
                    row.sources, row.num_gaussians, row.num_bytes,
                    absl::FormatTime(row.create_time));
  }
  ASSIGN_OR_RETURN(const ModelRecord live, store.models().GetLiveModel(scene));
  ASSIGN_OR_RETURN(const auto labels, store.labels().ListLabels(scene, kAll));
  for (const LabelRecord& row : labels.records) {
    absl::StrAppend(&all, live.number, row.id, row.text, row.view, row.width, row.height,
                    row.counts, row.area, row.request_id, absl::FormatTime(row.create_time));
  }
  ASSIGN_OR_RETURN(const auto selections, store.selections().ListSelections(scene, kAll));
  for (const SelectionRecord& row : selections.records) {
    absl::StrAppend(&all, row.number, row.model, row.model_gaussians, row.num_gaussians, row.base,
                    row.file, row.request_id, row.request_digest,
                    absl::FormatTime(row.create_time));
  }
  return absl::OkStatus();
}

// Returns all answers of the store as a text.
absl::StatusOr<std::string> DescribeAll(const std::string& url) {
  ASSIGN_OR_RETURN(const auto store, Store::Open(url));
  std::string all;
  ASSIGN_OR_RETURN(const auto scenes, store->scenes().ListScenes(kAll));
  for (const SceneRecord& row : scenes.records) {
    absl::StrAppend(&all, row.scene.id, row.scene.name, row.display_name, row.request_id,
                    row.scene.project, absl::FormatTime(row.create_time));
    RETURN_IF_ERROR(store->scenes().GetScene(row.scene).status());
    RETURN_IF_ERROR(DescribeScene(*store, row.scene, all));
  }
  ASSIGN_OR_RETURN(const auto jobs, store->jobs().ListJobs({}, kAll));
  for (const JobRecord& row : jobs.records) {
    absl::StrAppend(&all, row.id, row.scene.id, row.dataset, static_cast<int>(row.state), row.stage,
                    row.device, row.options, row.effective_options, row.request_id, row.fence,
                    row.launch, row.crashes, row.server_ends, row.error_code, row.error_message,
                    row.model, absl::FormatTime(row.create_time), absl::FormatTime(row.start_time),
                    absl::FormatTime(row.end_time));
  }
  ASSIGN_OR_RETURN(const auto keys, store->keys().ListKeys("", kAll));
  for (const KeyRecord& row : keys.records) {
    absl::StrAppend(&all, row.id, row.project, row.sha256, row.scopes,
                    absl::FormatTime(row.revoke_time), absl::FormatTime(row.expire_time));
    RETURN_IF_ERROR(store->keys().FindKeyByDigest(row.sha256).status());
  }
  ASSIGN_OR_RETURN(const Quota usage, store->quotas().GetUsage(kDefaultProject));
  absl::StrAppend(&all, usage.stored_bytes, usage.open_uploads);
  return all;
}

struct FlipReport {
  int refused = 0;    // DATA_LOSS at the start
  int reported = 0;   // another error, at the start or from a call
  int unchanged = 0;  // all answers are the same as before
  int unnoticed = 0;  // some answer differs
  int sum() const { return refused + reported + unchanged + unnoticed; }
};

class FlippedDatabase : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto store = Store::Open("sqlite:" + (folder_ / "whole.db").string());
    ASSERT_OK(store);
    for (int i = 0; i < kNumScenes; ++i) Fill(**store, absl::StrCat("scene-", i));
  }

  // Opens copies of the database, each with one bit flipped in the file with suffix `flipped` (""
  // or
  // "-wal").
  FlipReport FlipBits(const std::map<std::string, std::string>& files, const std::string& flipped) {
    const fs::path copy = folder_ / "copy.db";
    const auto write = [&](const std::map<std::string, std::string>& bytes) {
      for (const char* suffix : {"", "-wal", "-shm"}) fs::remove(copy.string() + suffix);
      for (const auto& [suffix, text] : bytes) {
        std::ofstream(copy.string() + suffix, std::ios::binary) << text;
      }
    };
    const std::string url = "sqlite:" + copy.string();
    write(files);
    const auto whole = DescribeAll(url);
    EXPECT_OK(whole);
    FlipReport report;
    std::mt19937_64 random(7);
    for (int i = 0; i < (testing::FullStress() ? 1000 : 200); ++i) {
      std::map<std::string, std::string> bytes = files;
      std::string& text = bytes.at(flipped);
      const size_t bit = random() % (8 * text.size());
      text[bit / 8] = static_cast<char>(text[bit / 8] ^ (1 << (bit % 8)));
      write(bytes);
      const auto answer = DescribeAll(url);
      if (absl::IsDataLoss(answer.status())) {
        ++report.refused;
      } else if (!answer.ok()) {
        ++report.reported;
      } else {
        ++(*answer == *whole ? report.unchanged : report.unnoticed);
      }
    }
    std::cout << "'" << flipped << "', " << files.at(flipped).size() << " bytes: refused "
              << report.refused << ", reported " << report.reported << ", unchanged "
              << report.unchanged << ", unnoticed " << report.unnoticed << "\n";
    return report;
  }

  std::string Bytes(const std::string& name) const {
    return ReadFile(folder_ / name, name, int64_t{1} << 30).value_or("");
  }

  const testing::TempFolder folder_;
};

TEST_F(FlippedDatabase, IsRefusedIfSqliteDetectsIt) {
  const FlipReport report = FlipBits({{"", Bytes("whole.db")}}, "");
  EXPECT_GT(report.refused, report.sum() / 20);
  EXPECT_LT(report.unnoticed, report.sum() / 5);
}

// A killed server leaves a log (WAL), which alone has its last answers.
TEST_F(FlippedDatabase, IsRefusedIfItsLogIsDamaged) {
  const auto store = Store::Open("sqlite:" + (folder_ / "whole.db").string());
  ASSERT_OK(store);
  for (int i = 0; i < 4; ++i) Fill(**store, absl::StrCat("late-", i));
  const FlipReport report =
      FlipBits({{"", Bytes("whole.db")}, {"-wal", Bytes("whole.db-wal")}}, "-wal");
  // The rest are flips in the last commit, which SQLite cannot distinguish from a torn one.
  EXPECT_GT(report.refused, report.sum() * 9 / 10);
}

TEST_F(FlippedDatabase, IsReportedByName) {
  std::string bytes = Bytes("whole.db");
  bytes[5] = static_cast<char>(bytes[5] ^ 1);
  std::ofstream(folder_ / "whole.db", std::ios::binary) << bytes;
  const auto store = Store::Open("sqlite:" + (folder_ / "whole.db").string());
  EXPECT_STATUS(store, absl::StatusCode::kDataLoss, "whole.db");
  EXPECT_STATUS(store, absl::StatusCode::kDataLoss, "backup");
}

}  // namespace
}  // namespace pepeseg
