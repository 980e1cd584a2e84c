#pragma once

#include <string>

#include "absl/status/status.h"
#include "server/access/quota.h"
#include "server/jobs/soci.h"

// Quotas inside a transaction: what is taken, and whether that is allowed. The checks come after
// what they are about was written, and are RESOURCE_EXHAUSTED (QuotaError) when it is too much.
namespace pepeseg {

// stored_bytes, open_uploads, queued_jobs and running_jobs of a project.
Quota SelectUsage(soci::session& sql, const std::string& project);

// Of stored_bytes, declared ones included, and open_uploads, for the project of a scene.
absl::Status CheckUploadQuotas(soci::session& sql, const std::string& scene, const Quota& defaults);
// Of queued_jobs.
absl::Status CheckQueueQuota(soci::session& sql, const std::string& scene, const Quota& defaults);

}  // namespace pepeseg
