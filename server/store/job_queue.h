#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "server/store/records.h"

namespace pepeseg {

class Database;

// Claims of queued jobs, and the writes of their attempts. See Store for what holds for all calls.
//
// A server holds a RUNNING job by a lease, which it renews. When the lease has expired, another
// server may claim the job. The fence is the number of the attempt. Every write of an attempt
// carries its fence and returns ABORTED if the job is not RUNNING under this fence, or is not held
// by this store, so that an attempt that lost its claim changes nothing.
class JobQueue {
 public:
  // Identity under which a store claims jobs.
  struct Holder {
    std::string name = "server";  // unique among the stores that are open at the same time
    absl::Duration lease = absl::InfiniteDuration();  // of a claimed job, from its last renewal
  };
  JobQueue(Database& database, const Holder& holder, const Quota& defaults)
      : database_(database), holder_(holder), defaults_(defaults) {}

  // What ClaimJob may claim: all, QUEUED jobs, or QUEUED previews.
  enum class Claims { kAll, kQueued, kPreviews };

  // Claims a job that is QUEUED, or RUNNING with an expired lease, and these first. Of the queued
  // jobs it takes first those that were put back for a preview, then previews and jobs that have
  // waited for ten minutes, then the rest. Of these it takes the one of the project that runs the
  // fewest jobs; then of the project whose jobs ran for the least time within the last hour; then
  // the oldest. With kPreviews it claims queued previews only. The job becomes RUNNING on `device`
  // under the next fence, for the length of a lease. A job that a launcher still runs for
  // a holder whose lease has expired keeps its fence, device and launch: only its holder changes.
  // Passes over queued jobs that pause after a crash, and those of a project that runs as many jobs
  // as its quota allows. Returns nullopt if there is nothing to claim.
  absl::StatusOr<std::optional<JobRecord>> ClaimJob(const std::string& device,
                                                    Claims claims = Claims::kAll);
  // Returns the id of the preview that ClaimJob would claim next; empty: none. Changes nothing.
  absl::StatusOr<std::string> FindPreview();
  // Returns the numbers of QUEUED jobs in the order in which ClaimJob would take them now, but for
  // what each claim changes: those that may be claimed, at most kMostListed. Changes nothing.
  absl::StatusOr<std::vector<int64_t>> ListClaimable();
  static constexpr int kMostListed = 1'000;
  // Renews the leases of the jobs that this store holds, and returns these jobs.
  absl::StatusOr<std::vector<JobRecord>> RenewLeases();
  // Returns the RUNNING jobs of this store; changes nothing.
  absl::StatusOr<std::vector<JobRecord>> ListHeldJobs();
  // Returns the RUNNING jobs of all holders.
  absl::StatusOr<std::vector<JobRecord>> ListRunningJobs();
  // Makes this store the holder of a RUNNING job of `gone`, a holder that is known to have ended.
  // ABORTED: `gone` no longer holds it.
  absl::StatusOr<JobRecord> TakeOverJob(const std::string& id, const std::string& gone);
  // Records the launcher's name for the worker of an attempt.
  absl::Status SetJobLaunch(const std::string& id, int64_t fence, const std::string& launch);
  // Takes the next fence of a RUNNING job for a worker that its launcher has started again. Any
  // process may call this, whoever holds the job. ABORTED: the job no longer runs under this
  // launch.
  absl::StatusOr<int64_t> TakeNextFence(const std::string& id, const std::string& launch);
  // Records the stage that an attempt has reached.
  absl::Status SetJobStage(const std::string& id, int64_t fence, const std::string& stage);
  // Cancels a QUEUED job at once, records the request for a RUNNING one, and leaves an ended job
  // unchanged.
  absl::StatusOr<JobRecord> RequestCancel(const std::string& id);
  // RUNNING -> QUEUED, or CANCELLED if that was requested. Sets `crashes` and `server_ends` to 0
  // after an attempt with progress; else adds one to the counter that matches the attempt's end.
  // Counts every put-back.
  absl::StatusOr<JobRecord> RequeueJob(const std::string& id, int64_t fence,
                                       const EndedAttempt& attempt);
  // RUNNING -> FAILED with the code and message of `error`, or CANCELLED if that is its code.
  absl::StatusOr<JobRecord> EndJob(const std::string& id, int64_t fence, const absl::Status& error);
  // RUNNING -> SUCCEEDED, and makes the job's model the scene's live one, in one transaction. Reads
  // folder, metrics, sources, num_gaussians and num_bytes of the model.
  absl::StatusOr<ModelRecord> CommitModel(const std::string& id, int64_t fence,
                                          const ModelRecord& model);

 private:
  Database& database_;
  const Holder& holder_;
  const Quota& defaults_;  // limits of projects without values of their own
};

}  // namespace pepeseg
