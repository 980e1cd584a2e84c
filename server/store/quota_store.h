#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/store/rows.h"

namespace pepeseg {

class Database;

// Projects with their quotas and usage. See Store for what holds for all calls.
class QuotaStore {
 public:
  explicit QuotaStore(Database& database) : database_(database) {}

  // Returns a project; one without a record has no quota of its own.
  absl::StatusOr<ProjectRow> GetProject(const std::string& id);
  // Sets a project's quota, and creates the project if there is none. INVALID_ARGUMENT: the id is
  // not an RFC 1034 label.
  absl::StatusOr<ProjectRow> SetProjectQuota(const std::string& id, const Quota& quota);
  // Returns stored_bytes, open_uploads, queued_jobs and running_jobs as the quota counts them.
  absl::StatusOr<Quota> GetUsage(const std::string& project);

 private:
  Database& database_;
};

}  // namespace pepeseg
