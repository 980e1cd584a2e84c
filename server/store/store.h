#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/store/dataset_store.h"
#include "server/store/file_store.h"
#include "server/store/job_queue.h"
#include "server/store/job_store.h"
#include "server/store/label_store.h"
#include "server/store/model_store.h"
#include "server/store/project_store.h"
#include "server/store/records.h"
#include "server/store/scene_store.h"
#include "server/store/selection_store.h"

namespace pepeseg {

class Database;

// The server's records in a SQL database: one class for each kind of record, all on one Database.
//
// Every call of these classes is one transaction, which is durable when the call returns. Calls
// block on the disk or the network: never make one from an RPC reaction. All are thread safe and
// throw nothing. NOT_FOUND names what is missing. Any call may return the errors of
// Database::Transact.
//
// A create call that repeats the request_id of an earlier one of the same parent returns what the
// earlier call made, or ALREADY_EXISTS if the two calls ask for different things.
class Store {
 public:
  using Holder = JobQueue::Holder;
  // `url`: as for Database::Open. `holder`: identity under which the store claims jobs.
  static absl::StatusOr<std::unique_ptr<Store>> Open(const std::string& url, Holder holder);
  static absl::StatusOr<std::unique_ptr<Store>> Open(const std::string& url);
  ~Store();

  // Returns the random number by which the database and its data directory know each other
  // (server/data/data_identity.h), 32 hexadecimal digits. Empty: it has none yet.
  absl::StatusOr<std::string> Identity();
  // Sets the identity of a database that has none. ABORTED: it has one.
  absl::Status SetIdentity(const std::string& id);

  SceneStore& scenes() { return scenes_; }
  DatasetStore& datasets() { return datasets_; }
  FileStore& files() { return files_; }
  JobStore& jobs() { return jobs_; }
  JobQueue& queue() { return queue_; }
  ModelStore& models() { return models_; }
  LabelStore& labels() { return labels_; }
  SelectionStore& selections() { return selections_; }
  KeyStore& keys() { return keys_; }
  QuotaStore& quotas() { return quotas_; }

  // Returns OK if the database answers.
  absl::Status Ping();
  struct Counts {
    std::map<JobState, int64_t> jobs;  // by state; states without jobs are absent
    int64_t num_scenes = 0, num_models = 0;
  };
  absl::StatusOr<Counts> CountAll();
  const Holder& holder() const { return holder_; }
  // Returns whether other servers may use the same database and change it between two calls.
  bool shared() const;

  // Sets the limits of projects without values of their own. Not thread safe: call it before any
  // other call, or while none is in progress.
  void SetDefaultQuota(const Quota& quota) { default_quota_ = quota; }
  const Quota& default_quota() const { return default_quota_; }

 private:
  Store(std::unique_ptr<Database> database, Holder holder);

  const std::unique_ptr<Database> database_;
  const Holder holder_;
  Quota default_quota_;
  SceneStore scenes_;
  DatasetStore datasets_;
  FileStore files_;
  JobStore jobs_;
  JobQueue queue_;
  ModelStore models_;
  LabelStore labels_;
  SelectionStore selections_;
  KeyStore keys_;
  QuotaStore quotas_;
};

}  // namespace pepeseg
