#pragma once

#include <string>

#include "absl/status/status.h"
#include "server/store/quota.h"
#include "server/store/soci.h"

// Quotas inside a transaction: what is taken, and whether that is allowed. The checks come after
// what they are about was written, and are RESOURCE_EXHAUSTED (QuotaError) when it is too much.
namespace pepeseg {

// Empty: there is no such scene.
std::string SelectProjectOf(soci::session& sql, const std::string& scene);

// stored_bytes, open_uploads, queued_jobs and running_jobs of a project.
Quota SelectUsage(soci::session& sql, const std::string& project);

// Of stored_bytes and open_uploads, for the project of a scene.
absl::Status CheckUploadQuotas(soci::session& sql, const std::string& scene, const Quota& defaults);
// Of stored_bytes.
absl::Status CheckSelectionQuota(soci::session& sql, const std::string& scene,
                                 const Quota& defaults);
// Of queued_jobs, and of stored_bytes, of which something must be left for the model.
absl::Status CheckQueueQuota(soci::session& sql, const std::string& scene, const Quota& defaults);

}  // namespace pepeseg
