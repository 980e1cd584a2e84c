#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "server/jobs/supervisor.h"
#include "server/store/store.h"
#include "server/worker_protocol/event_log.h"
#include "tests/server/store/scene_of.h"
#include "tests/server/store/test_database.h"
#include "tests/testing/eventually.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {

// A supervisor that starts tests/server/jobs/fake_worker.cc as workers.
class SupervisorTest : public ::testing::Test {
 protected:
  SupervisorTest() {
    store_ = Store::Open(database_).value();
    options_.launch.crash_pauses = {absl::Milliseconds(20)};
    Restart();
  }

  void Restart() {
    supervisor_.reset();
    SupervisorOptions options = options_;
    options.data_folder = folder_.path();
    options.worker = PEPESEG_FAKE_WORKER;
    options.file_path = [](const std::string&, const DatasetFileRecord& file) {
      return "/blobs/" + file.sha256;
    };
    options.cancel_grace = absl::Milliseconds(300);
    options.launch.lease_seconds = 3;
    auto supervisor = Supervisor::Start(*store_, options);
    ASSERT_OK(supervisor);
    supervisor_ = std::move(supervisor).value();
  }

  // Stops claims. StopClaiming() does not wait for a claim in progress, so this pauses until it is
  // over, on a busy machine, too.
  void StopClaims() {
    supervisor_->StopClaiming();
    absl::SleepFor(absl::Milliseconds(200));
  }

  // Submits a job of a new scene, whose worker does what `act` says. Returns its id.
  std::string Submit(const std::string& act, bool preview = false) {
    const std::string scene = absl::StrCat("s", ++num_scenes_);
    EXPECT_OK(store_->scenes().CreateScene(NewScene(scene)));
    EXPECT_OK(
        store_->datasets().CreateDataset(SceneOf(*store_, scene), "", {{act, 1, 3, "00", true}}));
    EXPECT_OK(store_->datasets().SealDataset(SceneOf(*store_, scene), 1));
    JobRecord job;
    job.scene = SceneOf(*store_, scene);
    job.dataset = 1;
    job.preview = preview;
    const auto submitted = supervisor_->Submit(job);
    EXPECT_OK(submitted);
    return submitted.ok() ? submitted->id : "";
  }

  JobRecord WaitFor(const std::string& job, const std::function<bool(const JobRecord&)>& reached) {
    absl::StatusOr<JobRecord> row;
    EXPECT_TRUE(testing::Eventually([&] {
      row = store_->jobs().GetJob(job);
      return row.ok() && reached(*row);
    })) << "jobs/"
        << job;
    return row.value_or(JobRecord());
  }

  JobRecord WaitForEnd(const std::string& job) {
    return WaitFor(job, [](const JobRecord& row) { return IsTerminal(row.state); });
  }

  void WaitForStage(const std::string& job) {
    WaitFor(job, [](const JobRecord& row) { return row.stage == "reconstruct"; });
  }

  // Returns the job's events, once the last is written. The supervisor writes the store first and
  // then the log.
  std::vector<v1::JobEvent> EventsOf(const std::string& job) {
    std::vector<v1::JobEvent> events;
    EXPECT_TRUE(testing::Eventually([&] {
      EventLogReader reader = supervisor_->ReadEvents(job, 0);
      events = reader.Read().value_or(std::vector<v1::JobEvent>());
      return !events.empty() && events.back().has_state_changed() &&
             events.back().state_changed().state() > v1::JOB_STATE_RUNNING;
    })) << "jobs/"
        << job;
    return events;
  }

  testing::TempFolder folder_;
  const std::string database_ = testing::NewTestDatabase(folder_.path());
  SupervisorOptions options_;  // options of the next Restart()
  std::unique_ptr<Store> store_;
  std::unique_ptr<Supervisor> supervisor_;
  int num_scenes_ = 0;
};

}  // namespace pepeseg
