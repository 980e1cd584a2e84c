#include "clients/cli/server_state.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/time/clock.h"

namespace pepeseg::client::cli {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;

TEST(TopLines, ShowServerPoolsJobsAndModels) {
  TopSnapshot snapshot;
  v1::ServerStatus& status = snapshot.status;
  status.set_version("1.2");
  status.set_device("cpu");
  status.mutable_start_time()->set_seconds(1000);
  status.set_num_threads(17);
  status.set_queries_per_second(12.5);
  status.mutable_query_p99()->set_nanos(42'000'000);
  auto& pool = *status.add_pools();
  pool.set_work(v1::ServerStatus::WORK_QUERY);
  pool.set_num_threads(2);
  pool.set_num_busy(1);
  pool.set_num_queued(3);
  pool.set_max_queued(100);
  status.set_num_queued_jobs(4);
  v1::Job& job = *status.add_running_jobs();
  job.set_name("jobs/j7");
  job.set_scene("scenes/shelf");
  job.mutable_progress()->set_stage(v1::JOB_STAGE_RECONSTRUCT);
  job.mutable_progress()->set_step(5);
  job.mutable_progress()->set_num_steps(10);
  job.mutable_progress()->mutable_eta()->set_seconds(65);
  v1::ResidentModel& model = *snapshot.resident.add_models();
  model.set_name("scenes/shelf/models/2");
  model.set_host_bytes(3 << 20);
  status.mutable_find_sources()->set_num_detector_words(80);
  status.mutable_find_sources()->set_appearance(true);
  const auto lines = TopLines(snapshot, absl::FromUnixSeconds(1065));
  EXPECT_EQ(lines[0], "pepesegd 1.2 on cpu, up 1:05");
  EXPECT_THAT(lines, Contains(HasSubstr("17 threads")));
  EXPECT_THAT(lines, Contains(HasSubstr("12.5 queries/s, p50 0.0 ms, p99 42.0 ms")));
  EXPECT_THAT(lines, Contains("query       1 of 2 busy, 3 of 100 queued"));
  EXPECT_THAT(lines, Contains("finds by labels, a detector of 80 words, looks"));
  EXPECT_THAT(lines, Contains("jobs: 1 running, 4 queued"));
  EXPECT_THAT(lines, Contains(HasSubstr("5/10")));
  EXPECT_THAT(lines, Contains(HasSubstr("about 1 min left of this stage")));
  EXPECT_THAT(lines, Contains(HasSubstr("scenes/shelf/models/2")));
  EXPECT_THAT(lines[0], Not(HasSubstr("DRAINING")));
  status.set_draining(true);
  EXPECT_THAT(TopLines(snapshot, absl::Now())[0], HasSubstr("DRAINING"));
}

}  // namespace
}  // namespace pepeseg::client::cli
