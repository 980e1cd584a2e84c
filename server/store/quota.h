#pragma once

#include <cstdint>
#include <string>

#include "absl/status/status.h"

namespace soci {
class session;
}

namespace pepeseg {

// Limits of a project, or its usage; the fields are those of pepeseg.v1.Quota. As a limit, 0 means
// the server's default in a project's record, and no limit in the server's options.
struct Quota {
  int64_t stored_bytes = 0;  // files, models and selections on the disk, and open uploads
  int64_t open_uploads = 0;
  int64_t queued_jobs = 0;
  int64_t running_jobs = 0;
  int64_t queries_per_second = 0;
  int64_t resident_bytes = 0;  // models in memory
};

// Returns the limits in force for a project: its own values where they are set, else the server's.
Quota InForce(const Quota& own, const Quota& server);

// Returns RESOURCE_EXHAUSTED: the call would raise the project's use of the quota field `name` to
// `need`, above `limit`. Carries an ErrorDetail with reason QUOTA.
absl::Status QuotaError(const std::string& name, int64_t need, int64_t limit);

// Usage and quotas of projects, computed inside a transaction.
//
// Call a check after the records that it is about were inserted, so that they count: it returns
// RESOURCE_EXHAUSTED (QuotaError) if the project is over its quota, and the caller
// then rolls back. `defaults`: limits of projects without values of their own.

// Returns stored_bytes, open_uploads, queued_jobs and running_jobs of a project.
Quota SelectUsage(soci::session& sql, const std::string& project);

// Checks stored_bytes and open_uploads.
absl::Status CheckUploadQuotas(soci::session& sql, const std::string& project,
                               const Quota& defaults);
// Checks stored_bytes.
absl::Status CheckStoredBytes(soci::session& sql, const std::string& project,
                              const Quota& defaults);
// Checks queued_jobs, and that at least one of stored_bytes is left for the model.
absl::Status CheckQueueQuota(soci::session& sql, const std::string& project, const Quota& defaults);

}  // namespace pepeseg
