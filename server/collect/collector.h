#pragma once

#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <mutex>
#include <thread>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "server/store/store.h"

namespace pepeseg {

struct CollectorOptions {
  std::filesystem::path data;  // laid out as server/store/layout.h says
  // Minimum age of a file without a record: a younger one may be about to get its record. Does not
  // apply to blobs that the store counts, which had one.
  absl::Duration file_age = absl::Hours(24);
  // No other server uses the directory. Then temporary files from before the collector was made
  // are removed at once, except those of jobs, which may run on a cluster.
  bool alone = false;
  // Time without a write after which an open upload is deleted.
  absl::Duration upload_age = absl::Hours(7 * 24);
};

// Files and records that one run has removed.
struct Collected {
  int64_t num_files = 0;
  int64_t num_bytes = 0;
  int64_t num_uploads = 0;
};

// Removes from the data directory what no record of the store refers to:
//
//   - blobs that no dataset or upload names, and damaged blobs that were set aside,
//   - uploads without a write for a long time, with their records,
//   - partial files of uploads that are sealed or gone,
//   - folders of deleted jobs, and working files of ended ones,
//   - files of selections and datasets without a record,
//   - temporary files that a crash left.
//
// Never removes anything that is referred to, even while other servers accept uploads. What cannot
// be removed takes up space until the next run.
class Collector {
 public:
  // `store` must outlive the collector.
  Collector(Store& store, CollectorOptions options);
  ~Collector();  // calls Stop()

  // Starts a thread that runs now and then again every hour.
  void Start();
  // Waits for a run in progress.
  void Stop();

  // Runs once, in the caller's thread. ABORTED: another server is collecting in this directory.
  // FAILED_PRECONDITION: the directory has jobs that the store never had, so it belongs to another
  // database.
  absl::StatusOr<Collected> Run();

 private:
  void RunForever();

  Store& store_;
  const CollectorOptions options_;
  const absl::Time made_ = absl::Now();
  std::mutex mutex_;  // guards stopping_
  std::condition_variable wake_;
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace pepeseg
