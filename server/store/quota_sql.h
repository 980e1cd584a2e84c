#pragma once

#include <string>

#include "absl/status/status.h"
#include "server/store/quota.h"
#include "server/store/soci.h"

// Usage and quotas of projects, computed inside a transaction.
//
// Call a check after the records that it is about were inserted, so that they count: it returns
// RESOURCE_EXHAUSTED (QuotaError) if the project of the scene is over its quota, and the caller
// then rolls back. `defaults`: limits of projects without values of their own.
namespace pepeseg {

// Returns the project of a scene, "" if there is no such scene.
std::string SelectProjectOf(soci::session& sql, const std::string& scene);

// Returns stored_bytes, open_uploads, queued_jobs and running_jobs of a project.
Quota SelectUsage(soci::session& sql, const std::string& project);

// Checks stored_bytes and open_uploads.
absl::Status CheckUploadQuotas(soci::session& sql, const std::string& scene, const Quota& defaults);
// Checks stored_bytes.
absl::Status CheckSelectionQuota(soci::session& sql, const std::string& scene,
                                 const Quota& defaults);
// Checks queued_jobs, and that at least one of stored_bytes is left for the model.
absl::Status CheckQueueQuota(soci::session& sql, const std::string& scene, const Quota& defaults);

}  // namespace pepeseg
