#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/store/records.h"

// Projects: their quotas and their API keys. See Store for what holds for all calls.
namespace pepeseg {

class Database;

// Projects with their quotas and usage.
class QuotaStore {
 public:
  explicit QuotaStore(Database& database) : database_(database) {}

  // Returns a project; one without a record has no quota of its own.
  absl::StatusOr<ProjectRecord> GetProject(const std::string& id);
  // Sets a project's quota, and creates the project if there is none. INVALID_ARGUMENT: the id is
  // not an RFC 1034 label.
  absl::StatusOr<ProjectRecord> SetProjectQuota(const std::string& id, const Quota& quota);
  // Returns stored_bytes, open_uploads, queued_jobs and running_jobs as the quota counts them.
  absl::StatusOr<Quota> GetUsage(const std::string& project);

 private:
  Database& database_;
};

// API keys.
class KeyStore {
 public:
  explicit KeyStore(Database& database) : database_(database) {}

  // Creates a key from all fields but create_time and revoke_time, and its project if there is
  // none. ABORTED: the id or the digest is taken. INVALID_ARGUMENT: the project is not an RFC 1034
  // label.
  absl::StatusOr<KeyRecord> CreateKey(const KeyRecord& key);
  // Both return expired and revoked keys, too.
  absl::StatusOr<KeyRecord> GetKey(const std::string& id);
  absl::StatusOr<KeyRecord> FindKeyByDigest(const std::string& sha256);
  // Lists keys by id, expired and revoked ones included. `project`: empty for all projects.
  absl::StatusOr<Page<KeyRecord>> ListKeys(const std::string& project, const PageRequest& page);
  // Revokes a key. The time of the first revocation stays.
  absl::StatusOr<KeyRecord> RevokeKey(const std::string& id);

 private:
  Database& database_;
};

}  // namespace pepeseg
