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
  absl::Duration interval = absl::Hours(1);
  // What has no row may be about to get one, or be on its way, for so long. Blobs that the store
  // counts had one.
  absl::Duration file_age = absl::Hours(24);
  // No other server uses the directory: temporary files of before the collector was made are
  // nobody's, but for those of jobs, which may run on a cluster.
  bool alone = false;
  // Of an open upload without a write.
  absl::Duration upload_age = absl::Hours(7 * 24);
};

// What one run has freed.
struct Collected {
  int64_t num_files = 0;
  int64_t num_bytes = 0;
  int64_t num_uploads = 0;
};

// Removes what no row of the store refers to: blobs that no dataset or upload names or that are
// damaged, beginnings of files of uploads that are sealed or gone, uploads that nobody goes on
// with, with their rows, folders of jobs that are gone and attempts whose model is, files of
// selections and datasets without a row, and unfinished temporary files. Never removes what is
// referred to, also while other servers take uploads. What cannot be removed costs space until the
// next run.
class Collector {
 public:
  // `store` must outlive it.
  Collector(Store& store, CollectorOptions options);
  ~Collector();  // Stop()

  // Runs now and then at the interval, in a thread of its own.
  void Start();
  void Stop();

  // Once. ABORTED: another server on the directory does it just now. FAILED_PRECONDITION: the
  // directory has jobs that the store has never had, so it is another database's.
  absl::StatusOr<Collected> Run();

 private:
  void RunForever();

  Store& store_;
  const CollectorOptions options_;
  const absl::Time made_ = absl::Now();
  std::mutex mutex_;
  std::condition_variable wake_;
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace pepeseg
