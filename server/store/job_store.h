#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/store/records.h"

namespace pepeseg {

class Database;

// Jobs, as clients see them. See Store for what holds for all calls; JobQueue runs the jobs.
class JobStore {
 public:
  JobStore(Database& database, const Quota& defaults) : database_(database), defaults_(defaults) {}

  // Creates a queued job from scene, dataset, options, effective_options, request_id, host_bytes,
  // seconds and traceparent. ABORTED: the scene has an active job; names it. FAILED_PRECONDITION:
  // the dataset is not sealed. RESOURCE_EXHAUSTED: the project's quota of queued jobs or stored
  // bytes.
  absl::StatusOr<JobRecord> CreateJob(const JobRecord& job);
  absl::StatusOr<JobRecord> GetJob(const std::string& id);
  struct JobFilter {
    std::optional<SceneRef> scene;  // nullopt: all scenes
    std::optional<JobState> state;  // nullopt: any state
    std::string project = {};       // empty: all projects
  };
  // Lists jobs, newest first.
  absl::StatusOr<Page<JobRecord>> ListJobs(const JobFilter& filter, const PageRequest& page);
  // Returns the scene's QUEUED or RUNNING job, or nullopt.
  absl::StatusOr<std::optional<JobRecord>> FindActiveJob(const SceneRef& scene);
  // Returns the number of the next job. No job of this database has had it or a higher one.
  absl::StatusOr<int64_t> NextJobNumber();
  // Returns the project of a job. NOT_FOUND: there is no such job. INVALID_ARGUMENT: no job can
  // have this id.
  absl::StatusOr<std::string> ProjectOfJob(const std::string& id);

 private:
  Database& database_;
  const Quota& defaults_;  // limits of projects without values of their own
};

}  // namespace pepeseg
