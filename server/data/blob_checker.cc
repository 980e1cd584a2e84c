#include "server/data/blob_checker.h"

#include <spdlog/spdlog.h>

#include <set>
#include <utility>

namespace pepeseg {

BlobChecker::BlobChecker(const BlobStore& blobs, Store& store)
    : blobs_(blobs), store_(store), thread_([this] { Run(); }) {}

BlobChecker::~BlobChecker() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  wake_.notify_all();
  thread_.join();
  // Those who wait for a check get an answer: "not known to be damaged".
  for (Task& task : tasks_) task.num_damaged.set_value(0);
}

std::shared_future<int> BlobChecker::Check(const std::string& project,
                                           std::vector<DatasetFileRecord> files) {
  Task task{project, std::move(files), {}};
  std::shared_future<int> num_damaged = task.num_damaged.get_future().share();
  {
    const std::lock_guard lock(mutex_);
    tasks_.push_back(std::move(task));
  }
  wake_.notify_all();
  return num_damaged;
}

void BlobChecker::Run() {
  std::unique_lock lock(mutex_);
  while (true) {
    wake_.wait(lock, [this] { return stopping_ || !tasks_.empty(); });
    if (stopping_) return;
    Task task = std::move(tasks_.front());
    tasks_.pop_front();
    lock.unlock();
    task.num_damaged.set_value(CheckAll(task));
    lock.lock();
  }
}

// Marks all damaged blobs of a task in one transaction, after they were set aside. If the server is
// killed in between, the blob is found missing when its files are used next.
int BlobChecker::CheckAll(const Task& task) const {
  std::set<std::string> checked;
  std::vector<std::string> damaged;
  for (const DatasetFileRecord& file : task.files) {
    if (stopping_ || !checked.insert(file.sha256).second) continue;
    const absl::Status whole = blobs_.Verify({task.project, file.sha256}, stopping_);
    if (absl::IsDataLoss(whole)) {
      spdlog::error(
          "project {}: '{}' is damaged on the disk: it {}, not {}; it is set aside, and the"
          " next upload brings it again",
          task.project, file.path, std::string(whole.message()), file.sha256);
      damaged.push_back(file.sha256);
    } else if (!whole.ok()) {
      spdlog::error("project {}: '{}': {}", task.project, file.path, whole.ToString());
    }
  }
  const absl::Status marked =
      store_.files().SetDigestsStored(task.project, damaged, /*stored=*/false);
  if (!marked.ok()) spdlog::error("project {}: {}", task.project, marked.ToString());
  return static_cast<int>(damaged.size());
}

}  // namespace pepeseg
