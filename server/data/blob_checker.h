#pragma once

#include <atomic>
#include <condition_variable>
#include <deque>
#include <future>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "server/data/blob_store.h"
#include "server/store/store.h"

namespace pepeseg {

// Reads blobs again that a worker has found damaged, one after the other in a thread of its own, so
// that neither an RPC nor the supervisor waits for the disk. A damaged blob is set aside
// (BlobStore::Verify), and the files that name it are marked as not stored.
//
// Thread safe. Blobs that are not checked when the object is destroyed stay as they are.
class BlobChecker {
 public:
  // `blobs` and `store` must outlive the checker.
  BlobChecker(const BlobStore& blobs, Store& store);
  ~BlobChecker();
  BlobChecker(const BlobChecker&) = delete;
  BlobChecker& operator=(const BlobChecker&) = delete;

  // Queues these files of a project. The future gets the number of their distinct blobs that are
  // damaged or missing; 0 if the checker was stopped before. Does not block.
  std::shared_future<int> Check(const std::string& project, std::vector<DatasetFileRecord> files);

 private:
  struct Task {
    std::string project;
    std::vector<DatasetFileRecord> files;
    std::promise<int> num_damaged;
  };
  void Run();
  int CheckAll(const Task& task) const;

  const BlobStore& blobs_;
  Store& store_;
  std::atomic<bool> stopping_ = false;
  std::mutex mutex_;  // guards tasks_
  std::condition_variable wake_;
  std::deque<Task> tasks_;
  std::thread thread_;
};

}  // namespace pepeseg
